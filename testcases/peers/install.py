"""Install the software of others that the tests with the mark `peers` need, as the lists next to this file
pin it.

    python testcases/peers/install.py <directory>

Needs Node.js with npm, a compiler for one of the packages, and pip. What is installed already is left alone.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NODE = ("package.json", "package-lock.json")
EDCON = "edcon_requirements.txt"


def is_done(stamp: Path, *lists: str) -> str | None:
    """Return None when what the lists ask for is installed, otherwise what to write into the stamp
    afterwards.
    """
    digest = hashlib.sha256(b"".join((HERE / name).read_bytes() for name in lists)).hexdigest()
    return None if stamp.exists() and stamp.read_text(encoding="ascii") == digest else digest


def install_node_packages(target: Path) -> int:
    """Install the packages of npm."""
    stamp = target / "installed"
    digest = is_done(stamp, *NODE)
    if digest is None:
        return 0
    npm = shutil.which("npm")
    if npm is None:
        print("npm is missing (Debian: apt-get install nodejs npm g++ make python3)", file=sys.stderr)
        return 2
    for name in NODE:
        shutil.copy(HERE / name, target / name)
    done = subprocess.run([npm, "ci", "--no-audit", "--no-fund"], cwd=target, check=False)
    if done.returncode == 0:
        stamp.write_text(digest, encoding="ascii")
    return done.returncode


def install_edcon(target: Path) -> int:
    """Install festo-edcon into a directory of its own: it holds pymodbus to a version that the product does
    not use.
    """
    stamp = target / "edcon" / "installed"
    digest = is_done(stamp, EDCON)
    if digest is None:
        return 0
    shutil.rmtree(target / "edcon", ignore_errors=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    done = subprocess.run([*pip, "--target", target / "edcon", "--requirement", HERE / EDCON], check=False)
    if done.returncode == 0:
        stamp.write_text(digest, encoding="ascii")
    return done.returncode


def main(directory: str) -> int:
    """Install into `directory` and return the exit code."""
    target = Path(directory)
    target.mkdir(parents=True, exist_ok=True)
    return install_node_packages(target) or install_edcon(target)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

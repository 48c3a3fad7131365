"""Install the software of others that the tests with the mark `peers` need, as package-lock.json pins it.

    python testcases/peers/install.py <directory>

Needs Node.js with npm, and a compiler for one of the packages. What is installed already is left alone.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
LISTS = ("package.json", "package-lock.json")


def main(directory: str) -> int:
    """Install into `directory` and return the exit code."""
    target = Path(directory)
    npm = shutil.which("npm")
    if npm is None:
        print("npm is missing (Debian: apt-get install nodejs npm g++ make python3)", file=sys.stderr)
        return 2
    digest = hashlib.sha256(b"".join((HERE / name).read_bytes() for name in LISTS)).hexdigest()
    stamp = target / "installed"
    if stamp.exists() and stamp.read_text(encoding="ascii") == digest:
        return 0
    target.mkdir(parents=True, exist_ok=True)
    for name in LISTS:
        shutil.copy(HERE / name, target / name)
    done = subprocess.run([npm, "ci", "--no-audit", "--no-fund"], cwd=target, check=False)
    if done.returncode == 0:
        stamp.write_text(digest, encoding="ascii")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

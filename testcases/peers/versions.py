"""Which software of others the tests of a module use, with the version that is installed."""

from __future__ import annotations

import json
import os
import re
import subprocess
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from typing import Final


def _distribution(name: str) -> str:
    return f"{name} {metadata.version(name)}"


def _npm_package(name: str) -> str:
    file = Path(os.environ["HIL_PEERS"]) / "node_modules" / name / "package.json"
    return f"{name} (npm) {json.loads(file.read_text(encoding='utf-8'))['version']}"


def _edcon() -> str:
    folder = Path(os.environ["HIL_PEERS"]) / "edcon"
    (found,) = metadata.distributions(name="festo-edcon", path=[str(folder)])
    return f"festo-edcon {found.version}"


def _program(name: str, option: str) -> str:
    done = subprocess.run([name, option], capture_output=True, text=True, check=False, timeout=60.0)
    found = re.search(r"\d+(?:\.\d+)+", done.stdout + done.stderr)
    return f"{name} {found[0] if found else 'of unknown version'}"


_CANOPEN: Final = (partial(_npm_package, "canopen"),)
_TSHARK: Final = (partial(_program, "tshark", "--version"),)
_MBPOLL: Final = partial(_program, "mbpoll", "-V")
_USED: Final[dict[str, tuple[Callable[[], str], ...]]] = {
    "test_ads_client": (partial(_npm_package, "ads-client"),),
    "test_cam_oracles": (partial(_distribution, "scipy"), partial(_distribution, "pyplcopen")),
    "test_dcf_tools": (partial(_distribution, "dcf-tools"),),
    "test_edcon": (_edcon,),
    "test_mbpoll": (_MBPOLL,),
    "test_mdf": (partial(_distribution, "asammdf"),),
    "test_modbus_drive": (_MBPOLL, partial(_distribution, "pymodbus")),
    "test_node_canopen_lss": _CANOPEN,
    "test_node_canopen_master": _CANOPEN,
    "test_node_canopen_slave": _CANOPEN,
    "test_parquet": (partial(_distribution, "pyarrow"),),
    "test_pyads": (partial(_distribution, "pyads"),),
    "test_tshark": _TSHARK,
    "test_tshark_modbus": _TSHARK,
}


@cache
def software_of(module: str) -> tuple[str, ...]:
    """Return name and version of what a module of tests uses, as far as it is installed.

    Args:
        module: Its name, without a package.

    Raises:
        KeyError: The module is not in the list here.

    """
    found = []
    for one in _USED[module]:
        # The tests say what is missing.
        with suppress(OSError, KeyError, ValueError, metadata.PackageNotFoundError):
            found.append(one())
    return tuple(found)

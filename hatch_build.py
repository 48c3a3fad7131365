"""Build hook: puts the list of what the product cannot do yet into a wheel, and with `HIL_COMPILE=1` in the
environment the compiled core, for one platform.

Without the variable the wheel is pure Python, as always. `compile_core.py` does the work.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ROOT = Path(__file__).resolve().parent


class CoreBuildHook(BuildHookInterface[Any]):
    """Adds `features.md` to a wheel, and `motion_hil_core` where it is wanted."""

    PLUGIN_NAME = "custom"

    def _wanted(self) -> bool:
        return self.target_name == "wheel" and os.environ.get("HIL_COMPILE") == "1"

    def dependencies(self) -> list[str]:
        """Return what the build needs: the compiler, and libraries whose types the compiled modules name."""
        return ["mypy>=2.4,<2.5", "numpy>=1.26", "setuptools>=70"] if self._wanted() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Say what is added to the wheel; compile where that is wanted."""
        if version == "editable":
            return
        # What the product cannot do yet, for the page of `hil qualify`; a checkout has it already.
        build_data["force_include"]["docs/reference/features.md"] = "hil/data/features.md"
        if not self._wanted():
            return
        sys.path.insert(0, str(ROOT))
        from compile_core import PACKAGE, compile_core, settings

        folder = Path(tempfile.mkdtemp(prefix="motion-hil-core-"))
        compile_core(
            folder,
            ROOT / ".cache" / "core",
            optimise=str(settings()["optimise"]),
            jobs=os.cpu_count() or 1,
            shipped=True,
        )
        build_data["force_include"][str(folder / PACKAGE)] = PACKAGE
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

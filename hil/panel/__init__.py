"""The commands of an operator on one axis, whoever shows them: a terminal, a script, the cockpit."""

from hil.panel._nc import JOGS as NC_JOGS
from hil.panel._nc import NcPanelSession
from hil.panel._s7 import PanelSession
from hil.panel._words import Commands, help_lines, parse

__all__ = ["NC_JOGS", "Commands", "NcPanelSession", "PanelSession", "help_lines", "parse"]

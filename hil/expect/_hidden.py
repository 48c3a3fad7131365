"""States of a drive that a log need not show: it tells the state at every SYNC, and not what was between two
of them.
"""

from __future__ import annotations

from typing import Final

from hil.expect._profidrive_rules import TRANSITIONS, state_of
from hil.expect._words import normal_state
from hil.expect.checkers import LEGAL_TRANSITIONS
from hil.record import EventSelector, Trace

_REACTION: Final = "fault_reaction_active"
_START: Final = "not_ready_to_switch_on"


def hidden_state(trace: Trace, selector: EventSelector, since_s: float, until_s: float) -> str:
    """Return why a change of state may have happened unseen in a log; empty where it would have shown.

    A state may be hidden in a change from A to B that the profile makes by way of it.
    """
    wanted = selector.data.get("to")
    if not trace.from_log or selector.kind != "drive.state" or wanted is None:
        return ""
    for entry in trace.select(source=selector.source):
        if not since_s <= entry.time_ns * 1e-9 <= until_s:
            continue
        if entry.kind == "node.bootup" and normal_state(str(wanted)) == _START:
            return f"{wanted} may have been left before it was seen, at {entry.time_ns * 1e-9:.6f} s"
        if entry.kind == "drive.state" and _by_way(entry.data.get("from"), wanted, entry.data.get("to")):
            return (
                f"{wanted} may have been between {entry.data['from']} and {entry.data['to']} at "
                f"{entry.time_ns * 1e-9:.6f} s, for less than a SYNC"
            )
    return ""


def _by_way(old: object, via: object, new: object) -> bool:
    """Return whether a profile allows a change from `old` to `new` by way of `via`."""
    if not old or not new or via in (old, new):
        return False
    one, two, three = (state_of(text) for text in (old, via, new))
    if one and two and three:
        return (one, two) in TRANSITIONS and (two, three) in TRANSITIONS
    one, two, three = (normal_state(str(text)) for text in (old, via, new))
    first = two == _REACTION or two in LEGAL_TRANSITIONS.get(one, ())
    return first and three in LEGAL_TRANSITIONS.get(two, ())

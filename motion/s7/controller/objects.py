"""What becomes of a technology object when the controller changes its operating state, and what it keeps.

| kept over | RUN-STOP-RUN | restart of the object | download | power off, memory reset | factory reset |
|---|---|---|---|---|---|
| values assigned (DIR, CAL, `MC_WriteParameter` 1000 and 1020) | yes | no | no | no | no |
| start values written in load memory | yes | yes | as downloaded | yes | yes |
| T_i, T_o, T_DC of `MC_WriteParameter` | yes | yes | no | no | no |
| position, modulo counter, homed: incremental encoder | yes | no | no | no | no |
| position, modulo counter, homed: absolute encoder | yes | yes | yes | by encoder value and offset | no |
| bits of `MC_SetAxisSTW`, jobs, torque functions | no | no | no | no | no |

(MC-444, MC-460, MC-461, VAR-012, VAR-013, CFG-270, CFG-271, CFG-108 to CFG-115, HOM-179 to HOM-190.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from motion.kernel.mechanics import INCREMENTAL
from motion.s7.axis.external_encoder import ExternalEncoder
from motion.s7.axis.homing.passive import abort_passive
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motion.s7.axis import TechnologyAxis

    TechnologyObject = TechnologyAxis | ExternalEncoder

_RESTING: Final = frozenset((AxisState.DISABLED, AxisState.ALARM_DISABLED))
_OFFSET: Final = ".AbsEncoderOffset"
_REACTION_REMOVE_ENABLE: Final = 4
_ALARM_CONFIGURATION: Final = 101


def at_rest(one: TechnologyObject) -> bool:
    """Whether the object is disabled: its drive is off, and nothing is under way."""
    return one.state in _RESTING


def disable(one: TechnologyObject) -> None:
    """Take the object from the user program with the effect of reaction 4 (STP-506): jobs are aborted, the
    drive stops.
    """
    one.master = None
    abort_passive(one)
    if isinstance(one, ExternalEncoder):
        one.enabling.call(enable=False, start_mode=1, stop_mode=0)
        return
    one.motion.abort_all()
    one.control_words.release()
    one.torque.end_all()
    one.enabling.enable = False
    if one.state not in _RESTING and one.state is not AxisState.RESTARTING:
        one.alarms.react(0, _REACTION_REMOVE_ENABLE)


def switch_outputs(one: TechnologyObject, on: bool) -> None:
    """Switch the process outputs of the object's drive."""
    if not isinstance(one, ExternalEncoder):
        one.enabling.rest(outputs=on)
        one.drive_port.switch_outputs(on)


def hold_back(one: TechnologyObject) -> None:
    """Let the object refuse jobs with 16#800D until `release` (MC-631)."""
    if isinstance(one, ExternalEncoder):
        one.state = AxisState.RESTARTING
    else:
        one.set_state(AxisState.RESTARTING)


def release(one: TechnologyObject) -> None:
    """End the initialisation of an object after STARTUP: from now on it takes jobs."""
    if isinstance(one, ExternalEncoder):
        one.state = AxisState.DISABLED
        return
    one.set_state(AxisState.ALARM_DISABLED if one.alarms.blocking else AxisState.DISABLED)


def power_down(one: TechnologyObject) -> None:
    """Lose everything that is not retentive, at once: jobs, enables, values."""
    one.master = None
    abort_passive(one)
    if not isinstance(one, ExternalEncoder):
        one.motion.abort_all()
        one.control_words.release()
        one.torque.end_all()
    one.homings.clear()
    one.power_down()
    _start_values(one, powered_off=True)


def forget_adjustment(one: TechnologyObject, *, only_incremental: bool = False) -> None:
    """Delete the adjustment of the object's absolute encoders.

    Args:
        one: The object.
        only_incremental: Only of those whose type is no longer an absolute one (HOM-157).

    """
    store = one.variables
    for path in [path for path in store.paths() if path.endswith(_OFFSET)]:
        sensor = path.removesuffix(_OFFSET)
        if only_incremental and store.read(f"{sensor.removeprefix('Status')}.Type") != INCREMENTAL:
            continue
        store.set_internal(path, 0.0)
        store.set_internal(f"{sensor}.Adjusted", 0)


def download(one: TechnologyObject, values: Mapping[str, Any]) -> None:
    """Load start values of any access class and initialise the object with them.

    Raises:
        ConfigurationError: A variable does not exist, its value is out of range, or values do not fit
            together; then nothing has changed.

    """
    take_back = one.variables.load(values)
    problems = one.check(start=True)
    if problems:
        take_back()
        raise problems[0].error()
    forget_adjustment(one, only_incremental=True)
    _start_values(one, powered_off=False)


def _start_values(one: TechnologyObject, *, powered_off: bool) -> None:
    """Put the start values of load memory into force, or disable the object with alarm 101."""
    problems = [str(problem) for problem in one.variables.violations() or one.check(start=True)]
    alarms = one.engine if isinstance(one, ExternalEncoder) else one.alarms
    alarms.restart()
    if problems:
        alarms.raise_alarm(_ALARM_CONFIGURATION, text="; ".join(problems))
    else:
        one.variables.power_cycle()
        one.apply_configuration(powered_off=powered_off)

"""Rules that judge every trace: silent on what the product does, loud on a trace that breaks one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pytest

from fieldbus.history import Event
from hil.bench import load_bench
from hil.expect.rules import AXIS_RULES, DRIVE_RULES, judge
from hil.expect.rules.handbook import with_rules
from hil.faults import Injector
from hil.record import Trace
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench

Numbers = Any
NAMES: Final = tuple(rule.name for rule in (*AXIS_RULES, *DRIVE_RULES))
pytestmark = pytest.mark.exhaustive


def _drive_around(bench: Bench) -> Trace:
    """Move with and without jerk, stop, then let the drive trip, and acknowledge."""
    axis = bench.axis()
    power = axis.power()
    bench.wait_until(power.status, timeout=2.0)
    bench.wait_until(axis.home(0.0).done, timeout=1.0)
    job = axis.move_velocity(100.0, Acceleration=400.0, Deceleration=700.0, Jerk=0.0)
    bench.wait_until(job.in_velocity, timeout=2.0)
    bench.run_for(0.2)
    job = axis.move_velocity(30.0, Acceleration=400.0, Deceleration=700.0, Jerk=0.0)
    bench.wait_until(job.in_velocity, timeout=2.0)
    bench.run_for(0.05)
    way = axis.move_relative(-15.0, Velocity=80.0, Acceleration=900.0, Deceleration=600.0, Jerk=9000.0)
    bench.wait_until(way.done, timeout=3.0)
    job = axis.move_velocity(100.0, Jerk=0.0)
    bench.wait_until(job.in_velocity, timeout=2.0)
    stop = axis.stop(0)
    bench.wait_until(stop.done, timeout=2.0)
    stop.set(Execute=False)
    bench.network().sdo(bench.config.drive["drive1"].node_id).upload(0x6041)
    bench.run_for(0.1)
    axis.move_velocity(90.0)
    bench.run_for(0.3)
    axis.power(False, stop_mode=1)
    bench.run_for(0.4)
    axis.power()
    bench.run_for(0.3)
    fault = Injector(bench).inject("drive.fault", bench.drive().name, code=0x2310)
    bench.run_for(0.3)
    fault.remove()
    axis.reset()
    bench.run_for(0.3)
    return bench.trace()


LIMITED: Final = {"axis": {"axis1": {"variables": {"PositionLimits_SW.Active": True}}}}
MODULO: Final = {"axis": {"axis1": {"variables": {"Modulo.Enable": True, "Modulo.Length": 360.0}}}}
BRAKE: Final = {"torque_nm": 5.0, "opening_time_ms": 30.0, "closing_time_ms": 30.0}


@pytest.fixture(scope="module")
def traces() -> Mapping[str, Trace]:
    """A trace of a drive of either profile, and one of a modulo axis whose torque is limited."""
    found = {}
    for name, brake in (("reference", {}), ("profidrive", {"drive": {"drive1": {"brake": BRAKE}}})):
        with load_bench(name).configured(brake | LIMITED).build(seed=3) as bench:
            found[name] = _drive_around(bench)
    with load_bench("reference").configured(MODULO).build(seed=3) as bench:
        axis = bench.axis()
        bench.wait_until(axis.power().status, timeout=2.0)
        bench.wait_until(axis.home(300.0).done, timeout=1.0)
        bench.run_for(0.05)
        bench.wait_until(axis.move_absolute(20.0, Direction=3, Velocity=300.0).done, timeout=2.0)
        axis.torque_limiting(0.2)
        bench.run_for(0.1)
        axis.move_velocity(300.0, Acceleration=10_000.0)
        bench.run_for(0.2)
        found["modulo"] = bench.trace()
    return found


@dataclass(frozen=True)
class _Edit:
    """A change of a trace against a rule."""

    column: str = ""
    """Component and column, or several columns of it with a comma between them."""
    change: Callable[[Numbers], Numbers] = lambda values: values
    event: Callable[[Event], Event | None] = lambda entry: entry
    bench: str = "reference"

    def of(self, trace: Trace) -> Trace:
        """Return the changed trace."""
        component, _, column = self.column.partition(".")
        groups = list(trace.groups)
        for number, group in enumerate(groups):
            if group.name == component:
                values, names = group.values.copy(), [name for name, _ in group.columns]
                for at in map(names.index, column.split(",")):
                    values[:, at] = self.change(values[:, at])
                groups[number] = group._replace(values=values)
        events = [one for one in map(self.event, trace.events) if one is not None]
        frames = {bus: trace.raw_frames(bus) for bus in trace.can_buses}
        return Trace(
            groups,
            events=events,
            frames=frames,
            constants=trace.constants,
            end_ns=trace.end_ns,
            vocabulary=trace.vocabulary,
        )


def _bits(set_: int = 0, *, clear: int = 0, flip: int = 0) -> Callable[[Numbers], Numbers]:
    def change(values: Numbers) -> Numbers:
        return ((values.astype(np.int64) | set_) & ~clear) ^ flip

    return change


def _times(factor: float) -> Callable[[Numbers], Numbers]:
    return lambda values: values * factor


def _beyond(values: Numbers) -> Numbers:
    """Beyond the limit from the second halfway, in the motion before the stop."""
    changed = values.copy()
    changed[len(values) // 2 :] += 600.0
    return changed


def _without_faults(entry: Event) -> Event | None:
    return None if entry.kind.startswith("fault.") else entry


def _of_following(entry: Event) -> Event | None:
    """Take the cause of an alarm away, and let it be that of the following error."""
    if entry.kind.startswith(("fault.", "drive.fault", "drive.warning")):
        return None
    return _detail("alarm.raised", number=521)(entry)


def _detail(kind: str, **values: Any) -> Callable[[Event], Event]:
    def change(entry: Event) -> Event:
        return entry._replace(data={**entry.data, **values}) if entry.kind == kind else entry

    return change


EDITS: Final[Mapping[str, _Edit]] = {
    "position setpoint": _Edit("axis1.position_setpoint", _times(1.05)),
    "velocity setpoint": _Edit("axis1.velocity_setpoint", _times(1.5)),
    "actual velocity": _Edit("axis1.actual_velocity", _times(-1.0)),
    "following error": _Edit("axis1.following_error", _times(-1.0)),
    "control law": _Edit("axis1.control_difference", _times(1.1)),
    "actual position": _Edit("axis1.actual_position", _times(1.001)),
    "setpoint at enabling": _Edit("axis1.position_setpoint", lambda values: values + 1.0),
    "acceleration of jobs": _Edit("axis1.acceleration_setpoint", _times(1.1)),
    "ramps of jobs": _Edit("axis1.acceleration_setpoint", _times(0.9)),
    "jerk of jobs": _Edit("axis1.acceleration_setpoint", _times(1.3)),
    "velocity of jobs": _Edit("axis1.velocity_setpoint", _times(1.1)),
    "deceleration of stops": _Edit("axis1.acceleration_setpoint", _times(0.9)),
    "speed setpoint on the bus": _Edit("axis1.speed_output", _times(-1.0)),
    "actual speed": _Edit("axis1.actual_speed", _times(1.01)),
    "reserved bits": _Edit("axis1.status_word", _bits(1 << 19)),
    "motion bits": _Edit("axis1.status_word", _bits(flip=1 << 13 | 1 << 14)),
    "standstill bit": _Edit("axis1.status_word", _bits(1 << 7)),
    "enable bit": _Edit("axis1.status_word", _bits(flip=1)),
    "done bit": _Edit("axis1.status_word", _bits(flip=1 << 6)),
    "command bits": _Edit("axis1.status_word", _bits(clear=1 << 10)),
    "ErrorWord": _Edit("axis1.error_word", _bits(1 << 9)),
    "WarningWord": _Edit("axis1.warning_word", _bits(1 << 3)),
    "ErrorDetail": _Edit("axis1.alarm_number", _times(0.0)),
    "reactions of alarms": _Edit(event=_detail("alarm.raised", reaction=3)),
    "end of positioning": _Edit("axis1.actual_position", lambda values: values + 0.15),
    "target of positioning": _Edit("axis1.position_setpoint", _times(1.01)),
    "modulo range": _Edit("axis1.modulo_cycle", lambda values: values + 1.0, bench="modulo"),
    "bits of software limits": _Edit("axis1.status_word", _bits(1 << 15)),
    "software limits": _Edit("axis1.position_setpoint", _beyond),
    "homed bit": _Edit("axis1.status_word", _bits(clear=1 << 5)),
    "drive in operation": _Edit("axis1.in_operation", _times(0.0)),
    "permitted following error": _Edit("axis1.permitted_following_error", _times(1.01)),
    "alarm 521": _Edit("axis1.following_error", lambda values: values + 100.0),
    "alarms 421 and 550": _Edit("axis1.zsw1", lambda values: 0 * values + 0x0237),
    "fault of the drive": _Edit("axis1.zsw1", _bits(1 << 3)),
    "alarm 431": _Edit(event=_detail("alarm.raised", number=431, info=1)),
    "alarms of limits": _Edit(event=_detail("alarm.raised", number=304)),
    "alarms of devices": _Edit(event=_without_faults),
    "motion of the mechanics": _Edit("drive1.position", _times(1.05)),
    "gear": _Edit("drive1.motor_speed", _times(1.001)),
    "encoder": _Edit("drive1.encoder_increments", _times(1.01)),
    "position on the bus": _Edit("drive1.encoder_increments", lambda values: values + 1000.0),
    "speed on the bus": _Edit("drive1.motor_speed", _times(0.9)),
    "torque on the bus": _Edit("drive1.torque", lambda values: values + 1.0),
    "status word on the bus": _Edit("drive1.statusword", _bits(1 << 8)),
    "speed setpoint": _Edit("drive1.velocity_demand", _times(1.01)),
    "state in 6041h": _Edit("drive1.statusword", _bits(flip=1 << 2)),
    "warning bit": _Edit("drive1.statusword", _bits(1 << 7)),
    "remote bit": _Edit("drive1.statusword", _bits(clear=1 << 9)),
    "voltage bit": _Edit("drive1.statusword", _bits(clear=1 << 4)),
    "bits of the mode in 6041h": _Edit("drive1.statusword", _bits(clear=1 << 12)),
    "ZSW1 and ZSW2": _Edit("drive1.drive_zsw1", _bits(clear=1 << 4), bench="profidrive"),
    "direction in ZSW1": _Edit("drive1.drive_zsw1", _bits(flip=1 << 14), bench="profidrive"),
    "brake in ZSW1": _Edit("drive1.drive_zsw1", _bits(flip=1 << 12), bench="profidrive"),
    "error register": _Edit(event=_detail("emcy.raised", register=0x09)),
    "error code": _Edit("drive1.error_code", lambda values: 0x2310 - values),
    "EMCY": _Edit(event=_detail("emcy.raised", code=0x2320)),
    "torque limits": _Edit("drive1.torque", lambda values: values + 100.0, bench="modulo"),
    "ramp of a stop of the drive": _Edit("drive1.velocity_demand", _times(1.05)),
    "force and acceleration": _Edit("drive1.torque", _times(1.2)),
    "torque at its limit": _Edit("drive1.torque_demand", _times(-1.0), bench="modulo"),
    "speed of the motor": _Edit("drive1.motor_speed", _times(0.8)),
    "motor of the axis": _Edit("drive1.motor_speed", _times(0.8)),
    "cause of alarm 521": _Edit(event=_of_following),
    "velocity that a job keeps": _Edit("axis1.velocity_setpoint", _times(1.01)),
    "time of a positioning": _Edit(event=_detail("job.started", acceleration=200.0), bench="modulo"),
    "begin of a motion": _Edit("axis1.velocity_setpoint,acceleration_setpoint", _times(0.0)),
    "reset of faults": _Edit("drive1.controlword", _bits(clear=1 << 7)),
    "faults of the drive": _Edit(event=_without_faults),
    "end of operation": _Edit(event=_without_faults),
    "objects of the drive": _Edit("drive1.statusword", _bits(flip=1 << 9)),
}


def _failed(trace: Trace) -> set[str]:
    return {check.name for check in judge(trace) if check.verdict is not Verdict.PASSED}


def test_rules_are_silent_on_a_sound_run(traces: Mapping[str, Trace]) -> None:
    """No rule complains about a run of the product, and every rule has something to judge in one of them."""
    judged = set()
    for trace in traces.values():
        checks = judge(trace)
        assert [check.observed for check in checks if check.verdict is not Verdict.PASSED] == []
        judged |= {check.name.rpartition(" of ")[0] for check in checks}
        assert all(check.rule and check.requirements and check.sentence for check in checks)
    missing = set(NAMES) - judged
    assert missing <= {
        "alarm 431",
        "alarms of limits",
        "cause of alarm 521",
        "end of operation",
    }, "events of other runs"


def test_the_handbook_has_every_rule() -> None:
    """The table of the handbook is that of the rules."""
    page = (Path(__file__).parents[3] / "docs/guides/writing-tests.md").read_text(encoding="utf-8")
    assert with_rules(page) == page, "python -m hil.expect.rules.handbook docs/guides/writing-tests.md"


def test_every_rule_notices_what_it_forbids(traces: Mapping[str, Trace], subtests: pytest.Subtests) -> None:
    """A trace that is changed against a rule breaks that rule."""
    assert sorted(NAMES) == sorted(EDITS)
    for name in NAMES:
        with subtests.test(name):
            edit = EDITS[name]
            broken = _failed(edit.of(traces[edit.bench]))
            assert any(one.startswith(f"{name} of ") for one in broken), sorted(broken)

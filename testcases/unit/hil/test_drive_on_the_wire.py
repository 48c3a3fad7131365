"""What goes over the wire between an axis and its PROFIdrive drive, and what a test sees of drive and encoder
(section 11).
"""

from __future__ import annotations

import itertools
import struct

import pytest

from emulators.drive.profidrive import AxisState as DriveState
from emulators.drive.profidrive.faults.catalogue import CATALOGUE
from emulators.drive.profidrive.statemachine import Off
from fieldbus.profidrive import from_n4
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.expect import event_order
from hil.record import event
from testcases.unit.hil.homing_bench import Machine as HomingMachine
from testcases.unit.hil.homing_bench import homing_bench
from testcases.unit.hil.test_hil_profidrive import CYCLE_S, bench, enabled

NODE = 5
SYNC, RPDO1, RPDO2, TPDO1, TPDO2 = 0x080, 0x200 + NODE, 0x300 + NODE, 0x180 + NODE, 0x280 + NODE
OWNED = 0x04FF


def words(frame):
    return struct.unpack(f"<{len(frame.data) // 2}H", frame.data)


def sent(machine, can_id, since_s=0.0):
    """Return (time in s, words) of every frame with an identifier."""
    return [
        (frame.time_ns * 1e-9, words(frame))
        for frame in machine.trace().frames
        if frame.can_id == can_id and frame.time_ns * 1e-9 >= since_s and not frame.error
    ]


def distinct(values):
    return [value for at, value in enumerate(values) if at == 0 or value != values[at - 1]]


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-044", "STP-533")
def test_everything_goes_through_the_telegram():
    """From enabling over motion to the quick stop the bus has SYNC, process data and heartbeats, and nothing
    else.
    """
    with bench() as machine:
        machine.run_for(0.1)
        since = machine.now_s
        axis = enabled(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.3)
        axis.power(False, stop_mode=1)
        machine.run_for(0.6)
        seen = {frame.can_id for frame in machine.trace().frames if frame.time_ns * 1e-9 >= since}
        data = {base + NODE for base in (0x180, 0x200, 0x280, 0x300, 0x380, 0x400, 0x480, 0x500)}
        assert {SYNC, RPDO1, TPDO1} <= seen
        others = seen - {SYNC} - data
        assert all(one & 0x700 == 0x700 for one in others), sorted(map(hex, others))


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-533")
def test_words_of_a_quick_stop_with_their_times():
    """STW1, NSET, STW2 and ZSW1, NACT, ZSW2 of every cycle with time stamps: 047F, 047B, 0478, 047E, and the
    ramp of the drive.
    """
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.4)
        before = machine.now_s
        axis.power(False, stop_mode=1)
        machine.run_for(0.6)
        to_drive, from_drive = sent(machine, RPDO1, before - CYCLE_S), sent(machine, TPDO1, before - CYCLE_S)
        assert distinct([row[0] & OWNED for _, row in to_drive]) == [0x047F, 0x047B, 0x0478, 0x047E]
        setpoints = [from_n4(row[1] << 16 | row[2]) * 3000.0 for _, row in to_drive]
        assert setpoints[0] == pytest.approx(1800.0, abs=1.0)
        stopped = next(at for at, (_, row) in enumerate(to_drive) if row[0] & OWNED == 0x047B)
        assert set(setpoints[stopped:]) == {0.0}
        counters = [row[3] >> 12 for _, row in to_drive]
        assert all((b - a) % 15 == 1 or (a, b) == (15, 1) for a, b in itertools.pairwise(counters))
        steps = [b - a for (a, _), (b, _) in itertools.pairwise(to_drive)]
        assert steps == pytest.approx([CYCLE_S] * len(steps), abs=1e-4)
        assert 0x0213 in [row[0] & 0x027F for _, row in from_drive]
        braking = [
            (at, from_n4(row[1] << 16 | row[2]) * 3000.0)
            for at, row in from_drive
            if row[0] & 0x027F == 0x0213
        ]
        assert braking[0][1] > 1700.0
        duration = braking[-1][0] - braking[0][0]
        assert duration == pytest.approx(0.5 * 1800.0 / 3000.0, abs=3 * CYCLE_S)


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-537")
@pytest.mark.parametrize(("reaction", "path"), [(Off.OFF1, "S5A"), (Off.OFF2, "S1"), (Off.OFF3, "S5B")])
def test_the_reaction_of_a_fault_can_be_chosen(reaction, path):
    """ZSW1.3 with the stop that was chosen; acknowledged by STW1.7, which MC_Reset sends, the buffer is
    empty.
    """
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.3)
        drive = machine.drive().drive
        drive.faults.enter(CATALOGUE[7860], reaction=reaction)
        machine.run_for(0.006)
        assert drive.state is DriveState[path]
        machine.run_for(0.02)
        assert axis.port.zsw1 & 0x0008
        machine.run_for(4.0 if reaction is Off.OFF2 else 1.0)
        since = machine.now_s
        assert machine.run_until(axis.reset().done, 1.0)
        assert not axis.port.zsw1 & 0x0008
        assert not drive.faults.present
        edges = distinct([row[0] >> 7 & 1 for _, row in sent(machine, RPDO1, since)])
        assert edges[:2] == [0, 1]


@pytest.mark.requirement("STP-043")
def test_a_drive_that_stays_in_s3_within_a_time_limit():
    """With `enable_timeout_s` of the bench file a drive that does not go to S4 is alarm 421, and MC_Power
    stays without Status.
    """
    config = load_bench("profidrive").config
    section = config.axis["axis1"].model_copy(update={"enable_timeout_s": 0.2})
    with Bench(config.model_copy(update={"axis": {"axis1": section}}), seed=1) as machine:
        axis = machine.axis()
        faults(machine).inject("drive.refuse_transition", "drive1", transition=4)
        began = machine.now_s
        power = axis.power()
        assert machine.run_until(lambda: axis.var("ErrorDetail.Number") == 421, 1.0)
        assert machine.now_s - began == pytest.approx(0.2, abs=0.03)
        assert not power.Status


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-103")
def test_defaults_of_the_dynamics_apply_to_active_homing():
    """Approach and search accelerate and brake with DynamicDefaults."""
    defaults = {
        "DynamicDefaults.Acceleration": 700.0,
        "DynamicDefaults.Deceleration": 350.0,
        "DynamicDefaults.Jerk": 0.0,
    }
    variables = {
        "Sensor[1].ActiveHoming.Mode": 1,
        "Sensor[1].ActiveHoming.HomePositionOffset": 5.0,
    } | defaults
    with homing_bench(variables=variables) as machine:
        run = HomingMachine(machine)
        run.done()
        _, speeds = run.column("velocity_setpoint")
        slopes = [(b - a) / CYCLE_S for a, b in itertools.pairwise(abs(speeds))]
        assert max(slopes) == pytest.approx(700.0, rel=0.01)
        assert min(slopes) == pytest.approx(-350.0, rel=0.01)


# -- bus and encoder
# ------------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-549", "STP-019")
@pytest.mark.parametrize("away_s", [0.2, 0.6])
def test_the_time_of_the_join_is_chosen(away_s):
    """A drive that comes back after a chosen time is enabled from then on, not before."""
    with bench() as machine:
        machine.run_for(0.1)
        machine_faults = faults(machine)
        machine_faults.inject("drive.power_off", "drive1", duration_s=away_s)
        machine.run_for(0.05)
        axis = machine.axis()
        began = machine.now_s
        power = axis.power()
        assert machine.run_until(power.status, 5.0)
        assert machine.now_s - began > away_s - 0.05


def faults(machine):
    from hil.faults import Injector

    return Injector(machine)


@pytest.mark.requirement("STP-549")
@pytest.mark.parametrize(
    ("kind", "options", "alarm"),
    [
        ("frame.delay", {"message": "tpdo1", "delay_s": 0.003, "duration_s": 0.2}, False),
        ("frame.drop", {"message": "tpdo1", "count": 2}, False),
        ("frame.drop", {"message": "tpdo1", "duration_s": 0.2}, True),
        ("telegram.sign_of_life", {"direction": "actual", "how": "freeze", "duration_s": 0.2}, True),
    ],
)
def test_telegrams_are_delayed_dropped_and_frozen(kind, options, alarm):
    """Within the grace the motion goes on; beyond it the link is lost, and a frozen sign of life is a lost
    link too.
    """
    with bench() as machine:
        axis = enabled(machine)
        axis.move_velocity(100.0)
        machine.run_for(0.2)
        target = "drive1" if kind.startswith("telegram") else "can0"
        faults(machine).inject(kind, target, **options)
        machine.run_for(0.15)
        numbers = [
            one.data["number"]
            for one in machine.history.select(kind="alarm.raised")
            if one.data["alarm_class"] != "W"
        ]
        assert numbers == ([431] if alarm else [])


@pytest.mark.requirement("STP-548")
def test_the_encoder_is_disturbed_while_it_works():
    """Noise, a jump and an error of the encoder come and go; its State falls with CommunicationOK of the
    drive untouched.
    """
    with bench() as machine:
        axis = enabled(machine)
        injector = faults(machine)
        noise = injector.inject("encoder.noise", "drive1", increments=500)
        machine.run_for(0.1)
        noisy = {round(value, 9) for value in list(machine.trace()["axis1.actual_position"].values)[-20:]}
        assert len(noisy) > 5
        noise.remove()
        machine.run_for(0.05)
        before = axis.var("ActualPosition")
        injector.inject("encoder.jump", "drive1", increments=2048)
        machine.run_for(0.006)
        assert axis.var("ActualPosition") != pytest.approx(before, abs=0.001)
        machine.run_for(0.3)
        error = injector.inject("encoder.wire_break", "drive1")
        machine.run_for(0.05)
        assert axis.var("StatusSensor[1].State") == 0
        assert axis.port.link_ok
        error.remove()


@pytest.mark.requirement("STP-550")
def test_true_position_and_encoder_are_both_there():
    """With the encoder frozen the axis sees no motion; the machine itself, recorded separately, coasts on."""
    with bench(variables={"FollowingError.EnableMonitoring": False}) as machine:
        axis = enabled(machine)
        axis.move_velocity(300.0, Acceleration=2000.0, Jerk=0.0)
        machine.run_for(0.3)
        faults(machine).inject("encoder.freeze", "drive1")
        axis.power(False, stop_mode=3)
        machine.run_for(0.2)
        trace = machine.trace()
        seen, true = trace["axis1.actual_position"].values, trace["drive1.position"].values
        assert seen[-1] - seen[-40] == pytest.approx(0.0, abs=0.01)
        assert (true[-1] - true[-40]) * 1000.0 > 30.0


# -- the orchestrator
# -----------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("STP-552")
def test_jobs_in_chosen_cycles():
    """Jobs that are started 3 cycles after each other act 3 cycles after each other; order and outputs are
    recorded by cycle.
    """
    with bench() as machine:
        axis = enabled(machine)
        machine.run_for(0.1)
        jobs = []
        outputs = []
        count = iter(range(1000))

        def each_cycle():
            at = next(count)
            if at in (5, 8, 11):
                jobs.append(axis.move_velocity(10.0 * at))
            outputs.append(tuple((job.Busy, job.CommandAborted) for job in jobs))

        end = machine.on_cycle(each_cycle)
        machine.run_for(20 * CYCLE_S)
        end()
        starts = [
            one.time_ns
            for one in machine.history.select(kind="job.active")
            if one.data["instruction"] == "MC_MoveVelocity"
        ]
        assert [b - a for a, b in itertools.pairwise(starts)] == [round(3 * CYCLE_S * 1e9)] * 2
        aborted = [
            next(at for at, row in enumerate(outputs) if len(row) > number and row[number][1])
            for number in (0, 1)
        ]
        assert aborted[1] - aborted[0] == 3
        order = [
            event("job.active", job=jobs[0].name),
            event("job.aborted", job=jobs[0].name),
            event("job.active", job=jobs[1].name),
        ]
        (check,) = event_order(order).evaluate(machine.trace())
        assert check.verdict.name == "PASSED"

"""The injector on a small real bench: triggers fire when they should, faults do what they say and end."""

import itertools

import pytest

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults import Fault, Injector, after, at, frame, on_event, position, signal, state, velocity
from testcases.unit.hil.toybench import CYCLE_NS, NODE, ToyBench


@pytest.fixture
def bench():
    return ToyBench(seed=7)


@pytest.fixture
def faults(bench):
    return Injector(bench)


def enable(bench):
    bench.axis().power()
    assert bench.run_until(lambda: bench.axis().state == "STANDSTILL", 1.0)


def kinds(bench):
    return [(entry.kind, entry.time_ns) for entry in bench.history.events if entry.kind.startswith("fault.")]


def frames(bench, can_id, error=None):
    return [
        entry
        for entry in bench.medium.log
        if entry[2].can_id == can_id and (error is None or bool(entry[3]) is error)
    ]


# -- triggers
# --------------------------------------------------------------------------------------------------------


def test_a_time_trigger_fires_at_that_time(bench, faults):
    """`at` counts from the start of the bench, `after` from arming; both are exact."""
    bench.run_for(0.010)
    first = faults.inject("mechanics.jam", trigger=at(0.0123))
    second = faults.inject("encoder.freeze", trigger=after(0.0123))
    bench.run_for(0.1)
    assert first.applied_ns == 12_300_000
    assert second.applied_ns == 22_300_000


def test_a_time_in_the_past_is_refused(bench, faults):
    """A trigger that can never fire is a mistake, and nothing stays armed."""
    bench.run_for(0.5)
    with pytest.raises(ConfigurationError, match="from now on"):
        faults.inject("mechanics.jam", trigger=at(0.1))
    assert faults.armed == []


@pytest.mark.requirement("STP-551")
@pytest.mark.parametrize("direction", ["rising", "any"])
def test_a_position_trigger_fires_in_the_cycle_of_the_crossing(bench, faults, direction):
    """The fault is applied in the application cycle in which the recorded position passes the value, not
    later.
    """
    enable(bench)
    bench.axis().move_velocity(100.0)
    armed = faults.inject("drive.sto", trigger=position(20.0, direction=direction))
    bench.run_for(0.6)

    actual = bench.trace()["axis1.actual_position"]
    crossing_s = actual.first_crossing(20.0, "rising")
    assert armed.applied_ns is not None
    assert 0 <= armed.applied_ns * 1e-9 - crossing_s <= CYCLE_NS * 1e-9


def test_a_crossing_in_the_other_direction_does_not_fire(bench, faults):
    """A falling trigger lets the signal rise through the value and fires on the way back."""
    enable(bench)
    bench.axis().move_velocity(100.0)
    armed = faults.inject("drive.sto", trigger=velocity(50.0, direction="falling"))
    bench.run_for(0.5)
    assert armed.applied_ns is None
    bench.axis().halt()
    bench.run_for(0.2)
    assert armed.applied_ns is not None


@pytest.mark.requirement("STP-551")
def test_a_state_trigger_fires_on_entry_and_at_once_when_already_there(bench, faults):
    """`state` fires when the state is entered, or immediately when the component is in it."""
    first = faults.inject("encoder.freeze", trigger=state("axis1", "STANDSTILL"), duration_s=0.001)
    enable(bench)
    entered = next(
        e.time_ns for e in bench.history.events if e.kind == "axis.state" and e.data["to"] == "STANDSTILL"
    )
    assert first.applied_ns == entered

    bench.run_for(0.1)
    second = faults.inject("encoder.freeze", trigger=state("axis1", "STANDSTILL"), duration_s=0.001)
    assert second.applied_ns == bench.scheduler.now
    third = faults.inject("encoder.freeze", trigger=state("axis1", "MOTION"))
    bench.run_for(0.1)
    assert third.applied_ns is None


def test_an_event_trigger_counts_its_events(bench, faults):
    """The n-th event after arming fires, at its own instant, and details must match."""
    enable(bench)
    armed = faults.inject(
        "mechanics.jam", trigger=on_event("job.started", nth=2, instruction="MC_MoveVelocity")
    )
    bench.axis().move_absolute(1.0)
    bench.axis().move_velocity(10.0)
    bench.run_for(0.1)
    assert armed.applied_ns is None
    bench.axis().move_velocity(20.0)
    instant = bench.scheduler.now
    bench.run_for(0.1)
    assert armed.applied_ns == instant


def test_a_trigger_that_came_true_inside_a_callback_is_applied_outside_of_it(bench, faults):
    """A fault fired by an event of the drive is applied at the same instant, after the drive has finished."""
    enable(bench)
    bench.axis().move_velocity(50.0)
    seen = []
    bench.history.listen(lambda entry: seen.append(entry.kind) if entry.kind != "job.active" else None)
    faults.inject("drive.fault", trigger=on_event("drive.state", to="SWITCH_ON_DISABLED"), code=0x1000)
    bench.toy_drive.set_sto(True)
    bench.run_for(0.05)
    assert seen.index("drive.state") < seen.index("fault.applied")
    assert bench.toy_drive.state == "FAULT"


@pytest.mark.parametrize("number", [1, 3])
def test_the_nth_frame_itself_is_hit(bench, faults, number):
    """A frame fault triggered by the n-th frame hits that very frame."""
    got = heard(bench)
    armed = faults.inject(
        "frame.drop", trigger=frame(message="tpdo1", number=number), count=1, message="tpdo1"
    )
    bench.run_for(0.0199)

    assert [round(time / CYCLE_NS) for time, _ in got] == [k for k in range(5) if k != number - 1]
    assert armed.over
    log = [(entry.kind, entry.data.get("can_id")) for entry in bench.history.select(kind="fault.")]
    assert [kind for kind, _ in log] == ["fault.armed", "fault.applied", "fault.hit", "fault.removed"]
    assert log[2][1] == 0x180 + NODE


def test_a_signal_that_is_not_recorded_is_refused(faults):
    """A trigger on an unknown signal is a mistake, not a fault that never comes."""
    with pytest.raises(ConfigurationError, match="recorded signal"):
        faults.inject("mechanics.jam", trigger=signal("axis1.nonsense", 1.0))


def test_a_watch_costs_nothing_once_it_has_fired(bench, faults):
    """After the last application no callback of the trigger is left in the cycle or in the log."""
    enable(bench)
    listeners = len(bench.history._listeners)
    faults.inject("mechanics.jam", trigger=position(0.5), duration_s=0.01)
    faults.inject("mechanics.jam", trigger=on_event("job.done"), duration_s=0.01)
    assert len(bench._callbacks) == 1
    assert len(bench.history._listeners) == listeners + 1
    bench.axis().move_absolute(10.0)
    bench.run_for(1.0)
    assert bench._callbacks == []
    assert len(bench.history._listeners) == listeners


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"trigger": on_event("alarm.rised")}, "trigger.kind"),
        ({"trigger": on_event("alarms.")}, "trigger.kind"),
        ({"trigger": state("axis1", "MOTION", kind="axis.stat")}, "trigger.kind"),
        ({"trigger": at(1.0), "until": on_event("job.finished")}, "until.kind"),
    ],
)
def test_a_trigger_on_a_kind_that_nobody_emits_is_refused(bench, faults, options, key):
    """It would never fire, and say nothing; the message names near kinds, and nothing is armed."""
    with pytest.raises(ConfigurationError, match=rf"{key}.*(alarm\.raised|axis\.state|job\.started)"):
        faults.inject("mechanics.jam", **options)
    assert faults.armed == []


def test_a_kind_of_ones_own_can_be_declared(bench, faults):
    """What a part of one's own emits is known once it is declared, or once it was heard."""
    with pytest.raises(ConfigurationError, match=r"history.declare\('bench.mark'\)"):
        faults.inject("mechanics.jam", trigger=on_event("bench.mark"))
    bench.history.emit("bench", "bench.mark")
    armed = faults.inject("mechanics.jam", trigger=on_event("bench.mark"))
    bench.history.emit("bench", "bench.mark")
    assert armed.active


# -- lasting, repeating, ending
# -----------------------------------------------------------------------------------


def test_a_duration_ends_a_fault_exactly(bench, faults):
    """A fault with a duration is removed that long after its application, and both are logged."""
    armed = faults.inject("encoder.freeze", trigger=at(0.02), duration_s=0.005)
    bench.run_for(0.1)
    assert kinds(bench) == [("fault.armed", 0), ("fault.applied", 20 * MS), ("fault.removed", 25 * MS)]
    assert (armed.applied_ns, armed.removed_ns, armed.over) == (20 * MS, 25 * MS, True)
    assert bench.toy_drive.frozen is None


def test_until_ends_a_fault(bench, faults):
    """The second trigger removes the fault."""
    bench.history.declare("bench.mark")
    armed = faults.inject("mechanics.jam", until=on_event("bench.mark"))
    bench.run_for(0.01)
    assert bench.toy_drive.jammed
    bench.history.emit("bench", "bench.mark")
    assert not bench.toy_drive.jammed
    assert armed.over


def test_count_repeats_an_application(bench, faults):
    """A fault with a count is applied at each firing of its trigger until the count is reached."""
    bench.history.declare("bench.mark")
    armed = faults.inject("drive.heartbeat_loss", trigger=on_event("bench.mark"), duration_s=0.001, count=2)
    for _ in range(4):
        bench.history.emit("bench", "bench.mark")
        bench.run_for(0.01)
    assert armed.applications == 2
    assert [kind for kind, _ in kinds(bench)] == ["fault.armed", *["fault.applied", "fault.removed"] * 2]


@pytest.mark.exhaustive
def test_remove_all_repairs_everything(bench, faults):
    """After `remove_all` nothing is broken, and what had not been applied says so."""
    faults.inject("mechanics.jam")
    faults.inject("switch.press", input="home")
    waiting = faults.inject("drive.sto", trigger=at(9.0))
    faults.remove_all()
    faults.remove_all()
    bench.run_for(10.0)
    assert not bench.toy_drive.jammed
    assert bench.toy_drive.forced["home"] is None
    assert not bench.toy_drive.sto
    assert waiting.applied_ns is None
    assert [kind for kind, _ in kinds(bench)][-3:] == ["fault.disarmed", "fault.removed", "fault.removed"]


# -- what the kinds do
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "options", "broken"),
    [
        ("drive.sto", {}, lambda drive: drive.sto),
        ("drive.power_off", {}, lambda drive: not drive.port.online),
        ("drive.heartbeat_loss", {}, lambda drive: drive.silent),
        ("switch.press", {"input": "positive_limit"}, lambda drive: drive.forced["positive_limit"] is True),
        ("switch.stuck", {"input": "home"}, lambda drive: drive.forced["home"] is False),
        ("switch.stuck", {"input": "home", "state": True}, lambda drive: drive.forced["home"] is True),
        ("mechanics.jam", {}, lambda drive: drive.jammed),
        ("mechanics.load_step", {"force_N": -20.0}, lambda drive: drive.force == -20.0),
        ("encoder.freeze", {}, lambda drive: drive.frozen is not None),
    ],
)
def test_lasting_faults_break_and_repair(bench, faults, kind, options, broken):
    """A lasting fault breaks its part while it is active and repairs it afterwards."""
    before = vars(bench.toy_drive).copy()
    armed = faults.inject(kind, "drive1", **options)
    assert armed.active
    assert broken(bench.toy_drive)
    armed.remove()
    assert not broken(bench.toy_drive)
    assert not armed.active
    assert bench.toy_drive.force == before["force"]


@pytest.mark.requirement("STP-559")
def test_a_drive_fault_with_a_persistent_cause_refuses_the_reset(bench, faults):
    """The cause of a persistent fault stays until the fault is removed; only then the reset works."""
    enable(bench)
    armed = faults.inject("drive.fault", code=0x2310, persistent=True)
    bench.run_for(0.2)
    assert bench.axis().alarm_number == 421
    assert (bench.toy_drive.error_code, bench.toy_drive.state) == (0x2310, "FAULT")
    bench.axis().reset()
    bench.run_for(0.2)
    assert bench.toy_drive.state == "FAULT"
    armed.remove()
    bench.axis().reset()
    bench.run_for(0.2)
    assert bench.axis().alarm_number == 0


def test_a_jump_stays(bench, faults):
    """A jump of the encoder displaces the reported position for good and is over at once."""
    armed = faults.inject("encoder.jump", increments=-500)
    assert bench.toy_drive.offset == -500
    assert armed.over
    assert armed.removed_ns == armed.applied_ns


@pytest.mark.requirement("STP-551")
def test_alarms_are_raised_with_a_given_reaction_and_their_cause_withdrawn(bench, faults):
    """Any alarm can be raised with any reaction; a persistent cause lasts as long as the fault."""
    enable(bench)
    armed = faults.inject("axis.alarm", number=533, reaction=2, persistent=True)
    raised = next(bench.history.select(kind="alarm.raised"))
    assert (raised.data["number"], raised.data["reaction"]) == (533, 2)
    assert bench.toy_axis.alarms.causes == {533: 2}
    armed.remove()
    assert bench.toy_axis.alarms.causes == {}


def edges(bench):
    return [(e.time_ns, e.data["state"]) for e in bench.history.select(kind="drive.input")]


@pytest.mark.parametrize("final", [True, False])
def test_a_bouncing_switch_toggles_and_settles(bench, faults, final):
    """Bouncing has the given number of pulses with intervals within their limits, and ends in the given
    state.
    """
    faults.inject(
        "switch.bounce",
        input="home",
        pulses=4,
        shortest_s=0.001,
        longest_s=0.002,
        state=final,
        duration_s=0.5,
    )
    bench.run_for(0.4)
    seen = edges(bench)
    assert [value for _, value in seen] == [final, *[not final, final] * 4]
    gaps = [b[0] - a[0] for a, b in itertools.pairwise(seen)]
    assert all(1 * MS <= gap <= 2 * MS for gap in gaps)
    assert len(set(gaps)) > 1
    bench.run_for(0.2)
    assert bench.toy_drive.forced["home"] is None


def test_chance_comes_from_the_seed_alone():
    """The same seed bounces and drops in the same way, another seed in another."""

    def run(seed):
        bench = ToyBench(seed=seed)
        faults = Injector(bench)
        faults.inject("switch.bounce", input="home")
        faults.inject("frame.drop", probability=0.5, message="tpdo1")
        bench.run_for(0.3)
        return edges(bench), [entry[0] for entry in frames(bench, 0x180 + NODE)]

    assert run(1) == run(1)
    assert run(1) != run(2)


# -- frames
# -----------------------------------------------------------------------------------------------------------


def heard(bench, can_id=0x180 + NODE):
    """Attach a listener and return the list of what it hears."""
    got = []
    bench.medium.attach(
        "listener", lambda f, t: got.append((t, bytes(f.data))) if f.can_id == can_id else None
    )
    return got


def test_dropped_frames_do_not_arrive(bench, faults):
    """`first`, `every` and `count` choose exactly which frames vanish."""
    got = heard(bench)
    armed = faults.inject("frame.drop", "can0", message="tpdo1", first=2, every=3, count=2)
    bench.run_for(0.0399)
    cycles = [round(time / CYCLE_NS) for time, _ in got]
    assert cycles == [0, 2, 3, 5, 6, 7, 8, 9]
    assert armed.over
    assert [event.data["hit"] for event in bench.history.select(kind="fault.hit")] == [1, 2]


def test_delayed_frames_arrive_later(bench, faults):
    """A delay moves a frame by that time."""
    got = heard(bench)
    bench.run_for(0.0199)
    usual = got[-1][0] - 4 * CYCLE_NS
    faults.inject("frame.delay", message="tpdo1", delay_s=0.002, count=1)
    bench.run_for(0.004)
    assert got[-1][0] - 5 * CYCLE_NS - usual == pytest.approx(2 * MS, abs=200_000)


def test_corrupted_frames_are_repeated(bench, faults):
    """A bit error shows in the log; the frame arrives with its repetition."""
    got = heard(bench)
    faults.inject("frame.corrupt", message="tpdo1", attempts=2, count=1)
    bench.run_for(0.0039)
    assert len(got) == 1
    assert len(frames(bench, 0x180 + NODE, error=True)) == 2


def test_duplicated_and_replaced_frames(bench, faults):
    """Copies follow the frame; a replaced payload arrives in place of the original."""
    got = heard(bench)
    faults.inject("frame.duplicate", message="tpdo1", copies=2, count=1)
    bench.run_for(0.0039)
    assert len(got) == 3
    assert len({data for _, data in got}) == 1
    faults.inject("frame.replace", message="tpdo1", data="AA BB", count=1)
    bench.run_for(0.004)
    assert got[-1][1] == b"\xaa\xbb"


def test_injected_frames_come_at_their_period(bench, faults):
    """A foreign node sends as often as given, at the given distance; without an end it sends once."""
    got = heard(bench, 0x333)
    armed = faults.inject("frame.inject", can_id=0x333, data="01", period_s=0.003, count=4)
    bench.run_for(0.1)
    assert [round((b[0] - a[0]) / MS) for a, b in itertools.pairwise(got)] == [3, 3, 3]
    assert armed.over
    faults.inject("frame.inject", can_id=0x333)
    bench.run_for(0.1)
    assert len(got) == 5
    flood = faults.inject("frame.inject", can_id=0x333, period_s=0.001, duration_s=0.0105)
    bench.run_for(0.1)
    assert len(got) == 5 + 11
    assert flood.over


def test_sender_and_mask_narrow_the_choice(bench, faults):
    """Only frames of the named sender, and of identifiers equal under the mask, are hit."""
    got = heard(bench)
    faults.inject("frame.drop", can_id=0x100 + NODE, mask=0x17F, sender="controller")
    bench.run_for(0.02)
    assert len(got) >= 5
    faults.inject("frame.drop", can_id=0x180 + NODE, mask=0x7FF, sender="drive1")
    count = len(got)
    bench.run_for(0.02)
    assert len(got) == count


def test_unknown_names_are_refused(faults):
    """A message or part that the bench does not have is a mistake that lists what there is."""
    with pytest.raises(ConfigurationError, match="tpdo1"):
        faults.inject("frame.drop", message="tpdo9")
    with pytest.raises(ConfigurationError, match="drive1"):
        faults.inject("drive.sto", "drive9")
    with pytest.raises(ConfigurationError, match=r"frame\.drop\.parameters\.sender: 'drive9'.*drive1"):
        faults.inject("frame.drop", sender="drive9")
    assert faults.armed == []


# -- refusal
# --------------------------------------------------------------------------------------------------------


def test_what_a_bench_cannot_do_is_refused_with_a_reason(bench, faults):
    """On a live bus there is no access to the bits of the wire: refused, with the reason, and nothing is
    armed.
    """
    bench.kind = "live"
    with pytest.raises(UnsupportedFaultError, match=r"frame\.corrupt.*live.*bits of the wire"):
        faults.inject("frame.corrupt", can_id=1)
    assert faults.armed == []
    assert kinds(bench) == []


def test_a_physical_drive_refuses_what_only_an_emulator_can(bench, faults):
    """A fault that needs a seam inside the drive is refused for hardware."""
    bench.kind = "live"
    bench.toy_drive.physical = True
    with pytest.raises(UnsupportedFaultError, match="hardware"):
        faults.inject("mechanics.jam")


def test_a_part_without_the_seam_refuses(bench, faults, monkeypatch):
    """A drive that lacks the method of a fault leads to a refusal that names it."""
    monkeypatch.delattr(type(bench.toy_drive), "jam")
    with pytest.raises(UnsupportedFaultError, match=r"drive1 offers no jam\(\)"):
        faults.inject("mechanics.jam")


def test_faults_are_logged_with_their_parameters(bench, faults):
    """The log holds kind, number, trigger and parameters of every armed fault."""
    faults.arm(Fault("drive.fault", trigger=at(0.5), parameters={"code": 0x3210}))
    entry = bench.history.events[-1]
    assert (entry.source, entry.kind) == ("drive1", "fault.armed")
    assert entry.data == {"fault": "drive.fault", "injection": 1, "trigger": "at 0.5 s", "code": 0x3210}

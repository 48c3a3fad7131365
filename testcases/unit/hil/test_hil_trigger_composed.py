"""Triggers made of triggers, on a bench: what fires, when, how often; and what is refused."""

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import load_bench
from hil.cli import main
from hil.faults import (
    TRIGGERS,
    AnyOf,
    Fault,
    Injector,
    after,
    any_of,
    at,
    chance,
    condition,
    every,
    frame,
    immediately,
    on_event,
    position,
    sequence,
    state,
    trigger_from_dict,
    velocity,
)
from testcases.unit.hil.toybench import ToyBench


@pytest.fixture
def bench():
    bench = ToyBench(seed=3)
    axis = bench.axis()
    axis.power()
    assert bench.run_until(lambda: axis.state == "STANDSTILL", 1.0)
    return bench


def applied(bench):
    return [entry.time_ns * 1e-9 for entry in bench.history.events if entry.kind == "fault.applied"]


def arm(bench, trigger, **options):
    return Injector(bench).inject("drive.sto", trigger=trigger, **options)


EXAMPLES = [
    condition("drive1.statusword", ones=0x27, zeros=0x48),
    condition("axis1.actual_velocity", low=-1.5, high=100.0),
    every(0.5),
    every(0.5, first_s=0.0),
    sequence(position(10.0), after(0.1), on_event("fault.removed")),
    any_of(at(3.0), velocity(10.0, direction="rising")),
    chance(on_event("job.active", nth=2), 0.25),
    chance(sequence(any_of(after(1.0), after(2.0)), condition("a.b", high=0.0)), 1.0),
    frame(0x600, mask=0x780, data="2F .. 60", number=3),
]


@pytest.mark.parametrize("trigger", EXAMPLES, ids=str)
def test_they_go_to_toml_values_and_back(trigger):
    """What is written is read back equal, also within a fault; and a fault with it can be a key."""
    assert trigger_from_dict(trigger.to_dict()) == trigger
    fault = Fault("drive.sto", trigger=trigger, duration_s=0.1)
    assert Fault.from_dict(fault.to_dict()) == fault
    assert hash(fault) == hash(Fault.from_dict(fault.to_dict()))


def test_a_condition_fires_when_it_comes_true_and_at_once_when_it_is(bench):
    """It is a level: true already fires at once, and later only after it was false."""
    begun = bench.scheduler.now * 1e-9
    arm(bench, condition("axis1.actual_velocity", high=0.5, low=-0.5), duration_s=0.001)
    assert applied(bench) == [pytest.approx(begun)]
    bench.run_for(0.2)
    moving = arm(bench, condition("actual_velocity", low=20.0), duration_s=0.001)
    assert moving.applied_ns is None


def test_a_condition_on_bits_of_a_word_fires(bench):
    """Bits set and cleared of a recorded word; here those of Operation enabled in the status word."""
    bench.axis().power(False, stop_mode=0)
    bench.run_for(0.5)
    arm(bench, condition("drive1.statusword", ones=0x27, zeros=0x48), duration_s=0.01)
    bench.run_for(0.05)
    assert applied(bench) == []
    bench.axis().power()
    bench.run_for(0.5)
    enabled = [
        e.time_ns
        for e in bench.history.events
        if e.kind == "drive.state" and "nabled" in str(e.data["to"]).lower()
    ]
    (when,) = applied(bench)
    assert 0.0 <= when - enabled[-1] * 1e-9 < 0.01


def test_every_repeats_as_often_as_count_says(bench):
    """Each application is a period after the one before; an end between them is needed."""
    begun = bench.scheduler.now * 1e-9
    armed = arm(bench, every(0.1, first_s=0.05), duration_s=0.02, count=3)
    bench.run_for(1.0)
    assert applied(bench) == [pytest.approx(begun + t) for t in (0.05, 0.15, 0.25)]
    assert armed.over
    with pytest.raises(ConfigurationError, match="duration_s or until"):
        Fault("drive.sto", trigger=every(0.1), count=3)


def test_a_sequence_goes_stage_by_stage(bench):
    """A later part counts from the one before it: what comes before its turn does not count."""
    injector = Injector(bench)
    first = injector.inject("switch.press", input="home", trigger=after(0.1), duration_s=0.2)
    begun = bench.scheduler.now * 1e-9
    injector.inject("drive.sto", trigger=sequence(on_event("fault.removed"), after(0.05)), duration_s=0.01)
    bench.run_for(1.0)
    assert first.removed_ns == pytest.approx((begun + 0.3) * 1e9)
    assert applied(bench)[1:] == [pytest.approx(begun + 0.35)]


def test_a_sequence_begins_again_for_the_next_time(bench):
    """With a count it is waited for from the beginning again."""
    begun = bench.scheduler.now * 1e-9
    arm(bench, sequence(after(0.1), after(0.05)), duration_s=0.01, count=3)
    bench.run_for(1.0)
    assert applied(bench) == [pytest.approx(begun + t) for t in (0.15, 0.30, 0.45)]


def test_any_of_takes_the_first_that_comes(bench):
    """One of the parts suffices."""
    begun = bench.scheduler.now * 1e-9
    arm(bench, any_of(after(0.4), after(0.2)), duration_s=0.01)
    bench.run_for(1.0)
    assert applied(bench) == [pytest.approx(begun + 0.2)]


@pytest.mark.exhaustive
def test_chance_draws_from_the_stream_of_the_fault():
    """The same seed gives the same occasions, the share is about the probability, and probability 1 is
    always.
    """

    def occasions(probability, seed):
        bench = ToyBench(seed=seed)
        arm(bench, chance(every(0.01), probability), duration_s=0.001, count=1000)
        bench.run_for(2.0)
        return applied(bench)

    some = occasions(0.25, 3)
    assert some == occasions(0.25, 3)
    assert some != occasions(0.25, 4)
    assert 25 <= len(some) <= 75, "a quarter of 200"
    assert len(occasions(1.0, 3)) in (199, 200)


def test_overlapping_faults_are_distinguished(bench):
    """Two faults act at the same time, each with its own begin and end in the log."""
    injector = Injector(bench)
    injector.inject("switch.press", input="home", trigger=after(0.1), duration_s=0.3)
    injector.inject("drive.sto", trigger=after(0.2), duration_s=0.1)
    bench.run_for(1.0)
    reported = [
        (e.kind, e.data["injection"])
        for e in bench.history.events
        if e.kind in ("fault.applied", "fault.removed")
    ]
    assert reported == [
        ("fault.applied", 1),
        ("fault.applied", 2),
        ("fault.removed", 2),
        ("fault.removed", 1),
    ]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: condition("a.b"), "low, high, ones or zeros"),
        (lambda: condition("a.b", low=2.0, high=1.0), "low <= high"),
        (lambda: condition("a.b", ones=3, zeros=1), "without a bit in both"),
        (lambda: every(0.0), "> 0 s"),
        (lambda: sequence(after(1.0)), "two triggers"),
        (lambda: sequence(after(1.0), at(2.0)), "after"),
        (lambda: sequence(after(1.0), immediately()), "brings about"),
        (lambda: AnyOf(()), "two triggers"),
        (lambda: chance(after(1.0), 0.0), "at most 1"),
        (lambda: frame(0x181, data="2"), "2F .. 60"),
        (lambda: frame(0x181, data="00" * 9), "8 bytes"),
        (lambda: frame(0x181, mask=-1), "1FFFFFFFh"),
        (lambda: trigger_from_dict({"when": "sequence", "triggers": "x"}), "list of tables"),
        (lambda: trigger_from_dict({"when": "sequence"}), "required"),
        (lambda: trigger_from_dict({"when": "condition", "signal": "a.b", "ones": 1.5}), "whole number"),
        (lambda: trigger_from_dict({"when": "every", "period": 1.0}), "period_s"),
        (lambda: trigger_from_dict({"when": "any", "triggers": [{"when": "x"}, {}]}), r"triggers\[0\].when"),
    ],
)
def test_what_makes_no_trigger_is_refused(make, words):
    """The message names the key and what is allowed."""
    with pytest.raises(ConfigurationError, match=words):
        make()


@pytest.mark.parametrize(
    "trigger",
    [
        sequence(after(0.1), condition("axis1.nothing", low=0.0)),
        sequence(after(0.1), on_event("job.strted")),
        any_of(after(0.1), position(1.0, axis="axis9")),
        chance(condition("axis1.nothing", low=0.0), 0.5),
    ],
    ids=str,
)
def test_parts_are_checked_when_the_fault_is_armed(bench, trigger):
    """A name that a later part has wrong is found at once, not in the middle of the run."""
    with pytest.raises(ConfigurationError):
        arm(bench, trigger)


def test_a_live_bench_refuses_what_it_hears_too_late(bench, monkeypatch):
    """Events of the process of the drives come at the end of a live bench: a trigger on them says what to
    take instead.
    """
    monkeypatch.setattr(bench, "kind", "live")
    bench.history.events.clear()
    for trigger in (on_event("drive.state"), state("drive1", "Fault"), on_event("emcy.raised", "drive1")):
        with pytest.raises(UnsupportedFaultError, match=r"live bench.*emcy\.received"):
            arm(bench, trigger)
    for trigger in (on_event("axis.state"), on_event("link.down"), on_event("alarm.raised")):
        assert arm(bench, trigger).applied_ns is None


def test_the_nth_frame_that_fits_a_filter_fires():
    """Identifier under a mask and the begin of the data: the second RPDO1 that says Operation enabled to any
    node.
    """
    with load_bench("reference").build() as bench:
        bench.axis().power()
        injector = Injector(bench)
        injector.inject(
            "drive.sto", trigger=frame(0x200, mask=0x780, data="0F .. ..", number=2), duration_s=0.01
        )
        never = injector.inject("drive.sto", trigger=frame(0x205, data="FF"), duration_s=0.01)
        bench.run_for(0.5)
        log = bench.trace().raw_frames("can0")
        fitting = [t for t, _, f, _ in log if f.can_id == 0x205 and f.data[0] == 0x0F]
        (when,) = [e.time_ns for e in bench.history.events if e.kind == "fault.applied"]
        assert fitting[1] - 200_000 <= when <= fitting[1], (
            "the log has the end of the frame, the hook its begin"
        )
        assert never.applied_ns is None


def test_every_trigger_is_listed_with_what_it_can_use_live(capsys):
    """`hil faults` says of each value of `when` what it can use on a live bench, and of no other."""
    with pytest.raises(ConfigurationError) as refused:
        trigger_from_dict({"when": "never"})
    allowed = str(refused.value).partition("allowed: ")[2].split(", ")
    assert set(TRIGGERS) == set(allowed)
    assert main(["faults"]) == 0
    printed = capsys.readouterr().out
    assert all(f"    {when}: " in printed for when in allowed)
    assert printed.count("live: ") >= len(allowed)

"""What benches, axes, drives and jobs say of themselves, and messages about mistakes in a test."""

import re

import pytest

import hil
from hil.campaign import Campaign, CaseSettings, execute_case
from hil.errors import ConfigurationError, ExpectationFailedError, HilError
from hil.expect import (
    alarm,
    evaluate,
    event,
    no_alarm,
    no_motion_after,
    ramp,
    standstill,
    state_at,
    status_word_bit,
)
from hil.expect import stop as stop_by_mode
from hil.faults import Injector, any_of, at, condition, position, sequence, signal, state, velocity
from hil.testing import CurrentTrace
from reports.model import Verdict
from testcases.unit.hil import three_axes

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def broken():
    """A bench on which z has tried to move with a wrong encoder."""
    with three_axes.WRONG_ENCODER.build(seed=1) as bench:
        z = bench.axis("z")
        power = z.power()
        assert bench.run_until(power.status, 2.0)
        first, second = z.home(0.0), z.move_relative(50.0)
        bench.run_for(0.03)
        third = z.move_relative(10.0)
        bench.drive("x_drive").raise_fault(0x8611)
        bench.run_for(0.5)
        yield bench, power, (first, second, third)


def test_a_job_says_how_it_stands_and_why(broken):
    """Done, aborted by whom, ended with which ErrorID, alarm and time, enabled or not."""
    _, power, (first, second, third) = broken
    assert re.fullmatch(r"<MC_Home_1 of z was done at 0\.\d{3} s>", repr(first))
    assert re.fullmatch(
        r"MC_MoveRelative_1 of z was aborted at 0\.\d{3} s by MC_MoveRelative_2", second.summary()
    )
    ended = r"MC_MoveRelative_2 of z ended with 16#8001: alarm 521 at 0\.\d{3} s"
    assert re.fullmatch(ended, third.summary())
    assert power.summary() == "MC_Power_1 of z has Enable TRUE, Status FALSE, and shows 16#8001: alarm 521"


def test_a_bench_its_axes_and_drives_say_how_they_stand(broken):
    """State, position, alarms, faults and time; nowhere the address of an object."""
    bench, _, _ = broken
    assert re.fullmatch(
        r"<z ALARM_DISABLED at -?[\d.e-]+ mm, (alarm 522, )?alarm 521 \(0\.\d{3} s\)>", repr(bench.axis("z"))
    )
    assert re.fullmatch(
        r"<CiA402Drive x_drive Fault, fault 8611h: following error \(0\.\d{3} s\)>",
        repr(bench.drive("x_drive")),
    )
    assert repr(bench).startswith("<Bench 'three axes' at 0.")
    assert "x DISABLED at 0 mm, not homed; y DISABLED at 0 mm, not homed; z ALARM_DISABLED at" in repr(bench)
    assert bench.axis("x").move_relative(1.0).summary() == "MC_MoveRelative_1 of x has not been called yet"


def test_a_wait_says_what_it_waited_for_and_how_that_ended(broken):
    """`wait_until` raises with job, ErrorID and alarm; without a job with the place of the condition and the
    axes.
    """
    bench, power, (_, _, third) = broken
    with pytest.raises(
        ExpectationFailedError, match=r"^move: MC_MoveRelative_2 of z ended with 16#8001: alarm 521"
    ):
        bench.wait_until(third.done, 0.01, "move")
    with pytest.raises(
        AssertionError, match=r"test_words_of_benches.py:\d+ did not come within 0.01 s: x DISABLED"
    ):
        bench.wait_until(lambda: False, 0.01)
    assert bench.wait_until(third.error, 0.01) == bench.now_s
    assert not bench.unmet_wait()
    assert not bench.run_until(power.status, 0.01)
    assert "shows 16#8001: alarm 521" in bench.unmet_wait()
    bench.run_for(0.01)
    assert not bench.unmet_wait(), "what was waited for is over"
    for mistake in (None, third.done()):
        for wait in (bench.run_until, bench.wait_until):
            with pytest.raises(ConfigurationError, match=r"job.done, not job.done\(\)"):
                wait(mistake, 1.0)


def test_misspelt_names_get_the_nearest_right_one(broken):
    """Methods of an axis, bits of its words, signals of a trigger."""
    bench, _, _ = broken
    axis, faults = bench.axis("x"), Injector(bench)
    with pytest.raises(AttributeError, match="x has no 'move_absolut'; similar: move_absolute"):
        axis.move_absolut(1.0)
    assert axis.var("StatusWord.X0") is False
    with pytest.raises(HilError, match="StatusWord has no bit 77"):
        axis.var("StatusWord.X77")
    with pytest.raises(ConfigurationError, match=r"similar: x_drive\.torque"):
        faults.inject("drive.fault", "x_drive", code=0x8611, trigger=signal("x_drive.torqe", 1.0))
    with pytest.raises(
        ConfigurationError, match=r"trigger: 0.5 is not allowed; allowed: .*at\(0.5\), after\(0.5\)"
    ):
        faults.inject("drive.fault", "x_drive", code=0x8611, trigger=0.5)
    assert not faults.armed


CALLS = [
    (
        lambda bench: bench.axes,
        "the bench has no 'axes'; use bench.axis(\"x\"), with a name of bench.axis_names",
    ),
    (lambda bench: bench.inject("drive.fault"), 'use faults.inject("drive.fault", ...)'),
    (lambda bench: bench.now, "use bench.now_s"),
    (lambda bench: bench.run(0.5), r"use bench.run_for(0.5)"),
    (lambda bench: bench.run_fro(0.5), "similar: run_for"),
    (
        lambda bench: bench.move_relative(5.0),
        'use bench.axis("x").move_relative: it belongs to an axis; name the axis: x, y or z',
    ),
    (lambda bench: bench.axis("x").enable(), "x has no 'enable'; use power()"),
    (lambda bench: bench.axis("x").power().Statsu, "MC_Power has no 'Statsu'; similar: Status, status"),
    (lambda bench: CurrentTrace(bench).chek(), "the trace has no 'chek'; similar: check"),
    (lambda bench: CurrentTrace(bench).expect(), "use trace.check(alarm(421))"),
    (lambda bench: hil.Bnech, "module 'hil' has no 'Bnech'; similar: Bench"),
]


def test_names_that_do_not_exist_lead_to_those_that_do(broken, subtests):
    """The error of a near miss says the right call; it stays an `AttributeError`, as `hasattr` expects."""
    bench, power, _ = broken
    for call, words in CALLS:
        with subtests.test(words):
            with pytest.raises(AttributeError) as caught:
                call(bench)
            assert words in str(caught.value)
    assert not hasattr(bench, "axes")
    assert not hasattr(power, "axes")


VALUES = [
    (lambda bench: bench.run_for("0.5"), "bench.run_for: '0.5' is not allowed; allowed: a time in seconds"),
    (lambda bench: bench.run_for(None), "bench.run_for: None is"),
    (lambda bench: bench.run_for(float("nan")), "bench.run_for: nan is"),
    (lambda bench: bench.run_for(float("inf")), "bench.run_for: inf is"),
    (lambda bench: bench.run_for(-1), "bench.run_for: -1 is"),
    (lambda bench: bench.run_until(lambda: True, "1"), "bench.run_until.timeout: '1' is"),
    (
        lambda bench: bench.axis("x").move_relative(1, velocity=5),
        "'velocity' is not an input; similar: Velocity",
    ),
    (lambda bench: CurrentTrace(bench).check(), "trace.check: () checks nothing"),
    (lambda bench: CurrentTrace(bench).check([alarm(421)]), "with a star: check(*expectations)"),
    (lambda bench: CurrentTrace(bench).check(alarm), "with parentheses: alarm(...)"),
]


def test_values_of_a_wrong_kind_are_refused_at_the_call(broken, subtests):
    """Texts, None, numbers that are no time and checks of nothing do not pass in silence, and no line of the
    library is blamed.
    """
    bench, _, _ = broken
    for call, words in VALUES:
        with subtests.test(words), pytest.raises(ConfigurationError) as caught:
            call(bench)
        assert words in str(caught.value)


def test_mistakes_in_a_check_are_named(broken):
    """A time that is a text, a bench in place of an expectation, a signal that does not exist."""
    bench, _, _ = broken
    trace = CurrentTrace(bench)
    (check,) = evaluate(trace(), [state_at("z", "0.05", "STANDSTILL")])
    assert check.verdict is Verdict.ERROR
    assert (
        check.observed
        == "at: '0.05' is not allowed; allowed: a time in seconds, such as 0.05, or an event(...)"
    )
    with pytest.raises(ConfigurationError, match=r"expectations of hil.expect, such as alarm\(421\)"):
        trace.check(bench)
    (check,) = evaluate(trace(), [standstill(by=0.1, velocity="axis1.actual_velocity")])
    assert "similar: " in check.observed
    assert len(check.observed) < 250


def test_an_expectation_is_about_the_axis_of_its_event(broken):
    """The axis, or the axis of the drive, whose event is the reference; else one line asks for the name."""
    bench, _, _ = broken
    trace = bench.trace()
    for reference in (
        event("alarm.raised", number=521),
        event("drive.state", "z_drive"),
        event("axis.state", "z"),
    ):
        checks = evaluate(trace, [standstill(by=reference.plus(0.2)), no_motion_after(reference.plus(0.2))])
        assert [check.name for check in checks] == [
            "standstill of z.actual_velocity",
            "no motion of z.actual_position",
        ]
    (fault,) = evaluate(trace, [standstill(by=event("drive.fault"))])
    assert fault.name == "standstill of x.actual_velocity"
    (named,) = evaluate(trace, [standstill(by=0.4, axis="z_drive")])
    assert named.name == "standstill of z.actual_velocity"
    asking = [standstill(by=0.4), ramp(0.4), stop_by_mode(0.4, "default"), status_word_bit(0, True, at=0.4)]
    for check in evaluate(trace, asking):
        assert (check.verdict, check.observed) == (Verdict.ERROR, "name the axis: x, y or z")
    (any_axis,) = evaluate(trace, [alarm(521)])
    assert any_axis.verdict is Verdict.PASSED


def test_a_trigger_watches_the_axis_of_the_target():
    """A fault of a drive or axis watches its axis; a fault of a bus with three axes needs the name."""
    with three_axes.BENCH.build(seed=1) as bench:
        faults = Injector(bench)
        z = bench.axis("z")
        z.power()
        bench.run_for(0.3)
        z.move_velocity(60.0)
        on_drive = faults.inject("telegram.sign_of_life", "z_drive", trigger=velocity(45.0))
        on_axis = faults.inject(
            "axis.alarm", "z", number=521, trigger=sequence(velocity(20.0), position(2.0))
        )
        late = faults.inject("drive.fault", "x_drive", code=0x8611, trigger=velocity(45.0))
        odd = faults.inject("drive.fault", "y_drive", code=0x8611, trigger=state("z", "HALTING"))
        for trigger in (velocity(45.0), any_of(velocity(45.0), condition("actual_position", low=3.0))):
            with pytest.raises(ConfigurationError, match=r"name the axis: x, y or z$"):
                faults.inject("frame.drop", "can0", can_id=0x185, trigger=trigger)
        bench.run_for(1.0)
        assert on_drive.applied_ns is not None
        assert on_axis.applied_ns is not None
        assert late.waiting_summary() == "velocity of x peaked at 0, asked 45 mm/s"
        assert odd.waiting_summary().startswith("z did not come into state HALTING, it is in ")
        assert faults.waiting_summary()[0] == (
            "drive.fault on x_drive: armed, never fired: velocity of x peaked at 0, asked 45 mm/s"
        )
        assert faults in Injector.all_of(bench)
        faults.note_waiting()
        (waiting, _) = bench.trace().select(kind="fault.waiting")
        assert waiting.data["reason"] == "velocity of x peaked at 0, asked 45 mm/s"
        faults.remove_all()
        assert not faults.waiting_summary()


def test_a_case_says_which_fault_never_fired():
    """Its message, its fault and its log have the reason."""
    campaign = Campaign("waiting")

    @campaign.case("never")
    def never(ctx):
        """A fault whose trigger does not come."""
        ctx.inject("drive.fault", "x_drive", code=0x8611, trigger=velocity(45.0))
        ctx.run_for(0.05)
        ctx.expect(alarm(421, since=event("fault.applied")))

    reason = "velocity of x peaked at 0, asked 45 mm/s"
    result = execute_case(campaign.cases[0], three_axes.BENCH, CaseSettings(seed=1)).result
    assert result.verdict is Verdict.FAILED
    assert result.message.endswith(f"drive.fault on x_drive: armed, never fired: {reason}")
    assert result.faults[0].trigger.endswith(reason)
    assert any(reason in step.text for step in result.story)


TARGETS = [
    ("drive.fault", "", {"code": 0x2310}, "drive.fault: target: name the drive: x_drive, y_drive or z_drive"),
    ("drive.fault", "y", {"code": 0x2310}, "drive.fault: target 'y' is an axis: name the drive: y_drive"),
    ("mechanics.jam", "z", {}, "mechanics.jam: target 'z' is an axis: name the drive: z_drive"),
    ("drive.sto", "q", {}, "'q' is not the name of a drive; allowed: x_drive, y_drive, z_drive"),
    ("axis.alarm", "", {"number": 521}, "axis.alarm: target: name the axis: x, y or z"),
    ("axis.alarm", "z_drive", {"number": 521}, "axis.alarm: target 'z_drive' is a drive: name the axis: z"),
    ("telegram.sign_of_life", "z", {}, "target 'z' is an axis: name the drive: z_drive"),
]
"""Kind, target and parameters of a fault, and what is said of them on the bench with three axes."""
NO_ALARMS = [
    (
        lambda: alarm("421"),
        "alarm.number: '421' is not allowed; allowed: a number from 1 to 9999: 421, without quotes",
    ),
    (lambda: alarm(421.5), "alarm.number: 421.5 is not allowed; allowed: a number from 1 to 9999"),
    (lambda: alarm(0), "alarm.number: 0 is not allowed"),
    (lambda: alarm(421, reaction=77), "alarm.reaction: 77 is not allowed; allowed: a number from 0 to 15"),
    (lambda: alarm(421, within_s="0.5"), "alarm.within_s: '0.5' is not allowed; allowed: a time >= 0 s"),
    (lambda: no_alarm(besides=("421",)), "no_alarm.besides: '421' is not allowed"),
]


def test_a_fault_names_the_drives_and_axes_that_it_could_be_about(broken, subtests):
    """Nothing is injected into the first drive or axis by chance; where only one can be meant it is."""
    bench, _, _ = broken
    faults = Injector(bench)
    for kind, target, parameters, words in TARGETS:
        with subtests.test(kind=kind, target=target):
            with pytest.raises(ConfigurationError) as caught:
                faults.inject(kind, target, **parameters)
            assert words in str(caught.value)
    assert not faults.armed
    assert faults.inject("telegram.sign_of_life", trigger=at(900.0)).target == "z_drive"


def test_an_alarm_is_a_number(subtests):
    """A text, a fraction and a reaction that does not exist are refused before anything is judged."""
    for make, words in NO_ALARMS:
        with subtests.test(words):
            with pytest.raises(ConfigurationError) as caught:
                make()
            assert words in str(caught.value)
    assert alarm(421, reaction=4).number == 421

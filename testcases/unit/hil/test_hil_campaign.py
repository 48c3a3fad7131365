"""Campaigns and single cases: registration, verdicts, evidence."""

import pytest

from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, CaseSettings, execute_case
from hil.errors import BlockedError, UnsupportedFaultError
from hil.expect import alarm, event, no_alarm, state_at
from reports.model import Verdict
from testcases.unit.hil.toybench import BENCH, CREEPING, NOISY


def run(function, *, bench=BENCH, settings=None, **options):
    campaign = Campaign("Some Tests")
    campaign.case("one", **options)(function)
    return execute_case(campaign.cases[0], bench, settings or CaseSettings(seed=5)).result


def enable(ctx):
    ctx.axis.power()
    ctx.wait_until(lambda: ctx.axis.state == "STANDSTILL", 1.0, "enabled")


# -- registration
# ---------------------------------------------------------------------------------------------------


def test_cases_are_named_after_their_campaign():
    """The identifier is the slug of campaign and case; the title comes from the docstring when none is
    given.
    """
    campaign = Campaign("Stop Modes", tags=("stop",), requirements=("STP-239",))

    @campaign.case("MC Power 0/constant", tags=("power",), requirements=("STP-301", "STP-239"))
    def stop(ctx):
        """Emergency ramp.

        Longer words.
        """

    case = campaign.cases[0]
    assert case.identifier == "stop-modes/mc-power-0/constant"
    assert case.title == "Emergency ramp"
    assert case.tags == ("stop", "power")
    assert case.requirements == ("STP-239", "STP-301")
    assert case.identifier in campaign
    assert campaign[case.identifier] is case


def test_a_product_makes_every_combination_in_order():
    """All combinations, the last parameter fastest; names, titles, tags and requirements know the
    parameters.
    """
    campaign = Campaign("c")
    calls = []

    @campaign.product(
        "m-{mode}-{phase}",
        parameters={"mode": [0, 1], "phase": ["a", "b"]},
        title="Mode {mode}, {phase}",
        tags=("{phase}",),
        requirements=lambda mode, phase: (f"X-{mode}",),
    )
    def case(ctx, mode, phase):
        calls.append((mode, phase))

    assert [c.identifier for c in campaign.cases] == ["c/m-0-a", "c/m-0-b", "c/m-1-a", "c/m-1-b"]
    assert campaign.cases[2].title == "Mode 1, a"
    assert (campaign.cases[3].tags, campaign.cases[3].requirements) == (("b",), ("X-1",))
    for one in campaign.cases:
        one.call(None)
    assert calls == [(0, "a"), (0, "b"), (1, "a"), (1, "b")]


def test_combinations_may_be_given_one_by_one():
    """A list of combinations stands for itself."""
    campaign = Campaign("c")
    campaign.product("{a}{b}", parameters=[{"a": 1, "b": 2}, {"a": 3, "b": 4}])(lambda ctx, a, b: None)
    assert [case.identifier for case in campaign.cases] == ["c/12", "c/34"]


@pytest.mark.parametrize(
    ("name", "parameters"),
    [("same", {"a": [1, 2]}), ("{b}", {"a": [1]}), ("{0}", {"a": [1]}), ("{", {"a": [1]})],
)
def test_names_that_do_not_tell_cases_apart_are_refused(name, parameters):
    """A name without its parameters, or with unknown ones, is a mistake at definition."""
    with pytest.raises(ConfigurationError):
        Campaign("c").product(name, parameters=parameters)(lambda ctx, a: None)


def test_impossible_campaigns_are_refused():
    """A title without letters and a limit of zero are mistakes."""
    with pytest.raises(ConfigurationError, match="campaign title"):
        Campaign("!!")
    with pytest.raises(ConfigurationError, match="wall_limit_s"):
        Campaign("c").case("x", wall_limit_s=0.0)


# -- verdicts
# ---------------------------------------------------------------------------------------------------------


def test_a_good_case_passes_with_the_rules_of_every_run():
    """A case passes when its expectations hold; the always-on rules are among its checks."""

    def case(ctx):
        enable(ctx)
        ctx.expect(no_alarm())

    result = run(case)
    assert (result.verdict, result.message) == (Verdict.PASSED, "")
    assert {"no alarm", "switching on of axis1", "no motion of drive1 without torque"} <= {
        check.name for check in result.checks
    }


def raising(error):
    def case(ctx):
        enable(ctx)
        raise error

    return case


@pytest.mark.parametrize(
    ("function", "verdict", "words"),
    [
        (lambda ctx: ctx.expect(alarm(421)), Verdict.FAILED, "Alarm 421 did not come, no alarm came"),
        (lambda ctx: ctx.check(alarm(421)), Verdict.FAILED, "Alarm 421"),
        (
            lambda ctx: ctx.measure("gap", 3.0, "mm", high=2.0),
            Verdict.FAILED,
            "Gap: 3 mm (allowed: at most 2 mm)",
        ),
        (raising(AssertionError("not equal")), Verdict.FAILED, "not equal"),
        (raising(BlockedError("no air")), Verdict.BLOCKED, "no air"),
        (raising(UnsupportedFaultError("no seam")), Verdict.BLOCKED, "no seam"),
        (lambda ctx: ctx.require(False, "warm machine"), Verdict.BLOCKED, "warm machine"),
        (raising(ValueError("a slip")), Verdict.ERROR, "ValueError: a slip at "),
        (raising(SystemExit(3)), Verdict.ERROR, "SystemExit"),
        (lambda ctx: ctx.expect(state_at("axis9", 0.0, "X")), Verdict.ERROR, "axis9"),
        (lambda ctx: ctx.expect("hope"), Verdict.ERROR, "expectations made by hil.expect"),
    ],
)
def test_every_way_to_end_has_its_verdict(function, verdict, words):
    """Failed, blocked and error are distinguished, with a message that says why."""
    result = run(function)
    assert result.verdict is verdict
    assert words in result.message


@pytest.mark.requirement("STP-554")
def test_a_wait_that_takes_too_long_fails():
    """Every wait has a limit; when it is passed the case fails and says what was waited for."""
    result = run(lambda ctx: ctx.wait_until(lambda: False, 0.5, "axis homed"))
    assert result.verdict is Verdict.FAILED
    assert "Axis homed: it did not happen within 0.5 s" in result.message
    assert result.simulated_s == pytest.approx(0.5)


@pytest.mark.requirement("STP-554")
@pytest.mark.parametrize("swallow", [False, True])
def test_bench_time_is_limited(swallow):
    """A case that lets more bench time pass than it may ends, even when it swallows the first
    interruption.
    """

    def case(ctx):
        try:
            ctx.run_for(1000.0)
        except Exception:
            if not swallow:
                raise
        ctx.run_for(1000.0)

    result = run(case, simulated_limit_s=2.0)
    assert result.verdict is Verdict.ERROR
    assert "2 s of bench time" in result.message
    assert result.simulated_s < 2.1


@pytest.mark.exhaustive
def test_wall_time_is_limited():
    """A case that hangs outside of the bench is interrupted."""

    def case(ctx):
        while True:
            pass

    result = run(case, wall_limit_s=0.2)
    assert result.verdict is Verdict.ERROR
    assert "0.2 s of wall time" in result.message


def test_the_rules_of_every_run_fail_a_case():
    """A case whose own expectations hold fails when a rule of every run is broken, unless it excepts that
    rule.
    """

    def case(ctx):
        enable(ctx)
        ctx.axis.power(False, stop_mode=1)
        ctx.run_for(0.5)

    result = run(case, bench=CREEPING)
    assert result.verdict is Verdict.FAILED
    assert "without torque" in result.message
    assert run(case, bench=CREEPING, without=("STP-331",)).verdict is Verdict.PASSED


def test_a_bench_that_cannot_be_built_is_an_error():
    """Whatever the bench raises while it is built becomes a result, and the run goes on."""

    class Broken:
        name = text = digest = ""

        def build(self, *, seed):
            raise RuntimeError("no such cable")

    result = run(lambda ctx: None, bench=Broken())
    assert result.verdict is Verdict.ERROR
    assert "no such cable" in result.message


def test_expectations_of_a_case_that_failed_early_are_still_judged():
    """What was expected before the failure is evidence too."""

    def case(ctx):
        ctx.expect(no_alarm())
        raise AssertionError("early")

    result = run(case)
    assert result.message == "early"
    assert "no alarm" in {check.name for check in result.checks}


# -- evidence
# ---------------------------------------------------------------------------------------------------------


def tripped(ctx):
    enable(ctx)
    ctx.do("move", velocity=100.0)
    ctx.axis.move_velocity(100.0)
    ctx.run_for(0.2)
    ctx.inject("drive.fault", code=0x2310, duration_s=0.3, trigger=event("storage.failed"))
    ctx.inject("drive.fault", code=0x2310)
    ctx.run_for(0.5)
    ctx.axis.reset()
    ctx.run_for(0.3)
    ctx.expect(alarm(421, since=event("fault.applied")).covers("STP-559"))


def test_the_story_tells_instructions_faults_observations_and_checks_in_order():
    """The story holds what was done, injected, seen and expected, by time."""
    result = run(tripped)
    assert result.verdict is Verdict.PASSED
    assert [step.time_s for step in result.story] == sorted(step.time_s for step in result.story)
    texts = [(step.kind, step.text) for step in result.story]
    order = [
        ("do", "move"),
        ("inject", "drive.fault on drive1 applied (code 2310h, momentary True)"),
        ("observe", "axis1: MOTION -> ALARM_DRIVE_STOP"),
        ("expect", "Alarm 421 came 4 ms after the fault"),
    ]
    positions = [texts.index(item) for item in order]
    assert positions[:2] == sorted(positions[:2])
    assert positions[1] < positions[2]
    assert any(text.startswith("axis1.MC_MoveVelocity_2: Error 16#8001") for _, text in texts)
    assert next(step for step in result.story if step.text == "move").detail == {"velocity": 100.0}


def test_alarms_and_faults_are_recorded_with_their_times():
    """An alarm knows when it was cleared; a fault knows trigger, parameters and the state of the axis it
    met.
    """
    result = run(tripped)
    (alarm_record,) = result.alarms
    assert (alarm_record.number, alarm_record.reaction, alarm_record.axis) == (421, 4, "axis1")
    assert alarm_record.cleared_s > alarm_record.time_s
    waiting, applied = result.faults
    assert (waiting.applied_s, waiting.removed_s, waiting.axis_state) == (None, None, "")
    assert waiting.trigger == "at storage.failed; storage.failed did not happen"
    assert (applied.kind, applied.target, applied.parameters) == ("drive.fault", "drive1", {"code": 0x2310})
    assert applied.axis_state == "MOTION"
    assert 0 < alarm_record.time_s - applied.applied_s < 0.02


def test_messages_around_faults_are_decoded():
    """Frames before and after faults and alarms are kept, in order and decoded; far away ones are not."""
    result = run(tripped, settings=CaseSettings(seed=5, message_window=4))
    times = [message.time_s for message in result.messages]
    assert times == sorted(times)
    fault_s = result.faults[1].applied_s
    assert any(time_s < fault_s for time_s in times)
    assert min(abs(time_s - fault_s) for time_s in times) < 0.004
    assert all(0.2 < time_s < 0.3 for time_s in times)
    emcy = next(message for message in result.messages if message.identifier == 0x85)
    assert emcy.text.startswith("emcy ")
    assert emcy.data.startswith("10 23")


def test_signals_for_the_report_can_be_chosen():
    """The usual signals, all of them, or those named."""
    usual = {signal.name for signal in run(tripped).signals}
    assert "axis1.actual_velocity" in usual
    assert "axis1.power_busy" not in usual
    assert "axis1.power_busy" in {signal.name for signal in run(tripped, signals=("*",)).signals}
    assert [signal.name for signal in run(tripped, signals=("axis1.stw1",)).signals] == ["axis1.stw1"]


def test_the_result_carries_seed_digest_and_time():
    """Seed, trace digest and simulated time belong to the result, and are the same in every run."""
    first, second = run(tripped), run(tripped)
    assert first.seed == 5
    assert first.trace_digest == second.trace_digest
    assert len(first.trace_digest) == 64
    assert first.simulated_s == second.simulated_s > 1.0


# -- twice
# ------------------------------------------------------------------------------------------------------------


def test_running_twice_proves_repeatability():
    """A case that leaves the same trace twice says so."""
    result = run(tripped, settings=CaseSettings(seed=5, twice=True))
    assert result.verdict is Verdict.PASSED
    check = next(check for check in result.checks if check.name == "repeatable")
    assert check.verdict is Verdict.PASSED


def test_a_case_that_differs_names_the_first_difference():
    """A bench that is not repeatable is an error of the harness that names the first diverging event."""
    result = run(tripped, bench=NOISY, settings=CaseSettings(seed=5, twice=True))
    assert result.verdict is Verdict.ERROR
    assert "not repeatable: first difference at 0.070000 s event bench.noise of bench" in result.message
    assert next(check for check in result.checks if check.name == "repeatable").time_s == pytest.approx(0.07)


def test_a_result_says_which_signals_were_looked_at():
    """A signal that the case, an expectation or a rule reads is not among the others; each is in one list."""

    def reads(ctx):
        """It looks at a torque."""
        enable(ctx)
        ctx.trace()["drive1.torque"]

    def does_not(ctx):
        """It does not."""
        enable(ctx)

    for function, seen in ((reads, True), (does_not, False)):
        result = run(function)
        assert ("drive1.torque" in result.looked_at) is seen
        assert ("drive1.torque" in result.not_looked_at) is not seen
        assert not set(result.looked_at) & set(result.not_looked_at)
        assert "axis1.state" in result.looked_at

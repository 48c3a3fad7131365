"""Every alarm that an axis can have, raised at rest, in motion and while braking: bit, detail, jobs, enable
(DIA-112).
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from motion.s7.alarms import catalogue
from testcases.catalogue import each, requirements_in
from testcases.unit.motion_axis.conftest import Rig

BITS = {
    "ErrorWord": {
        0: (201, 202, 203, 204),
        1: (101, 104, 105, 106, 107, 108, 109, 343),
        2: (113, 304, 305, 306, 307, 308, 542),
        3: (321, 323),
        4: (421,),
        5: (411, 412),
        7: (431,),
        8: (533, 534),
        9: (531,),
        10: (341, 342),
        11: (521,),
        12: (541,),
        13: (401, 550),
        15: (102, 103, 552),
    },
    "WarningWord": {1: (110,), 3: (322,), 6: (501, 502, 503, 504, 511, 551), 11: (522,), 15: (111, 112)},
}
"""Bit -> alarms of a positioning axis, by word (section 4 of the alarm list)."""
PLACE = {
    number: (word, bit) for word, bits in BITS.items() for bit, numbers in bits.items() for number in numbers
}
REACTIONS = {
    1: (), 2: (104, 307, 341, 533), 3: (304, 305, 306, 321, 342), 5: (550,),
    0: (110, 111, 112, 202, 322, 501, 502, 503, 504, 511, 522, 551),
}  # fmt: skip
"""Usual reaction -> alarms; every other one removes the enable."""
REACTION = {number: reaction for reaction, numbers in REACTIONS.items() for number in numbers}
STAYS_ENABLED = (533,)
GROUPS = {
    "PositioningAxis": {"DIA-057": 201, "DIA-067": None, "DIA-071": 102, "DIA-054": 110, "DIA-055": 322},
    "SpeedAxis": {"DIA-019": 201, "DIA-026": None, "DIA-016": 110, "DIA-017": 322},
}


def resting(rig):
    rig.enabled()
    rig.run(0.1)
    return


def moving(rig):
    rig.enabled()
    job = rig.axis.move_velocity(300.0)
    rig.until(job.in_velocity)
    return job


def braking(rig):
    moving(rig)
    job = rig.axis.halt()
    rig.cycles(10)
    return job


def cases():
    """Yield every alarm of both kinds of axis in the three phases."""
    for kind in ("PositioningAxis", "SpeedAxis"):
        rows = {number: row for row, number in GROUPS[kind].items()}
        for number, entry in catalogue().items():
            if kind in entry.applies_to:
                marks = pytest.mark.requirement(rows[number]) if number in rows else ()
                for phase in (resting, moving, braking):
                    yield pytest.param(
                        kind, number, phase, id=f"{kind}-{number}-{phase.__name__}", marks=marks
                    )


BIT_DETAIL_JOBS_AND_ENABLE_CASES = list(cases())


def check_bit_detail_jobs_and_enable(kind, number, phase):
    rig = Rig(speed=kind == "SpeedAxis")
    job = phase(rig)
    rig.axis.object.alarms.raise_alarm(number)
    rig.cycles(1)
    var = rig.axis.var
    word, bit = PLACE[number]
    reaction = REACTION.get(number, 4)
    words = {"ErrorWord": 0, "WarningWord": 0} | {word: 1 << bit}
    assert {name: var(name) for name in words} == words
    assert var("StatusWord.X1") is (word == "ErrorWord")
    assert (var("ErrorDetail.Number"), var("ErrorDetail.Reaction")) == (number, reaction)
    if job is not None:
        assert (job.Error, job.ErrorID) == ((True, 0x8001) if reaction else (False, 0))
        assert job.Busy is not bool(reaction)
    assert var("StatusWord.X0") is (reaction not in (4, 5))
    if not reaction:
        rig.run(0.1)
        assert rig.axis.state.name == {resting: "STANDSTILL", moving: "MOTION", braking: "HALTING"}[phase]
        return
    rig.until(lambda: abs(rig.axis.actual_velocity) < 1e-6)
    rig.run(0.3)
    # Tracking goes on while the drive is in operation: nothing is wrong with it here.
    assert var("StatusWord.X0") is (number in STAYS_ENABLED)
    assert rig.axis.state.name == (
        "ALARM_STANDSTILL" if number in STAYS_ENABLED else "TRACKING" if reaction == 5 else "ALARM_DISABLED"
    )


@pytest.mark.exhaustive
@pytest.mark.requirement("DIA-112", "TA-001", "TA-002", "TA-005", "TA-021", "TA-023", "DIA-104")
@requirements_in(BIT_DETAIL_JOBS_AND_ENABLE_CASES)
def test_bit_detail_jobs_and_enable(subtests):
    """Exactly the bit of its group; X1 for errors only; the job in control ends with 16#8001 if there is a
    reaction.
    """
    for label, values in each(BIT_DETAIL_JOBS_AND_ENABLE_CASES):
        with subtests.test(label):
            check_bit_detail_jobs_and_enable(*values)


@pytest.mark.requirement("TA-022", "DIA-026", "DIA-067")
def test_bits_that_no_alarm_sets():
    """ErrorWord.X6 and the warnings X0, X2, X4, X5, X7 to X10, X12, X13 stay FALSE whatever is pending."""
    rig = Rig()
    engine = rig.axis.object.alarms.engine
    for number, entry in catalogue().items():
        if "PositioningAxis" in entry.applies_to:
            engine.raise_alarm(number)
    assert rig.axis.var("ErrorWord") >> 6 & 1 == 0
    assert rig.axis.var("WarningWord") & 0b0011_0111_1011_0101 == 0
    assert len(engine.pending) == len(PLACE)


TWO_ALARMS_FIRST_SECOND_SHOWN = [
    ((421, 4), (321, 3), 421),
    ((321, 3), (421, 4), 421),
    ((533, 1), (304, 3), 304),
    ((304, 3), (533, 1), 304),
    ((550, 5), (321, 3), 550),
    ((104, 2), (550, 5), 550),
    ((550, 5), (431, 4), 431),
    ((522, 0), (533, 2), 533),
    ((533, 2), (522, 0), 533),
    ((104, 2), (307, 2), 104),
    ((421, 4), (101, 4), 101),
    ((202, 0), (501, 0), 202),
    ((501, 0), (202, 0), 202),
    ((304, 3), (305, 3), 304),
]


def check_two_alarms(apart, first, second, shown):
    rig = Rig()
    moving(rig)
    alarms = rig.axis.object.alarms
    alarms.raise_alarm(first[0], reaction=first[1])
    if apart:
        rig.cycles(apart)
        assert rig.axis.var("ErrorDetail.Number") == first[0]
    alarms.raise_alarm(second[0], reaction=second[1])
    strongest = max((first[1], second[1]), key=[0, 1, 2, 3, 5, 4].index)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorDetail.Reaction")) == (shown, strongest)
    since = rig.scheduler.now / 1e9
    rig.until(lambda: abs(rig.axis.actual_velocity) < 1e-6 or not strongest, 5.0)
    if strongest == 3:
        speeds = rig.column("velocity_setpoint")
        slopes = [(later - earlier) / 0.004 for earlier, later in pairwise(speeds)]
        assert sum(abs(slope + 4000.0) < 1.0 for slope in slopes) > 8  # the emergency ramp, whenever it began
    if strongest == 4:
        assert not any(
            x for x, time in zip(rig.column("power_status"), rig.times(), strict=True) if time > since + 0.004
        )


@pytest.mark.exhaustive
@pytest.mark.requirement("TA-027", "TA-004", "TA-003", "DIA-103", "STP-347")
def test_two_alarms(subtests):
    """In one cycle and in successive ones: the stronger reaction rules, then class R before F before W, then
    the earlier one.
    """
    for label, values in each([0, 1, 5], TWO_ALARMS_FIRST_SECOND_SHOWN):
        with subtests.test(label):
            check_two_alarms(*values)


@pytest.mark.requirement("TA-027", "TA-007", "MC-179", "DIA-104")
@pytest.mark.parametrize("lasting", [0, 1])
def test_acknowledging_while_one_cause_lasts(lasting):
    """The alarm whose cause is gone goes; the other one is raised again at once, and `ErrorDetail` shows
    it.
    """
    rig = Rig()
    moving(rig)
    alarms = rig.axis.object.alarms
    numbers = (421, 304)
    for number in numbers:
        alarms.set_cause(number, True)
    rig.cycles(2)
    alarms.set_cause(numbers[1 - lasting], False)
    rig.run(1.5)
    rig.until(rig.axis.reset().done)
    assert [one.number for one in alarms.engine.pending] == [numbers[lasting]]
    assert rig.axis.var("ErrorDetail.Number") == numbers[lasting]
    alarms.set_cause(numbers[lasting], False)
    rig.until(rig.axis.reset().done)
    assert (rig.axis.var("ErrorDetail.Number"), rig.axis.var("ErrorWord")) == (0, 0)

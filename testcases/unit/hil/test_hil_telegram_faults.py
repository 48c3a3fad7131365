"""Faults of the words of a PROFIdrive telegram: places by name, what becomes of them, seams, counts,
refusals.
"""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from fieldbus.profidrive import telegram
from hil.bench import load_bench
from hil.faults import CATALOGUE, Fault, Injector, after
from hil.faults.kinds._places import displaced, find_place, flipped, overridden, scaled, stuck, swapped

KINDS = [entry for entry in CATALOGUE if entry.name.startswith("telegram.")]
TELEGRAM = telegram(105)


def actual(**values):
    """Return a telegram from the drive as a number."""
    return int.from_bytes(TELEGRAM.actual.encode(values))


def values(frame):
    """Return the signals of a telegram from the drive."""
    return TELEGRAM.actual.decode(frame.to_bytes(TELEGRAM.actual.length))


def place(text, direction="actual"):
    return find_place(TELEGRAM, text, direction, "signal")


@pytest.fixture
def bench():
    with load_bench("profidrive").build(seed=1) as machine:
        yield machine


@pytest.fixture
def faults(bench):
    return Injector(bench)


def hits(bench):
    return [event.data["change"] for event in bench.history.select(kind="fault.hit")]


# -- places
# ---------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-348")
@pytest.mark.parametrize(
    ("text", "setpoint", "shift", "bits"),
    [
        ("ZSW1", False, 144, 16),
        ("ZSW1.3", False, 147, 1),
        ("NIST_B", False, 112, 32),
        ("zsw2.15", False, 111, 1),
        ("G1_XIST2", False, 0, 32),
        ("STW1.10", True, 154, 1),
        ("KPC", True, 0, 32),
        ("PZD10.0", False, 0, 1),
    ],
)
def test_a_name_means_a_place_of_the_telegram(text, setpoint, shift, bits):
    """A signal stands where the table of the telegram has it, high word first; a name knows its direction."""
    found = place(text)
    assert (found.setpoint, found.shift, found.bits) == (setpoint, shift, bits)


def test_words_by_number_take_the_direction_that_is_given():
    """PZD2 is the high word of NSOLL_B to the drive, and of NIST_B from it."""
    assert place("PZD2", "setpoint").setpoint
    assert place("PZD2").shift == place("NIST_B").shift + 16


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("ZSW9", "STW1, NSOLL_B, STW2, MOMRED"),
        ("ZSW1.16", "bits 0 to 15 of ZSW1"),
        ("PZD11", "PZD1 to PZD10"),
        ("PZD0", "PZD1 to PZD10"),
        ("M_ACT", "ZSW1, NIST_B"),
        ("ZSW1.", "a signal, with a bit or without"),
        ("", "a signal"),
    ],
)
def test_what_the_telegram_has_not_is_refused(text, allowed):
    """An unknown signal, word or bit is refused with those that there are."""
    with pytest.raises(ConfigurationError, match=f"signal.*{allowed}"):
        place(text)


# -- what becomes of them
# ----------------------------------------------------------------------------------------------


def test_a_stuck_signal_keeps_the_first_value_that_is_hit():
    """Without a value a signal stands at that of the first telegram; the others go on."""
    change = stuck(place("NIST_B"), None)
    change(actual(NIST_B=-5, ZSW1=1))
    assert values(change(actual(NIST_B=77, ZSW1=2)))["NIST_B"] == -5
    assert values(change(actual(NIST_B=77, ZSW1=2)))["ZSW1"] == 2


def test_bits_flip_lie_and_change_places():
    """Inverted bits, bits that are shown as 1 or 0, exchanged words: all others stay."""
    frame = actual(ZSW1=0x0237, NIST_B=0x11112222, MELDW=0x8001)
    assert values(flipped(place("ZSW1.2"), 0)(frame))["ZSW1"] == 0x0233
    assert values(flipped(place("ZSW1"), 0x0030)(frame))["ZSW1"] == 0x0207
    assert values(flipped(place("ZSW1"), 0)(frame))["ZSW1"] == 0xFDC8
    assert values(overridden(place("ZSW1"), 0x0088, 0x0200)(frame))["ZSW1"] == 0x00BF
    assert values(swapped(place("PZD2"), place("PZD3"))(frame)) == {**values(frame), "NIST_B": 0x22221111}
    assert values(swapped(place("MELDW.0"), place("MELDW.14"))(frame))["MELDW"] == 0xC000


def test_normalised_signals_end_at_their_limits_and_counters_wrap():
    """N4 saturates at the end values of its range, the encoder value wraps as its counter does."""
    top, bottom = 0x7FFFFFFF, -0x80000000
    assert values(displaced(place("NIST_B"), 10)(actual(NIST_B=top - 3)))["NIST_B"] == top
    assert values(displaced(place("G1_XIST1"), 10)(actual(G1_XIST1=top - 3)))["G1_XIST1"] == bottom + 6
    assert values(scaled(place("NIST_B"), -4.0)(actual(NIST_B=0x40000000)))["NIST_B"] == bottom
    assert values(scaled(place("NIST_B"), 0.5)(actual(NIST_B=-1000)))["NIST_B"] == -500
    assert values(scaled(place("ZSW1"), 2.0)(actual(ZSW1=0x9000)))["ZSW1"] == 0xFFFF


# -- on a bench
# ----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("PD-349")
def test_what_the_axis_sees_differs_from_what_the_drive_shows(bench, faults):
    """The telegram is disturbed between drive and axis: the drive itself is not, and the trace shows both."""
    bench.run_for(0.1)
    faults.inject("telegram.stuck", signal="ZSW1.7", value=1)
    bench.run_for(0.1)
    trace = bench.trace()
    now = bench.scheduler.now * 1e-9 - 0.01
    assert int(trace["axis1.zsw1"].at(now)) & 0x80
    assert not int(trace["drive1.drive_zsw1"].at(now)) & 0x80


@pytest.mark.exhaustive
def test_count_says_how_many_telegrams_are_hit(bench, faults):
    """Each hit is logged with what has become of the telegram; after the last one the fault is over."""
    bench.run_for(0.1)
    begin = bench.scheduler.now
    armed = faults.inject("telegram.flip", count=3, signal="ZSW1.8", trigger=after(0.02))
    assert bench.port().actual_seam is None
    bench.run_for(0.1)
    assert armed.over
    assert armed.applied_ns == begin + 20_000_000
    assert len(hits(bench)) == 3
    assert hits(bench)[0] == "PZD1 EB31 becomes EA31"
    assert bench.port().actual_seam is None


@pytest.mark.exhaustive
def test_a_duration_ends_it(bench, faults):
    """A fault with a duration hits the telegrams of that time: ten of 4 ms in 40 ms."""
    bench.run_for(0.1)
    armed = faults.inject("telegram.flip", duration_s=0.04, signal="ZSW1.8")
    bench.run_for(0.1)
    assert armed.over
    assert len(hits(bench)) == 10


@pytest.mark.exhaustive
def test_several_faults_work_one_after_the_other(bench, faults):
    """Two faults of a direction disturb the same telegram; each can be taken back for itself."""
    bench.run_for(0.1)
    first = faults.inject("telegram.stuck", signal="ZSW1.7", value=1)
    second = faults.inject("telegram.flip", signal="ZSW1.7")
    bench.run_for(0.02)
    assert not bench.axis().port.zsw1 & 0x80
    second.remove()
    bench.run_for(0.02)
    assert bench.axis().port.zsw1 & 0x80
    first.remove()
    bench.run_for(0.02)
    assert not bench.axis().port.zsw1 & 0x80
    assert bench.port().actual_seam is None


def test_a_telegram_that_an_earlier_fault_has_taken_or_cut_is_lived_with(bench, faults):
    """After a fault that loses or cuts telegrams those behind it have nothing to disturb, and nothing
    breaks.
    """
    bench.run_for(0.1)
    faults.inject("telegram.length", words=-3)
    for kind in ("telegram.freeze", "telegram.flip", "telegram.lost", "telegram.late"):
        options = {"telegram.flip": {"signal": "ZSW1"}, "telegram.late": {"cycles": 2}}.get(kind, {})
        faults.inject(kind, **options)
        bench.run_for(0.02)
    assert not bench.axis().port.link_ok


def test_late_telegrams_come_in_order(bench, faults):
    """Two cycles late: for two cycles nothing comes, then every telegram, two cycles old."""
    bench.run_for(0.1)
    seen = []
    take = bench.port()._unpack
    bench.port()._unpack = lambda frame: seen.append(frame) or take(frame)
    bench.run_for(0.02)
    faults.inject("telegram.late", cycles=2)
    bench.run_for(0.04)
    signs = [TELEGRAM.actual.decode(frame)["ZSW2"] >> 12 for frame in seen]
    assert len(signs) == 5 + 8
    assert all(later == (earlier % 15) + 1 for earlier, later in pairwise(signs))


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_every_kind_is_applied_logged_and_taken_back(bench, faults, entry):
    """The example of the catalogue reads back from its TOML form, hits telegrams, and leaves the port as it
    was.
    """
    fault = Fault.from_dict(dict(entry.example))
    assert Fault.from_dict(fault.to_dict()) == fault
    bench.axis().power()
    bench.run_for(0.3)
    bench.axis().move_velocity(100.0)
    bench.run_for(0.3)
    faults.arm(fault)
    bench.run_for(0.3)
    assert hits(bench)
    assert (bench.port().setpoint_seam, bench.port().actual_seam) == (None, None)


@pytest.mark.exhaustive
@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_a_drive_without_telegram_has_no_such_faults(entry):
    """A CiA 402 drive is led by no telegram: the fault is refused, a case is blocked."""
    with (
        load_bench("reference").build(seed=1) as machine,
        pytest.raises(UnsupportedFaultError, match="no PROFIdrive"),
    ):
        Injector(machine).arm(Fault.from_dict(dict(entry.example)))


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("stuck", {"signal": "ZSW1.3", "value": 2}, "a value of 1 bit"),
        ("stuck", {"signal": "ZSW1", "value": 0x10000}, "a value of 16 bit"),
        ("flip", {"signal": "ZSW1", "mask": 0x10000}, "0..FFFFh"),
        ("bits", {"signal": "ZSW1.1", "set": 2}, "bits of ZSW1.1"),
        ("swap", {"signal": "ZSW1", "other": "NIST_B"}, "16 bit in the direction"),
        ("swap", {"signal": "ZSW1", "other": "STW1"}, "16 bit in the direction"),
        ("offset", {"signal": "G1_XIST1", "percent": 1.0}, "takes counts"),
        ("offset", {"signal": "NIST_B", "counts": 1}, "takes percent"),
        ("length", {"words": 0}, "not 0"),
        ("sign_of_life", {"how": "sleeps"}, "freeze, jump, zero"),
        ("freeze", {"direction": "back"}, "actual, setpoint"),
    ],
)
def test_what_does_not_fit_is_refused(faults, kind, parameters, message):
    """Values beyond the width of their place, and signals that do not go together, are refused with what
    would fit.
    """
    with pytest.raises(ConfigurationError, match=message):
        faults.inject(f"telegram.{kind}", **parameters)
    assert faults.armed == []


def test_a_telegram_without_sign_of_life_is_refused_for_it():
    """Telegram 1 has no counter that could stand still."""
    config = load_bench("profidrive").config
    drive = config.drive["drive1"].model_copy(update={"telegram": 1})
    axis = config.axis["axis1"].model_copy(update={"type": "speed", "variables": {}})
    from hil.bench.bench import Bench

    with (
        Bench(
            config.model_copy(update={"drive": {"drive1": drive}, "axis": {"axis1": axis}}), seed=1
        ) as machine,
        pytest.raises(UnsupportedFaultError, match="telegram 1 has no sign of life"),
    ):
        Injector(machine).inject("telegram.sign_of_life")

"""Encoder, drive and controller components of an NC axis, with the numbers of the specification."""

from itertools import pairwise

import pytest

from motion.nc.controller import Controller, OffsetMode
from motion.nc.drive import DIGITAL, Drive
from motion.nc.encoder import Encoder, Retained
from motion.nc.parameters import ParameterSet, catalogue

T = 0.002


def _values(values):
    return {key.replace("__", "."): value for key, value in values.items()}


def _encoder(**values):
    return Encoder(ParameterSet(_values(values)), cycle_s=T, io_cycle_s=T)


def _drive(**values):
    return Drive(ParameterSet(_values(values)), cycle_s=T)


def _controller(analog=False, **values):
    kind = {
        "PP": "Position controller with two P constants (with Ka)",
        "PID": "Position controller PID (with Ka)",
        "P": "Position controller P",
    }
    values["ctrl__type"] = kind[values.pop("kind", "P")]
    return Controller(_set(values), cycle_s=T, analog=analog)


def _set(values):
    """Return a set with those values that its controller has."""
    given = _values(values)
    one = ParameterSet({"ctrl.type": given.get("ctrl.type", "Position controller P")})
    return ParameterSet({key: value for key, value in given.items() if one.present(key)})


# -- encoder


@pytest.mark.requirement("NC-250", "NC-251", "NC-252", "NC-264", "NC-265", "NC-253", "NC-266")
def test_scaling(subtests):
    """Increments become position by numerator, denominator, direction and bias."""
    wide = {"enc__encoder_mask": 0xFFFFFFFF}
    for values, raw, expected in (
        ({}, 1000, 0.1),
        ({"enc__invert_counting_direction": True}, 1000, -0.1),
        ({"enc__scaling_numerator": 36.0, "enc__scaling_denominator": 1048576.0}, 1048576, 36.0),
        ({"enc__scaling_numerator": 36.0, "enc__scaling_denominator": 1048576.0}, 10485760, 360.0),
        ({"enc__scaling_numerator": 100.0, "enc__scaling_denominator": 1048576.0}, 524288, 50.0),
        ({"enc__scaling_numerator": 100.0, "enc__scaling_denominator": 1048576.0}, 1048576, 100.0),
        ({"enc__position_bias": 12.5}, 1000000, 112.5),
    ):
        with subtests.test(values=values, raw=raw):
            for start in (0, raw):
                encoder = _encoder(**wide, **values)
                encoder.update(start)
                encoder.update(raw)
                assert encoder.position == pytest.approx(expected)


@pytest.mark.requirement("NC-256", "NC-260", "NC-269")
def test_overflow(subtests):
    """The count is continuous over any mask, in both directions, however often."""
    for mask in (0x0036EE7F, 0xFFFF, 0xFFFFFFFF, 999):
        with subtests.test(mask=mask):
            encoder = _encoder(enc__encoder_mask=mask)
            encoder.update(mask)
            start = encoder.soft_increments
            assert encoder.update(0) == 0
            assert encoder.soft_increments == start + 1
            assert encoder.position == pytest.approx((mask + 1) * 0.0001)
            assert encoder.update(mask) == 0
            assert encoder.soft_increments == start
            step = mask // 3
            raw = mask
            for _ in range(10):
                raw = (raw + step) % (mask + 1)
                encoder.update(raw)
            assert encoder.soft_increments == start + 10 * step
            assert encoder.overflows == (start + 10 * step) // (mask + 1)


@pytest.mark.requirement("NC-262")
def test_half_a_span_is_ambiguous():
    """A step of half the span or more reads as one in the other direction."""
    for step, read in ((499, 499), (500, -500), (501, -499)):
        encoder = _encoder(enc__encoder_mask=999)
        encoder.update(0)
        encoder.update(step)
        assert encoder.soft_increments == read


@pytest.mark.requirement("NC-254", "NC-267", "NC-300")
def test_modulo_values():
    """Turns and place within the turn; negative positions have negative turns."""
    encoder = _encoder(enc__encoder_mask=0xFFFFFFFF)
    encoder.update(7254014)
    assert encoder.position == pytest.approx(725.4014)
    assert (encoder.hard_increments, encoder.soft_increments) == (7254014, 7254014)
    turns, place = encoder.modulo(encoder.position)
    assert (turns, place) == (2, pytest.approx(5.4014))
    assert encoder.modulo(-10.0) == (-1, pytest.approx(350.0))
    assert encoder.modulo(360.0) == (1, 0.0)
    assert encoder.modulo(0.0) == (0, 0.0)


@pytest.mark.requirement("NC-280", "NC-281", "NC-282", "NC-283", "NC-284")
def test_filters():
    """The PT1 filters give the values of the specification; without a time the value itself."""
    encoder = _encoder(enc__filter_time_position=0.01)
    encoder.update(0)
    found = []
    for _ in range(3):
        encoder.update(60000)
        found.append(encoder.position)
    assert found == pytest.approx([1.0, 1.8333333, 2.5277778])
    encoder = _encoder()
    encoder.update(0)
    encoder.update(60000)
    assert encoder.position == 6.0
    encoder = _encoder(enc__filter_time_velocity=0.01)
    encoder.update(0)
    encoder.update(1200)  # 0.12 mm in a cycle: 60 mm/s
    assert encoder.velocity == pytest.approx(10.0)
    encoder = _encoder(enc__filter_time_acceleration=0.1, enc__encoder_mode="POSVELOACC")
    encoder.update(0)
    encoder.update(2)  # 0.1 mm/s in a cycle: 50 mm/s2
    assert encoder.acceleration == pytest.approx(50.0 / 51.0)


@pytest.mark.requirement("NC-285")
def test_encoder_mode(subtests):
    """The encoder mode says which actual values there are."""
    for mode, velocity, acceleration in (
        ("POS", False, False),
        ("POSVELO", True, False),
        ("POSVELOACC", True, True),
    ):
        with subtests.test(mode):
            encoder = _encoder(enc__encoder_mode=mode)
            for raw in (0, 100, 300):
                encoder.update(raw)
            assert (encoder.velocity != 0.0) is velocity
            assert (encoder.acceleration != 0.0) is acceleration


@pytest.mark.requirement("NC-286", "NC-288", "NC-289")
def test_time_compensation():
    """The position is put ahead by the delay in cycles and the fixed one, with velocity and acceleration."""
    for mode, cycles, microseconds, cycle, expected in (
        ("OFF", 1.0, 1000.0, 0.002, 100.0),
        ("ON (with velocity)", 1.0, 1000.0, 0.002, 103.0),
        ("ON (with velocity)", 1.0, 1000.0, 0.001, 102.0),
        ("ON (with velocity)", 0.0, 500.0, 0.001, 100.5),
        ("ON (with velocity)", 0.0, 500.0, 0.002, 100.5),
    ):
        encoder = Encoder(
            ParameterSet(
                {
                    "enc.time_comp_mode": mode,
                    "enc.time_comp_cycles": cycles,
                    "enc.time_comp_additional": microseconds,
                    "enc.encoder_mask": 0xFFFFFFFF,
                }
            ),
            cycle_s=T,
            io_cycle_s=cycle,
        )
        for raw in (960000, 980000, 1000000):  # 1000 mm/s
            encoder.update(raw)
        assert encoder.position == pytest.approx(expected)
    encoder = _encoder(
        enc__time_comp_mode="ON (with velocity and acceleration)",
        enc__time_comp_cycles=1.0,
        enc__encoder_mask=0xFFFFFFFF,
    )
    for raw in (0, 0, 20000):  # 1000 mm/s after rest: 500000 mm/s2
        encoder.update(raw)
    assert encoder.position == pytest.approx(2.0 + 2.0 + 0.5 * 500000.0 * T * T)


@pytest.mark.requirement("NC-268", "NC-276")
def test_homed_from_the_start(subtests):
    """Absolute systems are homed from the beginning, incremental ones are not; single-turn ones with retain
    data.
    """
    limits = {
        "axis__soft_limit_min_enable": True,
        "axis__soft_limit_max_enable": True,
        "axis__soft_limit_min": 0.0,
        "axis__soft_limit_max": 50.0,
    }
    for system, retained, homed in (
        ("INCREMENTAL", None, False),
        ("INCREMENTAL", Retained(5.0, 100), False),
        ("INCREMENTAL (singleturn absolute)", None, False),
        ("INCREMENTAL (singleturn absolute)", Retained(5.0, 100), True),
        ("ABSOLUTE", None, True),
        ("ABSOLUTE MULTITURN RANGE (with single overflow)", None, True),
        ("ABSOLUTE SINGLETURN RANGE (with single overflow)", None, True),
        ("ABSOLUTE (modulo)", None, False),
        ("ABSOLUTE (modulo)", Retained(5.0, 100), True),
    ):
        with subtests.test(system=system, retained=retained):
            encoder = _encoder(enc__reference_system=system, **limits)
            assert encoder.begin(100, retained) == 0
            assert encoder.homed is homed


@pytest.mark.requirement("NC-270", "NC-274", "NC-742")
def test_absolute_overflow():
    """An absolute encoder shows its position unchanged; beyond its range it is an error."""
    encoder = _encoder(enc__reference_system="ABSOLUTE")
    assert encoder.update(3599999) == 0
    assert encoder.position == pytest.approx(359.9999)
    assert encoder.update(0) == 0x4451
    encoder = _encoder(enc__reference_system="ABSOLUTE")
    encoder.update(0)
    assert encoder.update(3599999) == 0x4450
    encoder = _encoder(enc__reference_system="INCREMENTAL")
    encoder.update(0)
    assert encoder.update(3599999) == 0


@pytest.mark.requirement("NC-271", "NC-272", "NC-275", "NC-279")
def test_range_systems(subtests):
    """The position is initialised between the end positions; without them, or with a travel too long, it
    cannot be.
    """
    span = {
        "ABSOLUTE MULTITURN RANGE (with single overflow)": 360.0,
        "ABSOLUTE SINGLETURN RANGE (with single overflow)": 104.8576,
    }
    for system, length in span.items():
        with subtests.test(system):
            for expected in (50.0, 50.0 - length, 50.0 + length, 50.0 + 3 * length):
                low, high = expected - 20.0, expected + 30.0
                encoder = _encoder(
                    enc__reference_system=system,
                    axis__soft_limit_min_enable=True,
                    axis__soft_limit_max_enable=True,
                    axis__soft_limit_min=low,
                    axis__soft_limit_max=high,
                )
                assert encoder.begin(500000, None) == 0
                assert encoder.position == pytest.approx(expected)
                assert encoder.homed
            encoder = _encoder(enc__reference_system=system)
            assert encoder.begin(500000, None) == 0x4465
            assert not encoder.homed
            encoder = _encoder(
                enc__reference_system=system,
                axis__soft_limit_min_enable=True,
                axis__soft_limit_max_enable=True,
                axis__soft_limit_max=length,
            )
            assert encoder.begin(500000, None) == 0x4465


@pytest.mark.requirement("NC-277", "NC-257", "NC-778")
def test_single_turn_restart():
    """Moved by less than half a turn while off the position is right; beyond that it is a turn off."""
    turn = 1048576
    for moved, expected in ((0.4, 10.4), (-0.4, 9.6), (0.6, 9.6), (0.0, 10.0)):
        encoder = _encoder(
            enc__reference_system="INCREMENTAL (singleturn absolute)",
            enc__scaling_numerator=1.0,
            enc__scaling_denominator=float(turn),
            enc__encoder_mask=turn - 1,
        )
        encoder.begin(round(moved * turn) % turn, Retained(10.0, 0))
        assert encoder.position == pytest.approx(expected, abs=1e-5)
    for moved, expected in ((0.6, 9.6), (1.4, 10.4)):  # the count has more turns than the encoder knows
        encoder = _encoder(
            enc__reference_system="INCREMENTAL (singleturn absolute)",
            enc__scaling_numerator=1.0,
            enc__scaling_denominator=float(turn),
            enc__encoder_mask=4 * turn - 1,
            enc__encoder_sub_mask=turn - 1,
        )
        encoder.begin(round(moved * turn), Retained(10.0, 0))
        assert encoder.position == pytest.approx(expected, abs=1e-5)


@pytest.mark.requirement("NC-273", "NC-278")
def test_absolute_modulo():
    """The position is initialised within the turn, and moved by what the encoder has moved while off."""
    for moved, expected in ((0, 5.0), (100000, 15.0), (-100000, 355.0)):
        encoder = _encoder(enc__reference_system="ABSOLUTE (modulo)")
        encoder.begin((1000 + moved) % 3600000, Retained(725.0, 1000))
        assert encoder.position == pytest.approx(expected)


# -- drive


@pytest.mark.requirement("NC-082", "NC-335", "NC-336", "NC-337")
def test_full_scale():
    """The reference velocity belongs to the output ratio of full scale."""
    assert _drive(drv__type="KL4XXX").step(1100.0, 0.0) == pytest.approx(1100.0)
    for ratio, velocity, share in ((1.0, 1100.0, 0.5), (0.8, 2200.0, 0.8)):
        drive = _drive(drv__output_ratio=ratio, drv__type="KL4XXX")
        drive.step(velocity, 0.0)
        assert drive.output == pytest.approx(share)
    assert _drive(drv__output_ratio=0.8).full == pytest.approx(2750.0)


@pytest.mark.requirement("NC-334")
def test_polarity():
    """The inverted polarity reverses the output."""
    for inverted, sign in ((False, 1.0), (True, -1.0)):
        assert _drive(drv__invert_motor_polarity=inverted).step(220.0, 0.0) == pytest.approx(sign * 220.0)


@pytest.mark.requirement("NC-339", "NC-343", "NC-338", "NC-344")
def test_output_scaling(subtests):
    """The velocity factor acts on drives with an absolute velocity alone; the position factor on none."""
    for kind in catalogue()["drv.type"].choices:
        with subtests.test(kind):
            once = _drive(drv__type=kind, drv__output_scaling_velocity=3.0).step(100.0, 0.0)
            twice = _drive(drv__type=kind, drv__output_scaling_velocity=6.0).step(100.0, 0.0)
            assert twice == pytest.approx(2.0 * once if kind in DIGITAL else once)
            other = _drive(drv__type=kind, drv__output_scaling_position=2.0).step(100.0, 0.0)
            assert other == pytest.approx(twice)
    analog = {
        "M2400_DAC1", "M2400_DAC2", "M2400_DAC3", "M2400_DAC4", "KL4XXX", "KL4XXX_NONLINEAR", "TWOSPEED",
        "STEPPER", "KL5051", "UNIVERSAL", "NCBACKPLANE", "AX2000_B900", "AX2000_B310", "AX2000_B100",
    }  # fmt: skip
    assert set(catalogue()["drv.type"].choices) == analog | DIGITAL


@pytest.mark.requirement("NC-340")
def test_output_delay():
    """A step of the setpoint reaches the output as many cycles later as the delay has."""
    for delay, cycles in ((0.0, 0), (0.004, 2), (0.01, 5)):
        drive = _drive(drv__output_delay_velocity=delay)
        drive.step(0.0, 0.0)
        found = [drive.step(100.0, 0.0) for _ in range(8)]
        assert found == pytest.approx([0.0] * cycles + [100.0] * (8 - cycles))


@pytest.mark.requirement("NC-341", "NC-342", "NC-345")
def test_output_limits():
    """The total output is limited for each direction by itself."""
    drive = _drive(drv__output_limit_min=0.0)
    assert drive.step(-100.0, 0.0) == 0.0
    assert drive.step(2200.0, 0.0) == pytest.approx(2200.0)
    drive = _drive(drv__output_limit_max=0.5)
    assert drive.step(2000.0, 0.0) == pytest.approx(1100.0)
    assert drive.step(-2000.0, 0.0) == pytest.approx(-2000.0)
    assert drive.step(1000.0, 1000.0) == pytest.approx(1100.0)


@pytest.mark.requirement("NC-361")
def test_drift_compensation():
    """The constant offset is added to the output."""
    drive = _drive(drv__drift_compensation=11.0, drv__type="KL4XXX")
    drive.step(0.0, 0.0)
    assert drive.output == pytest.approx(0.005)


@pytest.mark.requirement("NC-554")
def test_controller_output_limit():
    """The share of the controller is limited, the feedforward is not."""
    drive = _drive()
    assert drive.step(0.0, 5000.0) == pytest.approx(1100.0)
    assert drive.control == pytest.approx(1100.0)
    assert drive.step(0.0, -5000.0) == pytest.approx(-1100.0)
    assert drive.step(1000.0, 5000.0) == pytest.approx(2100.0)


# -- controller


@pytest.mark.requirement("NC-517", "NC-528")
def test_p_controller():
    """Weighted set velocity plus gain times following error."""
    controller = _controller(ctrl__pos_kv=20.0)
    assert controller.step(100.0, 0.0, 0.5, has_job=True) + controller.feedforward == pytest.approx(110.0)
    controller = _controller(ctrl__velocity_precontrol_weight=0.8)
    assert controller.step(1000.0, 0.0, 0.0, has_job=True) + controller.feedforward == pytest.approx(800.0)


@pytest.mark.requirement("NC-518", "NC-519", "NC-526", "NC-529")
def test_two_gains(subtests):
    """The gain falls linearly with the set velocity, down to the gain of motion, in both directions."""
    controller = _controller(
        kind="PP", ctrl__pos_kv_standstill=50.0, ctrl__pos_kv_moving=10.0, ctrl__pos_vdyn=0.2
    )
    for share, gain in ((0.0, 50.0), (0.05, 40.0), (0.1, 30.0), (0.2, 10.0), (0.3, 10.0), (0.5, 10.0)):
        with subtests.test(share=share):
            for sign in (1.0, -1.0):
                output = controller.step(sign * share * 2200.0, 0.0, 0.1, has_job=True)
                assert output == pytest.approx(gain * 0.1)


@pytest.mark.requirement("NC-516", "NC-530")
def test_dead_band():
    """Inside the dead band the error counts as none, outside in full; the P controller has no dead band."""
    for kind in ("PP", "PID"):
        controller = _controller(
            kind=kind,
            ctrl__pos_dead_band=0.05,
            ctrl__pos_kv=10.0,
            ctrl__pos_kv_standstill=10.0,
            ctrl__pos_tv=0.0,
        )
        for error, output in ((0.04, 0.0), (0.05, 0.0), (-0.05, 0.0), (0.051, 0.51), (-0.06, -0.6)):
            assert controller.step(0.0, 0.0, error, has_job=False) == pytest.approx(output)
    assert _controller(ctrl__pos_kv=10.0).step(0.0, 0.0, 0.04, has_job=False) == pytest.approx(0.4)


@pytest.mark.requirement("NC-520", "NC-523", "NC-525", "NC-532")
def test_integral_part():
    """The integral part grows with the error over Tn up to its limit; during positioning it may stand
    still.
    """
    controller = _controller(kind="PID", ctrl__pos_ti_tn=0.5, ctrl__pos_kv=2.0)
    first = controller.step(0.0, 0.0, 0.1, has_job=True)
    for _ in range(500):
        last = controller.step(0.0, 0.0, 0.1, has_job=True)
    assert last - first == pytest.approx(0.4, rel=1e-6)
    controller = _controller(kind="PID", ctrl__pos_ti_tn=0.0, ctrl__pos_kv=2.0)
    assert {controller.step(0.0, 0.0, 0.1, has_job=True) for _ in range(50)} == {0.2}
    for sign in (1.0, -1.0):
        controller = _controller(kind="PID", ctrl__pos_ti_tn=0.01, ctrl__pos_kv=10.0)
        for _ in range(2000):
            last = controller.step(0.0, 0.0, sign * 1.0, has_job=True)
        assert last == pytest.approx(sign * 230.0)
    controller = _controller(
        kind="PID", ctrl__pos_ti_tn=0.5, ctrl__pos_kv=2.0, ctrl__pos_i_disable_moving=True
    )
    assert {controller.step(0.0, 0.0, 0.1, has_job=True) for _ in range(50)} == {0.2}
    assert controller.step(0.0, 0.0, 0.1, has_job=False) > 0.2
    held = controller.step(0.0, 0.0, 0.1, has_job=False)
    assert controller.step(0.0, 0.0, 0.1, has_job=True) == pytest.approx(held)


@pytest.mark.requirement("NC-521", "NC-522", "NC-524")
def test_derivative_part():
    """The derivative part follows a jump and decays with its damping time; without Tv there is none."""
    controller = _controller(kind="PID", ctrl__pos_tv=0.01, ctrl__pos_td=0.05, ctrl__pos_kv=1.0)
    controller.step(0.0, 0.0, 0.0, has_job=True)
    shares = [controller.step(0.0, 0.0, 1.0, has_job=True) - 1.0 for _ in range(26)]
    assert shares[0] == pytest.approx(0.01 / 0.052)
    for before, after in pairwise(shares):
        assert after / before == pytest.approx(0.05 / 0.052)
    controller = _controller(kind="PID", ctrl__pos_tv=0.0, ctrl__pos_kv=1.0)
    controller.step(0.0, 0.0, 0.0, has_job=True)
    assert controller.step(0.0, 0.0, 1.0, has_job=True) == 1.0
    controller = _controller(kind="PID", ctrl__pos_tv=1.0, ctrl__pos_kv=1.0)
    controller.step(0.0, 0.0, 0.0, has_job=True)
    assert controller.step(0.0, 0.0, 100.0, has_job=True) - 100.0 == pytest.approx(220.0)
    controller.step(0.0, 0.0, 100.0, has_job=True)
    assert controller.step(0.0, 0.0, 0.0, has_job=True) == pytest.approx(-220.0)


@pytest.mark.requirement("NC-527")
def test_acceleration_feedforward():
    """Ka times the set acceleration is added where the controller has it."""
    for kind, share in (("P", 0.0), ("PP", 3.0), ("PID", 3.0)):
        controller = _controller(kind=kind, ctrl__ka=0.002)
        controller.step(0.0, 1500.0, 0.0, has_job=True)
        assert controller.feedforward == pytest.approx(share)


@pytest.mark.requirement("NC-552", "NC-558", "NC-564", "NC-562", "NC-563")
def test_automatic_offset():
    """The offset integrates at standstill up to its limit, on analog interfaces and for P controllers alone;
    it may be held, and fades out without a step.
    """

    def run(controller, cycles, velocity=0.0):
        for _ in range(cycles):
            controller.step(velocity, 0.0, 1.0, has_job=False)
        return controller.offset

    on = {"ctrl__auto_offset": True, "ctrl__pos_kv": 100.0}
    assert run(_controller(analog=True, **on), 5000) == pytest.approx(22.0)
    assert run(
        _controller(analog=True, kind="PP", ctrl__pos_kv_standstill=100.0, **on), 5000
    ) == pytest.approx(22.0)
    assert run(_controller(analog=True, kind="PID", **on), 5000) == 0.0
    assert run(_controller(analog=False, **on), 5000) == 0.0
    assert run(_controller(analog=True, ctrl__pos_kv=100.0), 5000) == 0.0
    assert run(_controller(analog=True, **on), 5000, velocity=23.0) == 0.0
    assert run(_controller(analog=True, **on), 5000, velocity=22.0) == pytest.approx(22.0)
    parameters = ParameterSet(_values(on))
    controller = Controller(parameters, cycle_s=T, analog=True)
    run(controller, 50)
    parameters.write("ctrl.auto_offset", False)
    controller.offset_mode = OffsetMode.OFF
    assert run(controller, 1) == 0.0
    parameters.write("ctrl.auto_offset", True)
    controller.offset_mode = OffsetMode.FADE_OUT
    held = run(controller, 50)
    assert held == pytest.approx(10.0)
    controller.offset_mode = OffsetMode.HOLD
    assert run(controller, 500) == held
    controller.offset_mode = OffsetMode.FADE_OUT
    parameters.write("ctrl.auto_offset", False)
    faded = [run(controller, 1) for _ in range(500)]
    steps = [before - after for before, after in pairwise(faded)]
    assert all(0.0 < step < 0.03 for step in steps)
    assert faded[-1] == pytest.approx(held * (1.0 / 1.002) ** 500, rel=1e-6)


@pytest.mark.requirement("NC-561", "NC-551")
def test_offset_time_acts_at_once():
    """Time constant and limit of the offset act when they are written."""
    parameters = ParameterSet({"ctrl.auto_offset": True, "ctrl.pos_kv": 100.0, "ctrl.offset_limit": 1.0})
    controller = Controller(parameters, cycle_s=T, analog=True)
    growth = []
    for time in (1.0, 0.5):
        parameters.write("ctrl.offset_timer", time)
        before = controller.offset
        controller.step(0.0, 0.0, 1.0, has_job=False)
        growth.append(controller.offset - before)
    assert growth == pytest.approx([0.2, 0.4])
    parameters.write("ctrl.offset_limit", 0.0001)
    controller.step(0.0, 0.0, 1.0, has_job=False)
    assert controller.offset == pytest.approx(0.22)

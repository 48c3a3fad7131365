"""Telegrams that are not what the axis expects: parts lost, exchanged, of a wrong length, of something that
is no drive.
"""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.faults import Injector
from testcases.unit.hil.test_hil_profidrive import bench, enabled

SECOND = """
[drive.drive2]
segment = "can0"
node_id = 6
profile = "profidrive"
telegram = {telegram}

[axis.axis2]
type = "positioning"
drive = "drive2"
"""


def two(telegram):
    """Return a bench with two PROFIdrive axes."""
    return Bench(parse(read("profidrive")[1] + SECOND.format(telegram=telegram), "bench.toml"), seed=1)


def exchange(*ports):
    """Let each of two ports get what the other one's drive sends: wired or configured in the wrong order."""
    last: dict[int, bytes] = {}

    def seam(own, other):
        def pass_on(frame):
            last[own] = frame
            return last.get(other)

        return pass_on

    for own, port in enumerate(ports):
        port.actual_seam = seam(own, 1 - own)


class TestLostParts:
    """A part of the telegram does not arrive."""

    @pytest.mark.requirement("CFG-593")
    def test_one_pdo_of_the_telegram(self):
        """The last whole image stays in force, with no new word in it; after the tolerated cycles there is no
        communication.
        """
        with bench() as machine:
            axis = enabled(machine)
            axis.move_velocity(100.0)
            machine.run_for(0.5)
            injector = Injector(machine)
            injector.inject("frame.drop", "can0", drive="drive1", message="tpdo2")
            machine.run_for(2.5 * machine.cycle_ns / 1e9)
            image = axis.port.telegram_view()
            received = {name: image[name] for name in axis.port.telegram.actual.names}
            assert axis.var("StatusDrive.CommunicationOK")
            machine.run_for(machine.cycle_ns / 1e9)
            image = axis.port.telegram_view()
            assert {name: image[name] for name in axis.port.telegram.actual.names} == received
            machine.run_for(3 * machine.cycle_ns / 1e9)
            assert not axis.var("StatusDrive.CommunicationOK")
            assert axis.var("ErrorDetail.Number") == 431
            assert not axis.var("StatusWord.X0")

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-593")
    def test_registers_that_are_not_read(self):
        """Over Modbus the same: a response that does not come leaves the words of the one before."""
        with Bench(load_bench("profidrive_tcp").config, seed=1) as machine:
            axis = enabled(machine)
            axis.move_velocity(50.0)
            machine.run_for(0.5)
            Injector(machine).inject("modbus.drop", "net0", drive="drive1", direction="response")
            machine.run_for(2.5 * machine.cycle_ns / 1e9)
            before = [axis.port.actual(name) for name in axis.port.telegram.actual.names]
            assert axis.var("StatusDrive.CommunicationOK")
            machine.run_for(machine.cycle_ns / 1e9)
            assert [axis.port.actual(name) for name in axis.port.telegram.actual.names] == before
            machine.run_for(5 * machine.cycle_ns / 1e9)
            assert (axis.var("StatusDrive.CommunicationOK"), axis.var("ErrorDetail.Number")) == (False, 431)


class TestSignOfLife:
    """The counter in bits 12 to 15."""

    @pytest.mark.requirement("CFG-594", "CFG-192", "CFG-243")
    @pytest.mark.parametrize("how", ["freeze", "zero", "jump"])
    def test_frozen_or_jumping(self, how):
        """Without a valid counter there is no communication, though every telegram arrives."""
        with bench() as machine:
            axis = enabled(machine)
            injector = Injector(machine)
            if how != "jump":
                injector.inject("telegram.sign_of_life", direction="actual", how=how)
            for step in range(1, 16):  # one jump after the other
                if how == "jump":
                    injector.inject("telegram.sign_of_life", direction="actual", how=how, step=1 + step % 2)
                machine.run_for(machine.cycle_ns / 1e9)
            assert not axis.var("StatusDrive.CommunicationOK")
            assert not axis.var("StatusWord.X0")

    @pytest.mark.requirement("CFG-594", "CFG-243")
    def test_one_wrong_count_is_tolerated(self):
        """A single jump changes nothing."""
        with bench() as machine:
            axis = enabled(machine)
            Injector(machine).inject("telegram.sign_of_life", direction="actual", how="jump", step=2, count=1)
            machine.run_for(0.2)
            assert axis.var("StatusDrive.CommunicationOK")
            assert axis.var("ErrorWord") == 0

    @pytest.mark.requirement("CFG-243")
    def test_it_counts_from_1_to_15(self):
        """Both counters go up by one in every cycle and leave out 0."""
        with bench() as machine:
            axis = enabled(machine)
            ours, theirs = [], []
            for _ in range(40):
                machine.run_for(machine.cycle_ns / 1e9)
                view = axis.port.telegram_view()
                ours.append(view["STW2"] >> 12 & 15)
                theirs.append(view["ZSW2"] >> 12 & 15)
            for counts in (ours, theirs):
                assert set(counts) == set(range(1, 16))
                assert all(b == a % 15 + 1 for a, b in itertools.pairwise(counts))


class TestExchanged:
    """Telegrams in the wrong order."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-595", "CFG-183", "CFG-596")
    @pytest.mark.parametrize("telegram", [3, 4])
    def test_of_different_lengths(self, telegram):
        """Each axis gets the other one's words, which are too few or too many for it: neither communicates
        nor is enabled.
        """
        with two(telegram) as machine:
            exchange(*(machine.axis(name).port for name in ("axis1", "axis2")))
            axes = [machine.axis(name) for name in ("axis1", "axis2")]
            machine.run_for(0.1)
            powers = [axis.power() for axis in axes]
            machine.run_for(1.0)
            for axis, power in zip(axes, powers, strict=True):
                assert not axis.var("StatusDrive.CommunicationOK")
                assert not power.Status
                assert axis.object.speed_output_rpm == 0.0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-595", "CFG-183")
    def test_of_the_same_length(self):
        """102 and 105 answer with the same words: each axis sees the other drive, which shows when only one
        of them moves.
        """
        with two(102) as machine:
            axes = [machine.axis(name) for name in ("axis1", "axis2")]
            for axis in axes:
                power = axis.power()
                assert machine.run_until(power.status, 2.0)
            exchange(*(axis.port for axis in axes))
            machine.run_for(0.1)
            moving = axes[0].move_velocity(100.0)
            assert machine.run_until(lambda: axes[0].var("ErrorDetail.Number") == 521, 3.0)
            assert moving.ErrorID == 0x8001
            assert abs(machine.drive("drive2").mechanics.velocity) < 1.0


class TestLengthAndNumber:
    """A telegram of another length, or with another number."""

    @pytest.mark.requirement("CFG-596", "PD-030")
    @pytest.mark.parametrize("words", [-1, 1])
    def test_actual_values_of_a_wrong_length(self, words):
        """They are not taken over; after the tolerated cycles there is no communication."""
        with bench() as machine:
            axis = enabled(machine)
            length = len(axis.port.telegram.actual.pack(*[0] * len(axis.port.telegram.actual.names))) // 2
            Injector(machine).inject("telegram.length", direction="actual", words=length + words)
            machine.run_for(0.1)
            assert (axis.var("StatusDrive.CommunicationOK"), axis.var("ErrorDetail.Number")) == (False, 431)
            assert not axis.var("StatusWord.X0")

    @pytest.mark.requirement("CFG-250")
    def test_a_range_smaller_than_the_telegram(self):
        """A register map with room for fewer words than the telegram has is refused when the bench file is
        read.
        """
        text = read("profidrive_tcp")[1]
        assert "telegram = 105" in text or "telegram =" in text
        long = text.replace(
            "[axis.axis1]\n",
            "[drive.drive1.profidrive]\nsafety_telegram = 701\ntorque_telegram = true\n\n[axis.axis1]\n",
            1,
        )
        with pytest.raises(ConfigurationError, match="words"):
            Bench(parse(long, "bench.toml"), seed=1)


WORDS = st.lists(st.integers(0, 0xFFFF), min_size=10, max_size=10)


class TestNoDrive:
    """The words of a module that is no drive: room enough, meaning none."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-249", "CFG-597", "CFG-288")
    @given(rows=st.lists(WORDS, min_size=1, max_size=4))
    @settings(max_examples=12, deadline=None)
    def test_meaningless_words(self, rows):
        """Inputs that stand still or change now and then: no crash, no enable, no communication for the axis.

        A row with the next sign of life after another counts as one until the tolerated failures are over, so
        the last one is held for longer than that.
        """
        with bench() as machine:
            axis = machine.axis()
            count = [0]

            def module(_frame):
                count[0] += 1
                return b"".join(word.to_bytes(2, "big") for word in rows[min(count[0], 99) // 25 % len(rows)])

            axis.port.actual_seam = module
            axis.port.setpoint_seam = lambda _frame: None
            power = axis.power()
            machine.run_for(0.5)
            assert not power.Status
            assert not axis.var("StatusDrive.CommunicationOK")
            axis.move_velocity(10.0)
            machine.run_for(0.1)
            assert axis.object.speed_output_rpm == 0.0
            assert machine.drive().mechanics.velocity == 0.0


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-202", "CFG-195")
def test_a_speed_axis_does_not_look_at_the_encoder_of_its_telegram():
    """An encoder error in telegram 3 means nothing to a speed axis, and alarm 411 to a positioning axis."""
    for kind in ("speed", "positioning"):
        text = read("profidrive")[1].replace("telegram = 105", "telegram = 3")
        if kind == "speed":
            head, tail = text.split("[axis.axis1]\n", 1)
            text = head + '[axis.axis1]\ntype = "speed"\ndrive = "drive1"\n'
            assert "[drive" not in tail
        with Bench(parse(text, "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            power = axis.power()
            assert machine.run_until(power.status, 2.0)
            axis.move_velocity(20.0)
            machine.run_for(0.2)
            Injector(machine).inject("telegram.bits", signal="G1_ZSW", direction="actual", set=0x8000)
            machine.run_for(0.2)
            if kind == "speed":
                assert axis.var("ErrorWord") == 0
                assert power.Status
                assert axis.var("ActualSpeed") == pytest.approx(20.0, abs=0.5)
            else:
                assert axis.var("ErrorDetail.Number") == 411


@pytest.mark.requirement("CTL-010", "CTL-028", "CFG-317", "CFG-221")
def test_dsc_needs_the_motor_encoder_first():
    """With the scale as `Sensor[1]` in place of the motor encoder dynamic servo control is refused, and
    without it is not.
    """
    scale = """
[encoder.scale]
segment = "can0"
node_id = 20
type = "absolute_linear"
measuring_step_um = 1.0
on = "drive1"
mounting = "load"
"""
    text = (
        read("profidrive")[1].replace(
            'drive = "drive1"\n', 'drive = "drive1"\nencoders = ["scale", "drive1"]\n', 1
        )
        + scale
    )
    Bench(parse(text, "bench.toml"), seed=1).close()
    text = text.replace(
        "[axis.axis1.variables]\n", '[axis.axis1.variables]\n"PositionControl.EnableDSC" = true\n'
    )
    with pytest.raises(ConfigurationError, match=r"PositionControl\.EnableDSC"):
        Bench(parse(text, "bench.toml"), seed=1)


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-251", "CFG-272", "CFG-263")
def test_times_of_a_direct_connection_come_by_themselves():
    """The following error of a direct connection needs no times, and they cannot be written."""
    with bench() as machine:
        axis = enabled(machine)
        assert axis.object.delay_s == pytest.approx(axis.port.delay_ns * 1e-9)
        for number in (1010, 1011, 1012):
            job = axis.write_parameter(number, 0.001)
            machine.run_for(0.02)
            assert job.ErrorID == 0x805D
        axis.move_velocity(100.0)
        machine.run_for(1.0)
        assert abs(axis.var("StatusPositioning.FollowingError")) < 0.2


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-606")
def test_a_data_block_without_times_shows_a_following_error():
    """With times of 0.0 a setpoint counts as executed after T_servo: an error of v * (T_i + T_o + T_DC) that
    is none.

    A controller that hardly controls shows it, instead of taking it for an error of the axis and correcting
    it.
    """
    text = read("profidrive")[1].replace(
        'drive = "drive1"\n', 'drive = "drive1"\nconnection = "data_block"\n', 1
    )
    text = text.replace("[axis.axis1.variables]\n", '[axis.axis1.variables]\n"PositionControl.Kv" = 0.001\n')
    text = text.replace('"PositionControl.Kv" = 20.0\n', "")
    shown = []
    for times in (False, True):
        with Bench(parse(text, "bench.toml"), seed=1) as machine:
            axis = machine.axis()
            axis.port.block.pass_through()
            if times:
                machine.run_for(0.1)
                job = axis.write_parameter(1012, axis.port.delay_ns * 1e-9 - machine.cycle_ns * 1e-9)
                assert machine.run_until(job.done, 1.0)
                assert machine.run_until(axis.reset(restart=True).done, 1.0)
            axis = enabled(machine)
            axis.move_velocity(100.0)
            machine.run_for(1.0)
            shown.append(axis.var("StatusPositioning.FollowingError"))
    assert shown[0] - shown[1] == pytest.approx(100.0 * 0.004, rel=0.02)

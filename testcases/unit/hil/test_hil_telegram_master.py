"""PROFIdrive drives without an axis: telegrams 7, 9, 20, 110 and 111 in a bench file, led by the test word by
word.
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.errors import TelegramError
from fieldbus.profidrive.words import POS_STW1, POS_STW2, STW1, ZSW1
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import BenchFileError, parse
from hil.errors import BlockedError
from hil.faults import Injector

TEXT = """
[bench]
name = "positioner"
kind = "virtual"
cycle_ms = 4
[segment.can0]
bitrate = 1_000_000
[drive.slide]
profile = "profidrive"
telegram = {telegram}
segment = "can0"
node_id = 5
{more}
"""
BLOCKS = """
[drive.slide.positioner]
software_limits = [-500_000, 500_000]
[[drive.slide.positioner.block]]
number = 3
position = 20_000
velocity = 6_000
continuation = "continue with stop"
[[drive.slide.positioner.block]]
number = 4
task = "relative"
position = -5_000
velocity = 6_000
"""
READY = 0x043E
RUN = READY | STW1.ON
GO = RUN | STW1.ACTIVATE_TASK
MDI = POS_STW1.MDI | POS_STW1.ABSOLUTE


def bench(telegram=111, more=""):
    """Return a bench with a drive that no axis moves."""
    return Bench(parse(TEXT.format(telegram=telegram, more=more), "own.toml"), seed=1)


def enabled(machine, **signals):
    """Enable the drive and set its reference point if the telegram can; returns the master."""
    master = machine.telegram()
    for stw1 in (READY, RUN):
        master.send(STW1=stw1, **signals)
        machine.run_for(8 * machine.config.bench.cycle_ms / 1000)
    assert master["ZSW1"] & 0x0047 == 0x0007
    return master


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-019", "PD-032", "CFG-221")
def test_a_test_leads_a_positioner_by_telegram_111():
    """Enable, reference point, MDI: the true slide goes there; the words of the answer by their names."""
    with bench() as machine:
        master = enabled(machine, POS_STW2=POS_STW2.SET_REFERENCE_POINT)
        master.send(POS_STW1=MDI, POS_STW2=0, MDI_TARPOS=50_000, MDI_VELOCITY=6_000)
        machine.run_for(0.02)
        master.send(STW1=GO)
        assert machine.run_until(lambda: master["ZSW1"] & ZSW1.TARGET_REACHED, 2.0)
        assert master["XIST_A"] == pytest.approx(50_000, abs=50)
        machine.run_for(0.1)
        assert machine.drive().mechanics.position * 1e6 == pytest.approx(50_000, abs=20)
        assert master.sent["MDI_TARPOS"] == 50_000
        assert master.actual["FAULT_CODE"] == 0
        assert machine.telegram("slide") is master


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-007")
def test_blocks_of_the_bench_file():
    """Telegram 7 starts them by number; a relative one follows the absolute one."""
    with bench(7, BLOCKS) as machine:
        master = enabled(machine)
        machine.drive().drive.mode.positioner.set_reference_point()
        master.send(STW1=GO, SATZANW=3)
        seen = set()
        for _ in range(300):
            machine.run_for(0.004)
            seen.add(master["AKTSATZ"])
        assert {3, 4} <= seen
        assert machine.drive().mechanics.position * 1e6 == pytest.approx(15_000, abs=20)


@pytest.mark.requirement("PD-009")
def test_telegram_20_shows_speed_current_torque_and_power():
    """Shares of the reference quantities."""
    with bench(20) as machine:
        master = machine.telegram()
        master.send(STW1=0x047E)
        machine.run_for(0.03)
        master.send(STW1=0x047F, NSOLL_A=0x0CCD)  # 20 %: 600 rpm
        machine.run_for(0.5)
        assert master["NIST_A_GLATT"] == pytest.approx(0x0CCD, rel=0.01)
        torque = machine.drive().core.torque
        assert master["MIST_GLATT"] / 0x4000 == pytest.approx(torque / 2.0, abs=0.01)
        assert master["PIST_GLATT"] / 0x4000 == pytest.approx(torque / 2.0 * 0.2, abs=0.01)


def test_a_speed_telegram_without_an_axis_has_its_sign_of_life():
    """The master counts in STW2, so that an isochronous drive goes on working."""
    with bench(105) as machine:
        master = machine.telegram()
        master.send(STW1=0x047E)
        machine.run_for(0.3)
        master.send(STW1=0x047F, NSOLL_B=0x0CCC_CCCD)
        machine.run_for(0.3)
        assert master["NIST_B"] == pytest.approx(0x0CCC_CCCD, rel=0.01)
        assert machine.drive().drive.isochronous


def test_faults_work_as_with_an_axis():
    """A fault of the catalogue stops the axis and shows in FAULT_CODE; acknowledged, it can be enabled
    again.
    """
    with bench() as machine:
        master = enabled(machine)
        Injector(machine).inject("drive.fault", code=30001)
        machine.run_for(0.05)
        assert master["FAULT_CODE"] == 30001
        master.send(STW1=READY | STW1.ACKNOWLEDGE)
        machine.run_for(0.05)
        enabled(machine)
        assert master["FAULT_CODE"] == 0


@pytest.mark.exhaustive
def test_what_a_master_refuses():
    """Signals that the telegram has not, values out of range; drives with an axis or without a telegram."""
    with bench() as machine:
        master = machine.telegram()
        with pytest.raises(ConfigurationError, match="NSOLL_B"):
            master.send(NSOLL_B=1)
        with pytest.raises(ConfigurationError, match="NIST_A"):
            master["NIST_A"]
        with pytest.raises(TelegramError, match="MDI_TARPOS"):
            master.send(MDI_TARPOS=1 << 31)
        with pytest.raises(ConfigurationError, match="slide"):
            machine.telegram("other")
    for name, words in (("profidrive", "axis1"), ("reference", "profile")):
        with load_bench(name).build(seed=1) as machine, pytest.raises(ConfigurationError, match=words):
            machine.telegram()


def test_a_segment_of_somebody_else_is_left_alone(request):
    """On a live segment without an axis the bench is no controller: blocked."""
    live = TEXT.format(telegram=111, more='device = "physical"').replace('"virtual"', '"live"')
    live = live.replace("bitrate", f'interface = "virtual"\nchannel = "{request.node.name}"\nbitrate')
    with Bench(parse(live, "own.toml")) as machine, pytest.raises(BlockedError, match="can0"):
        machine.telegram()


@pytest.mark.requirement("PD-032")
@pytest.mark.parametrize(
    ("telegram", "more", "words"),
    [
        (3, "[drive.slide.positioner]\nwindow = 10.0", "telegram 3 leads the speed"),
        (111, "[drive.slide.positioner]\nsoftware_limits = [5, 4]", "software_limits"),
        (111, '[axis.a]\ntype = "positioning"\ndrive = "slide"', "telegram"),
        (111, '[axis.a]\ntype = "speed"\ndrive = "slide"', "no setpoints for an axis"),
        (7, '[[drive.slide.positioner.block]]\nnumber = 3\ntask = "goto"\nparameter = 99', "goto"),
        (7, "[drive.slide.profidrive]\nsign_of_life = true", "telegram 7 has none"),
    ],
)
def test_mistakes_in_the_bench_file_are_named(telegram, more, words):
    """Key, value, and what is allowed."""
    with pytest.raises(BenchFileError, match=words):
        parse(TEXT.format(telegram=telegram, more=more), "own.toml")


@pytest.mark.parametrize("segment", ['kind = "modbus_tcp"', 'kind = "modbus_rtu"\nbaud = 115200'])
def test_a_positioner_on_modbus(segment):
    """The same master over a register map with room for twelve words."""
    text = TEXT.format(telegram=111, more='map = "festo"').replace("node_id = 5\n", "")
    text = text.replace("bitrate = 1_000_000", segment).replace("cycle_ms = 4", "cycle_ms = 20")
    with Bench(parse(text, "own.toml"), seed=1) as machine:
        master = enabled(machine, POS_STW2=POS_STW2.SET_REFERENCE_POINT)
        machine.run_for(0.1)
        master.send(POS_STW1=MDI, POS_STW2=0, MDI_TARPOS=-20_000, MDI_VELOCITY=6_000)
        machine.run_for(0.1)
        master.send(STW1=GO)
        assert machine.run_until(lambda: master["ZSW1"] & ZSW1.TARGET_REACHED, 2.0)
        assert master["XIST_A"] == pytest.approx(-20_000, abs=50)

"""Control words and encoder data of the compatibility level S7-1200 G2 (sections 6.4 and 6.5 of the
specification).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from motion.s7.controller import OperatingState
from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from motion.s7.memory_card import FILE, FOLDER, USED
from testcases.unit.motion_axis.conftest import Rig, TorquePort


def make(**changes):
    return Rig(cpu="S7-1200 G2", **changes)


STW1_BITS = {"G2-034": 9, "G2-035": 11, "G2-036": 12, "G2-037": 14}
STW2_BITS = {"G2-038": (0, 1, 2, 10), "G2-039": (4,), "G2-040": (6,), "G2-041": (7,), "G2-042": (8,)}


class TestControlWords:
    """Section 6.4: which bits, how they are selected, how long they stay. What they do is the drive's."""

    @pytest.mark.requirement("G2-033", "G2-050")
    @pytest.mark.parametrize(
        ("word", "bit"),
        [pytest.param(1, bit, marks=pytest.mark.requirement(ident)) for ident, bit in STW1_BITS.items()]
        + [
            pytest.param(2, bit, marks=pytest.mark.requirement(ident))
            for ident, bits in STW2_BITS.items()
            for bit in bits
        ],
    )
    def test_bit(self, word, bit):
        """The mask selects, the value counts: set and reset in every telegram, no other bit changes."""
        rig = make(port=TorquePort()).enabled()
        key, other = (f"STW{word}", f"STW{3 - word}")

        def sent():
            rig.cycles(2)
            return rig.port.stw1 if word == 1 else rig.port.stw2

        before = sent()
        assert rig.axis.set_axis_stw(**{key: 0xFFFF, f"{key}BitMask": 1 << bit, other: 0xFFFF}).ErrorID == 0
        assert sent() == before | 1 << bit
        rig.run(0.2)
        assert sent() == before | 1 << bit
        rig.axis.set_axis_stw(**{key: 0, f"{key}BitMask": 1 << bit})
        assert sent() == before & ~(1 << bit)

    @pytest.mark.requirement("G2-043", "G2-044", "G2-032")
    def test_brake(self):
        """16#1000 with mask 16#1000 opens, 16#0000 with the same mask closes; a restart gives the bit
        back.
        """
        rig = make(port=TorquePort())
        rig.cycles(5)
        rig.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        rig.run(0.2)
        assert rig.port.stw1 & 0x1000
        job = rig.axis.set_axis_stw(STW1=0x0000, STW1BitMask=0x1000)
        rig.cycles(3)
        assert job.Done
        assert not rig.port.stw1 & 0x1000
        rig.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000)
        rig.cycles(3)
        rig.until(rig.axis.reset(restart=True).done)
        rig.cycles(2)
        assert not rig.port.stw1 & 0x1000


class TestEncoderData:
    """Section 6.5."""

    ABSOLUTE = {"Sensor[1].Type": 1}  # noqa: RUF012 - never changed

    def saved(self, card: Path, **variables):
        rig = make(variables=self.ABSOLUTE | variables)
        restored = rig.runtime.insert_card(card)
        return rig, restored

    @pytest.mark.requirement("G2-045", "G2-046", "G2-047", "G2-048")
    @pytest.mark.parametrize("way", ["the card", "a copy of the file"])
    def test_save_and_restore(self, tmp_path, way):
        """Saved to UserFiles; a new controller takes the data from the same card or from a copied file, once,
        and says so.
        """
        rig, _ = self.saved(tmp_path / "card")
        rig.enabled()
        rig.until(rig.axis.home(321.0, mode=7).done)
        save = MC_SaveAbsoluteEncoderData(rig.runtime, Execute=True)
        rig.runtime.call(save)
        rig.until(save.done)
        saved = tmp_path / "card" / FOLDER / FILE
        assert (FOLDER, FILE) == ("UserFiles", "AbsEncoderData.dat")
        card = tmp_path / "card"
        if way != "the card":
            card = tmp_path / "new card"
            (card / FOLDER).mkdir(parents=True)
            (card / FOLDER / FILE).write_bytes(saved.read_bytes())
        _, restored = self.saved(card, **{"Sensor[1].Parameter.StepsPerRevolution": 4096})
        assert not restored  # another encoder configuration
        new, restored = self.saved(card)
        assert restored
        new.cycles(3)
        assert new.axis.var("ActualPosition") == pytest.approx(321.0, abs=1e-3)
        assert new.events("controller.encoder_data_restored")
        assert not (card / FOLDER / FILE).exists()
        assert (card / FOLDER / USED).name == "AbsEncoderData.bak"
        _, again = self.saved(card)
        assert not again


@pytest.mark.requirement("G2-032", "MC-444", "MC-606")
def test_the_bits_end_with_run():
    """RUN to STOP gives the bits back to the object, and they do not come again with the next RUN."""
    rig = make(port=TorquePort())
    controller = rig.runtime.controller
    rig.cycles(5)
    rig.axis.set_axis_stw(STW1=0x1000, STW1BitMask=0x1000, STW2=0x0010, STW2BitMask=0x0010)
    rig.cycles(5)
    assert (rig.port.stw1 & 0x1000, rig.port.stw2) == (0x1000, 0x0010)
    controller.stop()
    rig.until(lambda: controller.state is OperatingState.STOP)
    controller.run()
    rig.until(lambda: controller.state is OperatingState.RUN)
    rig.cycles(5)
    assert (rig.port.stw1 & 0x1000, rig.port.stw2) == (0, 0)

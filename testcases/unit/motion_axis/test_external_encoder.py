"""The external encoder as a technology object: status word, alarms, diagnosis (sections 2.1, 4.3)."""

from __future__ import annotations

import json

import pytest

from fieldbus.clock import MS
from motion.drives.encoder import EncoderPort
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.alarms import catalogue
from motion.s7.axis import ExternalEncoder
from testcases.rigs import ControllerRig

COARSE = {
    "Mechanics.LeadScrew": 10.0,
    "Sensor.Parameter.StepsPerRevolution": 1000,
    "Sensor.Parameter.FineResolutionXist1": 0,
}


GROUPS = [
    *((number, "ErrorWord", 0) for number in (201, 202, 203)),
    *((number, "ErrorWord", 1) for number in (101, 107, 108)),
    *((number, "ErrorWord", 2) for number in (113, 308)),
    *((number, "ErrorWord", 5) for number in (411, 412)),
    (431, "ErrorWord", 7),
    (401, "ErrorWord", 13),
    *((number, "ErrorWord", 15) for number in (103, 552)),
    (322, "WarningWord", 3),
    (112, "WarningWord", 15),
]
"""Alarms of an external encoder with the bit of their group."""


class Shaft(EncoderPort):
    """An encoder whose count grows by `step` increments per cycle."""

    __slots__ = ("connected", "step")

    def __init__(self):
        super().__init__()
        self.connected = True
        self.step = 0

    def read(self):
        self.link_ok = self.connected
        self.encoder_increments += self.step


class Rig(ControllerRig):
    """One external encoder on its shaft, with the runtime; an application cycle of 4 ms."""

    def __init__(self, **variables):
        super().__init__()
        self.port = Shaft()
        settings = COARSE | {path.replace("__", "."): value for path, value in variables.items()}
        external = ExternalEncoder(
            "ext1", self.port, cycle_ns=4 * MS, variables=settings, history=self.history
        )
        self.control_encoder(external)
        self.var = self.encoder.var
        self.runtime.start()

    def cycles(self, number=3):
        super().cycles(number)

    def enabled(self):
        self.power = self.encoder.power()
        self.until(self.power.status)
        self.cycles(5)
        return self

    def reset(self):
        self.until(self.encoder.reset().done)
        self.cycles(2)


@pytest.fixture
def rig():
    return Rig()


class TestStatusWord:
    """The bits that the object has."""

    @pytest.mark.requirement("DIA-073", "DIA-077", "DIA-079")
    def test_homed(self, rig):
        """Setting the position homes; adjusting shows in `Adjusted` too. Nothing but `MC_Power` acts:
        done.
        """
        rig.enabled()
        assert rig.var("StatusWord.X5") is False
        rig.until(rig.encoder.home(20.0).done)
        assert (rig.var("StatusWord.X5"), rig.var("StatusSensor.Adjusted")) == (True, 0)
        rig.until(rig.encoder.home(30.0, mode=13).done)
        assert (rig.var("StatusWord.X5"), rig.var("StatusSensor.Adjusted")) == (True, 1)
        assert rig.var("StatusWord.X6") is True

    @pytest.mark.requirement("DIA-080", "DIA-079")
    def test_homing_job(self, rig):
        """X11 while a passive homing waits for its mark, and the object is not done; `Mode` 9 ends it."""
        rig.port.mark = SimulatedDrivePort(cycle_s=0.004).mark
        rig.enabled()
        assert [rig.var(f"StatusWord.X{bit}") for bit in (6, 11)] == [True, False]
        waiting = rig.encoder.home(0.0, mode=8)
        rig.cycles(3)
        assert waiting.Busy
        assert [rig.var(f"StatusWord.X{bit}") for bit in (6, 11)] == [False, True]
        assert rig.encoder.diagnosis().pages["motion status"]["homing job"] is True
        rig.until(rig.encoder.home(0.0, mode=9).done)
        rig.cycles(2)
        assert [rig.var(f"StatusWord.X{bit}") for bit in (6, 11)] == [True, False]

    @pytest.mark.requirement("DIA-081")
    def test_standstill(self, rig):
        """Below the threshold for the dwell time."""
        rig.enabled()
        assert rig.var("StatusWord.X7") is True
        rig.port.step = 10
        rig.cycles(3)
        assert rig.var("StatusWord.X7") is False

    @pytest.mark.requirement("DIA-075", "DIA-078")
    def test_restart(self, rig):
        """A changed start value shows until the restart, which shows itself."""
        rig.cycles()
        rig.encoder.variables.write_start("Mechanics.LeadScrew", 20.0)
        rig.cycles(1)
        assert (rig.var("StatusWord.X3"), rig.var("StatusWord.X2")) == (True, False)
        reset = rig.encoder.reset(restart=True)
        rig.cycles(2)
        assert (rig.var("StatusWord.X2"), rig.var("StatusWord.X6")) == (True, False)
        rig.until(reset.done)
        assert (rig.var("StatusWord.X3"), rig.var("StatusWord.X2")) == (False, False)
        assert rig.var("Mechanics.LeadScrew") == 20.0

    @pytest.mark.requirement("DIA-088", "CFG-065")
    def test_only_these_bits(self, rig):
        """No control panel, no motion, whatever happens; reactions are none and 10."""
        seen = reactions = 0
        rig.enabled()
        rig.port.step = 10
        for number in sorted(
            number for number, one in catalogue().items() if "ExternalEncoder" in one.applies_to
        ):
            rig.encoder.object.engine.raise_alarm(number)
            for _ in range(2):
                rig.cycles(1)
                seen |= rig.var("StatusWord")
                reactions |= 1 << rig.var("ErrorDetail.Reaction")
            rig.encoder.object.engine.restart()
        rig.reset()
        rig.encoder.home(1.0)
        rig.cycles(1)
        seen |= rig.var("StatusWord")
        assert seen & ~0x08EF == 0
        assert reactions == 1 << 10 | 1 << 0


class TestAlarms:
    """Alarms while the object is enabled."""

    @pytest.mark.requirement("DIA-074", "DIA-085", "DIA-088", "MC-157")
    def test_encoder(self, rig):
        """411 with reaction 10 ends the enable; acknowledged after its cause it comes back by itself."""
        rig.enabled()
        rig.port.sensor_fault = True
        rig.cycles(2)
        assert (rig.var("ErrorDetail.Number"), rig.var("ErrorDetail.Reaction")) == (411, 10)
        assert (rig.var("ErrorWord"), rig.var("StatusWord.X1"), rig.var("StatusWord.X0")) == (
            1 << 5,
            True,
            False,
        )
        assert (rig.power.Status, rig.power.Busy, rig.power.ErrorID) == (False, True, 0x8001)
        rig.reset()
        assert rig.var("ErrorDetail.Number") == 411  # the cause is still there
        rig.port.sensor_fault = False
        rig.cycles()
        assert rig.var("ErrorDetail.Number") == 411
        rig.reset()
        assert (rig.var("ErrorWord"), rig.power.Status, rig.power.ErrorID) == (0, True, 0)

    @pytest.mark.requirement("DIA-086", "TA-020")
    def test_link(self, rig):
        """431 with its bit; the value is not valid."""
        rig.enabled()
        rig.port.connected = False
        rig.cycles(2)
        assert (rig.var("ErrorDetail.Number"), rig.var("ErrorDetail.Reaction")) == (431, 10)
        assert (rig.var("ErrorWord"), rig.var("StatusSensor.State")) == (1 << 7, 0)
        (raised,) = rig.history.select(kind="alarm.raised")
        assert raised.data["info"] == 3

    @pytest.mark.requirement("LIM-103", "DIA-084")
    def test_numerical_range(self, rig):
        """Beyond 9.0E12 the position is alarm 308; a new position brings it back."""
        rig.enabled()
        rig.until(rig.encoder.home(1.0e12).done)
        for _ in range(9):
            assert rig.var("ErrorWord") == 0
            rig.until(rig.encoder.home(0.9e12, mode=1).done)
            rig.cycles(2)
        assert (rig.var("ErrorDetail.Number"), rig.var("ErrorDetail.Reaction")) == (308, 10)
        assert rig.encoder.object.engine.highest.info == 2
        rig.until(rig.encoder.home(0.0).done)
        rig.reset()
        assert (rig.var("ErrorWord"), rig.power.Status) == (0, True)

    @pytest.mark.requirement("DIA-083", "TA-008", "MC-609")
    def test_configuration(self, rig):
        """A wrong start value: restart ends with 16#8015 and alarm 101, which only a restart with a good one
        clears.
        """
        rig.cycles()
        rig.encoder.variables.write_start("Mechanics.LeadScrew", -1.0)
        reset = rig.encoder.reset(restart=True)
        rig.until(reset.error)
        assert reset.ErrorID == 0x8015
        assert (rig.var("ErrorDetail.Number"), rig.var("ErrorWord")) == (101, 1 << 1)
        power = rig.encoder.power()
        rig.cycles(5)
        assert (power.Status, power.ErrorID) == (False, 0x8001)
        acknowledged = rig.encoder.reset()
        rig.until(acknowledged.error)
        assert (acknowledged.ErrorID, rig.var("ErrorDetail.Number")) == (0x8015, 101)
        rig.encoder.power(False)
        rig.encoder.variables.write_start("Mechanics.LeadScrew", 10.0)
        rig.cycles(2)
        rig.until(rig.encoder.reset(restart=True).done)
        assert rig.var("ErrorWord") == 0

    @pytest.mark.requirement(
        "DIA-082", "DIA-083", "DIA-084", "DIA-085", "DIA-086", "DIA-087", "DIA-088", "DIA-112"
    )
    @pytest.mark.parametrize(("number", "word", "bit"), GROUPS)
    def test_bits_of_the_words(self, rig, number, word, bit):
        """The bit of the group and no other; reaction 10 takes the enable away, a warning and 202 do not."""
        rig.enabled()
        rig.encoder.object.engine.raise_alarm(number)
        rig.cycles(1)
        words = {"ErrorWord": 0, "WarningWord": 0} | {word: 1 << bit}
        assert {name: rig.var(name) for name in words} == words
        keeps = word == "WarningWord" or number == 202
        detail = (rig.var("ErrorDetail.Number"), rig.var("ErrorDetail.Reaction"))
        assert detail == (number, 0 if keeps else 10)
        assert (rig.var("StatusWord.X0"), rig.power.Status) == (keeps, keeps)
        assert rig.power.ErrorID == (0 if keeps else 0x8001)

    def test_all_of_them(self):
        """The table has every alarm that the list knows for an external encoder."""
        listed = {number for number, one in catalogue().items() if "ExternalEncoder" in one.applies_to}
        assert {number for number, _, _ in GROUPS} == listed


class TestDiagnosis:
    """The pages of the object."""

    @pytest.mark.requirement("DIA-072", "DIA-073", "DIA-076", "DIA-077", "DIA-081", "DIA-096", "DIA-097")
    def test_pages(self, rig):
        """What the words say, by name; with values."""
        rig.enabled()
        rig.until(rig.encoder.home(30.0, mode=13).done)
        found = rig.encoder.diagnosis()
        assert found.pages["encoder status"] == {
            "enabled": True,
            "homed": True,
            "error": False,
            "restart active": False,
            "encoder values valid": 2,
            "encoder homed": 1,
            "restart required": False,
        }
        assert found.pages["motion status"] == {"done": True, "homing job": False, "standstill": True}
        assert found.pages["values"] == {"actual position": pytest.approx(30.0), "actual velocity": 0.0}
        assert (found.state, set(found.words)) == ("ENABLED", {"StatusWord", "ErrorWord", "WarningWord"})

    @pytest.mark.requirement("DIA-074", "DIA-085")
    def test_alarm(self, rig):
        """A pending alarm is on the page of errors and in the list; the dump is text and JSON."""
        rig.enabled()
        rig.port.sensor_fault = True
        rig.cycles(2)
        found = rig.encoder.diagnosis()
        assert [name for name, on in found.pages["errors"].items() if on] == ["encoder"]
        assert found.alarms[0]["number"] == 411
        assert json.loads(json.dumps(found.as_dict()))["encoder status"]["error"] is True
        assert "[x] encoder" in found.text()
        assert found.state == "ENABLING"

"""Automatic transfer of drive and encoder parameters: states, values, alarms, repetition, waiting of
`MC_Power`.
"""

from __future__ import annotations

import pytest

from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis, SpeedAxis
from testcases.rigs import ControllerRig
from testcases.unit.motion_axis.conftest import REFERENCE

MS = 1_000_000
STATES = ("NOT_ADAPTED", "IN_ADAPTION", "ADAPTED", "NOT_APPLICABLE", "ADAPTION_ERROR")
FORMAT = {1: 1 << 31, 2: 2048, 3: 11, 4: 9, 5: 0}
BOTH = {"Actor.DataAdaption": 1, "Sensor[1].DataAdaption": 1}


class ParameterPort(SimulatedDrivePort):
    """A simulated drive with parameters, each answered after 3 ms; a missing one is refused, a lazy drive
    says nothing.
    """

    __slots__ = ("asked", "lazy", "parameters", "scheduler")

    def __init__(self, scheduler):
        super().__init__(cycle_s=0.004)
        self.scheduler = scheduler
        self.has_parameters = True
        self.telegram_number = 105
        self.lazy = False
        self.asked = []
        self.parameters = {
            (922, 0): 105,
            (108, 0): 0,
            (2000, 0): 6000.0,
            (1082, 0): 4500.0,
            (2003, 0): 40.0,
            (1520, 0): 60.0,
            (1521, 0): -55.0,
        }
        self.parameters |= {(979, at): value for at, value in FORMAT.items()}

    def read_parameter(self, number, index, answer):
        self.asked.append((number, index))
        if not self.lazy:
            value = self.parameters.get((number, index))
            reason = "" if value is not None else "06020000h object does not exist"
            self.scheduler.after(3 * MS, lambda: answer(value, reason))


class Rig(ControllerRig):
    """An axis on a drive with parameters."""

    def __init__(self, variables=None, *, speed=False, dsc=False, **parameters):
        super().__init__()
        self.port = ParameterPort(self.scheduler)
        self.port.dsc = dsc
        for name, value in parameters.items():
            number, index = (int(part) for part in name[1:].split("_"))
            if value is None:
                del self.port.parameters[number, index]
            else:
                self.port.parameters[number, index] = value
        kind = SpeedAxis if speed else PositioningAxis
        axis = kind(
            "axis1",
            self.port,
            cycle_ns=4 * MS,
            history=self.history,
            variables=({} if speed else REFERENCE) | (variables or {}),
        )
        self.control_axis(axis)
        self.runtime.start()

    def run(self, seconds=0.2):
        super().run(seconds)
        return self

    def states(self, part="Actor"):
        return [
            STATES.index(event.data["state"])
            for event in self.history.select(kind="axis.adaption")
            if event.data["part"] == part
        ]

    def alarm(self):
        return self.axis.var("ErrorDetail.Number")

    def reset(self, *, restart):
        job = self.axis.reset(restart=restart)
        assert self.scheduler.run_until(job.done, 10**9)


class TestTransfer:
    """What is transferred, and when."""

    @pytest.mark.requirement(
        "CFG-347",
        "CFG-348",
        "CFG-349",
        "CFG-346",
        "CFG-352",
        "CFG-353",
        "CFG-359",
        "CFG-360",
        "CFG-361",
        "VAR-106",
        "VAR-150",
    )
    def test_drive(self):
        """0, 1, 2; then reference speed, maximum speed and reference torque are those of the drive."""
        rig = Rig({"Actor.DataAdaption": 1}).run()
        assert rig.states() == [0, 1, 2]
        assert rig.axis.var("StatusDrive.AdaptionState") == 2
        place = "Actor.DriveParameter."
        assert [rig.axis.var(place + one) for one in ("ReferenceSpeed", "MaxSpeed", "ReferenceTorque")] == [
            6000.0,
            4500.0,
            40.0,
        ]
        assert rig.axis.variables.start_value("Actor.DriveParameter.ReferenceSpeed") == 3000.0
        assert rig.port.asked == [(number, 0) for number in (922, 108, 2000, 1082, 2003, 1520, 1521)]

    @pytest.mark.requirement(
        "CFG-367", "CFG-369", "CFG-370", "CFG-371", "CFG-372", "CFG-373", "CFG-346", "VAR-150", "CFG-375"
    )
    def test_rotary_encoder(self):
        """System, steps, fine resolutions, revolutions and reference speed are those of p0979 and p2000."""
        rig = Rig(
            {"Sensor[1].DataAdaption": 1, "Sensor[1].Type": 1},
            p979_2=512,
            p979_3=4,
            p979_4=5,
            p979_5=4096,
        ).run()
        assert rig.states("Sensor[1]") == [0, 1, 2]
        names = (
            "StepsPerRevolution",
            "FineResolutionXist1",
            "FineResolutionXist2",
            "DeterminableRevolutions",
            "ReferenceSpeed",
        )
        assert [rig.axis.var(f"Sensor[1].Parameter.{one}") for one in names] == [512, 4, 5, 4096, 6000.0]
        assert rig.axis.var("Sensor[1].System") == 1
        assert rig.axis.mechanics.increment == pytest.approx(10.0 / (512 * 16))
        assert rig.axis.var("Sensor[1].Type") == 1

    @pytest.mark.requirement("CFG-367", "CFG-368", "CFG-374", "CFG-375")
    def test_linear_encoder(self):
        """p0979[1] bit 0 is a linear encoder, the opposite of `Sensor.System`; the distance of lines comes in
        nm.
        """
        rig = Rig(
            {"Sensor[1].DataAdaption": 1, "Sensor[1].MountingMode": 1},
            p979_1=1 << 31 | 1,
            p979_2=20_000,
            p979_3=4,
        ).run()
        assert rig.axis.var("StatusSensor[1].AdaptionState") == 2
        assert rig.axis.var("Sensor[1].System") == 0
        assert rig.axis.var("Sensor[1].Parameter.Resolution") == pytest.approx(0.02)
        assert rig.axis.var("Sensor[1].Parameter.ReferenceVelocity") == 6000.0
        assert rig.axis.mechanics.increment == pytest.approx(0.02 / 16)

    @pytest.mark.requirement("CFG-358", "CFG-362", "CFG-363", "CFG-364")
    def test_linear_motor(self):
        """r0108 bit 12 is a linear motor: its reference values are velocity and force."""
        rig = Rig({"Actor.DataAdaption": 1}, p108_0=1 << 12).run()
        place = "Actor.LinearMotorDriveParameter."
        names = ("ReferenceVelocity", "MaxVelocity", "ReferenceForce")
        assert rig.axis.var("Actor.MotorType") == 1
        assert [rig.axis.var(place + one) for one in names] == [6000.0, 4500.0, 40.0]

    @pytest.mark.requirement("CFG-350", "CFG-354", "VAR-106")
    def test_not_selected(self):
        """Without it the state is 3, nothing is read, and enabling does not wait."""
        rig = Rig()
        power = rig.axis.power()
        rig.run()
        assert (rig.axis.var("StatusDrive.AdaptionState"), rig.axis.var("StatusSensor[1].AdaptionState")) == (
            3,
            3,
        )
        assert rig.port.asked == []
        assert power.Status is True

    @pytest.mark.requirement("CFG-350")
    def test_simulated(self):
        """A simulated axis transfers nothing though it is selected."""
        rig = Rig(BOTH | {"Simulation.Mode": 1}).run()
        assert rig.axis.var("StatusDrive.AdaptionState") == 3
        assert rig.port.asked == []

    @pytest.mark.requirement("MC-131", "CFG-353", "VAR-106")
    def test_power_waits(self):
        """`MC_Power` stays busy until the state is 2; nothing else waits meanwhile."""
        rig = Rig(BOTH)
        power = rig.axis.power()
        while (
            rig.axis.var("StatusDrive.AdaptionState") != 2
            or rig.axis.var("StatusSensor[1].AdaptionState") != 2
        ):
            assert (power.Status, rig.axis.var("StatusWord.X0")) == (False, False)
            rig.run(0.004)
            assert rig.scheduler.now < 10**9
        rig.run(0.05)
        assert power.Status is True

    def test_a_silent_drive_stops_nobody(self):
        """A drive that never answers leaves the axis waiting, with its cycle running."""
        rig = Rig(BOTH)
        rig.port.lazy = True
        power = rig.axis.power()
        rig.run(1.0)
        assert (power.Busy, power.Status, power.Error) == (True, False, False)
        assert rig.runtime.cycles >= 249
        assert rig.states() == [0, 1]


class TestRepetition:
    """It is done again after a restart of the object, and whenever the drive comes back."""

    @pytest.mark.requirement("CFG-345")
    def test_only_at_a_restart(self):
        """A parameter that changes in the running drive is taken over by the next restart, not before."""
        rig = Rig({"Actor.DataAdaption": 1}).run()
        rig.port.parameters[2000, 0] = 3000.0
        rig.run(1.0)
        assert rig.axis.var("Actor.DriveParameter.ReferenceSpeed") == 6000.0
        rig.reset(restart=True)
        rig.run()
        assert rig.axis.var("Actor.DriveParameter.ReferenceSpeed") == 3000.0
        assert rig.states() == [0, 1, 2, 0, 1, 2]

    @pytest.mark.requirement("CFG-345", "CFG-598")
    def test_at_a_restart_of_the_drive(self):
        """A drive that was away is read again: what was changed in it is in force then."""
        rig = Rig({"Actor.DataAdaption": 1}).run()
        rig.port.link = False
        rig.run(0.05)
        assert rig.axis.var("StatusDrive.AdaptionState") == 0
        rig.port.parameters[2000, 0] = 1500.0
        rig.port.link = True
        rig.run()
        assert rig.states() == [0, 1, 2, 0, 1, 2]
        assert rig.axis.var("Actor.DriveParameter.ReferenceSpeed") == 1500.0

    def test_an_answer_of_before_does_not_count(self):
        """What the drive says after it was lost belongs to a transfer that has been given up."""
        rig = Rig({"Actor.DataAdaption": 1})
        rig.run(0.006)
        assert rig.states() == [0, 1]
        rig.port.link = False
        rig.run(0.1)
        assert rig.states() == [0, 1, 0]
        assert len(rig.port.asked) < 5

    def test_the_homing_survives(self):
        """The same data again leave position and homing alone."""
        rig = Rig(BOTH, p979_2=131072, p979_3=0)
        rig.axis.power()
        rig.run()
        rig.axis.home(50.0)
        rig.run()
        rig.port.link = False
        rig.run(0.05)
        rig.port.link = True
        rig.run()
        assert rig.axis.var("StatusSensor[1].AdaptionState") == 2
        assert rig.axis.var("StatusWord.X5") is True
        assert rig.axis.var("ActualPosition") == pytest.approx(50.0)

    @pytest.mark.requirement("CFG-355", "VAR-106", "VAR-084")
    def test_other_encoder_data_on_return(self):
        """An encoder that comes back with other data raises 552 and ends the homing; an acknowledgement
        suffices.
        """
        rig = Rig(BOTH, p979_2=131072, p979_3=0)
        rig.axis.power()
        rig.run()
        rig.axis.home(50.0)
        rig.run()
        rig.port.link = False
        rig.run(0.05)
        rig.port.parameters[979, 2] = 4096
        rig.port.link = True
        rig.run()
        assert rig.axis.alarms.engine.is_pending(552)
        assert rig.axis.var("ErrorWord.X15") is True
        assert rig.axis.var("StatusWord.X5") is False
        assert rig.axis.var("Sensor[1].Parameter.StepsPerRevolution") == 4096
        rig.reset(restart=False)
        rig.run(0.02)
        assert not rig.axis.alarms.engine.is_pending(552)


class TestErrors:
    """What goes wrong, with its alarm."""

    @pytest.mark.requirement(
        "CFG-351", "CFG-355", "CFG-599", "CFG-623", "VAR-106", "VAR-084", "VAR-087", "TA-025"
    )
    @pytest.mark.parametrize(
        ("selected", "missing", "alarm", "cause", "name"),
        [
            ("Actor", "p2000_0", 102, 6, "p2000"),
            ("Actor", "p1082_0", 102, 2, "p1082"),
            ("Actor", "p2003_0", 102, 7, "p2003"),
            ("Actor", "p1520_0", 102, 3, "p1520"),
            ("Actor", "p1521_0", 102, 4, "p1521"),
            ("Actor", "p108_0", 102, 8, "r0108[0]"),
            ("Actor", "p922_0", 102, 9, "p0922"),
            ("Sensor[1]", "p979_1", 103, 2, "p0979[1]"),
            ("Sensor[1]", "p979_2", 103, 3, "p0979[2]"),
            ("Sensor[1]", "p979_3", 103, 4, "p0979[3]"),
            ("Sensor[1]", "p979_4", 103, 5, "p0979[4]"),
            ("Sensor[1]", "p979_5", 103, 6, "p0979[5]"),
        ],
    )
    def test_unreadable(self, selected, missing, alarm, cause, name):
        """A parameter that cannot be read: state 4, alarm 102 or 103 with its name, reaction 4, cleared by a
        restart alone.
        """
        rig = Rig({f"{selected}.DataAdaption": 1}, **{missing: None})
        rig.axis.power()
        rig.run()
        status = "StatusDrive" if selected == "Actor" else "StatusSensor[1]"
        assert rig.axis.var(f"{status}.AdaptionState") == 4
        entry = rig.axis.alarms.engine.highest
        assert (entry.number, entry.reaction, entry.info) == (alarm, 4, cause)
        assert name in entry.text
        assert "06020000h" in entry.text
        assert rig.axis.var("ErrorWord.X15") is True
        assert rig.axis.var("WarningWord.X15") is False
        assert rig.axis.var("StatusWord.X0") is False
        rig.reset(restart=False)
        rig.run(0.02)
        assert rig.alarm() == alarm
        number, index = (int(part) for part in missing[1:].split("_"))
        rig.port.parameters[number, index] = (
            FORMAT.get(index, 0)
            if number == 979
            else 105
            if number == 922
            else 0
            if number == 108
            else -3000.0
            if number == 1521
            else 3000.0
        )
        rig.axis.power(False)
        rig.run(0.02)
        rig.reset(restart=True)
        rig.run()
        assert rig.axis.var(f"{status}.AdaptionState") == 2
        assert rig.axis.var("ErrorWord") == 0

    @pytest.mark.requirement("CFG-375", "CFG-623")
    @pytest.mark.parametrize(
        ("parameters", "cause", "text"),
        [
            ({"p979_1": 0}, 2, "bit 31"),
            ({"p979_2": 0}, 3, "p0979, resolution = 0 is not within 1 to 8388608"),
            ({"p979_3": 32}, 4, "fine resolution of Gx_XIST1 = 32 is not within 0 to 31"),
            ({"p979_4": 32}, 5, "fine resolution of Gx_XIST2 = 32 is not within 0 to 31"),
            ({"p979_5": -1}, 6, "revolutions = -1 is not within 0 to 8388608"),
            ({"p979_2": 9_000_000}, 3, "resolution = 9e+06 is not within"),
            ({"p2000_0": float("nan")}, 7, "p2000 = nan is not above 0"),
        ],
    )
    def test_invalid_encoder(self, parameters, cause, text):
        """An invalid value is alarm 103 with the same cause as a missing one, the value and its range."""
        rig = Rig({"Sensor[1].DataAdaption": 1}, **parameters).run()
        entry = rig.axis.alarms.engine.highest
        assert (entry.number, entry.info) == (103, cause)
        assert text in entry.text

    @pytest.mark.requirement("CFG-623")
    @pytest.mark.parametrize(("name", "cause"), [("p2000_0", 6), ("p1082_0", 2), ("p2003_0", 7)])
    def test_invalid_drive(self, name, cause):
        """A reference or maximum value that is not above 0 is alarm 102 with the cause of a missing one."""
        rig = Rig({"Actor.DataAdaption": 1}, **{name: 0.0}).run()
        entry = rig.axis.alarms.engine.highest
        assert (entry.number, entry.info) == (102, cause)
        assert "is not above 0" in entry.text

    @pytest.mark.requirement("CFG-623")
    @pytest.mark.parametrize(("name", "cause"), [("p1520_0", 3), ("p1521_0", 4)])
    def test_invalid_torque_limits(self, name, cause):
        """A torque limit that is no number is alarm 102 with its own cause; any number is good."""
        rig = Rig({"Actor.DataAdaption": 1}, **{name: float("inf")}).run()
        entry = rig.axis.alarms.engine.highest
        assert (entry.number, entry.info) == (102, cause)
        assert "= inf is no torque" in entry.text
        rig = Rig({"Actor.DataAdaption": 1}, **{name: -3.0}).run()
        assert rig.axis.var("StatusDrive.AdaptionState") == 2

    @pytest.mark.requirement("CFG-623", "CFG-627")
    def test_no_parameter_access(self):
        """A connection without parameters: drive 102, encoder 103."""
        rig = Rig(BOTH)
        rig.port.has_parameters = False
        rig.run()
        assert {one.number for one in rig.axis.alarms.engine.pending} == {102, 103}
        assert rig.states() == [0, 4]

    @pytest.mark.requirement("CFG-376", "CFG-624", "CFG-357", "CFG-365", "TA-025", "PD-031")
    def test_other_telegram(self):
        """p0922 is compared and never changed: warning 111, which disturbs nothing."""
        rig = Rig({"Actor.DataAdaption": 1}, p922_0=3)
        rig.axis.power()
        rig.run()
        entry = next(one for one in rig.axis.alarms.engine.pending if one.number == 111)
        assert (entry.reaction, entry.info) == (0, 1)
        assert "telegram 105, p0922 = 3" in entry.text
        assert rig.axis.var("WarningWord.X15") is True
        assert rig.axis.var("ErrorWord") == 0
        assert rig.axis.var("StatusWord.X0") is True
        assert rig.axis.var("StatusDrive.AdaptionState") == 2
        assert rig.port.telegram_number == 105

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-376", "CFG-625", "CFG-366", "TA-025")
    @pytest.mark.parametrize(("kind", "revolutions", "cause"), [(1, 0, 2), (0, 1, 5), (0, 4096, 5)])
    def test_other_encoder_type(self, kind, revolutions, cause):
        """An encoder that is not absolute, or not incremental, is warning 112; the type stays as it is
        configured.
        """
        rig = Rig({"Sensor[1].DataAdaption": 1, "Sensor[1].Type": kind}, p979_5=revolutions).run()
        entry = next(one for one in rig.axis.alarms.engine.pending if one.number == 112)
        assert (entry.reaction, entry.info) == (0, cause)
        assert rig.axis.var("Sensor[1].Type") == kind
        assert rig.axis.var("WarningWord.X15") is True

    @pytest.mark.requirement("CFG-070", "CFG-624")
    def test_linear_motor_on_a_rotary_axis(self):
        """A linear motor in the drive of a rotary axis is warning 111, and the axis stays as it is."""
        rig = Rig({"Actor.DataAdaption": 1, "Properties.MotionType": 1}, p108_0=1 << 12).run()
        entry = next(one for one in rig.axis.alarms.engine.pending if one.number == 111)
        assert (entry.reaction, entry.info) == (0, 5)
        assert "linear motor" in entry.text
        assert (rig.axis.var("Actor.MotorType"), rig.axis.var("ErrorWord")) == (0, 0)
        assert rig.axis.var("WarningWord.X15") is True

    @pytest.mark.requirement("CFG-622")
    def test_maximum_beyond_the_telegram(self):
        """A drive that turns faster than twice its reference speed is limited, with warning 110."""
        rig = Rig({"Actor.DataAdaption": 1}, p1082_0=20_000.0).run()
        assert rig.axis.alarms.engine.is_pending(110)

    def test_speed_axis(self):
        """A speed axis transfers the drive alone."""
        rig = Rig({"Actor.DataAdaption": 1}, speed=True).run()
        assert rig.axis.var("StatusDrive.AdaptionState") == 2
        assert rig.axis.var("Actor.DriveParameter.MaxSpeed") == 4500.0


@pytest.mark.requirement("CFG-580", "CFG-581", "CFG-577")
@pytest.mark.parametrize(
    ("settings", "motor", "load"),
    [
        (
            {"Properties.MotionType": 1, "LoadGear.Numerator": 3},
            ("DriveParameter.MotorInertia", 0.001),
            0.002 * 9,
        ),
        (
            {"LoadGear.Numerator": 2},
            ("DriveParameter.MotorInertia", 0.001),
            0.002 * (2 * 3.141592653589793 / 0.01) ** 2 * 4,
        ),
        (
            {"Actor.MotorType": 1, "Sensor[1].System": 0},
            ("LinearMotorDriveParameter.MotorMass", 0.001),
            0.002,
        ),
    ],
    ids=["rotary", "linear", "linear motor"],
)
def test_inertias(settings, motor, load):
    """p1498 is converted to the load side: by the square of the gear, and of the lead in metres; a mass of a
    linear motor is one.
    """
    parameters = {"p341_0": 0.001, "p1498_0": 0.002}
    if "Actor.MotorType" in settings:
        parameters["p108_0"] = 1 << 12
    rig = Rig(
        {"Actor.DataAdaption": 1, "PositionControl.EnableDSC": True} | settings, dsc=True, **parameters
    ).run()
    assert rig.axis.var("StatusDrive.AdaptionState") == 2
    assert rig.axis.var(f"Actor.{motor[0]}") == pytest.approx(motor[1])
    assert rig.axis.var("Actor.LoadInertia") == pytest.approx(load)


def test_a_drive_without_inertias():
    """They are no reason for the transfer to fail: what the variables say stays."""
    rig = Rig(
        {"Actor.DataAdaption": 1, "PositionControl.EnableDSC": True, "Actor.LoadInertia": 7.0}, dsc=True
    ).run()
    assert (rig.axis.var("StatusDrive.AdaptionState"), rig.axis.var("Actor.LoadInertia")) == (2, 7.0)

"""A linear motor behind a PROFIdrive telegram: shares of a reference velocity and a reference force on the
wire.

The emulated machine is one with a screw of 10 mm; to the words of the telegram a motor that travels 10 mm per
revolution is a linear motor with 30 m/min for 3000 rpm, and 2 Nm are 1256.6 N.
"""

from __future__ import annotations

from math import tau

import pytest

from fieldbus.profidrive import from_n4
from testcases.unit.hil.test_hil_profidrive import bench, enabled

FORCE = 2.0 * tau / 0.010
LINEAR = {
    "Actor.MotorType": 1,
    "Sensor[1].System": 0,
    "Sensor[1].Parameter.Resolution": 10.0 / 2048,
    "Actor.LinearMotorDriveParameter.ReferenceVelocity": 30.0,
    "Actor.LinearMotorDriveParameter.MaxVelocity": 30.0,
    "Actor.LinearMotorDriveParameter.ReferenceForce": FORCE,
}


def word(machine, name):
    """Return a word of the telegram, signed."""
    return (machine.axis().port.telegram_view()[name] + 0x8000) % 0x10000 - 0x8000


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-276", "CFG-277", "CFG-518", "VAR-132", "CFG-362")
def test_motion():
    """100 mm/s are 6 of 30 m/min in NSOLL_B; the slide is where the axis says."""
    with bench(variables=LINEAR) as machine:
        axis = enabled(machine)
        origin = machine.drive().mechanics.position * 1000.0
        axis.move_velocity(100.0)
        machine.run_for(1.0)
        assert from_n4(axis.port.telegram_view()["NSOLL_B"]) == pytest.approx(0.2, abs=0.002)
        assert machine.drive().mechanics.velocity == pytest.approx(0.1, rel=0.01)
        assert machine.run_until(axis.move_absolute(40.0).done, 5.0)
        machine.run_for(0.2)
        assert machine.drive().mechanics.position * 1000.0 - origin == pytest.approx(40.0, abs=0.1)


@pytest.mark.requirement("CFG-403", "CFG-278", "CFG-402", "MC-515", "VAR-118", "VAR-119")
def test_forces_in_telegram_750():
    """A quarter of the reference force is 1000h in M_ADD1; limits are shares of it; M_ACT is the actual
    force.
    """
    with bench(profidrive={"torque_telegram": True}, variables=LINEAR) as machine:
        axis = enabled(machine)
        axis.torque_additive(FORCE / 4)
        axis.torque_range(FORCE / 2, -FORCE / 4)
        machine.run_for(0.05)
        assert word(machine, "M_ADD1") == 0x1000
        assert (word(machine, "M_LIMIT_POS"), word(machine, "M_LIMIT_NEG")) == (0x2000, -0x1000)
        assert machine.drive().core.torque_offset == pytest.approx(0.5)
        assert axis.var("StatusTorqueData.TotalForceAdditive") == pytest.approx(FORCE / 4)
        actual = word(machine, "M_ACT") / 0x4000 * FORCE
        assert axis.var("StatusTorqueData.ActualForce") == pytest.approx(actual)
        assert axis.var("StatusTorqueData.ActualTorque") == 0.0


@pytest.mark.requirement("CFG-278", "STP-142", "CFG-408")
def test_limit_in_the_telegram():
    """A limit of a quarter of the reference force takes three quarters away in MOMRED."""
    with bench(variables=LINEAR) as machine:
        axis = enabled(machine)
        axis.torque_limiting(FORCE / 4)
        machine.run_for(0.05)
        assert word(machine, "MOMRED") == 0x3000


@pytest.mark.requirement("VAR-133", "CFG-459", "CFG-460", "CFG-461")
def test_limit_of_the_setpoint_by_kind_of_axis(subtests):
    """S_V_LIMIT_B in the unit of the axis: by lead screw and gear, by 360 degrees and gear, or of a linear
    motor without either.
    """
    linear_motor = LINEAR | {"Actor.LinearMotorDriveParameter.ReferenceVelocity": 120.0}
    rotary = {"Properties.MotionType": 1, "LoadGear.Numerator": 10}
    for name, variables, share, reference, wanted in (
        ("linear axis", {"Mechanics.LeadScrew": 10.0}, 0x1999_999A, "DriveParameter.ReferenceSpeed", 200.0),
        (
            "linear axis with a gear",
            {"Mechanics.LeadScrew": 4.0, "LoadGear.Numerator": 5, "LoadGear.Denominator": 2},
            0x2000_0000,
            "DriveParameter.ReferenceSpeed",
            40.0,
        ),
        ("rotary axis", rotary, 0x2000_0000, "DriveParameter.ReferenceSpeed", 900.0),
        ("linear motor", linear_motor, 0x1000_0000, "LinearMotorDriveParameter.ReferenceVelocity", 500.0),
    ):
        with subtests.test(name), bench(variables=variables) as machine:
            axis = machine.axis()
            limit = share / 0x4000_0000 * axis.var(f"Actor.{reference}")
            assert limit / axis.object.mechanics.rpm_per_unit == pytest.approx(wanted)


@pytest.mark.exhaustive
@pytest.mark.requirement("CFG-399", "CTL-050", "CTL-051", "CTL-052", "CFG-577", "CFG-575")
def test_precontrolled_force_in_the_telegram():
    """50 kg at 1 m/s² are 50 N in M_ADD1 while the axis accelerates, and nothing at constant velocity."""
    settings = LINEAR | {
        "TorquePreControl.Mode": 1,
        "TorquePreControl.Scale": 100.0,
        "Actor.LoadInertia": 40.0,
        "Actor.LinearMotorDriveParameter.MotorMass": 10.0,
    }
    with bench(profidrive={"torque_telegram": True}, variables=settings) as machine:
        axis = enabled(machine)
        axis.move_velocity(300.0, Acceleration=1000.0, Jerk=0.0)
        machine.run_for(0.1)
        assert axis.var("Acceleration") == pytest.approx(1000.0)
        assert word(machine, "M_ADD1") == round(50.0 / FORCE * 0x4000)
        assert machine.drive().core.torque_offset == pytest.approx(50.0 * 0.010 / tau, rel=1e-2)
        machine.run_for(1.0)
        assert word(machine, "M_ADD1") == 0

"""Quantisation of the control difference: inside the quantum the position is not corrected."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from fieldbus.clock import S
from motion.kernel.position_control import PositionController
from testcases.unit.motion_axis.conftest import Rig

MODE = "PositionControl.ControlDifferenceQuantization.Mode"
VALUE = "PositionControl.ControlDifferenceQuantization.Value"


def output(difference, quantum):
    """Return what a controller with Kv = 10/s puts out for a standing axis."""
    cells = [SimpleNamespace(value=value) for value in (10.0, 100.0, 0.0, 0.0)]
    kv, kpc, constant, delay = cells
    controller = PositionController(
        kv=kv,
        kpc=kpc,
        time_constant=constant,
        additional_delay=delay,
        cycle_s=0.004,
        delay_s=0.008,
    )
    controller.quantum = quantum
    controller.reset(difference)
    return controller.step(difference, 0.0, 0.0)


@pytest.mark.requirement(
    "PTO-268", "PTO-269", "CFG-379", "CFG-381", "CFG-382", "CFG-383", "CTL-012", "CTL-047"
)
@pytest.mark.parametrize(
    ("difference", "quantum", "corrected"),
    [
        (0.06, 0.1, 0.0),
        (0.25, 0.1, 0.2),
        (0.09, 0.1, 0.0),
        (-0.25, 0.1, -0.2),
        (-0.09, 0.1, 0.0),
        (0.3, 0.1, 0.3),
        (-0.3, 0.1, -0.3),
        (0.04, 0.05, 0.0),
        (0.06, 0.05, 0.05),
        (0.03, 0.05, 0.0),
        (0.07, 0.05, 0.05),
        (0.06, 0.0, 0.06),
    ],
)
def test_difference_is_rounded_towards_zero(difference, quantum, corrected):
    """0.25 with 0.1 is 0.2, 0.09 is 0, a whole multiple stays one; without quantisation nothing is
    rounded.
    """
    assert output(difference, quantum) == pytest.approx(10.0 * corrected, abs=1e-9)


@pytest.mark.requirement("CTL-013", "PTO-268", "CFG-379", "CFG-380", "CFG-381", "CTL-012")
@pytest.mark.parametrize(("mode", "quantum"), [(0, 0.0), (1, 10.0 / 131072), (2, 0.05)])
def test_the_mode_chooses_the_quantum(mode, quantum):
    """0 none, 1 the resolution of the encoder, 2 the value; it acts after a restart of the object."""
    rig = Rig(variables={VALUE: 0.05, MODE: mode})
    assert rig.axis.servo.controller.quantum == pytest.approx(quantum)


@pytest.mark.requirement("CFG-381", "CFG-382")
def test_an_axis_rests_inside_the_quantum():
    """A standing axis that is displaced by 0.04 mm with 0.05 puts out nothing, with 0.01 it does."""
    for quantum, moves in ((0.05, False), (0.01, True)):
        rig = Rig(variables={VALUE: quantum, MODE: 2})
        rig.axis.power()
        rig.scheduler.run_for(S)
        rig.port.turn(0.04 / 10.0 * 6.283185307179586)
        speeds = []
        for _ in range(20):
            rig.scheduler.run_for(4_000_000)
            speeds.append(rig.axis.var("VelocitySetpoint"))
        assert any(speeds) is moves

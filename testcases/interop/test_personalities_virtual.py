"""A controller that knows no quirks, the unmodified `canopen` library, on a drive of every personality."""

from __future__ import annotations

import pytest

from emulators.drive.cia402 import DriveConfig, load_personality, personality_names
from fieldbus.cia402 import DriveState
from testcases.interop.conftest import NODE, library_master, make_station
from testcases.interop_master import IMMEDIATELY, REVOLUTION

pytestmark = pytest.mark.exhaustive


@pytest.fixture
def of_personality(request):
    """Return a function that gives a context with station and library for a personality."""

    def make(name):
        config = load_personality(name).apply(DriveConfig.reference(node_id=NODE))
        return make_station(f"{request.node.name}-{name}", config)

    return make


@pytest.mark.parametrize("name", personality_names())
def test_the_library_drives_every_personality(of_personality, name):
    """Commission, enable, run, quick stop, fault, reset, and run again."""
    station = of_personality(name)
    with library_master(station) as master:
        station.scheduler.run_until(
            lambda: station.drive.state is not DriveState.NOT_READY_TO_SWITCH_ON, 2_000_000_000
        )
        master.commission()
        master.enable("PROFILED VELOCITY")
        master.run_at(600.0)
        assert station.drive.core.speed_rpm == pytest.approx(600.0, rel=1e-2)
        master.node.state = "QUICK STOP ACTIVE"
        station.run(1.0)
        assert station.drive.core.standing
        master.node.state = "SWITCH ON DISABLED"
        station.drive.raise_fault(0x4310)
        station.run(0.1)
        assert master.node.emcy.log[-1].code == 0x4310
        master.node.state = "SWITCH ON DISABLED"
        master.enable("PROFILED VELOCITY")
        master.run_at(-300.0)
        master.close()


@pytest.mark.parametrize("name", personality_names())
def test_positioning_by_the_library(of_personality, name):
    """A setpoint with bit 5 moves every personality; without it one ignores it, which its documentation
    says.
    """
    station = of_personality(name)
    with library_master(station) as master:
        station.run(1.0)
        master.commission()
        master.enable("PROFILED POSITION")
        if load_personality(name).quirks.setpoint_needs_bit_5:
            with pytest.raises(AssertionError, match="setpoint acknowledge"):
                master.give_setpoint(REVOLUTION)
            assert station.drive.axis.actual_position == 0
        master.give_setpoint(2 * REVOLUTION, IMMEDIATELY)
        station.run(2.0)
        assert station.drive.axis.actual_position == pytest.approx(2 * REVOLUTION, abs=2)
        master.close()

"""Homing guided by the NC: sequence, reference modes, sensor sources, abort."""

import pytest

from motion.drives.mark import MarkSearch
from motion.nc.blocks import HomingMode, MC_ReadApplicationRequest
from motion.nc.parameters import catalogue
from testcases.unit.motion_nc.nc_rig import Rig

pytestmark = pytest.mark.exhaustive


class Mark(MarkSearch):
    """A mark that a test lets be found."""

    def _begin(self):
        pass

    def _end(self):
        pass

    def pass_by(self, raw):
        self._finish(raw)


class Machine:
    """A rig with a reference cam from 50 mm to 60 mm."""

    def __init__(
        self, start=0.0, cam=(50.0, 60.0), source="PLC", mark=None, mark_at=None, home=True, **parameters
    ):
        parameters = {"ctrl__pos_kv": 50.0, **parameters}
        if source != "PLC":
            parameters["enc__homing_sensor_source"] = f"Digital Input {source}"
        self.rig = Rig(**parameters)
        self.rig.device.position = start
        self.rig.enabled()
        self.cam, self.source = cam, source
        self.mark, self.mark_at = mark, mark_at
        if mark is not None:
            self.rig.device.searches[mark[0]] = mark[1]
        self.rows = []
        self.home = self.rig.handle.home() if home else None
        self.set_cam()

    @property
    def on_cam(self):
        return self.cam[0] <= self.rig.device.position <= self.cam[1]

    def set_cam(self):
        if self.source == "PLC":
            if self.home is not None:
                self.home.set(bCalibrationCam=self.on_cam)
        else:
            self.rig.device.digital_inputs = self.on_cam << (self.source - 1)

    def run(self, cycles=20000):
        rig = self.rig
        for _ in range(cycles):
            before = rig.device.position
            rig.cycles()
            self.set_cam()
            after = rig.device.position
            if self.mark is not None and self.mark[1].searching and self.mark_at is not None:
                passed = min(before, after) <= self.mark_at < max(before, after)
                if passed:
                    self.mark[1].pass_by(round(self.mark_at / rig.device.scaling))
            velocity = round(rig.generator.v, 6)
            row = (rig.ref.NcToPlc.HomingState, velocity)
            if not self.rows or self.rows[-1] != row:
                self.rows.append(row)
            if self.home.ended():
                break
        return self

    @property
    def states(self):
        found = []
        for state, _ in self.rows:
            if not found or found[-1] != state:
                found.append(state)
        return found

    def speeds(self, state):
        return {velocity for one, velocity in self.rows if one == state}


@pytest.mark.requirement(
    "NC-101", "NC-102", "NC-301", "NC-302", "NC-303", "NC-306", "NC-307", "NC-308", "NC-309", "NC-311",
    "NC-313",    "NC-314", "NC-320",
)  # fmt: skip
def test_default_sequence(subtests):
    """Towards the cam, off it, stop at its falling edge; the edge has the home position, the standstill its
    way more.
    """
    for invert_cam, invert_sync in ((False, True), (False, False), (True, False), (True, True)):
        with subtests.test(invert_cam=invert_cam, invert_sync=invert_sync):
            side = -1.0 if invert_cam else 1.0
            cam = (50.0, 60.0) if side > 0.0 else (-60.0, -50.0)
            machine = Machine(
                cam=cam,
                axis__homing_velocity_towards_cam=30.0,
                axis__homing_velocity_off_cam=12.0,
                enc__homing_invert_cam_search=invert_cam,
                enc__homing_invert_sync_search=invert_sync,
                enc__home_position=100.0,
            )
            rig = machine.rig
            rig.cycles(8)
            assert rig.status("HomingBusy")
            assert not rig.status("Homed")
            machine.run()
            assert machine.home.Done
            assert machine.states == [2, 3, 4, 6, 0] or machine.states == [1, 2, 3, 4, 6, 0]
            off = -1.0 if invert_sync else 1.0
            assert side * 30.0 in machine.speeds(2)
            assert off * 12.0 in machine.speeds(4)
            assert all(velocity * off >= -1e-9 for velocity in machine.speeds(4))
            assert rig.status("Homed")
            assert not rig.status("HomingBusy")
            edge = cam[0] if off < 0.0 else cam[1]
            assert rig.axis.position - rig.device.position == pytest.approx(100.0 - edge, abs=0.1)
            assert abs(rig.axis.position - 100.0) < 2.0
            assert rig.generator.s == pytest.approx(rig.axis.position, abs=0.01)


@pytest.mark.requirement("NC-315")
def test_default_values():
    """Without parameters of its own the search goes positive and off the cam negative, both at 30 mm/s."""
    machine = Machine().run()
    assert 30.0 in machine.speeds(2)
    assert -30.0 in machine.speeds(4)


@pytest.mark.requirement("NC-312")
def test_start_on_the_cam():
    """On the cam the search for it is skipped."""
    machine = Machine(start=55.0).run()
    assert machine.home.Done
    assert 2 not in machine.states
    assert all(velocity <= 0.0 for _, velocity in machine.rows)


@pytest.mark.requirement("NC-305", "NC-328", "NC-329", "NC-108")
def test_sensor_sources(subtests):
    """The cam comes from bit 5 of the control word, or from the input that is selected and no other."""
    for source in ("PLC", *range(1, 9)):
        with subtests.test(source=source):
            machine = Machine(source=source).run()
            assert machine.home.Done
            if source != "PLC":
                wrong = Machine(source=source)
                wrong.source = source % 8 + 1
                wrong.run(1500)
                assert wrong.rig.device.position > 62.0
                assert not wrong.home.ended()
    machine = Machine(source=3)
    machine.home.set(bCalibrationCam=True)
    machine.run(100)
    assert machine.states[-1] == 2
    machine = Machine()
    machine.rig.cycles(2)
    assert machine.rig.axis.plc_to_nc.ControlDWord & 0x20 == 0
    machine.home.set(bCalibrationCam=True)
    machine.rig.cycles(3)
    assert machine.rig.axis.plc_to_nc.ControlDWord & 0x20


@pytest.mark.requirement("NC-310", "NC-321", "NC-322", "NC-323", "NC-326")
def test_latched_events(subtests):
    """The latched position after the cam is the reference, however the edges of the cam move."""
    for text, number in (
        ("Hardware Sync (Feedback reference pulse)", 1),
        ("Hardware Latch 1 (pos. edge)", 2),
        ("Hardware Latch 1 (neg. edge)", 3),
    ):
        places = set()
        for jitter in (-1.0, -0.3, 0.0, 0.7, 1.0):
            with subtests.test(mode=text, jitter=jitter):
                machine = Machine(
                    cam=(50.0 + jitter, 60.0),
                    mark=(number, Mark()),
                    mark_at=45.0,
                    enc__reference_mode=text,
                    enc__home_position=7.0,
                ).run()
                assert machine.home.Done
                assert 5 in machine.states
                rig = machine.rig
                places.add(round((rig.axis.position - rig.axis.encoder.soft_increments * 0.0001) / 0.0001))
                assert rig.axis.homing.latch_difference == pytest.approx(-5.0 - jitter, abs=0.25)
        assert places == {round((7.0 - 45.0) / 0.0001)}
        machine = Machine(enc__reference_mode=text)
        machine.run(10)
        assert machine.home.ErrorID == 0x4B04


@pytest.mark.requirement("NC-324")
def test_software_sync():
    """The overflow of the count after a turn is the reference: raw count modulo sub mask + 1."""
    machine = Machine(
        enc__reference_mode="Software Sync", enc__encoder_sub_mask=99999, enc__home_position=1.0
    ).run()
    assert machine.home.Done
    rig = machine.rig
    # Left of the cam, which begins at 50 mm, the count of 10 mm turns overflows at 50 mm or at 40 mm.
    offset = rig.axis.position - rig.axis.encoder.soft_increments * 0.0001
    assert offset == pytest.approx(1.0 - 50.0 if rig.axis.homing.latch_difference > -1.0 else 1.0 - 40.0)


@pytest.mark.requirement("NC-776", "NC-316")
def test_missing_signals():
    """Without cam, mark or latch the sequence goes on without an end; the first falling edge of a bouncing
    cam counts.
    """
    machine = Machine(cam=(1e9, 1e9)).run(10000)
    assert machine.home.Busy
    assert machine.rig.device.position > 500.0
    machine = Machine(mark=(1, Mark()), enc__reference_mode="Hardware Sync (Feedback reference pulse)").run(
        10000
    )
    assert machine.home.Busy
    assert machine.states[-1] == 5
    assert machine.rig.device.position < 0.0


@pytest.mark.requirement("NC-133")
def test_software_limits_during_homing():
    """A software limit does not act on the sequence, and does so again afterwards."""
    machine = Machine(axis__soft_limit_max=20.0, axis__soft_limit_max_enable=True).run()
    assert machine.home.Done
    rig = machine.rig
    assert rig.handle.error_id == 0
    refused = rig.handle.move_absolute(20.1, Velocity=10.0)
    rig.cycles(2)
    assert refused.ErrorID == 0x4461


def test_aborted():
    """A stop, an error or the loss of the enable ends the sequence without a reference."""
    for reason in ("stop", "error", "enable"):
        machine = Machine()
        machine.run(300)
        rig = machine.rig
        if reason == "stop":
            rig.handle.stop()
        elif reason == "error":
            rig.axis.raise_error(0x4550)
        else:
            rig.handle.power(False)
        rig.cycles(400)
        assert machine.home.CommandAborted or machine.home.Error
        assert machine.home.CommandAborted is (reason == "stop")
        assert not rig.status("Homed")
        assert not rig.status("HomingBusy")
        assert rig.generator.v == 0.0


@pytest.mark.requirement("NC-325")
def test_application():
    """The NC does not move: it asks the PLC, which homes by itself and sets the flag."""
    machine = Machine(enc__reference_mode="Application (PLC code)")
    rig = machine.rig
    asked = rig.handle.run(MC_ReadApplicationRequest(rig.ref, Enable=True))
    rig.cycles(50)
    assert rig.generator.s == 0.0
    assert rig.ref.NcToPlc.OpModeDWord >> 23 & 1
    assert asked.ApplicationRequestType == 1
    assert machine.home.Busy
    rig.until(rig.handle.home(25.0, mode=HomingMode.MC_Direct).done)
    rig.cycles(2)
    assert asked.ApplicationRequestType == 0
    assert machine.home.Done
    assert rig.status("Homed")
    assert rig.axis.position == pytest.approx(25.0)
    rig.until(rig.handle.home(mode=HomingMode.MC_ResetCalibration).done)
    rig.cycles()
    assert not rig.status("Homed")
    rig.until(rig.handle.home(mode=HomingMode.MC_ForceCalibration).done)
    rig.cycles()
    assert rig.status("Homed")
    assert rig.axis.position == pytest.approx(25.0)


@pytest.mark.requirement("NC-327", "NC-297")
def test_cam_near_the_overflow():
    """Where the cam falls within its jitter of the overflow the reference jumps by a turn; half a turn away
    it does not. Latch Pos. Diff. is the way from the cam to the event.
    """
    for edge, jumps in ((50.0, True), (55.0, False)):
        found, differences = [], []
        for jitter in (-0.5, 0.5):
            machine = Machine(
                cam=(edge + jitter, 70.0),
                enc__reference_mode="Software Sync",
                enc__encoder_sub_mask=99999,
            ).run()
            rig = machine.rig
            found.append(rig.axis.position - rig.axis.encoder.soft_increments * 0.0001)
            differences.append(rig.axis.homing.latch_difference)
        assert abs(found[0] - found[1]) == pytest.approx(10.0 if jumps else 0.0, abs=1e-6)
        if not jumps:
            assert all(-7.0 < one < -3.0 for one in differences)  # about half a turn, backwards


@pytest.mark.requirement("NC-304")
def test_reference_modes():
    """There are six reference modes; each one without its signal in the hardware is refused or waits."""
    choices = catalogue()["enc.reference_mode"].choices
    assert choices == (
        "Default",
        "Hardware Sync (Feedback reference pulse)",
        "Hardware Latch 1 (pos. edge)",
        "Hardware Latch 1 (neg. edge)",
        "Software Sync",
        "Application (PLC code)",
    )
    for number, mode in enumerate(choices):
        rig = Rig(enc__reference_mode=mode).enabled()
        home = rig.handle.home()
        rig.cycles(20)
        if number in {1, 2, 3}:
            assert home.ErrorID == 0x4B04
        elif number == 5:
            assert rig.axis.homing.application_request
            assert rig.generator.v == 0.0
        else:
            assert rig.axis.homing.busy

"""Position correction and backlash: signs, filter, limiter, reference edges, both interfaces, homing."""

from itertools import pairwise

import pytest

from motion.nc.correction_blocks import CorrectionMode, DisableMode
from motion.nc.device import POSITION
from testcases.unit.motion_nc.nc_rig import Plant, Rig, T

pytestmark = pytest.mark.exhaustive


class _Play(Plant):
    """A load behind play: the encoder sits on the motor (positive backlash), or on the load (neutral), or
    sees the motor through the play while the load moves at once (negative).
    """

    def __init__(self, scaling, play=0.5, kind="positive", interface=None):
        super().__init__(scaling)
        if interface is not None:
            self.interface = interface
        self.play, self.kind = play, kind
        self.other = 0.0
        """What is behind the play."""
        self.wanted = 0

    def read(self):
        if self.interface == POSITION:
            if self.operating:
                self.position = self.wanted * self.scaling
        else:
            self.position += self.velocity * T
        # Left edge: positive motion carries at once, negative motion loses the play first.
        if self.position > self.other:
            self.other = self.position
        elif self.position < self.other - self.play:
            self.other = self.position + self.play
        seen = self.position if self.kind == "positive" else self.other
        self.raw = round(seen / self.scaling)

    @property
    def load(self):
        return self.position if self.kind == "negative" else self.other

    def write(self, outputs):
        super().write(outputs)
        self.wanted = outputs.position


def _rig(kind="positive", interface=None, **values):
    return Rig(
        device=lambda scaling: _Play(scaling, kind=kind, interface=interface),
        axis__position_correction=True,
        **values,
    ).enabled()


def _to(rig, *targets):
    for target in targets:
        rig.until(rig.handle.move_absolute(target, Velocity=100.0).done)
        rig.cycles(300)


@pytest.mark.requirement("NC-206", "NC-207", "NC-596", "NC-598", "NC-194")
def test_signs_of_the_correction():
    """Actual position is the encoder plus the correction, the output to a drive with a position interface the
    set position less it; without the parameter nothing acts.
    """
    rig = Rig(axis__position_correction=True).enabled()
    rig.ref.PlcToNc.PositionCorrection = 1.0
    rig.cycles(2)
    assert rig.axis.following_error == pytest.approx(-1.0, abs=0.05)
    assert rig.axis.encoder.position == pytest.approx(rig.axis.encoder.uncorrected + 1.0)
    rig.cycles(500)
    assert rig.device.position == pytest.approx(-1.0, abs=0.001)
    assert rig.axis.position == pytest.approx(0.0, abs=0.001)
    assert rig.ref.NcToPlc.ActPosWithoutPosCorrection == pytest.approx(-1.0, abs=0.001)
    rig = Rig(axis__position_correction=False).enabled()
    rig.ref.PlcToNc.PositionCorrection = 3.0
    rig.cycles(50)
    assert rig.axis.position == rig.axis.motion.s == 0.0


@pytest.mark.requirement("NC-597", "NC-595", "NC-593")
def test_both_interfaces(subtests):
    """A correction of 0.2 mm moves the machine in the same way with both interfaces; with a position
    interface it never shows as a following error.
    """
    for interface in (None, POSITION):
        with subtests.test(interface=interface):
            rig = _rig(interface=interface)
            _to(rig, 10.0)
            before = rig.device.position
            rig.ref.PlcToNc.PositionCorrection = 0.2
            worst = 0.0
            for _ in range(400):
                rig.cycles()
                worst = max(worst, abs(rig.axis.following_error))
            assert rig.device.position - before == pytest.approx(-0.2, abs=0.002)
            assert rig.axis.position == pytest.approx(10.0, abs=0.002)
            if interface is None:
                assert worst > 0.15  # the difference makes the controller move
            else:
                assert rig.axis.following_error == pytest.approx(0.0, abs=1e-4)


@pytest.mark.requirement("NC-599", "NC-600", "NC-601", "NC-602", "NC-603", "NC-605")
def test_reference_edges(subtests):
    """Left edge: corrected by +backlash in negative motion; right edge: by -backlash in positive motion; else
    not at all, whatever the sign of the backlash.
    """
    for backlash in (0.5, -0.5):
        for right, forward, backward in ((False, 0.0, backlash), (True, -backlash, 0.0)):
            with subtests.test(backlash=backlash, right=right):
                rig = Rig(axis__position_correction=True).enabled()
                block = rig.handle.compensate_backlash(backlash, CompensationInPositiveDirection=right)
                _to(rig, 20.0)
                assert block.Enabled
                assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(forward)
                assert rig.axis.encoder.uncorrected == pytest.approx(20.0 - forward, abs=0.002)
                _to(rig, 5.0)
                assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(backward)
                assert rig.axis.encoder.uncorrected == pytest.approx(5.0 - backward, abs=0.002)
                assert rig.axis.position == pytest.approx(5.0, abs=0.002)
    rig = Rig().enabled()
    block = rig.handle.compensate_backlash(0.5)
    rig.cycles(2)
    assert block.ErrorID == 0x4B04
    assert rig.ref.PlcToNc.PositionCorrection == 0.0


@pytest.mark.requirement("NC-604", "NC-588", "NC-786", "NC-196")
def test_positive_backlash():
    """0 to 100 to 50 with a play of 0.5: the load stands at 50.5, with compensation at 50.0 and the encoder
    at 49.5; the parameter Backlash alone does nothing.
    """
    rig = _rig(axis__backlash=0.5)
    _to(rig, 100.0, 50.0)
    assert rig.device.load == pytest.approx(50.5, abs=0.02)
    assert rig.axis.position == pytest.approx(50.0, abs=0.002)
    rig = _rig()
    rig.handle.compensate_backlash(0.5)
    _to(rig, 100.0, 50.0)
    assert rig.device.load == pytest.approx(50.0, abs=0.02)
    assert rig.device.raw * 0.0001 == pytest.approx(49.5, abs=0.002)
    assert rig.axis.position == pytest.approx(50.0, abs=0.002)
    _to(rig, 80.0)
    assert rig.device.load == pytest.approx(80.0, abs=0.02)


@pytest.mark.requirement("NC-589", "NC-591", "NC-590", "NC-786")
def test_negative_and_neutral_backlash():
    """Negative: the load travels too far by the play, and the same function with the other sign compensates
    it; neutral: the loop drives through the play by itself.
    """
    rig = _rig("negative")
    _to(rig, 100.0, 50.0)
    assert rig.device.load == pytest.approx(49.5, abs=0.1)
    rig = _rig("negative")
    rig.handle.compensate_backlash(-0.5)
    _to(rig, 100.0, 50.0)
    assert rig.device.load == pytest.approx(50.0, abs=0.1)
    rig = _rig("neutral")
    _to(rig, 100.0, 50.0)
    assert rig.device.load == pytest.approx(50.0, abs=0.02)


@pytest.mark.requirement("NC-594", "NC-319")
def test_homing_without_correction():
    """With compensation off before homing the reference is at the edge of the last direction of motion; a
    correction that is left on falsifies it by its value.
    """
    found = []
    for corrected in (False, True):
        rig = _rig()
        block = rig.handle.compensate_backlash(0.5)
        _to(rig, 20.0, 10.0)
        if not corrected:
            block.set(Enable=False)
            rig.until(lambda block=block: not block.Active)
            rig.cycles(300)
        rig.handle.home(0.0, mode=1)
        rig.cycles(2)
        found.append(rig.axis.encoder.uncorrected)
    assert found[0] == pytest.approx(0.0, abs=0.003)
    assert found[1] == pytest.approx(-0.5, abs=0.003)


@pytest.mark.requirement("NC-208")
def test_correction_limiter(subtests):
    """The limiter writes the value directly, with a limited acceleration, or over a way of the axis; it needs
    the parameter.
    """
    rig = Rig(axis__position_correction=True, axis__position_lag_max=50.0).enabled()
    block = rig.handle.correct_position(2.0)
    rig.cycles(1)
    assert rig.ref.PlcToNc.PositionCorrection == 2.0
    assert not block.Limiting
    block.set(
        CorrectionMode=CorrectionMode.POSITIONCORRECTION_MODE_FAST,
        PositionCorrectionValue=5.0,
        Acceleration=100.0,
    )
    values = [rig.ref.PlcToNc.PositionCorrection]
    for _ in range(400):
        rig.cycles()
        values.append(rig.ref.PlcToNc.PositionCorrection)
    assert values[-1] == pytest.approx(5.0)
    assert max(values) <= 5.0 + 1e-9
    speeds = [(after - before) / T for before, after in pairwise(values)]
    steepest = max(abs(after - before) / T for before, after in pairwise(speeds))
    assert steepest <= 1.1 * 100.0
    assert not block.Limiting
    block.set(
        CorrectionMode=CorrectionMode.POSITIONCORRECTION_MODE_FULLLENGTH,
        PositionCorrectionValue=0.0,
        CorrectionLength=50.0,
    )
    rig.cycles(100)
    assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(5.0)  # the axis stands
    assert block.Limiting
    start = rig.axis.motion.s
    rig.handle.move_velocity(20.0)
    rig.until(lambda: not block.Limiting, 60.0)
    assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(0.0, abs=1e-6)
    assert rig.axis.motion.s - start > 45.0
    rig = Rig().enabled()
    block = rig.handle.correct_position(2.0)
    rig.cycles(2)
    assert block.ErrorID == 0x4B04
    assert rig.ref.PlcToNc.PositionCorrection == 0.0


def test_ramp_and_disable_modes():
    """The correction changes with Ramp; switched off it stays or goes to 0; another user keeps his share."""
    for mode, left in ((DisableMode.DisableModeHold, 0.5), (DisableMode.DisableModeReset, 0.0)):
        rig = Rig(axis__position_correction=True).enabled()
        rig.ref.PlcToNc.PositionCorrection = 3.0
        block = rig.handle.compensate_backlash(0.5, Ramp=5.0, DisableMode=mode)
        rig.handle.move_velocity(-50.0)
        rig.cycles(20)
        assert block.Active
        assert 3.0 < rig.ref.PlcToNc.PositionCorrection < 3.3
        rig.cycles(200)
        assert not block.Active
        assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(3.5)
        block.set(Enable=False)
        rig.cycles(200)
        assert rig.ref.PlcToNc.PositionCorrection == pytest.approx(3.0 + left)

"""A drive without a bus: the PROFIdrive general state machine on an ideal motor.

The technology object's own simulation of a drive and the fixture of the instruction timelines ("actual value
= setpoint one application cycle later"): motor speed follows the setpoint exactly in S4, the drive's own
ramps are exact, coasting is a constant deceleration.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from math import tau
from typing import Final

from typing_extensions import override

from motion.drives.mark import IdealMarkSearch
from motion.drives.port import STW1, ZSW1, DrivePort

_ZSW1: Final = {1: 0x0240, 2: 0x0201, 3: 0x0203, 4: 0x0207, 5: 0x0203}
_HALF: Final = 1 << 31
_FULL: Final = 1 << 32


class DriveStage(IntEnum):
    """States of the PROFIdrive general state diagram (STP-268 to STP-272)."""

    S1 = 1
    S2 = 2
    S3 = 3
    S4 = 4
    S5 = 5


class SimulatedDrivePort(DrivePort):
    """An ideal motor behind the PROFIdrive state machine.

    Args:
        cycle_s: Application cycle, s.
        increments_per_revolution: Encoder increments per motor revolution.
        max_speed_rpm: p1082.
        off1_ramp_s: p1121, from p1082 to zero.
        off3_ramp_s: p1135, from p1082 to zero.
        coast_s: Time in which friction stops the motor from p1082.
        zero_marks: Places of zero marks, increments.
        probe_edges: Places of the rising and of the falling edges of a probe, increments.

    Attributes `fault`, `link`, `inhibited` and `autonomous_stop` break it: a drive fault, the loss of the
    link, a drive that stays in S1, braking by the drive itself.

    """

    __slots__ = (
        "_acknowledge",
        "_angle",
        "_braking",
        "_coast",
        "_cycle",
        "_edges",
        "_increments",
        "_off1",
        "_off3",
        "_on",
        "_search",
        "_setpoint",
        "_speed",
        "_stw1",
        "autonomous_stop",
        "fault",
        "fault_latched",
        "inhibited",
        "link",
        "stage",
        "switches",
    )

    def __init__(
        self,
        *,
        cycle_s: float,
        increments_per_revolution: int = 131072,
        max_speed_rpm: float = 3000.0,
        off1_ramp_s: float = 1.0,
        off3_ramp_s: float = 0.5,
        coast_s: float = 3.0,
        zero_marks: Iterable[int] = (),
        probe_edges: tuple[Iterable[int], Iterable[int]] = ((), ()),
    ) -> None:
        super().__init__()
        self._cycle = cycle_s
        self._increments = increments_per_revolution
        self._off1 = max_speed_rpm / off1_ramp_s
        self._off3 = max_speed_rpm / off3_ramp_s
        self._coast = max_speed_rpm / coast_s
        self._stw1 = 0
        self._setpoint = 0.0
        self._speed = 0.0
        self._angle = 0.0
        self._braking = 0.0
        self._on = False
        self._acknowledge = False
        self.stage = DriveStage.S1
        self.fault = False
        """The cause of a drive fault is present."""
        self.fault_latched = False
        self.link = True
        self.inhibited = False
        self.autonomous_stop = False
        self.mark = self._search = IdealMarkSearch(*zero_marks)
        rises, falls = (IdealMarkSearch(*places) for places in probe_edges)
        self.probes = ((rises, falls),)
        self._edges = rises, falls
        self.switches = 0
        """Digital inputs at the drive."""

    @property
    def angle(self) -> float:
        """Angle of the shaft, rad."""
        return self._angle

    @property
    def written(self) -> tuple[int, float]:
        """Control word and speed setpoint (rpm) as the controller has last written them."""
        return self._stw1, self._setpoint

    def turn(self, angle: float) -> None:
        """Turn the shaft from outside by an angle, rad, within this instant."""
        self._angle += angle

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        self._stw1 = stw1
        self._setpoint = speed_rpm

    def read(self) -> None:
        """Let one cycle pass in the drive, then show its state."""
        self._transitions()
        self._move()
        self.link_ok = self.link
        if not self.link:
            self.zsw1 = 0
            return
        word = _ZSW1[self.stage]
        if self.stage is not DriveStage.S5 or self._braking != self._off3:
            word |= ZSW1.NO_OFF3 if self._stw1 & STW1.NO_OFF3 else 0
        word |= ZSW1.NO_OFF2 if self._stw1 & STW1.NO_OFF2 else 0
        if self.stage is DriveStage.S5 and self._braking == self._off3:
            word |= ZSW1.NO_OFF2
        if self.fault_latched:
            word |= ZSW1.FAULT
        self.zsw1 = word
        self.inputs = self.switches
        self.actual_speed_rpm = self._speed
        count = round(self._angle / tau * self._increments)
        self.encoder_increments = (count + _HALF) % _FULL - _HALF

    def _transitions(self) -> None:
        stw1 = self._stw1 if self.link else 0
        acknowledge = bool(stw1 & STW1.ACKNOWLEDGE)
        if acknowledge and not self._acknowledge and not self.fault:
            self.fault_latched = False
        self._acknowledge = acknowledge
        if self.fault:
            self.fault_latched = True
        on = bool(stw1 & STW1.ON)
        rising = on and not self._on
        self._on = on
        off2 = not stw1 & STW1.NO_OFF2 or self.fault_latched
        off3 = not stw1 & STW1.NO_OFF3
        stage = self.stage
        if stage is DriveStage.S1:
            if not on and not off2 and not off3 and not self.inhibited:
                stage = DriveStage.S2
        elif off2 and stage is not DriveStage.S2:
            stage = DriveStage.S1
        elif stage is DriveStage.S2:
            if off2 or off3 or self.inhibited:
                stage = DriveStage.S1
            elif rising:
                stage = DriveStage.S3
        elif stage is DriveStage.S3:
            if off3:
                stage = DriveStage.S1
            elif not on:
                stage = DriveStage.S2
            elif stw1 & STW1.ENABLE_OPERATION:
                stage = DriveStage.S4
        elif stage is DriveStage.S4:
            if off3 or self.autonomous_stop:
                stage, self._braking = DriveStage.S5, self._off3
            elif not on:
                stage, self._braking = DriveStage.S5, self._off1
            elif not stw1 & STW1.ENABLE_OPERATION:
                stage = DriveStage.S3
        elif self._braking == self._off1 and off3:
            self._braking = self._off3
        elif self._braking == self._off1 and on:
            stage = DriveStage.S4
        elif self._speed == 0.0 or not stw1 & STW1.ENABLE_OPERATION:
            stage = DriveStage.S1 if self._braking == self._off3 else DriveStage.S2
        self.stage = stage

    def _move(self) -> None:
        before = self._speed
        if self.stage is DriveStage.S4:
            self._speed = self._setpoint
        else:
            rate = self._braking if self.stage is DriveStage.S5 else self._coast
            step = rate * self._cycle
            self._speed = 0.0 if abs(before) <= step else before - step if before > 0.0 else before + step
        angle = self._angle
        self._angle += 0.5 * (before + self._speed) / 60.0 * tau * self._cycle
        for search in (self._search, *self._edges):
            if search.searching:
                per_radian = self._increments / tau
                search.pass_by(angle * per_radian, self._angle * per_radian)

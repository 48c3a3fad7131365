"""Brings an emulated drive into motion in any mode, for tests that are generated for all modes."""

from __future__ import annotations

import math
from dataclasses import replace

from emulators.drive.cia402 import DriveConfig, RotaryAxisConfig
from fieldbus.clock import MS
from testcases.unit.emulators.conftest import DriveBench

REV = 131072
RPM = 600
"""Speed of the motion."""
SLOW, QUICK = 3000, 12000
"""Slopes of the slow-down and the quick-stop ramp, rpm/s."""
TORQUE_NM = 0.6
"""Torque limit: 14 300 rpm/s with the inertia of the axis."""
MODES = {1: "pp", 2: "vl", 3: "pv", 4: "tq", 6: "hm", 7: "ip", 8: "csp", 9: "csv", 10: "cst"}
_VL_BITS = 0x70


class MovingDrive(DriveBench):
    """A drive on an endless axis without friction; setpoints come by SDO, those of csp and ip every
    millisecond.
    """

    def __init__(self, **objects: int) -> None:
        config = replace(
            DriveConfig.reference(sync_period_ms=1),
            mechanics=RotaryAxisConfig(coulomb_friction=0.0, viscous_friction=0.0),
        )
        super().__init__(config)
        self.streaming = False
        self.stream_position = self.stream_step = 0.0
        self.configure(
            {
                0x6083: SLOW * 1000,
                0x6084: SLOW * 1000,
                0x6085: QUICK * 1000,
                0x6087: 100_000,
                0x6072: round(TORQUE_NM / 2.0 * 1000),
                0x609A: SLOW * 1000,
                0x6065: 0xFFFFFFFF,
            }
        )
        for index, slope in ((0x6048, SLOW), (0x6049, SLOW), (0x604A, QUICK)):
            self.write(index, slope, 1)
        for key, value in objects.items():
            self.write(int(key[1:], 16), value)
        self.scheduler.every(MS, self._stream, phase_ns=MS // 2)

    def _stream(self) -> None:
        """Give csp and ip the next position of a motion with constant speed, or of none."""
        if self.streaming:
            self.stream_position += self.stream_step
            position = round(self.stream_position)
            self.write(0x607A, position)
            self.write(0x60C1, position, 1)

    @property
    def rpm(self) -> float:
        return self.drive.core.speed_rpm

    @property
    def inertia(self) -> float:
        return self.drive.mechanics.motor_inertia

    def following_word(self, mode: int) -> int:
        """Return the control word that lets a mode follow its setpoints."""
        return 0x0F | {2: _VL_BITS, 7: 0x10}.get(mode, 0)

    def prime(self, mode: int) -> None:
        """Give a mode the setpoints that fit to what the axis does now."""
        core = self.drive.core
        speed = round(core.velocity * 60.0 / math.tau)
        if mode == 2:
            self.write(0x6042, speed)
        elif mode in (3, 9):
            self.write(0x60FF, speed * 1000)
        elif mode in (4, 10):
            self.write(0x6071, 0)  # without friction a constant speed needs no torque
        elif mode in (7, 8):
            # The next sample of the stream (+1 ms) is taken with the next control cycle (1 ms), for the end
            # of the period (1 ms) after the servo step that follows (0.25 ms).
            ahead = 0.00125 if self.drive.core.controls_position is False else 0.001
            actual = self.drive.axis.commanded_position
            self.stream_position = actual + core.velocity / math.tau * REV * ahead
            self.stream_step = 0.0 if core.standing else RPM / 60.0 * REV * 0.001
            self.streaming = True

    def set_moving(self, mode: int) -> None:
        """Enable the drive in a mode and bring it to 600 rpm."""
        if mode in (1, 2, 3, 9):
            self.enable(mode)
            if mode == 1:
                self.configure({0x6081: RPM * 1000, 0x607A: 10_000 * REV})
                self.control(0x1F)
            self.configure({0x6042: RPM, 0x60FF: RPM * 1000})
            if mode == 2:
                self.control(self.following_word(2))
        else:
            self.enable(3)
            self.write(0x60FF, RPM * 1000)
        self.run(0.4)
        if mode not in (1, 2, 3, 9):
            self.prime(mode)
            if mode == 7:
                self.control(self.following_word(7), 0.0)
            self.write(0x6060, mode)
            self.run(0.02)
        assert self.read(0x6061) == mode
        if mode != 6:
            assert abs(self.rpm - RPM) < 12

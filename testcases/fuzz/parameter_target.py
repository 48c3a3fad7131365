"""Parameter access to PROFIdrive axes at work: a speed axis that turns, and a positioner on its way."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import Final

from emulators.drive.machine import NO_SWITCHES, LinearAxisConfig
from emulators.drive.profidrive import (
    AxisState,
    DriveParameters,
    DriveSettings,
    ProfidriveConfig,
    ProfidriveDrive,
)
from fieldbus.clock import VirtualScheduler
from fieldbus.profidrive.requests import decode_answer
from testcases.fuzz.targets import Take, promise

_READ_SPEED: Final = bytes.fromhex("80 01 01 01 10 01 0015 0000")
_CYCLES: Final = 2
_SETTLE: Final = 60


class _Axis:
    """A drive in operation with the telegram that keeps it there."""

    def __init__(self, telegram: int, mode: int, **signals: int) -> None:
        self.scheduler = VirtualScheduler()
        config = ProfidriveConfig.reference()
        self.config = replace(
            config,
            telegram=telegram,
            isochronous=False,
            settings=DriveSettings(operating_mode=mode, ramp_up_s=1.0, ramp_down_s=1.0, quick_stop_s=0.5),
            mechanics=LinearAxisConfig(negative_stop_mm=None, positive_stop_mm=None),
            switches=NO_SWITCHES,
            servo_period_ns=500_000,
        )
        self.drive = ProfidriveDrive(self.scheduler, self.config, name="drive")
        self.parameters = DriveParameters(self.drive)
        self.saved = self.parameters.store.saved
        layout = self.drive.telegram.setpoint
        ready = 0x043E if mode == 2 else 0x047E
        self.frames = [layout.encode({**signals, "STW1": stw1}) for stw1 in (ready, ready | 1, 0x047F)]
        self.drive.power_on()
        self.start()

    def start(self) -> None:
        """Bring the axis into operation, moving."""
        for frame in self.frames:
            self.cycle(frame, _SETTLE // 3)

    def cycle(self, frame: bytes, count: int) -> None:
        """Send a telegram in a number of bus cycles."""
        for _ in range(count):
            self.drive.receive(frame)
            self.drive.cycle()
            self.drive.transmit()
            self.scheduler.run_for(self.config.cycle_ns)

    def renew(self) -> None:
        """Be as at the beginning."""
        store = self.parameters.store
        store.saved = self.saved
        store.load()
        for number, value in ((9, 0), (10, 0), (927, 1), (928, 1)):
            store.set(number, value)
        self.drive.faults.buffer.clear()
        if self.drive.state is not AxisState.S4:
            self.parameters.memory.restart()
            self.start()


def parameters() -> Take:
    """Return both axes; an input is one request to each of them, and the axes go on working."""
    axes = [
        _Axis(3, 1, NSOLL_B=0x0800_0000),
        _Axis(111, 2, POS_STW1=0xC200, OVERRIDE=0x4000, MDI_VELOCITY=6_000, MDI_ACC=0x4000, MDI_DEC=0x4000),
    ]

    def take(data: bytes) -> None:
        for axis in axes:
            axis.renew()
            promise(axis.drive.state is AxisState.S4, f"the axis does not come back: {axis.drive.state}")
            _ask(axis, data)

    return take


def _ask(axis: _Axis, data: bytes) -> None:
    drive, store = axis.drive, axis.parameters.store
    answer = axis.parameters.request(data)
    promise(4 <= len(answer) <= 240, "an answer of a wrong length")
    decoded = decode_answer(answer)
    promise(bool(answer[1] & 0x80) is not decoded.positive, "the sign of the answer does not fit its content")
    promise(answer[0] == (data[0] if data else 0), "another reference")
    for number in store.changed():
        promise(store.is_writable(number) or number in store.locked, f"{number} can be written")
    DriveSettings(**asdict(drive.settings))  # what is not valid raises
    axis.cycle(axis.frames[-1], _CYCLES)
    promise(math.isfinite(drive.core.velocity) and math.isfinite(drive.core.torque), "a number is none")
    promise(drive.core.enabled is drive.machine.enabled, "state and pulses differ")
    speed = decode_answer(axis.parameters.request(_READ_SPEED))
    promise(speed.positive and len(speed.results) == 1, "a plain request is not answered")

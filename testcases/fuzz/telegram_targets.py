"""PROFIdrive telegrams: a drive, an encoder and the controller's port that get any words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from emulators.drive.profidrive import AxisState, ProfidriveConfig, ProfidriveDrive
from emulators.drive.profidrive.config import POSITION_TELEGRAMS
from emulators.encoder import Mounting
from emulators.encoder.profidrive import EncoderFormat
from emulators.encoder.profidrive.device import ProfidriveEncoder, ProfidriveEncoderConfig
from emulators.encoder.profidrive.settings import ProfidriveEncoderSettings
from fieldbus.can.frame import CanFrame
from fieldbus.canopen import CanopenMaster
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.history import Event, History
from fieldbus.profidrive import Layout, telegram
from fieldbus.profidrive.sign_of_life import next_sign
from motion.drives.profidrive import TelegramConfig
from motion.drives.profidrive_can import ProfidriveCanConfig, ProfidriveCanPort
from testcases.fuzz.targets import NODE, Loose, Take, promise

RUN: Final = 0x047F
READY: Final = 0x047E
_ACKNOWLEDGE: Final = 0x04FE
_LONGEST: Final = 24
"""Telegrams of one input."""

DRIVES: Final = (1, 2, 3, 4, 5, 6, 7, 9, 20, 102, 103, 105, 106, 110, 111, 112)
ENCODERS: Final = (81, 82, 83, 84)
PORTS: Final = (3, 5, 105)

TRANSITIONS: Final = {
    (AxisState.IDLE, AxisState.S1),
    (AxisState.S1, AxisState.S2),
    (AxisState.S2, AxisState.S1),
    (AxisState.S2, AxisState.S3),
    (AxisState.S3, AxisState.S1),
    (AxisState.S3, AxisState.S2),
    (AxisState.S3, AxisState.S4),
    (AxisState.S4, AxisState.S1),
    (AxisState.S4, AxisState.S3),
    (AxisState.S4, AxisState.S5A),
    (AxisState.S4, AxisState.S5B),
    (AxisState.S5A, AxisState.S1),
    (AxisState.S5A, AxisState.S2),
    (AxisState.S5A, AxisState.S4),
    (AxisState.S5A, AxisState.S5B),
    (AxisState.S5B, AxisState.S1),
    *((state, AxisState.IDLE) for state in AxisState),  # power-off
}
"""PD-096 to -114."""
_NAMED: Final = {(old.text, new.text) for old, new in TRANSITIONS}
WITH_TORQUE: Final = {AxisState.S4, AxisState.S5A, AxisState.S5B}


class Course:
    """What an input says: telegrams, each for some cycles.

    The first byte chooses the subject. Then come orders: a byte that says how, and the words of a telegram.
    Bits of it: 0, 1 number of cycles; 2 the words change those of an operating axis, in place of being the
    telegram; 3 the sign of life is right; 4 a byte is missing; 5 nothing comes at all.
    """

    def __init__(self, layout: Layout, data: bytes) -> None:
        self._layout = layout
        self._data = data
        self._sign = 0
        self._at = {name: number for number, name in enumerate(layout.names)}

    def frame(self, stw1: int, **signals: int) -> bytes:
        """Return a telegram with a right sign of life."""
        self._sign = next_sign(self._sign)
        values = {"STW1": stw1, "STW2": self._sign << 12, "STW2_ENC": self._sign << 12 | 0x0400, **signals}
        return self._layout.encode({name: value for name, value in values.items() if name in self._at})

    def __iter__(self) -> Iterator[tuple[bytes | None, int]]:
        """Return telegrams, None for none, with the number of cycles for which they come."""
        size = self._layout.length
        at = 1
        for _ in range(_LONGEST):
            if at >= len(self._data):
                return
            order = self._data[at]
            words = self._data[at + 1 : at + 1 + size].ljust(size, b"\0")
            at += 1 + size
            cycles = 1 + (order & 3)
            if order & 0x20:
                yield None, cycles
                continue
            if order & 0x04:
                base = self.frame(RUN)
                words = bytes(one ^ other for one, other in zip(words, base, strict=True))
            if order & 0x08:
                values = dict(zip(self._layout.names, self._layout.unpack(words), strict=True))
                for name in ("STW2", "STW2_ENC"):
                    if name in values:
                        self._sign = next_sign(self._sign)
                        values[name] = values[name] & 0x0FFF | self._sign << 12
                words = self._layout.pack(*values.values())
            yield words[:-1] if order & 0x10 else words, cycles


def _drive(number: int, *, isochronous: bool) -> Take:
    config = ProfidriveConfig.reference(
        telegram=number, cycle_ms=1, operating_mode=2 if number in POSITION_TELEGRAMS else 3
    )
    layout, back = telegram(number).setpoint, telegram(number).actual
    isochronous = isochronous and telegram(number).isochronous and number not in POSITION_TELEGRAMS
    config = replace(config, isochronous=isochronous, servo_period_ns=MS // 2)

    def judge(event: Event) -> None:
        if event.kind == "drive.state":
            step = (event.data["from"], event.data["to"])
            promise(step in _NAMED, f"transition {step[0]} -> {step[1]}")

    def take(data: bytes) -> None:
        scheduler = VirtualScheduler()
        history = History(scheduler)
        history.listen(judge)
        drive = ProfidriveDrive(scheduler, config, name="drive", history=history)
        course = Course(layout, data)

        def cycle(frame: bytes | None) -> None:
            if frame is not None:
                drive.receive(frame)
            drive.cycle()
            answer = drive.transmit()
            promise(len(answer) == back.length, "an answer of a wrong length")
            state = drive.state
            promise(state in WITH_TORQUE or not drive.core.enabled, f"torque in {state}")
            if drive.controlled_cyclically:
                word = back.unpack(answer)[0]
                promise(word & 0x0047 == state.bits & 0x0047, f"ZSW1 {word:04X}h in {state}")
            core = drive.core
            promise(math.isfinite(core.torque + core.velocity + core.position), "a value that is no number")
            scheduler.run_for(MS)

        def enable() -> None:
            for _ in range(40 if isochronous else 2):
                cycle(course.frame(READY))
            for _ in range(3):
                cycle(course.frame(RUN))
            promise(drive.state is AxisState.S4, f"cannot be enabled: {drive.state}")

        drive.power_on()
        enable()
        for frame, cycles in course:
            for _ in range(cycles):
                cycle(frame)
        # Whatever has happened, the drive can be had back: by acknowledging, or by its supply.
        drive.power_off()
        drive.power_on()
        cycle(course.frame(READY))
        cycle(course.frame(_ACKNOWLEDGE))
        enable()

    return take


def _encoder(number: int) -> Take:
    form = EncoderFormat(periods=8192, shift_xist1=4, shift_xist2=4, revolutions=4096, wide=number == 84)
    layout, back = telegram(number).setpoint, telegram(number).actual
    at = back.names.index("G1_ZSW")

    def take(data: bytes) -> None:
        scheduler = VirtualScheduler()
        angle = [0.0]
        encoder = ProfidriveEncoder(
            scheduler,
            ProfidriveEncoderConfig(
                form=form,
                settings=ProfidriveEncoderSettings(telegram=number, sign_of_life=bool(len(data) & 1)),
            ),
            Mounting(lambda: angle[0]),
        )
        course = Course(layout, data)

        def cycle(frame: bytes | None) -> int:
            angle[0] += 0.01
            if frame is not None:
                encoder.receive(frame)
            encoder.cycle()
            answer = encoder.transmit()
            promise(answer is not None and len(answer) == back.length, "an answer of a wrong length")
            assert answer is not None
            scheduler.run_for(MS)
            word = back.unpack(answer)[at]
            promise(not (word & 0x8000 and word & 0x4000), f"G1_ZSW {word:04X}h: parked with an error")
            return word

        encoder.power_on()
        for frame, cycles in course:
            for _ in range(cycles):
                cycle(frame)
        encoder.power_off()
        encoder.power_on()
        for _ in range(3):
            word = cycle(course.frame(0))
        promise(word & 0xC800 == 0, f"G1_ZSW {word:04X}h after power-on")

    return take


def _port(number: int) -> Take:
    words = TelegramConfig(telegram=number)
    segment = Loose()
    master = CanopenMaster(segment.scheduler, segment)
    port = ProfidriveCanPort(master, ProfidriveCanConfig(node_id=NODE, cycle_ns=MS, words=words))
    port.enter_service()
    back = telegram(number).actual
    parts = -(-back.length // 8)

    def take(data: bytes) -> None:
        course = Course(back, data)
        sign = 0

        def cycle(frame: bytes) -> None:
            for part in range(parts):
                piece = frame[8 * part : 8 * part + 8]
                swapped = b"".join(piece[at : at + 2][::-1] for at in range(0, len(piece), 2))
                segment.receive(CanFrame(0x180 + 0x100 * part + NODE, swapped), segment.scheduler.now)
            port.read()
            promise(
                math.isfinite(port.actual_speed_rpm + port.actual_torque_nm)
                and port.encoder_increments == int(port.encoder_increments),
                "a value that is no number",
            )
            promise(port.link_ok or port.zsw1 == 0, f"ZSW1 {port.zsw1:04X}h without a link")
            if port.dsc:
                port.control_position(float(port.encoder_increments) * 1e3, 1e3)
            port.write(RUN, port.actual_speed_rpm * 4.0)
            segment.scheduler.run_for(MS)

        for frame, cycles in course:
            for _ in range(cycles):
                cycle(b"" if frame is None else frame)
        for _ in range(20):
            sign = next_sign(sign)
            cycle(back.encode({"ZSW1": 0x0237, "ZSW2": sign << 12, "G1_XIST1": 4711}))
        promise(port.link_ok and port.zsw1 == 0x0237, "no link with a good drive")
        promise(port.encoder_increments == 4711, "another position than was sent")
        segment.heard.clear()

    return take


def telegrams() -> Take:
    """Return all that takes telegrams; the first byte of an input chooses among drives, encoders and
    ports.
    """
    made: dict[int, Take] = {}
    subjects: list[Callable[[], Take]] = [
        *(lambda number=number: _drive(number, isochronous=False) for number in DRIVES),
        lambda: _drive(105, isochronous=True),
        *(lambda number=number: _encoder(number) for number in ENCODERS),
        *(lambda number=number: _port(number) for number in PORTS),
    ]

    def take(data: bytes) -> None:
        chosen = (data[0] if data else 0) % len(subjects)
        if chosen not in made:
            made[chosen] = subjects[chosen]()
        made[chosen](data)

    return take

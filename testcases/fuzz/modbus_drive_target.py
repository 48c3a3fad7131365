"""The PROFIdrive axis behind its register maps: requests and telegrams of any content."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.modbus import Request, decode_request, decode_response, is_well_formed, load_map
from testcases.fuzz.targets import Take, promise

_WORDS: Final = 0x40
_PASS: Final = 0xA0
_LONGEST_PASS_NS: Final = 60 * MS
"""Time that one input may let pass, in addition to what its requests take."""
_REQUEST_NS: Final = MS
_COAST_STOP: Final = 0x0400
_READ_DISPLAY: Final = (0x0001, 0x2F0A, 0x8001, 0x0101, 0x1001, 0x0002, 0x0000)


def orders(data: bytes) -> Iterator[tuple[str, int, bytes]]:
    """Yield what an input says: a request (PDU), words of the telegram, or time that passes.

    The first byte of each order is its kind: below 40h a request, whose length is in the next byte; below A0h
    words of the telegram, their number in the low four bits; above, milliseconds.
    """
    at = 0
    while at < len(data):
        kind = data[at]
        at += 1
        if kind >= _PASS:
            yield "pass", kind - _PASS + 1, b""
            continue
        if kind >= _WORDS:
            size = 2 * (1 + kind % 16)
        else:
            size = data[at] % 64 if at < len(data) else 0
            at += 1
        yield "words" if kind >= _WORDS else "request", kind, data[at : at + size]
        at += size


class _Rig:
    """A drive that is used for many inputs: without supply in between, with the parameters of its
    configuration.
    """

    def __init__(self, registers: str, telegram: int) -> None:
        from emulators.drive.machine import NO_SWITCHES, LinearAxisConfig
        from emulators.drive.profidrive import AxisState, DriveSettings, ProfidriveConfig
        from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
        from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig

        self.scheduler = VirtualScheduler()
        config = ProfidriveConfig(
            telegram=telegram,
            servo_period_ns=MS // 2,
            cycle_ns=2 * MS,
            settings=DriveSettings(
                operating_mode=2 if telegram == 111 else 3, ramp_up_s=0.1, ramp_down_s=0.1
            ),
            mechanics=LinearAxisConfig(negative_stop_mm=None, positive_stop_mm=None),
            switches=NO_SWITCHES,
        )
        self.unit = ProfidriveModbusDrive(
            self.scheduler, ProfidriveModbusConfig(map=registers, drive=config), name="drive"
        )
        self.with_torque = (AxisState.S4, AxisState.S5A, AxisState.S5B)
        self.operating = AxisState.S4
        file = load_map(registers)
        self.first = file.first
        places = {block.hook: block.register_ - file.first for block in file.block if block.hook}
        self.setpoints, self.actual = places["setpoints"], places["actual_values"]
        self.channel, self.mailbox = places.get("ds47"), places.get("mailbox")
        self.saved = self.unit.parameters.store.saved

    def restart(self) -> None:
        self.unit.power_off()
        self.unit.parameters.store.saved = self.saved
        self.unit.power_on()

    def ask(self, pdu: bytes, **how: bool) -> bytes | None:
        """Hand a request over; what comes is a response to it."""
        answer = self.unit.server.respond(pdu, **how)
        if answer is None:
            promise(how.get("broadcast") or not pdu, "no response")
            return None
        promise(2 <= len(answer) <= 253, f"{len(answer)} bytes of response")
        promise(answer[0] & 0x7F == pdu[0] & 0x7F, "the response has another function")
        if answer[0] & 0x80 and not pdu[0] & 0x80:
            promise(len(answer) == 2 and answer[1] in (1, 2, 3, 4), f"exception {answer.hex()}")
        elif pdu[0] < 0x80 and is_well_formed(pdu, self.unit.server.limits):
            decode_response(decode_request(pdu), answer)
        return answer

    def write(self, address: int, *words: int) -> bytes | None:
        return self.ask(Request(16, address, len(words), words).encode())

    def read(self, address: int, count: int = 1) -> list[int]:
        answer = self.ask(Request(3, address, count).encode())
        promise(answer is not None and answer[0] == 3, f"{address} cannot be read")
        data = (answer or b"")[2:]
        return [data[at] << 8 | data[at + 1] for at in range(0, len(data), 2)]

    def judge(self) -> None:
        unit = self.unit
        promise(all(map(math.isfinite, unit.trace_row())), "a value that is no number")
        promise(unit.state in self.with_torque or not unit.core.enabled, f"torque in {unit.state}")
        (zsw1,) = self.read(self.actual)
        promise(bool(zsw1 & 4) is (unit.state is self.operating), f"ZSW1 {zsw1:04X}h in {unit.state}")
        promise(
            bool(zsw1 & 8) is unit.drive.faults.present,
            f"ZSW1 {zsw1:04X}h, faults {unit.drive.faults.number}",
        )


def modbus_drive() -> Take:
    """Return the drive behind the maps of G120 and Festo; the first byte of an input chooses map and
    telegram.
    """
    kinds = (("sinamics_g120", 1), ("sinamics_g120", 105), ("festo", 111), ("sinamics_g220", 3))
    rigs: dict[int, _Rig] = {}

    def take(data: bytes) -> None:
        chosen = data[0] % len(kinds) if data else 0
        if chosen not in rigs:
            rigs[chosen] = _Rig(*kinds[chosen])
        rig = rigs[chosen]
        unit, scheduler = rig.unit, rig.scheduler
        rig.restart()
        left = _LONGEST_PASS_NS
        for kind, number, content in orders(data[1:]):
            if kind == "request":
                rig.ask(content, serial=bool(number & 1), broadcast=number & 6 == 6)
                spent = _REQUEST_NS
            elif kind == "words":
                words = [content[at] << 8 | content[at + 1] for at in range(0, len(content) - 1, 2)]
                if words:
                    rig.write(rig.setpoints, *words)
                spent = _REQUEST_NS
            else:
                spent = number * MS
            spent = min(spent, left)
            left -= spent
            scheduler.run_for(spent)
            rig.judge()
        rig.write(rig.setpoints, _COAST_STOP, 0)
        scheduler.run_for(3 * MS)
        promise(not unit.core.enabled, "torque behind OFF2")
        rig.restart()
        if rig.channel is not None:
            rig.write(rig.channel, *_READ_DISPLAY)
            scheduler.run_for(25 * MS)
            found = rig.read(rig.channel, 5)
            promise(found == [2, 0x2F08, 0x8001, 0x0101, 0x0301], f"data record 47 {found}")
        if rig.mailbox is not None:
            rig.write(rig.mailbox, 2, 0, 1, 1)
            promise(rig.read(rig.mailbox + 3, 2) == [0x10, 2], "the mailbox does not answer")

    return take

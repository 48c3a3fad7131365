"""Frames of Modbus segments as text: drive, request or response, and the telegram in the registers."""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING, Final

from fieldbus.modbus import Function
from fieldbus.modbus.pdu import decode_request, decode_response, is_well_formed
from fieldbus.modbus.server import SERVED
from hil.bench.drive_config import ProfidriveModbusTable
from hil.bench.signal_texts import signal_words

if TYPE_CHECKING:
    from fieldbus.modbus import ModbusFrame, ProcessDataRegisters
    from fieldbus.profidrive import Layout
    from hil.bench.config import BenchConfig

_WRITES: Final = (Function.WRITE_MULTIPLE_REGISTERS, Function.READ_WRITE_MULTIPLE_REGISTERS)


class ModbusTexts:
    """Describes frames.

    Args:
        config: The bench file, which knows units, maps and telegrams.

    """

    def __init__(self, config: BenchConfig) -> None:
        self._drives: dict[
            tuple[str, int], list[tuple[str, ProfidriveModbusTable, ProcessDataRegisters]]
        ] = {}
        for name, drive in config.drive.items():
            if isinstance(drive, ProfidriveModbusTable):
                registers = drive.registers()
                for segment in (drive.segment, ""):
                    self._drives.setdefault((segment, drive.unit), []).append((name, drive, registers))

    def describe(self, frame: ModbusFrame, *, segment: str | None = None) -> str:
        """Return the meaning of `frame`."""
        text = frame.text()
        drives = self._drives.get((segment or "", frame.can_id), [])
        if not frame.data or not drives:
            return text
        # Over TCP drives with a connection each may have the same unit: then the words are those of the map
        # they share.
        names = ", ".join(name for name, _, _ in drives)
        _, drive, registers = drives[0]
        chosen = registers.telegram
        pdu = frame.pdu
        request = frame.asked or pdu
        if not pdu or request[0] not in SERVED or not is_well_formed(request):
            return f"{names}: {text}"
        asked = decode_request(request)
        signals = ""
        if not frame.asked:
            at = asked.write_address if asked.function == _WRITES[1] else asked.address
            if asked.function in _WRITES and at == registers.setpoints:
                signals = self._signals(drive, chosen.setpoint, registers, asked.values)
        elif asked.address == registers.actual_values and not pdu[0] & 0x80:
            signals = self._signals(drive, chosen.actual, registers, decode_response(asked, pdu).values)
        return f"{names}: {text}{signals}"

    @staticmethod
    def _signals(
        drive: ProfidriveModbusTable, layout: Layout, registers: ProcessDataRegisters, values: tuple[int, ...]
    ) -> str:
        """Return the signals of a telegram as text."""
        if len(values) != layout.words:
            return ""
        data = registers.frame(values, setpoints=layout is registers.telegram.setpoint)
        described = signal_words(drive, layout)
        return f" ({', '.join(described.describe(0, Struct(f'>{layout.words}H').unpack(data)))})"

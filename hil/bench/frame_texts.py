"""Frames of a bench as text, also if another controller has configured the drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

from fieldbus.can.frame import CanFrame
from hil.bench.names import named

if TYPE_CHECKING:
    from fieldbus.canopen.decode import FrameDecoder
    from fieldbus.modbus import ModbusFrame
    from hil.bench.config import BenchConfig
    from hil.bench.drive_ports import DrivePorts
    from hil.bench.modbus_texts import ModbusTexts
    from hil.bench.segments import Segments
    from hil.record._frames import FrameLog

_TEACHING: Final = (0x580, 0x600, 0x700)
"""SDO in both directions, and boot-up: what changes a mapping."""


class FrameTexts:
    """Describes the frames of a bench by the PDO mapping: the one that the bench has written, or on a bench
    without axes the one that another controller has written.

    Args:
        config: The bench file.
        segments: The buses.
        ports: The controller's ports, which know the mapping that they have written.
        frames: Returns the recorded frames of a segment.

    """

    def __init__(
        self, config: BenchConfig, segments: Segments, ports: DrivePorts, frames: Callable[[str], FrameLog]
    ) -> None:
        self._config = config
        self._segments = segments
        self._ports = ports
        self._frames = frames
        self._can: dict[str | None, CanTexts] = {}
        self._modbus: ModbusTexts | None = None

    def describe(self, frame: CanFrame | ModbusFrame, segment: str | None) -> str:
        """Return the meaning of a frame.

        Args:
            frame: The frame.
            segment: Where it was; None = anywhere.

        Raises:
            ConfigurationError: There is no such CAN segment.

        """
        if isinstance(frame, CanFrame):
            if segment not in self._can:
                self._can[segment] = self._make_can(segment)
            return self._can[segment].describe(frame)
        if self._modbus is None:
            from hil.bench.modbus_texts import ModbusTexts

            self._modbus = ModbusTexts(self._config)
        return self._modbus.describe(frame, segment=segment)

    def _make_can(self, segment: str | None) -> CanTexts:
        from hil.bench.drives import build_decoder

        can = self._segments.can
        names = list(can) if segment is None else [named("CAN segment", can, segment).name]
        logs = [partial(self._frames, name) for name in names]
        return CanTexts(
            lambda: build_decoder(self._config, self._ports.can, segment=segment),
            [] if self._config.axis else logs,
        )


class CanTexts:
    """Describes CAN frames.

    Args:
        build: Makes a decoder that knows names, dictionaries and the mapping that the
            bench itself has commissioned.
        logs: Logs of segments whose drives another controller configures: PDOs are described by the latest
            mapping in the log, in whatever order frames are described.

    """

    def __init__(self, build: Callable[[], FrameDecoder], logs: Sequence[Callable[[], FrameLog]]) -> None:
        self._decoder = build()
        self._logs = logs
        self._read = [0] * len(logs)
        # A decoder learns from what it describes: old SDO frames must not undo what later ones have taught.
        self._services = build() if logs else self._decoder

    def describe(self, frame: CanFrame) -> str:
        """Return the meaning of `frame`."""
        if self._logs:
            self._learn()
            if frame.can_id & 0x780 in _TEACHING:
                return self._services.decode(frame)
        return self._decoder.decode(frame)

    def _learn(self) -> None:
        for number, log in enumerate(self._logs):
            frames = log()
            for _, _, frame, error in frames[self._read[number] :]:
                if not error and isinstance(frame, CanFrame):
                    self._decoder.observe(frame)
            self._read[number] = len(frames)

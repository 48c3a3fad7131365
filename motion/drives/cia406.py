"""Port to an encoder of CiA 406 on CANopen: its position by SYNC (TPDO2, 6004h), its alarms by EMCY.

Nothing is written to the encoder. Its position runs from 0 to the end of its range and begins there again;
the port makes a count of it that continues (CFG-309).
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from motion.drives._link import GRACE_CYCLES
from motion.drives.encoder import EncoderPort

if TYPE_CHECKING:
    from fieldbus.canopen.master import CanopenMaster
    from fieldbus.history import History

_POSITION: Final = Struct("<i")
_ALARMS: Final = frozenset((0x1000, *range(0xFF00, 0xFF20)))
"""EMCY codes that say that the position cannot be relied on (C406-050)."""


@dataclass(frozen=True, kw_only=True)
class Cia406PortConfig:
    """Facts about the encoder that the controller has to know.

    Args:
        node_id: CANopen node, 1..127.
        range_steps: Number of positions before it begins again, 6002h; 2 or more.
        absolute_encoder: It keeps its position over power-off.
        grace_cycles: Cycles without a position until the link counts as lost.

    Raises:
        ConfigurationError: A value is out of range.

    """

    node_id: int
    range_steps: int
    absolute_encoder: bool = True
    grace_cycles: int = GRACE_CYCLES

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("encoder.node_id", self.node_id, "1..127")
        if self.range_steps < 2:
            raise ConfigurationError("encoder range", self.range_steps, "2 steps or more")


class Cia406Port(EncoderPort):
    """Reads the position from TPDO2 and the alarms from EMCY. It is the user of its node (`NodeUser`).

    Args:
        master: The controller's CANopen services on the segment of the encoder.
        config: Facts about the encoder.
        name: Name of the encoder in the history.
        history: Log for link events; None for none.

    """

    def __init__(
        self,
        master: CanopenMaster,
        config: Cia406PortConfig,
        *,
        name: str = "encoder",
        history: History | None = None,
    ) -> None:
        super().__init__()
        self.name = name
        self.absolute_encoder = config.absolute_encoder
        self._range = config.range_steps
        self._grace = self._age = config.grace_cycles
        self._history = history
        self._in_service = False
        self._seen = False
        self._value = self._last = 0
        self._known = False
        master.subscribe(0x280 + config.node_id, self._on_position, apart=True)

    # -- calls of the network
    # -------------------------------------------------------------------------------

    def node_restarted(self) -> None:
        """Take note that the node has booted."""
        # What it counts from now on has a new reference.
        self.encoder_restarts += 1
        self.sensor_fault = False
        self._known = False

    def node_in_service(self) -> None:
        """Take note that the node is in service."""
        self._in_service = True

    def node_lost(self, reason: str) -> None:
        """Take note that the node is lost."""
        self._in_service = False
        self._seen = False
        self._age = self._grace
        if self._history is not None:
            self._history.emit(self.name, "link.node_lost", reason=reason)

    def node_state(self, state: int) -> None:
        """Take the NMT state of the node."""

    def node_emcy(self, code: int) -> None:
        """Take an EMCY of the node."""
        # An alarm makes the position worthless until it is gone.
        if code in _ALARMS:
            self.sensor_fault = True
        elif code == 0:
            self.sensor_fault = False

    def _on_position(self, data: bytes, _time_ns: int) -> None:
        if len(data) >= _POSITION.size:
            self._value = _POSITION.unpack_from(data)[0]
            self._seen = True

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    @override
    def read(self) -> None:
        if self._seen:
            self._seen = False
            self._age = 0
            value = self._value
            if self._known:
                half = self._range >> 1
                self.encoder_increments += (value - self._last + half) % self._range - half
            else:
                self._known = True
                self.encoder_increments = value
            self._last = value
        elif self._age < self._grace:
            self._age += 1
        alive = self._age < self._grace and self._in_service
        if alive is not self.link_ok:
            self.link_ok = alive
            if self._history is not None:
                self._history.emit(self.name, "link.up" if alive else "link.down")

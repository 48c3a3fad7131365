"""LSS slave: node-ID and bit rate over the bus, by identity (CiA 305; C301-011, C301-153 to C301-163)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Protocol

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.nmt import UNCONFIGURED
from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.errors import HilError

COB_LSS_SLAVE: Final = 0x7E4
COB_LSS_MASTER: Final = 0x7E5

BITRATES: Final[tuple[int | None, ...]] = (
    1_000_000, 800_000, 500_000, 250_000, 125_000, None, 50_000, 20_000, 10_000,
)  # fmt: skip
"""Standard table of bit rates, bit/s, by index; index 5 is reserved (C301-156)."""


class LssState(IntEnum):
    """State of the LSS slave; the value is the one of "switch mode global"."""

    WAITING = 0
    CONFIGURATION = 1


class _Service(IntEnum):
    SWITCH_GLOBAL = 0x04
    NODE_ID = 0x11
    BIT_TIMING = 0x13
    ACTIVATE = 0x15
    STORE = 0x17
    SELECT_FIRST = 0x40
    SELECT_LAST = 0x43
    SELECTED = 0x44
    IDENTIFY_FIRST = 0x46
    IDENTIFY_LAST = 0x4B
    IDENTIFY_UNCONFIGURED = 0x4C
    IDENTIFIED = 0x4F
    IDENTIFIED_UNCONFIGURED = 0x50
    FAST_SCAN = 0x51
    INQUIRE_FIRST = 0x5A
    INQUIRE_LAST = 0x5D
    INQUIRE_NODE_ID = 0x5E


_OK: Final = 0
_OUT_OF_RANGE: Final = 1
_STORE_FAILED: Final = 2
_STANDARD_TABLE: Final = 0
_SCAN_START: Final = 0x80

# Which part of the address an identify request is about, and how the own one has to compare.
_IDENTIFY: Final[tuple[tuple[int, int], ...]] = ((0, 0), (1, 0), (2, -1), (2, 1), (3, -1), (3, 1))


@dataclass
class LssSettings:
    """What LSS sets and stores.

    Args:
        node_id: 1..127, or FFh: the node has none.
        bitrate: bit/s; None = LSS has never set it.

    """

    node_id: int
    bitrate: int | None = None


class LssOwner(Protocol):
    """The node as its LSS slave sees it."""

    def lss_address(self) -> tuple[int, int, int, int]:
        """Return vendor-ID, product code, revision number, serial number (1018h)."""

    def lss_node_id_set(self) -> None:
        """Start with the pending node-ID: a node without one has got one and was sent back to waiting."""

    def lss_mute(self, muted: bool) -> None:
        """Leave the bus alone while the bit rate changes, and take part again."""

    def lss_bitrate(self, bitrate: int) -> None:
        """Change to this bit rate, bit/s."""

    def lss_store(self) -> None:
        """Write the settings to non-volatile memory; raises `HilError` when it fails."""


class LssSlave:
    """Answers the LSS master; available in every NMT state, and without a node-ID.

    Args:
        scheduler: Time of the switch delay.
        send: Puts a frame on the bus.
        owner: The node.
        node_id: Node-ID that the node comes with, 1..127 or FFh.
        bitrates: Bit rates that the device supports, bit/s; empty = all of the standard table.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        send: Callable[[CanFrame], None],
        owner: LssOwner,
        *,
        node_id: int,
        bitrates: Iterable[int] = (),
    ) -> None:
        self._scheduler = scheduler
        self._send = send
        self._owner = owner
        self._bitrates = frozenset(bitrates)
        self._timer: Timer | None = None
        self._select_stage = 0
        self._identify_stage = 0
        self._scan_part = 0
        self.enabled = True
        """Whether the device has LSS at all."""
        self.state = LssState.WAITING
        self.active_node_id = node_id
        """Node-ID in effect; FFh = none."""
        self.stored = LssSettings(node_id)
        """Non-volatile settings: in effect after power-on and reset node."""
        self.settings_stored = False
        """Whether the node-ID has been stored by LSS; otherwise it is the one that the node comes with."""
        self.pending = LssSettings(node_id)
        """Configured settings; the node-ID comes into force with reset
        communication, the bit rate when activated.
        """

    @property
    def unconfigured(self) -> bool:
        """Whether the node has no node-ID (C301-163)."""
        return self.active_node_id == UNCONFIGURED

    def restart(self) -> None:
        """Begin again with the stored settings, as at power-on and reset node."""
        self.stop()
        self.pending = LssSettings(self.stored.node_id, self.stored.bitrate)

    def stop(self) -> None:
        """Forget what is under way: back to waiting, as at power-off and every reset."""
        self.state = LssState.WAITING
        self._select_stage = self._identify_stage = self._scan_part = 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._owner.lss_mute(False)

    # -- the master's requests
    # --------------------------------------------------------------------------------

    def receive(self, frame: CanFrame, _time_ns: int) -> None:
        """Take a frame of the LSS master; one of another length than eight bytes is ignored."""
        data = frame.data
        if len(data) != 8:
            return
        service = data[0]
        if service == _Service.SWITCH_GLOBAL:
            self._switch(data[1])
        elif _Service.SELECT_FIRST <= service <= _Service.SELECT_LAST:
            self._select(service - _Service.SELECT_FIRST, _number(data))
        elif _Service.IDENTIFY_FIRST <= service <= _Service.IDENTIFY_LAST:
            self._identify(service - _Service.IDENTIFY_FIRST, _number(data))
        elif service == _Service.IDENTIFY_UNCONFIGURED:
            if self.unconfigured:
                self._answer(_Service.IDENTIFIED_UNCONFIGURED)
        elif service == _Service.FAST_SCAN:
            self._fast_scan(_number(data), data[5], data[6], data[7])
        elif self.state is LssState.CONFIGURATION:
            self._configure(data)

    def _answer(self, service: int, content: bytes = b"") -> None:
        self._send(CanFrame(COB_LSS_SLAVE, (bytes((service,)) + content).ljust(8, b"\0")))

    def _switch(self, mode: int) -> None:
        """Switch mode global: no answer (C301-153)."""
        if mode == LssState.CONFIGURATION:
            self.state = LssState.CONFIGURATION
        elif mode == LssState.WAITING:
            leaving = self.state is LssState.CONFIGURATION
            self.state = LssState.WAITING
            self._scan_part = 0
            if leaving and self.unconfigured and self.pending.node_id != UNCONFIGURED:
                self._owner.lss_node_id_set()

    def _select(self, part: int, number: int) -> None:
        """Switch mode selective: four parts in order, all equal (C301-154)."""
        if self.state is not LssState.WAITING or part not in (0, self._select_stage):
            self._select_stage = 0
            return
        self._select_stage = part + 1 if number == self._owner.lss_address()[part] else 0
        if self._select_stage > 3:
            self._select_stage = 0
            self.state = LssState.CONFIGURATION
            self._answer(_Service.SELECTED)

    def _identify(self, step: int, number: int) -> None:
        """Identify remote slave: six steps in order; answered when the address is in the range (C301-159)."""
        if step not in (0, self._identify_stage):
            self._identify_stage = 0
            return
        part, side = _IDENTIFY[step]
        own = self._owner.lss_address()[part]
        fits = own == number if not side else own >= number if side < 0 else own <= number
        self._identify_stage = step + 1 if fits else 0
        if self._identify_stage == len(_IDENTIFY):
            self._identify_stage = 0
            self._answer(_Service.IDENTIFIED)

    def _fast_scan(self, number: int, bit: int, part: int, following: int) -> None:
        """Fastscan: answer if the bits from `bit` on agree; only nodes
        without node-ID take part (C301-161).
        """
        if not self.unconfigured or self.state is not LssState.WAITING:
            return
        if bit == _SCAN_START:
            self._scan_part = 0
            self._answer(_Service.IDENTIFIED)
            return
        if bit > 31 or part > 3 or following > 3 or part != self._scan_part:
            return
        if (number ^ self._owner.lss_address()[part]) >> bit:
            return
        self._scan_part = following
        if bit == 0 and following < part:
            self._scan_part = 0
            self.state = LssState.CONFIGURATION
        self._answer(_Service.IDENTIFIED)

    # -- in configuration state
    # -------------------------------------------------------------------------------

    def _configure(self, data: bytes) -> None:
        service = data[0]
        if service == _Service.NODE_ID:
            allowed = 1 <= data[1] <= 127 or data[1] == UNCONFIGURED
            if allowed:
                self.pending.node_id = data[1]
            self._answer(service, bytes((_OK if allowed else _OUT_OF_RANGE,)))
        elif service == _Service.BIT_TIMING:
            bitrate = BITRATES[data[2]] if data[1] == _STANDARD_TABLE and data[2] < len(BITRATES) else None
            allowed = bitrate is not None and (not self._bitrates or bitrate in self._bitrates)
            if allowed:
                self.pending.bitrate = bitrate
            self._answer(service, bytes((_OK if allowed else _OUT_OF_RANGE,)))
        elif service == _Service.ACTIVATE:
            self._activate(int.from_bytes(data[1:3], "little"))
        elif service == _Service.STORE:
            self._store()
        elif _Service.INQUIRE_FIRST <= service <= _Service.INQUIRE_LAST:
            number = self._owner.lss_address()[service - _Service.INQUIRE_FIRST]
            self._answer(service, number.to_bytes(4, "little"))
        elif service == _Service.INQUIRE_NODE_ID:
            self._answer(service, bytes((self.active_node_id,)))

    def _store(self) -> None:
        before = (self.stored, self.settings_stored)
        self.stored = LssSettings(self.pending.node_id, self.pending.bitrate)
        self.settings_stored = True
        try:
            self._owner.lss_store()
        except HilError:
            self.stored, self.settings_stored = before
            self._answer(_Service.STORE, bytes((_STORE_FAILED,)))
        else:
            self._answer(_Service.STORE, bytes((_OK,)))

    def _activate(self, delay_ms: int) -> None:
        """Wait, change the bit rate, wait again, and be silent until then (C301-157)."""
        bitrate = self.pending.bitrate
        if bitrate is None or self._timer is not None:
            return
        delay_ns = delay_ms * MS
        self._owner.lss_mute(True)

        def change() -> None:
            self._owner.lss_bitrate(bitrate)
            self._timer = self._scheduler.after(delay_ns, done)

        def done() -> None:
            self._timer = None
            self._owner.lss_mute(False)

        self._timer = self._scheduler.after(delay_ns, change)


def _number(data: bytes) -> int:
    return int.from_bytes(data[1:5], "little")

"""Nodes of a bench as a log shows them: process data become signals, changes of
state and faults become events.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from typing_extensions import override

from fieldbus.canopen.nmt import NmtState
from fieldbus.cia402 import decode_state, emcy_text
from fieldbus.clock import S
from hil.logs._facts import NodeFacts
from hil.logs._pdo import Motion, Pdo
from hil.logs._table import Table
from hil.record._trace import STATES

if TYPE_CHECKING:
    from fieldbus.history import Scalar

Emit = Callable[..., None]
"""Takes time (ns), source, kind and details."""

_WORDS: Final = {
    0x604000: "controlword",
    0x604100: "statusword",
    0x606000: "mode_set",
    0x606100: "mode",
    0x603F00: "error_code",
    0x60FD00: "inputs",
    0x60FE01: "outputs",
    0x100100: "error_register",
}
_PROFILE: Final = 0x60
"""Objects of a device profile begin with 6000h."""
_SILENCE_NS: Final = S
"""A node without heartbeat that sends nothing for so long is not known."""
_EMCY_NS: Final = 100_000_000
"""An EMCY this long before the change of state belongs to it, or longer where no status word came meanwhile.
"""


_STAYED_AWAY: Final = "its process data {:03X}h stayed away"


class LogNode:
    """Any node: NMT state, boot-up, heartbeat, EMCY."""

    def __init__(self, facts: NodeFacts, emit: Emit) -> None:
        self.facts = facts
        self.table = Table(facts.name, facts.enums)
        self.axis = None if facts.axis is None else Table(facts.axis.name)
        self.seen = False
        """Whether the node itself has sent anything."""
        self._emit = emit
        self._nmt = -1
        self._emcy_ns = 0
        self._heartbeat_ns: int | None = None
        self._emcy = 0
        self._heard_ns: int | None = None
        self._silence_ns = facts.consumer_heartbeat_ns or _SILENCE_NS
        self._begun_ns = 0
        self._pdos: dict[int, Pdo] = {}
        self._showed_profile = False
        """Whether a drive has sent its state or values."""
        self._showed_state = False
        """Whether a drive has sent its status word."""
        self._led: bool | None = None
        """Whether process data come; None before the first."""
        self._state = ""
        """State of the drive as the last status word told it; empty: not known."""
        self._fitted_ns: dict[int, int] = {}
        """Process data -> time of the last one of the mapping known."""
        self._misfits: set[int] = set()
        """Process data that were of another length the last time."""

    def begin(self, time_ns: int) -> None:
        """Take the begin of the log: until its first frame nothing is known of the node."""
        self._begun_ns = time_ns
        self._heard_ns = time_ns

    def heard(self, time_ns: int) -> None:
        """Take note that the node has sent something."""
        self.seen = True
        last = self._heard_ns
        if last is not None and time_ns - last > self._silence_ns:
            self.unknown(last, time_ns, "it sends nothing")
        self._heard_ns = time_ns

    def end(self, time_ns: int) -> None:
        """Take the end of the log."""
        self.silence(time_ns)
        last = self._heard_ns
        if last is not None and time_ns - last > self._silence_ns:
            self.unknown(last, None, "it sends nothing")
        for can_id, pdo in self._pdos.items():
            if self._led and pdo.stayed_away(time_ns):
                self.unknown(pdo.time_ns, None, _STAYED_AWAY.format(can_id), values=True)
        if self.facts.profile not in ("cia402", "profidrive", "other"):
            reason = f"states and values of the profile {self.facts.profile} are not read from a log"
            self.unknown(self._begun_ns, None, reason, values=True)
        elif self.speechless:
            self.unknown(
                self._begun_ns, None, "it sends no process data that the bench file maps", values=True
            )
        elif self._showed_profile and not self._showed_state:
            reason = "its status word is not in the log"
            self.unknown(self._begun_ns, None, reason, values=True, about=STATES)

    def unknown(
        self, from_ns: int, to_ns: int | None, reason: str, *, values: bool = False, about: str = ""
    ) -> None:
        """Tell that nothing is known of the node and its axis for a time; with `values` but for what is no
        process data.
        """
        further = {"about": about} if about else {}
        for name in self._names():
            self._emit(from_ns, name, "log.silent", reason=reason, values=values, **further)
            if to_ns is not None:
                self._emit(to_ns, name, "log.heard", values=values)

    def excuse(self, from_ns: int, to_ns: int, reason: str) -> None:
        """Tell of a time in which the node may have sent what was not
        recorded: no heartbeat was lost then.
        """
        self.unknown(from_ns, to_ns, reason)
        self._heard_ns = to_ns
        if self._heartbeat_ns is not None:
            self._heartbeat_ns = to_ns

    @property
    def speechless(self) -> bool:
        """Whether a drive has sent no process data."""
        return self.facts.profile in ("cia402", "profidrive") and not self._showed_profile

    def _names(self) -> tuple[str, ...]:
        axis = self.facts.axis
        return (self.facts.name,) if axis is None else (self.facts.name, axis.name)

    def _takes_part(self, time_ns: int, can_id: int, sync_ns: int | None, *, sent: bool) -> None:
        """Take note of process data: those of a node that is not operational are of long ago, as are those
        that stay away.
        """
        if not sent:
            return
        self.heard(time_ns)
        if self._led is False:
            for name in self._names():
                self._emit(time_ns, name, "log.heard", values=True)
            self._pdos.clear()
        self._led = True
        if sync_ns is None:
            return
        pdo = self._pdos.get(can_id)
        if pdo is None:
            pdo = self._pdos[can_id] = Pdo()
        elif pdo.stayed_away(sync_ns):
            self.unknown(pdo.time_ns, time_ns, _STAYED_AWAY.format(can_id), values=True)
        pdo.take(time_ns, sync_ns)

    def misfit(
        self, time_ns: int, can_id: int, length: int, wanted: int, *, sync_ns: int | None, sent: bool
    ) -> None:
        """Take process data of another length than the mapping known: what is in them is not known, nor was
        it since the last ones that fitted.
        """
        self._takes_part(time_ns, can_id, sync_ns, sent=sent)
        if can_id in self._misfits:
            return
        self._misfits.add(can_id)
        reason = f"its process data {can_id:03X}h have {length} bytes, {wanted} by the mapping known"
        since_ns = self._fitted_ns.get(can_id, self._begun_ns)
        for name in self._names():
            self._emit(since_ns, name, "log.silent", reason=reason, values=True, about=f"{can_id:03X}h")
        self._state = ""

    def fits(self, time_ns: int, can_id: int) -> None:
        """Take note that process data have the length of the mapping known."""
        self._fitted_ns[can_id] = time_ns
        if can_id in self._misfits:
            self._misfits.remove(can_id)
            for name in self._names():
                self._emit(time_ns, name, "log.heard", values=True, about=f"{can_id:03X}h")

    def error_control(self, time_ns: int, data: bytes) -> None:
        """Take boot-up, heartbeat or guarding answer."""
        self.heard(time_ns)
        if len(data) != 1:
            return
        self.silence(time_ns)
        name, state = self.facts.name, data[0] & 0x7F
        self._heartbeat_ns = time_ns
        if data[0] == 0:
            self._emit(time_ns, "controller", "node.bootup", node=self.facts.node_id, name=name)
            self._nmt, state = int(NmtState.INITIALISING), int(NmtState.PRE_OPERATIONAL)
        if state != self._nmt:
            details: dict[str, Scalar] = {"to": _nmt_name(state)}
            if self._nmt >= 0:
                details = {"from": _nmt_name(self._nmt), **details}
            self._emit(time_ns, name, "nmt.state", **details)
            self._emit(time_ns, name, "drive.nmt", **details)
            self._nmt = state
            if state != NmtState.OPERATIONAL and self._led:
                self._led = False
                self.unknown(time_ns, None, f"it sends no process data, {_nmt_name(state)}", values=True)
        self.table.set("nmt_state", state)
        self.table.row(time_ns)

    def silence(self, time_ns: int) -> None:
        """Tell of a heartbeat that did not come within the time of the bench
        file, as the controller would have.
        """
        limit, last = self.facts.consumer_heartbeat_ns, self._heartbeat_ns
        if limit and last is not None and time_ns - last > limit:
            self._emit(last + limit, "controller", "heartbeat.lost", node=self.facts.node_id)
            self._heartbeat_ns = None

    def emergency(self, time_ns: int, data: bytes) -> None:
        """Take an EMCY."""
        self.heard(time_ns)
        if len(data) != 8:
            return
        code, register, name = int.from_bytes(data[:2], "little"), data[2], self.facts.name
        if code:
            self._emit(time_ns, name, "emcy.raised", code=code, register=register, data=data[3:].hex())
        else:
            self._emit(time_ns, name, "emcy.cleared", code=self._emcy, register=register)
        self._emit(
            time_ns,
            "controller",
            "emcy.received",
            node=self.facts.node_id,
            name=name,
            code=code,
            register=register,
            text=emcy_text(code),
        )
        self._emcy, self._emcy_ns = code, time_ns

    def process_data(
        self,
        time_ns: int,
        values: list[tuple[int, int]],
        can_id: int,
        *,
        sync_ns: int | None,
        sent: bool,
    ) -> None:
        """Take a PDO; `sent`: by the node itself. Objects without a meaning known
        here are columns of their number.
        """
        self._takes_part(time_ns, can_id, sync_ns, sent=sent)
        for key, value in values:
            if key >= 0x100000:
                self.table.set(_column(key), value)
        self.table.row(time_ns)


def _nmt_name(state: int) -> str:
    return NmtState(state).name if state in {int(one) for one in NmtState} else f"state {state}"


def _column(key: int) -> str:
    sub = key & 0xFF
    return f"x{key >> 8:04x}_{sub}" if sub else f"x{key >> 8:04x}"


class Cia402Node(LogNode):
    """A CiA 402 drive."""

    def __init__(self, facts: NodeFacts, emit: Emit) -> None:
        super().__init__(facts, emit)
        self._tripped = 0
        self._status_ns = 0
        axis = facts.axis
        self._motion = (
            None if axis is None or self.axis is None else Motion(self.axis, axis.increment, axis.unit)
        )

    @override
    def process_data(
        self, time_ns: int, values: list[tuple[int, int]], can_id: int, *, sync_ns: int | None, sent: bool
    ) -> None:
        self._takes_part(time_ns, can_id, sync_ns, sent=sent)
        table, axis = self.table, self.axis
        self._showed_profile = self._showed_profile or (
            sent and any(key >> 16 >= _PROFILE for key, _ in values)
        )
        for key, value in values:
            match key:
                case 0x606400:
                    table.set("encoder_increments", value, "inc")
                    if self._motion is not None:
                        self._motion.take(value, time_ns, sync_ns)
                case 0x606C00 if axis is not None:
                    axis.set("actual_speed", value * 0.001, "rpm")
                case 0x607700 if axis is not None:
                    axis.set("actual_torque", value * 0.001 * self.facts.rated_torque_nm, "Nm")
                case 0x60FF00 if axis is not None:
                    axis.set("speed_output", value * 0.001, "rpm")
                case _:
                    self._word(time_ns, key, value)
        table.row(time_ns)
        if axis is not None:
            axis.row(time_ns)

    def _word(self, time_ns: int, key: int, value: int) -> None:
        column = _WORDS.get(key)
        if column is None:
            if key >= 0x100000:
                self.table.set(_column(key), value)
            return
        before = self.table.get(column)
        self.table.set(column, value)
        if column == "statusword":
            self._take_state(time_ns, value)
            self._status_ns = time_ns
        elif column == "inputs" and before is not None and before != value:
            self._emit(time_ns, self.facts.name, "drive.inputs", inputs=value)

    def _take_state(self, time_ns: int, statusword: int) -> None:
        state = decode_state(statusword)
        self._showed_state = True
        self.table.set("state", int(state))
        if state.text == self._state:
            return
        name = self.facts.name
        details = {"from": self._state, "to": state.text} if self._state else {"to": state.text}
        before = self._state
        tripped = state.name in ("FAULT", "FAULT_REACTION_ACTIVE") and not self._state.startswith("Fault")
        self._state = state.text
        self._emit(time_ns, name, "drive.state", **details)
        if tripped:
            # The EMCY goes out when the drive trips, the status word with the next SYNC.
            last_ns = max(time_ns - _EMCY_NS, 0) if self._status_ns > self._emcy_ns else self._status_ns
            reported = self._emcy != 0 and self._emcy_ns > last_ns
            self._tripped = self._emcy if reported else 0
            when = self._emcy_ns if reported else time_ns
            self._emit(when, name, "drive.fault", code=self._tripped, text=emcy_text(self._tripped))
        elif before == "Fault":
            self._emit(time_ns, name, "drive.fault_cleared", codes=f"{self._tripped:04X}h")


_STATUS_INPUTS, _STATUS_FAULT, _STATUS_WARNING = 0x22D200, 0x285300, 0x285400
_WORDS_TO, _WORDS_FROM = 0x5800, 0x5810
_N4: Final = 0x4000_0000
_N2: Final = 0x4000
_FAULT, _NO_OFF3, _PULSES = 0x0008, 0x0020, 0x0400


class ProfidriveNode(LogNode):
    """A PROFIdrive axis whose telegram is in words on PDOs."""

    def __init__(self, facts: NodeFacts, emit: Emit) -> None:
        super().__init__(facts, emit)
        assert facts.telegram is not None
        self._setpoint, self._actual = facts.telegram.setpoint, facts.telegram.actual
        self._out = bytearray(self._setpoint.length)
        self._back = bytearray(self._actual.length)
        self._fault = False
        self._number = 0
        axis = facts.axis
        self._motion = (
            None if axis is None or self.axis is None else Motion(self.axis, axis.increment, axis.unit)
        )

    @override
    def process_data(
        self, time_ns: int, values: list[tuple[int, int]], can_id: int, *, sync_ns: int | None, sent: bool
    ) -> None:
        self._takes_part(time_ns, can_id, sync_ns, sent=sent)
        whole = False
        for key, value in values:
            index = key >> 8
            if _WORDS_TO <= index < _WORDS_FROM or _WORDS_FROM <= index < 0x5820:
                first, words = (_WORDS_TO, self._out) if index < _WORDS_FROM else (_WORDS_FROM, self._back)
                at = 2 * (index - first)
                words[at : at + 2] = (value & 0xFFFF).to_bytes(2, "big")
                whole = whole or at + 2 == len(words)
            elif key == _STATUS_INPUTS:
                self.table.set("inputs", value)
            elif key == _STATUS_FAULT:
                self._number = value
                self.table.set("fault_number", value)
            elif key == _STATUS_WARNING:
                self.table.set("warning_number", value)
        self._showed_profile = self._showed_profile or (whole and sent)
        if whole and sent:
            self._take_actual(time_ns, self._actual.decode(bytes(self._back)), sync_ns)
        elif whole:
            self._take_setpoint(self._setpoint.decode(bytes(self._out)))
        self.table.row(time_ns)
        if whole and self.axis is not None:
            self.axis.row(time_ns)

    def _take_setpoint(self, signals: dict[str, int]) -> None:
        for name, value in signals.items():
            column = name.lower()
            self.table.set(f"drive_{column}" if column in ("stw1", "stw2") else column, value)
        if self.axis is not None:
            self.axis.set("stw1", signals.get("STW1", 0))
            self._speed(signals, "NSOLL", "speed_output")

    def _take_actual(self, time_ns: int, signals: dict[str, int], sync_ns: int | None) -> None:
        for name, value in signals.items():
            column = name.lower()
            self.table.set(f"drive_{column}" if column in ("zsw1", "zsw2") else column, value)
        self._showed_state = True
        zsw1, zsw2 = signals.get("ZSW1", 0), signals.get("ZSW2")
        if self.axis is not None:
            self.axis.set("zsw1", zsw1)
            self._speed(signals, "NIST", "actual_speed")
        if self._motion is not None and "G1_XIST1" in signals:
            self._motion.take(signals["G1_XIST1"], time_ns, sync_ns)
        self._take_state(time_ns, zsw1, zsw2)

    def _speed(self, signals: dict[str, int], name: str, column: str) -> None:
        """Set a speed of the axis from a normalised signal of 16 or 32 bits."""
        assert self.axis is not None
        for suffix, one, bits in (("_A", _N2, 16), ("_B", _N4, 32)):
            value = signals.get(name + suffix)
            if value is not None:
                signed = value - (1 << bits) if value >> (bits - 1) > 0 else value
                self.axis.set(column, signed / one * self.facts.reference_speed_rpm, "rpm")

    def _take_state(self, time_ns: int, zsw1: int, zsw2: int | None) -> None:
        if not zsw1:
            return  # before the first cyclic data
        text = self._state_text(zsw1, zsw2)
        name = self.facts.name
        for number, known in self.facts.enums.get("state", {}).items():
            if known == text:
                self.table.set("state", number)
        if text and text != self._state:
            details = {"from": self._state, "to": text} if self._state else {"to": text}
            self._emit(time_ns, name, "drive.state", **details)
            self._state = text
        fault = zsw1 & _FAULT != 0
        if fault and not self._fault:
            self._emit(time_ns, name, "drive.fault", number=self._number)
        self._fault = fault

    def _state_text(self, zsw1: int, zsw2: int | None) -> str:
        """Return the state; ZSW1 alone does not tell S3 from the stops of S5,
        in which there are still pulses.
        """
        bits = zsw1 & 0x47
        if bits == 0x03:
            pulses = self._state[:2] in ("S4", "S5") if zsw2 is None else zsw2 & _PULSES != 0
            if not pulses or self._state.startswith("S3"):
                wanted = "S3"
            else:
                wanted = "S5 ramp" if zsw1 & _NO_OFF3 else "S5 quick"
        else:
            wanted = {0x40: "S1", 0x01: "S2", 0x07: "S4"}.get(bits, "-")
        return next(
            (text for text in self.facts.enums.get("state", {}).values() if text.startswith(wanted)), ""
        )


def node_of(facts: NodeFacts, emit: Emit) -> LogNode:
    """Return the reader of a node."""
    if facts.profile == "cia402":
        return Cia402Node(facts, emit)
    if facts.profile == "profidrive":
        return ProfidriveNode(facts, emit)
    return LogNode(facts, emit)

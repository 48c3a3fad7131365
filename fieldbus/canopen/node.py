"""A node as its controller sees it: taken into service, supervised, taken in again when it comes back."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from fieldbus.canopen.boot import BootFailure, BootReport, BootRunner, BootState, Negotiator, boot_script
from fieldbus.canopen.connection import BusConnection
from fieldbus.canopen.nmt import COB_EMCY, COB_ERROR_CONTROL, COB_NMT, NmtCommand, NmtState
from fieldbus.canopen.node_setup import NodeSetup
from fieldbus.canopen.sdo_client import SdoClient
from fieldbus.canopen.supervision import HeartbeatWatch, NodeGuard
from fieldbus.cia402 import emcy_text
from fieldbus.clock import MS, S, Scheduler, Timer
from fieldbus.history import Scalar

EMCY_LIMIT: Final = 254
"""EMCYs that are kept of each node, the newest; as many as 1003h can hold."""
BOOT_UP_NS: Final = 5 * MS
"""How long a boot-up is waited for before a node is asked whether it is there, ns."""
RETRY_NS: Final = 200 * MS
"""Pause before a silent node is asked again at the start, ns."""
SEARCH_NS: Final = 1 * S
"""Pause before a lost node is asked whether it is there, ns; a boot-up or heartbeat counts at once.
"""
START_TIMEOUT_NS: Final = 1 * S
"""How long a node may take to show that it is Operational, ns."""

_NAMES: Final = {int(state): state.name for state in NmtState}


class EventWriter(Protocol):
    """Writes an event into the history."""

    def __call__(self, kind: str, **data: Scalar) -> None:
        """Write an event of `kind`."""


class Emcy(NamedTuple):
    """An emergency message of a node (C301-108)."""

    time_ns: int
    code: int
    register: int
    """Error register 1001h."""
    data: bytes
    """Five manufacturer-specific bytes."""

    @property
    def text(self) -> str:
        """What the code means."""
        return emcy_text(self.code)


class NodeUser(Protocol):
    """A user of a node: called, within callbacks, with what concerns its use."""

    def node_restarted(self) -> None:
        """The node has restarted: its state is lost."""

    def node_in_service(self) -> None:
        """The node is checked, configured and Operational."""

    def node_lost(self, reason: str) -> None:
        """The node must not be relied on any more."""

    def node_state(self, state: int) -> None:
        """The node reports another NMT state."""

    def node_emcy(self, code: int) -> None:
        """The node has sent an EMCY."""


class RemoteNode:
    """One node of the network; made by `CanopenMaster.add_node`.

    `boot` begins. From then on the node is taken into service whenever it is there: it is checked, configured
    as far as it differs, started, and supervised. A node that is silent is asked again and again. One that is
    another device, or refuses a parameter, stays `FAILED` until it restarts or `boot` is called.

    Args:
        setup: What the node is expected to be.
        user: Called with what concerns the use of the node; None = no user.
        scheduler: Time.
        connection: Connection of the controller to the segment.
        sdo: SDO client of the node.
        report: Writes an event into the history.

    """

    def __init__(
        self,
        setup: NodeSetup,
        user: NodeUser | None,
        *,
        scheduler: Scheduler,
        connection: BusConnection,
        sdo: SdoClient,
        report: EventWriter,
    ) -> None:
        self.setup = setup
        self.node_id = setup.node_id
        self.name = setup.name
        self.sdo: Final = sdo
        """The client for reads and writes of your own; they wait behind those of the boot."""
        self.boot_state = BootState.OFF
        self.nmt_state: NmtState | None = None
        """As last reported by boot-up, heartbeat or guarding; None = not yet."""
        self.failure: BootFailure | None = None
        """Why the last boot did not succeed."""
        self.report = BootReport()
        """What the last boot has found and written."""
        self.emcys: deque[Emcy] = deque(maxlen=EMCY_LIMIT)
        """EMCYs received, oldest first."""
        self.bootups = 0
        """Boot-up messages received."""
        self.losses = 0
        """How often the node went out of service without a command."""
        self._scheduler = scheduler
        self._connection = connection
        self._report = report
        self._user = user
        self._runner = BootRunner(self.sdo, self._configured, self._fail)
        self._in_place = False
        self._began_ns = 0
        self._retry: Timer | None = None
        self._start_timer: Timer | None = None
        self._signs: list[Callable[[], None]] = []
        self.negotiator: Negotiator | None = None
        """Knows what to try next when the node refuses a part of its configuration; None: the boot fails."""
        self._heartbeat: HeartbeatWatch | None = None
        self._guard: NodeGuard | None = None
        self._supervise()
        connection.subscribe(COB_ERROR_CONTROL + setup.node_id, self._on_error_control)
        connection.subscribe(COB_EMCY + setup.node_id, self._on_emcy)

    def _supervise(self) -> None:
        """Make the supervision that the setup asks for."""
        setup, connection, scheduler = self.setup, self._connection, self._scheduler
        if self._heartbeat is not None:
            self._heartbeat.stop()
        if self._guard is not None:
            self._guard.stop()
        self._heartbeat = self._guard = None
        if setup.heartbeat_timeout_ms:
            self._heartbeat = HeartbeatWatch(
                scheduler,
                setup.heartbeat_timeout_ms * MS,
                on_lost=lambda: self._supervision_lost("heartbeat"),
                on_back=lambda: self._log("heartbeat.back"),
            )
        elif setup.guard_time_ms:
            self._guard = NodeGuard(
                scheduler,
                lambda: connection.send_remote(COB_ERROR_CONTROL + setup.node_id, 1),
                guard_time_ns=setup.guard_time_ms * MS,
                life_time_factor=setup.life_time_factor,
                on_lost=lambda reason: self._supervision_lost("guarding", reason=reason),
                on_back=lambda: self._log("guarding.back"),
            )

    # -- what a user asks
    # -------------------------------------------------------------------------------------

    @property
    def in_service(self) -> bool:
        """Whether the node is checked, configured and Operational."""
        return self.boot_state is BootState.IN_SERVICE

    @property
    def started(self) -> bool:
        """Whether the node has been commanded to start, and nothing has gone wrong since."""
        return self.boot_state in (BootState.STARTING, BootState.IN_SERVICE)

    @property
    def error_register(self) -> int:
        """1001h as of the last EMCY; 0 = no error."""
        return self.emcys[-1].register if self.emcys else 0

    @property
    def identity(self) -> dict[str, int]:
        """1018h as the last boot has found it: `vendor_id`, `product_code`, `revision`, `serial`."""
        return self.report.identity

    def boot(self) -> None:
        """Take the node into service, from the beginning; whatever was under way is given up.

        A node that was just switched on may be about to send its boot-up, which counts as the answer.
        """
        self._restart_boot()
        self._retry_later(BOOT_UP_NS)

    def _restart_boot(self) -> None:
        in_service = self.in_service
        self._forget()
        self.failure = None
        self._began_ns = self._scheduler.now
        self._enter(BootState.WAITING)
        if in_service and self._user is not None:
            self._user.node_lost("boot")
        self._in_place = False

    def stop(self) -> None:
        """Leave the node alone: no transfers, no supervision, until `boot`."""
        self._forget()
        if self._heartbeat is not None:
            self._heartbeat.stop()
        if self._guard is not None:
            self._guard.stop()
        self.boot_state = BootState.OFF

    def describe(self) -> dict[str, object]:
        """Return the present view of the node for reports: plain values only."""
        failure = self.failure
        return {
            "node": self.node_id,
            "name": self.name,
            "state": self.boot_state.value,
            "nmt_state": None if self.nmt_state is None else self.nmt_state.name,
            "device_type": self.report.device_type,
            "identity": dict(self.identity),
            "bootups": self.bootups,
            "losses": self.losses,
            "error_register": self.error_register,
            "failure": None if failure is None else str(failure),
            "emcy": [
                {
                    "time_ns": e.time_ns,
                    "code": e.code,
                    "register": e.register,
                    "data": e.data.hex(),
                    "text": e.text,
                }
                for e in self.emcys
            ],
        }

    def __repr__(self) -> str:
        return f"<RemoteNode {self.name} (node {self.node_id}): {self.boot_state.value}>"

    # -- boot
    # -------------------------------------------------------------------------------------------------

    def _begin(self, *, in_place: bool) -> None:
        self._in_place = in_place
        self.report = report = BootReport()
        self._runner.run(
            boot_script(
                self.setup, report, self._step, self._halt, in_place=in_place, negotiator=self.negotiator
            )
        )

    def _step(self, state: BootState) -> None:
        # A node that answers but is dead to supervision is searched quietly, again and again, until something
        # changes.
        if not self._missing:
            self._enter(state)

    def _halt(self) -> None:
        self._command(NmtCommand.ENTER_PRE_OPERATIONAL)

    @property
    def _missing(self) -> bool:
        """Whether heartbeat or guarding answer are missing."""
        watch = self._heartbeat or self._guard
        return watch is not None and watch.lost

    def _configured(self) -> None:
        report = self.report
        if self._missing and not report.written:
            # It is there and configured to show signs of life, and shows none: starting it would not help.
            self._retry_later(SEARCH_NS)
            return
        self._log(
            "node.configured",
            verified=report.verified,
            compared=report.compared,
            written=len(report.written),
            objects=", ".join(dict.fromkeys(f"{p.index:04X}h:{p.sub}" for p in report.written)),
        )
        for refused, instead in report.refused:
            index, sub, value, _size = refused.parameter
            self._log(
                "node.refused",
                object=f"{index:04X}h:{sub}",
                value=value,
                reason=refused.reason,
                instead=instead,
            )
        if report.setup is not None:
            watched = (self.setup.heartbeat_timeout_ms, self.setup.guard_time_ms)
            self.setup = report.setup
            if watched != (self.setup.heartbeat_timeout_ms, self.setup.guard_time_ms):
                self._supervise()
        if self._in_place and report.written and self._user is not None:
            # It has lost its parameters without our seeing the boot-up: it was off.
            self._user.node_restarted()
        self._enter(BootState.STARTING)
        self._command(NmtCommand.START)
        if self._guard is not None:
            self._guard.start()
        self._watch_for_signs()
        self._start_timer = self._scheduler.after(
            max(START_TIMEOUT_NS, self.setup.heartbeat_timeout_ms * MS), self._start_due
        )

    def _watch_for_signs(self) -> None:
        """Take whatever proves the state Operational: a PDO, or error control (see `_report_state`)."""
        subscribe = self._connection.subscribe
        for pdo in self.setup.pdos:
            if pdo.transmit and pdo.entries is not None:
                self._signs.append(subscribe(pdo.cob_id, self._on_pdo))

    def _on_pdo(self, _data: bytes, _time_ns: int) -> None:
        if not self._missing:  # otherwise it has to show itself to the supervision first
            self._operational()

    def _operational(self) -> None:
        if self.boot_state is not BootState.STARTING:
            return
        self._signs_stop()
        self._enter(BootState.IN_SERVICE)
        self.failure = None
        self._log("node.booted", duration_ms=(self._scheduler.now - self._began_ns) / MS)
        if self._heartbeat is not None:
            self._heartbeat.expect()
        if self._user is not None:
            self._user.node_in_service()

    def _start_due(self) -> None:
        self._start_timer = None
        watched = self._heartbeat is not None or self._guard is not None
        if not watched and not self._signs:
            self._operational()  # there is nothing by which it could show it
            return
        self._fail(
            BootFailure(
                self.setup,
                BootState.STARTING,
                "does not become Operational: no PDO and no state Operational in its error control",
                expected=NmtState.OPERATIONAL,
                observed=None if self.nmt_state is None else int(self.nmt_state),
                silent=True,
            )
        )

    def _fail(self, failure: BootFailure) -> None:
        self._forget()
        self.failure = failure
        searching = failure.silent and self.boot_state in (BootState.WAITING, BootState.LOST)
        if not searching:
            self._enter(BootState.FAILED)
            self._log(
                "node.failed",
                step=failure.state.value,
                object=f"{failure.index:04X}h:{failure.sub}" if failure.index else None,
                expected=failure.expected,
                observed=failure.observed,
                abort_code=failure.abort_code,
                message=str(failure),
            )
        if failure.silent:
            self._retry_later(SEARCH_NS if self.boot_state is BootState.LOST else RETRY_NS)

    def _retry_later(self, delay_ns: int) -> None:
        self._retry_stop()
        self._retry = self._scheduler.after(delay_ns, self._try_again)

    def _try_again(self) -> None:
        self._retry = None
        if self.nmt_state in (NmtState.STOPPED, NmtState.INITIALISING):
            # Somebody may have stopped it after its boot-up: a stopped node answers no SDO.
            self._command(NmtCommand.ENTER_PRE_OPERATIONAL)
        self._begin(in_place=self._in_place)

    def _retry_stop(self) -> None:
        if self._retry is not None:
            self._retry.cancel()
            self._retry = None

    def _forget(self) -> None:
        """Give up what is under way."""
        self._runner.cancel()
        self._signs_stop()
        self._retry_stop()

    def _signs_stop(self) -> None:
        for remove in self._signs:
            remove()
        self._signs.clear()
        if self._start_timer is not None:
            self._start_timer.cancel()
            self._start_timer = None

    def _enter(self, state: BootState) -> None:
        if state is self.boot_state:
            return
        self.boot_state = state
        if state not in (
            BootState.FAILED,
            BootState.LOST,
            BootState.IN_SERVICE,
        ):  # these have events of their own
            self._log("node.boot", step=state.value)

    def _command(self, command: NmtCommand) -> None:
        self._connection.send(COB_NMT, bytes((command, self.node_id)))

    def _log(self, kind: str, **data: Scalar) -> None:
        self._report(kind, node=self.node_id, name=self.name, **data)

    # -- supervision
    # ------------------------------------------------------------------------------------------

    def _on_error_control(self, data: bytes, time_ns: int) -> None:
        if data == b"\0":
            self._booted_up()
        watch = self._heartbeat or self._guard
        if watch is not None:
            watch.receive(data, time_ns)
            state = watch.state
        else:
            state = data[0] & 0x7F if len(data) == 1 else -1
        if state <= 0:
            return
        if state != self.nmt_state:
            if state in _NAMES:  # anything else is no state of the standard
                self._report_state(NmtState(state))
        elif self.boot_state is BootState.STARTING or (
            self.boot_state is BootState.LOST and not self._runner.running
        ):
            self._check_state(state)

    def _booted_up(self) -> None:
        """React to a boot-up: the node has restarted, whatever it was doing (C301-022)."""
        self.bootups += 1
        self.nmt_state = NmtState.INITIALISING
        unexpected = self.in_service
        self._log("node.bootup", unexpected=unexpected)
        if self._guard is not None:
            self._guard.restarted()
        if self._user is not None:
            self._user.node_state(NmtState.INITIALISING)
            self._user.node_restarted()
        if self.boot_state is BootState.OFF:
            return
        if unexpected:
            self._lose("boot-up")
        self._restart_boot()
        self._begin(in_place=False)

    def _report_state(self, state: NmtState) -> None:
        self.nmt_state = state
        if self._user is not None:
            self._user.node_state(state)
        self._check_state(state)

    def _check_state(self, state: int) -> None:
        """React to a state that is not the commanded one, and to a node that is back."""
        boot_state = self.boot_state
        if boot_state is BootState.STARTING:
            if state == NmtState.OPERATIONAL:
                self._operational()
            else:
                self._command(NmtCommand.START)  # the first command was lost
        elif boot_state is BootState.IN_SERVICE and state != NmtState.OPERATIONAL:
            self._lose(f"state {_NAMES[state]}")
            self._back(state)
        elif boot_state is BootState.LOST:
            self._back(state)

    def _supervision_lost(self, kind: str, reason: str | None = None) -> None:
        """React to a heartbeat or guarding event (C301-026, C301-030)."""
        self.nmt_state = None
        self._log(f"{kind}.lost", **({} if reason is None else {"reason": reason}))
        if self.in_service:
            self._lose(kind)
            self._in_place = True
            self._retry_later(SEARCH_NS)

    def _lose(self, reason: str) -> None:
        self.losses += 1
        self._forget()
        self._began_ns = self._scheduler.now
        self._enter(BootState.LOST)
        self._log("node.lost", reason=reason)
        if self._user is not None:
            self._user.node_lost(reason)

    def _back(self, state: int) -> None:
        """Begin the re-integration of a node that shows a sign of life without having booted."""
        self._forget()
        self._began_ns = self._scheduler.now
        if state == NmtState.STOPPED:
            self._command(NmtCommand.ENTER_PRE_OPERATIONAL)  # it could not answer otherwise
        self._begin(in_place=True)

    def note_command(self, command: int) -> None:
        """Follow an NMT command that the program gives by itself: a node that was stopped by command is not
        started again.
        """
        if self.boot_state is BootState.OFF:
            return
        if command == NmtCommand.START:
            if self.boot_state is BootState.HELD:
                self._back(NmtState.OPERATIONAL)
        elif command in (NmtCommand.STOP, NmtCommand.ENTER_PRE_OPERATIONAL):
            in_service = self.in_service
            self._forget()
            self._enter(BootState.HELD)
            if in_service and self._user is not None:
                self._user.node_lost("command")

    # -- EMCY
    # -------------------------------------------------------------------------------------------------

    def _on_emcy(self, data: bytes, time_ns: int) -> None:
        if len(data) != 8:
            return
        message = Emcy(time_ns, data[0] | data[1] << 8, data[2], data[3:])
        self.emcys.append(message)
        self._log("emcy.received", code=message.code, register=message.register, text=message.text)
        if self._user is not None:
            self._user.node_emcy(message.code)

"""How a node is taken into service, as a script of SDO transfers (after CiA
302): what to ask, in which order.

`boot_script` is a generator: it yields the transfers that it needs and is sent the ended jobs. It
knows neither bus nor time, so that it reads as the procedure that it is; `RemoteNode` runs it. What
goes wrong is a `BootFailure`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from enum import Enum
from typing import Final

from fieldbus.canopen.abort import AbortCode
from fieldbus.canopen.node_setup import IDENTITY, NodeSetup, Parameter, PdoSetup
from fieldbus.canopen.sdo_client import SdoClient, SdoJob
from fieldbus.errors import HilError

_SAVE: Final = 0x65766173
_ABSENT: Final = (AbortCode.NO_OBJECT, AbortCode.NO_SUB_INDEX, AbortCode.ACCESS, AbortCode.WRITE_ONLY)
_NAMES: Final = ("vendor-ID", "product code", "revision", "serial number")


class BootState(Enum):
    """Where a node is on its way into service."""

    OFF = "off"
    """Nobody has asked for it."""
    WAITING = "waiting"
    """For its boot-up, or an answer to 1000h."""
    DEVICE_TYPE = "device type"
    IDENTITY = "identity"
    VERIFICATION = "verification"
    """Comparing 1020h."""
    CONFIGURATION = "configuration"
    """Comparing entry by entry, writing what differs."""
    STORING = "storing"
    STARTING = "starting"
    """The start command is out; the node has not yet shown that it is Operational."""
    IN_SERVICE = "in service"
    LOST = "lost"
    """Was in service; heartbeat, guarding answer or the state Operational is missing."""
    HELD = "held"
    """Taken out of service by an NMT command of the controller's own."""
    FAILED = "failed"


Transfer = tuple[int, int, bytes | None]
"""An SDO transfer that a script asks for: index, sub-index, and what to write; None = read."""


class BootFailure(HilError):  # noqa: N818 - a failed boot is an outcome first
    """A node cannot be taken into service.

    Args:
        setup: The node.
        state: Where it failed.
        what: What happened, a sentence without the node.
        index: Object concerned; 0 = none.
        sub: Its sub-index.
        expected: What was expected, or written.
        observed: What was found.
        abort_code: Abort code of the SDO; 0 = none.
        silent: The node did not answer: another attempt makes sense.

    """

    def __init__(
        self,
        setup: NodeSetup,
        state: BootState,
        what: str,
        *,
        index: int = 0,
        sub: int = 0,
        expected: int | None = None,
        observed: int | None = None,
        abort_code: int = 0,
        silent: bool = False,
    ) -> None:
        super().__init__(f"{setup.name} (node {setup.node_id}) {what}")
        self.state = state
        self.what = what
        self.index = index
        self.sub = sub
        self.expected = expected
        self.observed = observed
        self.abort_code = abort_code
        self.silent = silent


class BootReport:
    """What a boot has found and done; filled step by step."""

    def __init__(self) -> None:
        self.device_type: int | None = None
        """1000h."""
        self.identity: dict[str, int] = {}
        """1018h, as far as the node has it."""
        self.verified = False
        """1020h said that the configuration is the wanted one; nothing else was compared."""
        self.compared = 0
        """Entries that were read and compared."""
        self.written: list[Parameter] = []
        """What was written of the configuration, in order; without `prepare`, 1010h and 1020h."""


Script = Generator[Transfer, SdoJob, None]


def boot_script(
    setup: NodeSetup,
    report: BootReport,
    enter: Callable[[BootState], None],
    halt: Callable[[], None],
    *,
    in_place: bool,
) -> Script:
    """Return the script that checks and configures a node up to the point where it may be started.

    Args:
        setup: What the node is expected to be.
        report: Filled step by step.
        enter: Called at every step.
        halt: Takes the node to Pre-operational; called before PDOs or parameters are written.
        in_place: The node was in service and shows no sign of a new start: nothing is written as long as
            nothing differs, so that a drive which is just braking is not disturbed.

    Raises:
        BootFailure: From within: the node is silent, another one, or refuses.

    """
    read = _Reader(setup, report)
    device_type = yield from read.entry(BootState.WAITING, 0x1000, 0)
    enter(BootState.DEVICE_TYPE)
    report.device_type = device_type
    profile = setup.device_profile
    if profile is not None and device_type & 0xFFFF != profile:
        raise BootFailure(
            setup,
            BootState.DEVICE_TYPE,
            f"is no device of profile {profile}: 1000h is {device_type:08X}h, profile {device_type & 0xFFFF}",
            index=0x1000,
            expected=profile,
            observed=device_type,
        )
    enter(BootState.IDENTITY)
    for sub, (key, expected) in enumerate(zip(IDENTITY, setup.identity, strict=True), 1):
        observed = yield from read.optional(BootState.IDENTITY, 0x1018, sub)
        if observed is not None:
            report.identity[key] = observed
        if expected is not None and observed != expected:
            found = "does not have it" if observed is None else f"has {observed:08X}h"
            raise BootFailure(
                setup,
                BootState.IDENTITY,
                f"is another device: {_NAMES[sub - 1]} (1018h:{sub}) {expected:08X}h is expected, it {found}",
                index=0x1018,
                sub=sub,
                expected=expected,
                observed=observed,
            )
    if not in_place:
        yield from _prepare(setup, halt)
    if not setup.pdos and not setup.parameters:
        return  # it is as it is
    enter(BootState.VERIFICATION)
    stamp = yield from read.optional(BootState.VERIFICATION, 0x1020, 1)
    date, time = setup.signature
    if stamp == date:
        moment = yield from read.optional(BootState.VERIFICATION, 0x1020, 2)
        if moment == time:
            report.verified = True
            return
    enter(BootState.CONFIGURATION)
    yield from _configure(setup, report, read, halt, prepared=not in_place)
    if stamp is not None:
        for sub, value in enumerate((date, time), 1):
            yield from _write(setup, BootState.STORING, Parameter(0x1020, sub, value, 4))
    if setup.store and (report.written or stamp is not None):
        enter(BootState.STORING)
        yield from _write(setup, BootState.STORING, Parameter(0x1010, 1, _SAVE, 4))


def _prepare(setup: NodeSetup, halt: Callable[[], None]) -> Script:
    if setup.prepare or setup.pdos or setup.parameters:
        halt()
    for parameter in setup.prepare:
        yield from _write(setup, BootState.CONFIGURATION, parameter)


def _configure(
    setup: NodeSetup, report: BootReport, read: _Reader, halt: Callable[[], None], *, prepared: bool
) -> Script:
    """Compare entry by entry and write what differs; a PDO with one difference is set up as a whole."""
    groups: tuple[PdoSetup | Parameter, ...] = (*setup.pdos, *setup.parameters)
    for group in groups:
        if isinstance(group, PdoSetup):
            equal = yield from _pdo_equal(group, read)
            writes: tuple[Parameter, ...] = group.writes
        else:
            equal = (yield from read.compared(group)) == group.value & (1 << 8 * group.size) - 1
            writes = (group,)
        if equal:
            continue
        if not prepared:
            prepared = True
            yield from _prepare(setup, halt)
        for parameter in writes:
            yield from _write(setup, BootState.CONFIGURATION, parameter)
            report.written.append(parameter)


def _pdo_equal(pdo: PdoSetup, read: _Reader) -> Generator[Transfer, SdoJob, bool]:
    """Compare up to the first difference."""
    for parameter in pdo.wanted:
        if pdo.entries is None:
            # A PDO that the device does not even have is not in the way.
            found = yield from read.optional(BootState.CONFIGURATION, parameter.index, parameter.sub)
            return found is None or pdo.satisfied(parameter, found)
        if not pdo.satisfied(parameter, (yield from read.compared(parameter))):
            return False
    return True


def _write(setup: NodeSetup, state: BootState, parameter: Parameter) -> Script:
    index, sub, value, size = parameter
    try:
        data = value.to_bytes(size, "little", signed=value < 0)
    except OverflowError:
        raise refusal(setup, state, parameter, 0, f"the object has {8 * size} bits") from None
    job = yield index, sub, data
    if job.abort_code:
        if job.timed_out:
            raise _silence(setup, state, index, sub)
        raise refusal(setup, state, parameter, job.abort_code, job.reason)


def refusal(
    setup: NodeSetup, state: BootState, parameter: Parameter, abort_code: int, reason: str
) -> BootFailure:
    """Return the failure of a node that does not take a value."""
    index, sub, value, size = parameter
    shown = f"{value} ({value & (1 << 8 * size) - 1:X}h)"
    return BootFailure(
        setup,
        state,
        f"refuses {index:04X}h:{sub} = {shown}: {reason}",
        index=index,
        sub=sub,
        expected=value,
        abort_code=abort_code,
    )


def _silence(setup: NodeSetup, state: BootState, index: int, sub: int) -> BootFailure:
    return BootFailure(
        setup,
        state,
        f"does not answer to {index:04X}h:{sub}",
        index=index,
        sub=sub,
        abort_code=AbortCode.TIMEOUT,
        silent=True,
    )


class _Reader:
    """Reads entries within a script."""

    def __init__(self, setup: NodeSetup, report: BootReport) -> None:
        self._setup = setup
        self._report = report

    def entry(self, state: BootState, index: int, sub: int) -> Generator[Transfer, SdoJob, int]:
        """Read an entry that has to be there."""
        job = yield index, sub, None
        if job.abort_code:
            raise self._failure(job, state, index, sub)
        return job.value

    def optional(self, state: BootState, index: int, sub: int) -> Generator[Transfer, SdoJob, int | None]:
        """Read an entry that a device may leave out; None = it does."""
        job = yield index, sub, None
        if not job.abort_code:
            return job.value
        if job.abort_code in _ABSENT:
            return None
        raise self._failure(job, state, index, sub)

    def compared(self, parameter: Parameter) -> Generator[Transfer, SdoJob, int]:
        """Read what is about to be compared with `parameter`."""
        job = yield parameter.index, parameter.sub, None
        if not job.abort_code:
            self._report.compared += 1
            return job.value & (1 << 8 * parameter.size) - 1
        if job.timed_out:
            raise _silence(self._setup, BootState.CONFIGURATION, parameter.index, parameter.sub)
        if job.abort_code in (AbortCode.WRITE_ONLY, AbortCode.ACCESS):
            return -1  # what cannot be read is written
        raise refusal(self._setup, BootState.CONFIGURATION, parameter, job.abort_code, job.reason)

    def _failure(self, job: SdoJob, state: BootState, index: int, sub: int) -> BootFailure:
        if job.timed_out:
            return _silence(self._setup, state, index, sub)
        return BootFailure(
            self._setup,
            state,
            f"does not let {index:04X}h:{sub} be read: {job.reason}",
            index=index,
            sub=sub,
            abort_code=job.abort_code,
        )


class BootRunner:
    """Runs one script at a time.

    Args:
        sdo: Client of the node.
        on_done: Called when a script has come to its end.
        on_failure: Called with the reason when it has not.

    """

    def __init__(
        self, sdo: SdoClient, on_done: Callable[[], object], on_failure: Callable[[BootFailure], object]
    ) -> None:
        self._sdo = sdo
        self._on_done = on_done
        self._on_failure = on_failure
        self._script: Script | None = None
        self._job: SdoJob | None = None

    @property
    def running(self) -> bool:
        """Whether a script is under way."""
        return self._script is not None

    def run(self, script: Script) -> None:
        """Begin a script; one that is under way is given up."""
        self.cancel()
        self._script = script
        self._advance(None)

    def cancel(self) -> None:
        """Cancel what is under way; no callback is called."""
        self._script = None
        if self._job is not None:
            self._job.cancel()
            self._job = None

    def _advance(self, job: SdoJob | None) -> None:
        script = self._script
        self._job = None
        if script is None:
            return
        try:
            index, sub, data = script.send(job)  # type: ignore[arg-type]  # None starts a generator
        except StopIteration:
            self._script = None
            self._on_done()
        except BootFailure as failure:
            self._script = None
            self._on_failure(failure)
        else:
            sdo = self._sdo
            if data is None:
                self._job = sdo.upload(index, sub, self._advance)
            else:
                self._job = sdo.download(index, sub, data, self._advance)

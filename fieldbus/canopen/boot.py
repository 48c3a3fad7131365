"""How a node is taken into service, as a script of SDO transfers (after CiA
302): what to ask, in which order.

`boot_script` is a generator: it yields the transfers that it needs and is sent the ended jobs. It
knows neither bus nor time, so that it reads as the procedure that it is; `RemoteNode` runs it. What
goes wrong is a `BootFailure`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from enum import Enum
from typing import Final, NamedTuple, Protocol

from fieldbus.canopen.abort import AbortCode
from fieldbus.canopen.node_setup import IDENTITY, NodeSetup, Parameter, PdoSetup
from fieldbus.canopen.sdo_client import SdoClient, SdoJob
from fieldbus.errors import ConfigurationError, HilError

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


class Refusal(NamedTuple):
    """A node does not take a value of its configuration."""

    parameter: Parameter
    pdo: PdoSetup | None
    """The PDO of which it is a part; None: of none."""
    abort_code: int
    reason: str


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
        self.differences: tuple[str, ...] = ()
        """What is not as wanted in a node that is compared and not written."""
        self.refusal: Refusal | None = None
        """What the node refused of its configuration; None: something else happened."""


class Negotiator(Protocol):
    """Decides how to go on with a node that refuses a part of its configuration."""

    def look_at(self, refusal: Refusal) -> Iterable[tuple[int, int]]:
        """Return what has to be known of the node: index and sub-index of entries."""

    def instead(self, refusal: Refusal, found: Mapping[int, int]) -> tuple[NodeSetup, str] | None:
        """Return the configuration to go on with and what it does instead; None: there is none.

        Args:
            refusal: What the node has refused.
            found: The entries asked for, by `index << 8 | sub-index`, as far as the node has them.

        """


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
        self.refused: list[tuple[Refusal, str]] = []
        """What the node has refused, and what was done instead."""
        self.setup: NodeSetup | None = None
        """The configuration that was gone on with after a refusal; None: that which was wanted."""


Script = Generator[Transfer, SdoJob, None]


def boot_script(
    setup: NodeSetup,
    report: BootReport,
    enter: Callable[[BootState], None],
    halt: Callable[[], None],
    *,
    in_place: bool,
    negotiator: Negotiator | None = None,
) -> Script:
    """Return the script that checks and configures a node up to the point where it may be started.

    Args:
        setup: What the node is expected to be.
        report: Filled step by step.
        enter: Called at every step.
        halt: Takes the node to Pre-operational; called before PDOs or parameters are written.
        in_place: The node was in service and shows no sign of a new start: nothing is written as long as
            nothing differs, so that a drive which is just braking is not disturbed.
        negotiator: Knows what to try next when the node refuses a value; None: the boot fails then.

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
    writing = not setup.compare_only
    if not in_place and writing:
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
    setup = yield from _negotiated(setup, report, read, halt, negotiator, prepared=not in_place)
    if stamp is not None and writing:
        date, time = setup.signature
        for sub, value in enumerate((date, time), 1):
            yield from _write(setup, BootState.STORING, Parameter(0x1020, sub, value, 4))
    if setup.store and writing and (report.written or stamp is not None):
        enter(BootState.STORING)
        yield from _write(setup, BootState.STORING, Parameter(0x1010, 1, _SAVE, 4))


def _prepare(setup: NodeSetup, halt: Callable[[], None]) -> Script:
    if setup.prepare or setup.pdos or setup.parameters:
        for index, sub, value, size in setup.calm:
            yield index, sub, value.to_bytes(size, "little", signed=value < 0)
        halt()
    for parameter in setup.prepare:
        yield from _write(setup, BootState.CONFIGURATION, parameter)


def _negotiated(
    setup: NodeSetup,
    report: BootReport,
    read: _Reader,
    halt: Callable[[], None],
    negotiator: Negotiator | None,
    *,
    prepared: bool,
) -> Generator[Transfer, SdoJob, NodeSetup]:
    """Configure the node, with another configuration whenever it refuses a part of one; return the last."""
    while True:
        try:
            yield from _configure(setup, report, read, halt, prepared=prepared)
        except BootFailure as failure:
            refused = failure.refusal
            if refused is None or negotiator is None:
                raise
            found: dict[int, int] = {}
            for index, sub in negotiator.look_at(refused):
                value = yield from read.optional(BootState.CONFIGURATION, index, sub)
                if value is not None:
                    found[index << 8 | sub] = value
            try:
                next_one = negotiator.instead(refused, found)
            except ConfigurationError as reason:
                failure.what += f"; nothing else is possible: {reason}"
                failure.args = (f"{setup.name} (node {setup.node_id}) {failure.what}",)
                raise failure from None
            if next_one is None:
                raise
            setup, text = next_one
            report.setup = setup
            report.refused.append((refused, text))
            prepared = True
        else:
            return setup


def _configure(
    setup: NodeSetup, report: BootReport, read: _Reader, halt: Callable[[], None], *, prepared: bool
) -> Script:
    """Compare entry by entry and write what differs; a PDO with one difference is set up as a whole."""
    groups: tuple[PdoSetup | Parameter, ...] = (*setup.pdos, *setup.parameters)
    differences: list[str] = []
    for group in groups:
        pdo = group if isinstance(group, PdoSetup) else None
        try:
            if isinstance(group, PdoSetup):
                different = yield from _pdo_difference(group, read)
                writes: tuple[Parameter, ...] = group.writes
            else:
                different = yield from _difference(group, read)
                writes = (group,)
            if different is None:
                continue
            if setup.compare_only:
                differences.append(different)
                continue
            if not prepared:
                prepared = True
                yield from _prepare(setup, halt)
            for parameter in writes:
                yield from _write(setup, BootState.CONFIGURATION, parameter)
                report.written.append(parameter)
        except BootFailure as failure:
            if failure.refusal is not None:
                failure.refusal = failure.refusal._replace(pdo=pdo)
            raise
    if differences:
        text = "; ".join(differences)
        wrong = BootFailure(
            setup, BootState.CONFIGURATION, f"is not set up as needed, and nothing is written into it: {text}"
        )
        wrong.differences = tuple(differences)
        raise wrong


def _difference(parameter: Parameter, read: _Reader) -> Generator[Transfer, SdoJob, str | None]:
    """Return what is not as wanted, in words; None: it is."""
    found = yield from read.compared(parameter)
    if found == parameter.value & (1 << 8 * parameter.size) - 1:
        return None
    return _not_as_wanted(parameter, found)


def _pdo_difference(pdo: PdoSetup, read: _Reader) -> Generator[Transfer, SdoJob, str | None]:
    """Return the first difference of a PDO, in words; None: it is as wanted."""
    for parameter in pdo.wanted:
        if pdo.entries is None:
            # A PDO that the device does not even have is not in the way.
            found = yield from read.optional(BootState.CONFIGURATION, parameter.index, parameter.sub)
            if found is None or pdo.satisfied(parameter, found):
                return None
            return _not_as_wanted(parameter, found)
        observed = yield from read.compared(parameter)
        if not pdo.satisfied(parameter, observed):
            return _not_as_wanted(parameter, observed)
    return None


def _not_as_wanted(parameter: Parameter, found: int) -> str:
    index, sub, value, size = parameter
    shown = "cannot be read" if found < 0 else f"is {found:0{2 * size}X}h"
    return f"{index:04X}h:{sub} {shown}, {value & (1 << 8 * size) - 1:0{2 * size}X}h is wanted"


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
    failure = BootFailure(
        setup,
        state,
        f"refuses {index:04X}h:{sub} = {shown}: {reason}",
        index=index,
        sub=sub,
        expected=value,
        abort_code=abort_code,
    )
    failure.refusal = Refusal(parameter, None, abort_code, reason)
    return failure


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

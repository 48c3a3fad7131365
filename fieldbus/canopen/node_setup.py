"""What a controller expects of a node and wants it to be: identity, PDOs, parameters, supervision."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from struct import Struct
from typing import Final, NamedTuple

from fieldbus.errors import ConfigurationError

_PARAMETER: Final = Struct("<HBB")
_INVALID: Final = 1 << 31
_NO_REMOTE: Final = 1 << 30

IDENTITY: Final = ("vendor_id", "product_code", "revision", "serial")
"""What 1018h:1 to 4 hold (C301-146)."""


class Parameter(NamedTuple):
    """A value for an entry of a node's dictionary."""

    index: int  # type: ignore[assignment]  # hides a method of tuples that nobody needs here
    sub: int
    value: int
    """Signed or unsigned."""
    size: int
    """Bytes of the object's type."""

    @property
    def key(self) -> int:
        """`index << 8 | sub-index`."""
        return self.index << 8 | self.sub

    @property
    def data(self) -> bytes:
        """The bytes on the bus.

        Raises:
            ConfigurationError: The value does not fit the type.

        """
        try:
            return self.value.to_bytes(self.size, "little", signed=self.value < 0)
        except OverflowError:
            low, high = -(1 << 8 * self.size - 1), (1 << 8 * self.size) - 1
            raise ConfigurationError(f"{self.index:04X}h:{self.sub}", self.value, f"{low}..{high}") from None


@dataclass(frozen=True)
class PdoSetup:
    """One PDO, as seen by the node.

    Args:
        transmit: A TPDO of the node (1800h); otherwise an RPDO (1400h).
        number: 1..512, as in TPDO1.
        cob_id: Identifier, 11 bits.
        kind: Transmission type (C301-038 to C301-044).
        entries: Mapping entries, index << 16 | sub-index << 8 | bits (C301-051); None = the PDO is not used.
        fixed: Keys (index << 8 | sub-index) of members of the two records that cannot be written.

    """

    transmit: bool
    number: int
    cob_id: int
    kind: int = 1
    entries: tuple[int, ...] | None = None
    fixed: frozenset[int] = frozenset()

    @property
    def communication(self) -> int:
        """Index of the communication record."""
        return (0x1800 if self.transmit else 0x1400) + self.number - 1

    @property
    def mapping(self) -> int:
        """Index of the mapping record."""
        return self.communication + 0x200

    @property
    def wanted(self) -> tuple[Parameter, ...]:
        """What the entries hold when the PDO is set up, in the order in which it pays to look at them."""
        word = self.cob_id | (_NO_REMOTE if self.transmit else 0)
        if self.entries is None:
            return self._writable(Parameter(self.communication, 1, word | _INVALID, 4))
        return self._writable(
            Parameter(self.mapping, 0, len(self.entries), 1),
            *(Parameter(self.mapping, sub, entry, 4) for sub, entry in enumerate(self.entries, 1)),
            Parameter(self.communication, 2, self.kind, 1),
            Parameter(self.communication, 1, word, 4),
        )

    def _writable(self, *parameters: Parameter) -> tuple[Parameter, ...]:
        if not self.fixed:
            return parameters
        return tuple(one for one in parameters if one.key not in self.fixed)

    @property
    def writes(self) -> tuple[Parameter, ...]:
        """What sets it up, in the order of the standard: not valid, no entries,
        entries, number, valid (C301-052).
        """
        wanted = self.wanted
        if self.entries is None:
            return wanted
        identifier = [one for one in wanted if one.key == self.communication << 8 | 1]
        count = [one for one in wanted if one.key == self.mapping << 8]
        entries = [one for one in wanted if one.index == self.mapping and one.sub]
        kind = [one for one in wanted if one.key == self.communication << 8 | 2]
        return (
            *(one._replace(value=one.value | _INVALID) for one in identifier),
            *(one._replace(value=0) for one in count),
            *entries,
            *count,
            *kind,
            *identifier,
        )

    @property
    def record(self) -> Iterator[tuple[int, int]]:
        """Index and sub-index of all that describes the PDO in the node."""
        yield from ((self.communication, 1), (self.communication, 2))
        yield from ((self.mapping, sub) for sub in range(9))

    def satisfied(self, parameter: Parameter, observed: int) -> bool:
        """Say whether an entry is as wanted; of a PDO that is not used the bit "not valid" alone matters."""
        if observed < 0:
            return False  # it could not be read
        if self.entries is None:
            return bool(observed & _INVALID)
        if parameter.index == self.communication and parameter.sub == 1:
            # Whether a node answers remote requests makes no difference to a controller that sends none.
            return observed & ~_NO_REMOTE == parameter.value & ~_NO_REMOTE
        return observed == parameter.value


@dataclass(frozen=True)
class NodeSetup:
    """A node of the network as the controller knows it.

    Args:
        node_id: 1..127.
        name: Its name in messages and in the history.
        device_profile: Low word of 1000h, 402 for a drive; None = any.
        vendor_id: Expected 1018h:1; None = any. Likewise the next three.
        product_code: Expected 1018h:2.
        revision: Expected 1018h:3.
        serial: Expected 1018h:4.
        calm: Written before the node is taken out of Operational, so that it does not take that for a
            fault; a node that refuses it is left as it is.
        prepare: Written before anything else whenever the node has restarted, so that nothing moves
            until it is configured.
        pdos: PDOs in the order in which they are set up.
        parameters: Everything else, in the order in which it is written.
        store: Have the node keep what was written (1010h:1).
        heartbeat_timeout_ms: Time after which a missing heartbeat counts as
            lost; 0 = no heartbeat is expected.
        guard_time_ms: Period of node guarding; 0 = none. Not together with a heartbeat (C301-024).
        life_time_factor: Guard times without a right answer after which the node counts as lost.
        optional: The network is ready without it.
        compare_only: Nothing is written; a node that is not set up as wanted is not taken into service.

    Raises:
        ConfigurationError: A number is out of range, or two ways of supervision are asked for.

    """

    node_id: int
    name: str
    device_profile: int | None = None
    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    calm: tuple[Parameter, ...] = ()
    prepare: tuple[Parameter, ...] = ()
    pdos: tuple[PdoSetup, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    store: bool = False
    heartbeat_timeout_ms: int = 0
    guard_time_ms: int = 0
    life_time_factor: int = 3
    optional: bool = False
    compare_only: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError(f"{self.name}: node_id", self.node_id, "1..127")
        if self.heartbeat_timeout_ms < 0 or self.guard_time_ms < 0:
            raise ConfigurationError(f"{self.name}: supervision", "a negative time", "0 or more ms")
        if self.heartbeat_timeout_ms and self.guard_time_ms:
            raise ConfigurationError(
                f"{self.name}: supervision", "heartbeat and node guarding", "one of the two"
            )
        if self.guard_time_ms and not 1 <= self.life_time_factor <= 255:
            raise ConfigurationError(f"{self.name}: life_time_factor", self.life_time_factor, "1..255")

    @property
    def identity(self) -> tuple[int | None, ...]:
        """Expected 1018h:1 to 4, in the order of `IDENTITY`; None = any."""
        return self.vendor_id, self.product_code, self.revision, self.serial

    def everything(self) -> Iterator[Parameter]:
        """Return all that commissioning may write, in order."""
        for pdo in self.pdos:
            yield from pdo.writes
        yield from self.parameters

    @cached_property
    def signature(self) -> tuple[int, int]:
        """Date (days) and time (ms of the day) that stand for this configuration in 1020h (C301-148).

        They are no date but a digest in the form of one: equal for equal configurations, never 0.
        """
        digest = sha256()
        for index, sub, value, size in self.everything():
            digest.update(
                _PARAMETER.pack(index, sub, size) + (value & 0xFFFFFFFFFFFFFFFF).to_bytes(8, "little")
            )
        days, milliseconds = Struct("<QQ").unpack_from(digest.digest())
        return 1 + days % 0xFFFF, 1 + milliseconds % 86_399_999

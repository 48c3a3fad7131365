"""`[segment.NAME]` of a bench file: CAN, Modbus TCP, Modbus RTU."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import Discriminator, Field, Tag

from fieldbus.clock import MS, US, S
from hil.bench._table import Port, Table

if TYPE_CHECKING:
    from fieldbus.modbus import ConnectionLimits, SerialFormat

RESERVED_OPTIONS: Final = (
    "interface",
    "channel",
    "name",
    "scheduler",
    "history",
    "keep_log",
    "lossy",
    "fd_bitrate",
    "bridge",
)
"""Arguments of `LiveSegment.open`, which are no options of an interface."""

Option = bool | int | float | str
"""Value of an option that python-can passes to its interface."""


class BridgeTable(Table, frozen=True):
    """`[segment.NAME.bridge]`: the other side of a live segment that is made of two buses."""

    channel: str
    """Channel of the other bus."""
    interface: str | None = None
    """Its python-can interface; none: that of the segment."""
    options: dict[str, Option] = {}
    """Further options of the interface."""
    gateway: Literal["bench", "kernel"] = "bench"
    """Who passes frames on: the process of the bench, or the kernel (`can-gw`, SocketCAN only)."""


class CanTable(Table, frozen=True):
    """`[segment.NAME]` with `kind = "can"`: a CAN segment."""

    label: ClassVar[str] = 'a segment of kind = "can"'
    on_modbus: ClassVar[bool] = False

    kind: Literal["can"] = "can"
    """A CAN segment, a network with Modbus TCP, or a serial line with Modbus RTU."""
    bitrate: Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000] = 1_000_000
    """Bit rate of a virtual segment, bit/s; that of a live one is set at its interface, and here it says for
    which rate the load is recorded.
    """
    data_bitrate: Annotated[int, Field(ge=10_000, le=8_000_000)] | None = None
    """Bit rate of the data phase of CAN FD, bit/s, not below `bitrate`; none: a classical segment. Nodes of
    other programs (`can.Bus(interface="hil", fd=True)`) exchange such frames, drives stay classic CANopen and
    ignore them. That of a live segment is set at its interface, and is here for the load.
    """
    classic_nodes: list[str] = []
    """Nodes of a virtual segment with `data_bitrate` whose CAN controller knows no CAN FD: such a frame is an
    error for them, and they destroy it.
    """
    interface: str | None = None
    """python-can interface (`socketcan`, `udp_multicast`, `pcan`, ...); required on a live bench, refused on
    a virtual one.
    """
    channel: str | None = None
    """Channel of the interface (`vcan0`, `239.74.163.2`, `/dev/ttyACM0`, ...); required on a live bench."""
    options: dict[str, Option] = {}
    """Further options of the python-can interface: `{ bitrate = 500000 }` for `slcan`, `{ port = 43114 }` for
    `udp_multicast`; live benches only. `udp_multicast` stays on this machine unless `join` names a network
    interface: `{ join = "eth0" }`.
    """
    bridge: BridgeTable | None = None
    """The bus with the drives, when the controller is on `channel` and the bench stands between the two; live
    benches only.
    """

    def check(self, where: str, *, live: bool) -> None:
        """Check the table for a kind of bench.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if live and (self.interface is None or self.channel is None):
            raise ValueError(f"{where}: a live bench needs `interface` and `channel`")
        if not live and self.interface is not None:
            raise ValueError(f'{where}.interface: a virtual bench has no interface; set bench.kind = "live"')
        if not live and (self.options or self.bridge is not None):
            raise ValueError(f'{where}: options and bridge belong to a live bench; set bench.kind = "live"')
        if self.data_bitrate is not None and self.data_bitrate < self.bitrate:
            raise ValueError(
                f"{where}.data_bitrate: {self.data_bitrate} is not allowed; allowed: {self.bitrate} "
                "(bitrate) to 8000000"
            )
        if self.classic_nodes and (live or self.data_bitrate is None):
            raise ValueError(f"{where}.classic_nodes: for a virtual segment with data_bitrate only")
        self._check_options(where)

    def _check_options(self, where: str) -> None:
        """Refuse options that are keys of their own, and a bridge that leads back to the same bus."""
        far = self.bridge
        for place, options in (("", self.options), (".bridge", far.options if far is not None else {})):
            for key in options:
                if key in RESERVED_OPTIONS:
                    raise ValueError(f"{where}{place}.options.{key}: this is no option of an interface")
        if far is None:
            return
        interface = far.interface or self.interface
        if (far.channel, interface, far.options) == (self.channel, self.interface, self.options):
            raise ValueError(f"{where}.bridge: both sides are {self.interface} {self.channel}")
        kinds = {self.interface, interface}
        if far.gateway == "kernel" and kinds != {"socketcan"}:
            raise ValueError(
                f"{where}.bridge.gateway: the kernel joins interfaces of SocketCAN only, not "
                f"{', '.join(map(str, kinds))}"
            )

    def opening(self) -> dict[str, Any]:
        """Return the arguments that open a live CAN segment."""
        result: dict[str, Any] = {
            "interface": self.interface or "",
            "channel": self.channel or "",
            **self.options,
        }
        if self.data_bitrate is not None:
            result["fd_bitrate"] = self.data_bitrate
        if self.bridge is not None:
            own = {} if self.bridge.interface is None else {"interface": self.bridge.interface}
            result["bridge"] = {"channel": self.bridge.channel, **own, **self.bridge.options}
            if self.bridge.gateway == "kernel":
                result["bridge"]["gateway"] = "kernel"
        return result

    def opening_for_drives(self) -> dict[str, Any]:
        """Return the arguments that open the CAN bus of the drives: the far side of a bridge."""
        result = self.opening()
        far = result.pop("bridge", None)
        if far is not None:
            far.pop("gateway", None)
            if self.data_bitrate is not None:
                far["fd_bitrate"] = self.data_bitrate
        return result if far is None else {"interface": self.interface or "", **far}

    def in_virtual_time(self) -> CanTable:
        """Return the same segment without its place on a live bus."""
        return self.model_copy(update={"interface": None, "channel": None, "options": {}, "bridge": None})


class _ModbusTable(Table, frozen=True):
    """What both kinds of Modbus have."""

    on_modbus: ClassVar[bool] = True

    timeout_ms: Annotated[float, Field(gt=0.0, le=60_000.0)] | None = None
    """How long the controller waits for a response, on a line for its begin; none: over TCP one bus cycle,
    on a line a quarter of it and at least 5 ms.
    """


class TcpTable(_ModbusTable, frozen=True):
    """`[segment.NAME]` with `kind = "modbus_tcp"`: a network."""

    label: ClassVar[str] = 'a segment of kind = "modbus_tcp"'
    units: ClassVar[range] = range(256)

    kind: Literal["modbus_tcp"]
    """A network with Modbus TCP."""
    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    """Address of the drives of a live bench that have no `host` of their own."""
    port: Port = 0
    """Their TCP port; 0 = a free one, for emulated drives. A bench in virtual time has no use for `host` and
    `port`; `hil emulate` serves its drives there.
    """
    latency_us: Annotated[float, Field(ge=0.0, le=10_000_000.0)] = 100.0
    """Time from one end of a virtual network to the other."""
    connections: Annotated[int, Field(ge=1, le=1000)] = 64
    """Most connections that an emulated drive takes at the same time; it closes a further one at once."""
    request_timeout_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 5.0
    """Longest time from the first byte of a request to its last one; then an emulated drive closes the
    connection.
    """
    unread_timeout_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 5.0
    """How long a client may take nothing of its responses; then an emulated drive closes the connection. On a
    live bench only.
    """

    def check(self, where: str, *, live: bool) -> None:
        """Check the table for a kind of bench.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if live and self.latency_us != TcpTable.model_fields["latency_us"].default:
            raise ValueError(f"{where}.latency_us: a live network has its own; only on a virtual bench")

    def limits(self) -> ConnectionLimits:
        """Return what clients may ask of an emulated drive."""
        from fieldbus.modbus import ConnectionLimits

        return ConnectionLimits(self.connections, round(self.request_timeout_s * S))

    @property
    def latency_ns(self) -> int:
        """Time from one end of a virtual network to the other, ns."""
        return round(self.latency_us * US)

    def timeout_ns(self, cycle_ns: int) -> int:
        """Return how long the controller waits for a response, ns."""
        return cycle_ns if self.timeout_ms is None else round(self.timeout_ms * MS)

    def in_virtual_time(self) -> TcpTable:
        """Return the same segment for a bench in virtual time."""
        return self


class RtuTable(_ModbusTable, frozen=True):
    """`[segment.NAME]` with `kind = "modbus_rtu"`: a serial line."""

    label: ClassVar[str] = 'a segment of kind = "modbus_rtu"'
    units: ClassVar[range] = range(1, 248)

    kind: Literal["modbus_rtu"]
    """A serial line with Modbus RTU."""
    baud: Annotated[int, Field(ge=300, le=1_000_000)] = 19_200
    """Rate of the line, bit/s; emulated drives have those of a SINAMICS: 4800, 9600, 19200, 38400, 57600,
    76800, 93750, 115200, 187500.
    """
    parity: Literal["even", "odd", "none"] = "even"
    """Parity bit."""
    stop_bits: Literal[1, 2] | None = None
    """Stop bits; none: 1 with parity, 2 without, so that a character has 11 bits (MODB-001)."""
    path: str | None = None
    """Device file of the line of a live bench with physical drives. Emulated drives of a live bench bring a
    pseudo-terminal each.
    """

    def check(self, where: str, *, live: bool) -> None:
        """Check the table for a kind of bench.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if not live and self.path is not None:
            raise ValueError(f'{where}.path: a virtual bench has no such place; set bench.kind = "live"')

    def serial_format(self) -> SerialFormat:
        """Return rate and characters of the line."""
        from fieldbus.modbus import Parity, SerialFormat

        return SerialFormat(self.baud, Parity(self.parity), self.stop_bits)

    def timeout_ns(self, cycle_ns: int) -> int:
        """Return how long the controller waits for the begin of a response, ns."""
        return max(cycle_ns // 4, 5 * MS) if self.timeout_ms is None else round(self.timeout_ms * MS)

    def in_virtual_time(self) -> RtuTable:
        """Return the same segment for a bench in virtual time."""
        return self


def _kind(table: object) -> object:
    if isinstance(table, dict):
        return table.get("kind", "can")
    return table.kind if isinstance(table, CanTable | TcpTable | RtuTable) else None


SegmentTable = CanTable | TcpTable | RtuTable
ModbusTable = TcpTable | RtuTable
AnySegment = Annotated[
    Annotated[CanTable, Tag("can")]
    | Annotated[TcpTable, Tag("modbus_tcp")]
    | Annotated[RtuTable, Tag("modbus_rtu")],
    Discriminator(_kind),
]
"""`[segment.NAME]`, chosen by its key `kind`."""

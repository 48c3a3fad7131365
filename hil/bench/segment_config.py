"""`[segment.NAME]` of a bench file: CAN, Modbus TCP, Modbus RTU; its model and its checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from hil.bench._drive_sections import Section

if TYPE_CHECKING:
    from fieldbus.modbus import SerialFormat

RESERVED_OPTIONS: Final = (
    "interface",
    "channel",
    "name",
    "scheduler",
    "history",
    "keep_log",
    "lossy",
    "bridge",
)
"""What `LiveSegment.open` takes by itself, and is no option of an interface."""

KEYS_OF_KIND: Final = {
    "can": ("bitrate", "interface", "channel", "options", "bridge"),
    "modbus_tcp": ("host", "port", "latency_us", "timeout_ms"),
    "modbus_rtu": ("baud", "parity", "stop_bits", "path", "timeout_ms"),
}

Option = bool | int | float | str
"""Value of an option that python-can hands to its interface."""


class BridgeSection(Section):
    """`[segment.NAME.bridge]`: the other side of a live segment that is made of two buses."""

    channel: str
    interface: str | None = None
    """None: that of the segment."""
    options: dict[str, Option] = {}
    gateway: Literal["bench", "kernel"] = "bench"
    """Who passes frames on: the process of the bench, or the kernel (SocketCAN only)."""


class SegmentSection(Section):
    """`[segment.NAME]`: a CAN segment, a network with Modbus TCP, or a serial line with Modbus RTU."""

    kind: Literal["can", "modbus_tcp", "modbus_rtu"] = "can"
    bitrate: Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000] = 1_000_000
    interface: str | None = None
    """python-can interface of a live bench, for example `socketcan`; None on a virtual bench."""
    channel: str | None = None
    options: dict[str, Option] = {}
    """Further options of the python-can interface."""
    bridge: BridgeSection | None = None
    """The bus with the drives, when the controller is on `channel` and this bench stands between the two."""
    host: Annotated[str, Field(min_length=1)] = "127.0.0.1"
    """Address of the drives of a live bench, for those that name none of their own."""
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    """Their TCP port; 0 = one that is free, for emulated drives."""
    latency_us: Annotated[float, Field(ge=0.0, le=10_000_000.0)] = 100.0
    """Time from one end of a virtual network to the other, microseconds."""
    baud: Annotated[int, Field(ge=300, le=1_000_000)] = 19_200
    parity: Literal["even", "odd", "none"] = "even"
    stop_bits: Literal[1, 2] | None = None
    """None: 1 with parity, 2 without, so that a character has 11 bits (MODB-001)."""
    path: str | None = None
    """Device file of the serial line of a live bench; None = a pseudo-terminal, for emulated drives."""
    timeout_ms: Annotated[float, Field(gt=0.0, le=60_000.0)] | None = None
    """How long the controller waits for a response; None = one bus cycle over TCP, a quarter of it on a line.
    """

    @property
    def on_modbus(self) -> bool:
        """Whether it is no CAN segment."""
        return self.kind != "can"

    def serial_format(self) -> SerialFormat:
        """Return rate and characters of a serial line."""
        from fieldbus.modbus import Parity, SerialFormat

        return SerialFormat(self.baud, Parity(self.parity), self.stop_bits)

    def opening(self) -> dict[str, Any]:
        """Return the arguments that open a live CAN segment."""
        result: dict[str, Any] = {
            "interface": self.interface or "",
            "channel": self.channel or "",
            **self.options,
        }
        if self.bridge is not None:
            own = {} if self.bridge.interface is None else {"interface": self.bridge.interface}
            result["bridge"] = {"channel": self.bridge.channel, **own, **self.bridge.options}
            if self.bridge.gateway == "kernel":
                result["bridge"]["gateway"] = "kernel"
        return result

    def opening_for_drives(self) -> dict[str, Any]:
        """Return the arguments that open the CAN bus on which the drives are: the far side of a bridge."""
        result = self.opening()
        far = result.pop("bridge", None)
        if far is not None:
            far.pop("gateway", None)
        return result if far is None else {"interface": self.interface or "", **far}


def check_segment(name: str, segment: SegmentSection, *, live: bool) -> None:
    """Check a segment by itself.

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    where = f"segment.{name}"
    for kind, keys in KEYS_OF_KIND.items():
        for key in keys:
            if key not in KEYS_OF_KIND[segment.kind] and segment.differs(key):
                raise ValueError(
                    f'{where}.{key}: a segment of kind = "{segment.kind}" has none; it is of kind = "{kind}"'
                )
    if segment.kind == "can":
        _check_can(where, segment, live=live)
    elif segment.kind == "modbus_tcp" and live and segment.differs("latency_us"):
        raise ValueError(f"{where}.latency_us: a live network has its own; only on a virtual bench")
    elif not live:
        for key in ("host", "port", "path"):
            if segment.differs(key):
                raise ValueError(f'{where}.{key}: a virtual bench has no such place; set bench.kind = "live"')


def _check_can(where: str, segment: SegmentSection, *, live: bool) -> None:
    if live and (segment.interface is None or segment.channel is None):
        raise ValueError(f"{where}: a live bench needs `interface` and `channel`")
    if not live and segment.interface is not None:
        raise ValueError(f'{where}.interface: a virtual bench has no interface; set bench.kind = "live"')
    if not live and (segment.options or segment.bridge is not None):
        raise ValueError(f'{where}: options and bridge belong to a live bench; set bench.kind = "live"')
    _check_options(where, segment)


def _check_options(where: str, segment: SegmentSection) -> None:
    """Refuse options that are keys of their own, and a bridge that leads to where it comes from."""
    far = segment.bridge
    for place, options in (("", segment.options), (".bridge", far.options if far is not None else {})):
        for key in options:
            if key in RESERVED_OPTIONS:
                raise ValueError(f"{where}{place}.options.{key}: this is no option of an interface")
    if far is not None and (far.channel, far.interface or segment.interface, far.options) == (
        segment.channel,
        segment.interface,
        segment.options,
    ):
        raise ValueError(f"{where}.bridge: both sides are {segment.interface} {segment.channel}")
    if far is not None and far.gateway == "kernel":
        kinds = {segment.interface, far.interface or segment.interface}
        if kinds != {"socketcan"}:
            raise ValueError(
                f"{where}.bridge.gateway: the kernel joins interfaces of SocketCAN only, not "
                f"{', '.join(map(str, kinds))}"
            )

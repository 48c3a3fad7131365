"""`[device.NAME]` of a bench file: an emulated CANopen device of any kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from hil.bench._table import NodeId, Table

if TYPE_CHECKING:
    import canopen

    from emulators.station import CanopenDevice
    from hil.bench._site import DeviceSite


DEVICE_METHODS: Final = frozenset(("power_off", "power_on", "stop_heartbeat", "get", "set"))
"""Methods of a device that may be called from another process."""


class DeviceTable(Table, frozen=True):
    """`[device.NAME]`: an emulated CANopen device of any kind, made of its EDS."""

    segment: str
    """Name of the segment to which it is connected."""
    node_id: NodeId
    """CANopen node-ID, each once per segment."""
    eds: Annotated[str, Field(min_length=1)]
    """Its EDS or DCF, relative to the bench file."""
    storage: str | None = None
    """Where it keeps its stored parameters, relative to the bench file."""

    @property
    def device(self) -> Literal["emulated"]:
        """As the key of a drive."""
        return "emulated"

    @property
    def profile(self) -> str:
        """File that describes it."""
        return self.eds

    def build(self, site: DeviceSite) -> CanopenDevice:
        """Return the emulated device, still switched off."""
        from emulators.station import CanopenDevice

        return CanopenDevice(
            site.scheduler,
            site.segments[self.segment],
            self.eds,
            self.node_id,
            name=site.name,
            history=site.history,
            storage=self.storage,
        )

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary, shared and read-only."""
        from fieldbus.canopen.eds import shared_dictionary

        return shared_dictionary(self.eds, node_id=1)

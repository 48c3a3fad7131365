"""The project of an NC: its axes with their offline parameters, and the activation of the configuration
(sections 2, 3, 5, 6).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.errors import ConfigurationError, ErrorCollector, HilError, UnknownNameError
from motion.nc.axis import NcAxis
from motion.nc.axis_ref import AxisRef
from motion.nc.device import Device, SimulatedDevice
from motion.nc.parameters import ParameterSet, Value, catalogue, known_key

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from fieldbus.history import History
    from motion.nc.tables import TableSpace

INCLUDED_AXES: Final = {"TF5000": 10, "TF5010": 25, "TF5020": 255}
"""Axes that a licence includes (NC-005)."""
MOST_AXES: Final = 255
STANDARD_TYPE: Final = "Standard (Mapping via Encoder and Drive)"
_OBJECT: Final = {"axis": 0x05010000, "encoder": 0x05020000, "drive": 0x05030000, "controller": 0x05040000}


class LicenceError(HilError):
    """There are more axes than the licence allows."""


class AxisKind(Enum):
    """Type of an axis; it is set when the axis is created (NC-057 to NC-065)."""

    CONTINUOUS = "continuous"
    """Its drive takes continuous setpoints."""
    ENCODER = "encoder"
    """An encoder alone, without drive and controller."""
    DISCRETE = "discrete"
    """Its drive has two speeds."""


Link = Callable[[ParameterSet], Device]
"""Returns the device that an axis is linked to, for its parameters."""


class Licence:
    """Licence of an NC.

    Args:
        name: TF5000, TF5010 or TF5020.
        additional_axes: Axes on top of those that it includes.

    Raises:
        ConfigurationError: There is no such licence, or it cannot be extended so far.

    """

    def __init__(self, name: str = "TF5020", additional_axes: int = 0) -> None:
        if name not in INCLUDED_AXES:
            raise UnknownNameError("nc.licence", name, "a licence", INCLUDED_AXES)
        most = MOST_AXES - INCLUDED_AXES[name]
        if not 0 <= additional_axes <= most:
            raise ConfigurationError("nc.additional_axes", additional_axes, f"0 to {most} with {name}")
        self.name = name
        self.axes = INCLUDED_AXES[name] + additional_axes
        """Axes that it allows."""


class AxisEntry:
    """An axis of the project: what does not change while it runs, and its offline parameters.

    Args:
        name: Unique in the project.
        number: Its id, from 1 on.
        kind: Its type.
        values: Offline parameters that differ from their defaults.
        link: Makes the device it is linked to; None: not linked.
        comment: Free text.

    """

    def __init__(
        self,
        name: str,
        number: int,
        *,
        kind: AxisKind,
        values: Mapping[str, Value],
        link: Link | None,
        comment: str = "",
    ) -> None:
        self._name = name
        self._number = number
        self._kind = kind
        self._link = link
        self._values: dict[str, Value] = {}
        self.comment = comment
        self.ref: AxisRef | None = None
        """`AXIS_REF` of the program; None until the first activation."""
        for key, value in values.items():
            self.write(key, value)

    @property
    def name(self) -> str:
        """Its name."""
        return self._name

    @property
    def number(self) -> int:
        """Its id."""
        return self._number

    @property
    def kind(self) -> AxisKind:
        """Its type; it cannot be changed (NC-065)."""
        return self._kind

    @property
    def linked(self) -> bool:
        """Whether it has hardware."""
        return self._link is not None

    @property
    def object_ids(self) -> dict[str, int]:
        """Object ids of the axis and of the components that it has (NC-058, NC-078)."""
        parts = ("axis", "encoder") if self._kind is AxisKind.ENCODER else tuple(_OBJECT)
        return {part: _OBJECT[part] + (self._number << 4) for part in parts}

    @property
    def values(self) -> dict[str, Value]:
        """Offline parameters that are not left at their defaults, by key."""
        return dict(self._values)

    def read(self, key: str) -> Value:
        """Return an offline parameter.

        Raises:
            UnknownNameError: There is no such parameter.

        """
        key = known_key(key)
        return self._values.get(key, catalogue()[key].default)

    def write(self, key: str, value: object) -> None:
        """Change an offline parameter; it acts with the next activation.

        Raises:
            ConfigurationError: There is no such parameter, or it cannot have the value.

        """
        key = known_key(key)
        self._values[key] = catalogue()[key].check(value)

    def build_device(self, parameters: ParameterSet) -> Device | None:
        """Return the device of the axis; None: it needs one and has none (NC-014, NC-062, NC-070)."""
        if parameters.read("axis.simulation"):
            return simulation(parameters)
        if self._link is not None:
            return self._link(parameters)
        if parameters.read("axis.axis_type") == STANDARD_TYPE and parameters.read("enc.type") == (
            "Simulation encoder"
        ):
            return simulation(parameters)
        return None


def simulation(parameters: ParameterSet) -> SimulatedDevice:
    """Return simulation encoder and drive of an axis."""
    numerator, denominator = (parameters.cell(f"enc.scaling_{part}") for part in ("numerator", "denominator"))
    inverted = parameters.cell("enc.invert_counting_direction")
    # It shows the set position whatever the direction of counting is (NC-063).
    return SimulatedDevice(
        scaling=lambda: (-1.0 if inverted.value else 1.0) * numerator.value / denominator.value,
        noise_level=parameters.cell("enc.simulation_noise"),
    )


class NcSystem(Protocol):
    """The tasks of an NC as the project starts them."""

    cycle_ns: int
    parameters: ParameterSet
    tables: TableSpace

    def start(self) -> None:
        """Begin to cycle."""

    def stop(self) -> None:
        """End the cycle."""

    def clear(self) -> None:
        """Let go of all axes."""

    def connect(self, ref: AxisRef) -> None:
        """Take an axis in."""


class Project:
    """The axes of an NC before and after activation.

    Args:
        runtime: The NC.
        licence: How many axes it may have.
        history: Event log, or None.

    """

    def __init__(
        self, runtime: NcSystem, *, licence: Licence | None = None, history: History | None = None
    ) -> None:
        self._runtime = runtime
        self._history = history
        self.licence = licence or Licence()
        self.entries: dict[str, AxisEntry] = {}
        """Axes by name, in the order in which they were added."""

    def add(
        self,
        name: str,
        *,
        kind: AxisKind = AxisKind.CONTINUOUS,
        values: Mapping[str, Value] | None = None,
        link: Link | None = None,
        comment: str = "",
    ) -> AxisEntry:
        """Add an axis; it gets the lowest id that is free (NC-045, NC-078).

        Raises:
            ConfigurationError: The name is empty or taken, or a parameter cannot have its value.

        """
        if not name or name in self.entries:
            raise ConfigurationError("axis, name", name, "a name that no other axis has")
        used = {entry.number for entry in self.entries.values()}
        number = next(one for one in range(1, len(used) + 2) if one not in used)
        entry = AxisEntry(name, number, kind=kind, values=values or {}, link=link, comment=comment)
        self.entries[name] = entry
        return entry

    def remove(self, name: str) -> None:
        """Delete an axis; its id is free for another one.

        Raises:
            UnknownNameError: There is no such axis.

        """
        self[name]
        del self.entries[name]

    def __getitem__(self, name: str) -> AxisEntry:
        entry = self.entries.get(name)
        if entry is None:
            raise UnknownNameError("project", name, "an axis", self.entries)
        return entry

    def __iter__(self) -> Iterator[AxisEntry]:
        return iter(self.entries.values())

    def activate(self, *, start: bool = True) -> None:
        """Make the offline parameters the ones in effect: the system stops, and starts with new axes.

        What is refused leaves the running configuration as it is.

        Args:
            start: Let the tasks cycle afterwards.

        Raises:
            LicenceError: There are more axes than the licence allows; none starts.
            ConfigurationError: Parameters of an axis do not fit together.
            StartAbortedError: Retain data that have to be there are not.

        """
        if len(self.entries) > self.licence.axes:
            raise LicenceError(
                f"{len(self.entries)} axes; licence {self.licence.name} allows {self.licence.axes}"
            )
        errors = ErrorCollector()
        built: list[NcAxis] = []
        for entry in self:
            with errors.located(f"axis {entry.name}"):
                built.append(self._build(entry))
        errors.check()
        runtime = self._runtime
        runtime.stop()
        runtime.clear()
        for entry, axis in zip(self, built, strict=True):
            if entry.ref is None:
                entry.ref = AxisRef(axis)
            else:
                entry.ref.restart(axis)
            runtime.connect(entry.ref)
            for text in axis.parameters.warnings():
                self._emit(entry.name, "nc.warning", text=text)
        if start:
            runtime.start()

    def _build(self, entry: AxisEntry) -> NcAxis:
        parameters = ParameterSet(
            {
                "drv.type": "TWOSPEED" if entry.kind is AxisKind.DISCRETE else "M2400_DAC1",
                "ctrl.type": "Two speed controller"
                if entry.kind is AxisKind.DISCRETE
                else "Position controller P",
                **entry.values,
            },
            tasks=self._runtime.parameters,
        )
        device = entry.build_device(parameters)
        missing = device is None
        if device is None:
            device = simulation(parameters)
        return NcAxis(
            entry.name,
            number=entry.number,
            parameters=parameters,
            device=device,
            saf_cycle_s=self._runtime.cycle_ns * 1e-9,
            encoder_only=entry.kind is AxisKind.ENCODER,
            two_speed=entry.kind is AxisKind.DISCRETE,
            missing_resources=missing,
            tables=self._runtime.tables,
            history=self._history,
        )

    # -- online and offline parameters

    def upload(self, name: str) -> None:
        """Copy the parameters in effect into the project: online to offline.

        Raises:
            ConfigurationError: There is no such axis, or it was never activated.

        """
        entry = self[name]
        parameters = self._axis(entry).parameters
        for key in catalogue():
            if not key.startswith("task."):
                value = parameters.read(key)
                if value != entry.read(key):
                    entry.write(key, value)

    def download(self, name: str) -> None:
        """Make the offline parameters of an axis act at once, as far as they may change while it runs.

        Raises:
            ConfigurationError: There is no such axis, or a value is refused; those before it are in effect.

        """
        entry = self[name]
        parameters = self._axis(entry).parameters
        changed = {
            key: entry.read(key)
            for key in catalogue()
            if not key.startswith("task.") and entry.read(key) != parameters.read(key)
        }
        parameters.write_all(changed)

    @staticmethod
    def _axis(entry: AxisEntry) -> NcAxis:
        if entry.ref is None:
            raise ConfigurationError(f"axis {entry.name}", "offline", "an axis that has been activated")
        return entry.ref.axis

    def _emit(self, name: str, kind: str, **data: str | float | bool) -> None:
        if self._history is not None:
            self._history.emit(name, kind, **data)

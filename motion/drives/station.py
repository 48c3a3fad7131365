"""The controller's side of an I/O station: one exchange of the process image per cycle, shared by everybody
who uses it.

Outputs are written at any time and go with the next `exchange`; inputs are those of the last
answer. While an answer is outstanding the exchange of a cycle is left out: a line that is slower
than the cycle is not flooded.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

from fieldbus.errors import ConfigurationError
from fieldbus.modbus.client import Outcome, Result
from fieldbus.modbus.io_image import IoImage
from motion.drives._link import GRACE_CYCLES
from motion.drives.port import SWITCHES, DrivePort

if TYPE_CHECKING:
    from fieldbus.history import History
    from fieldbus.modbus.client import Done, Job
    from fieldbus.modbus.pdu import Request


class Client(Protocol):
    """What carries requests to the station."""

    def submit(self, request: Request, unit: int = 1, done: Done | None = None) -> Job:
        """Put a request into the queue."""


class StationLink:
    """Inputs and outputs of one station.

    Args:
        client: What carries requests to it.
        image: Its channels.
        unit: Its address.
        grace_cycles: Cycles without an answer until it counts as lost.
        name: Name of the station in the history.
        history: Log; None for none.

    """

    def __init__(
        self,
        client: Client,
        image: IoImage,
        *,
        unit: int = 1,
        grace_cycles: int = GRACE_CYCLES,
        name: str = "station",
        history: History | None = None,
    ) -> None:
        self._client = client
        self.image = image
        self.unit = unit
        self.name = name
        self._history = history
        self._grace = self._age = grace_cycles
        self._waiting = False
        self._digital_out = 0
        self._analog_out = [0] * image.analog_outputs
        self._outputs = True
        self._silent = False
        self.ok = False
        """Answers come."""
        self.answers = 0
        """Number of answers so far."""
        self.digital = 0
        """Digital inputs, bit n is channel n; 0 while the station is lost."""
        self.analog: list[int] = [0] * image.analog_inputs
        """Words of the analog inputs."""
        self.counters: list[int] = [0] * image.counters
        """Counters, signed 32 bit."""

    def input(self, number: int) -> bool:
        """Return a digital input as it was last reported."""
        return bool(self.digital >> number & 1)

    def set_output(self, number: int, level: bool) -> None:
        """Set a digital output; it goes with the next exchange."""
        bit = 1 << number
        self._digital_out = self._digital_out | bit if level else self._digital_out & ~bit

    def set_analog(self, number: int, word: int) -> None:
        """Set the word of an analog output; it goes with the next exchange."""
        self._analog_out[number] = word

    def switch_outputs(self, on: bool) -> None:
        """Switch the process outputs on or off; off, zeros are sent, and what is set meanwhile goes when they
        are on again.
        """
        self._outputs = on

    def power(self, on: bool) -> None:
        """Say whether the controller has supply; without it nothing is exchanged."""
        self._silent = not on
        if not on:
            self._digital_out = 0
            self._analog_out = [0] * self.image.analog_outputs
            self._age = self._grace
            if self.ok:
                self._lose()

    def exchange(self) -> None:
        """Send the outputs and ask for the inputs; once per cycle."""
        if self._silent:
            return
        if self._age < self._grace:
            self._age += 1
            if self._age == self._grace:
                self._lose()
        if self._waiting:
            return
        if self._outputs:
            outputs = self.image.pack_outputs(self._digital_out, self._analog_out)
        else:
            outputs = self.image.pack_outputs(0, [0] * self.image.analog_outputs)
        request = self.image.request(outputs)
        if request is not None:
            self._waiting = True
            self._client.submit(request, self.unit, self._answered)

    def _answered(self, result: Result) -> None:
        self._waiting = False
        if result.outcome is not Outcome.DONE or result.response is None:
            return
        if self.image.input_words:
            self.digital, self.analog, self.counters = self.image.unpack_inputs(result.response.values)
        self.answers += 1
        self._age = 0
        if not self.ok:
            self.ok = True
            self._emit("station.up")

    def _lose(self) -> None:
        self.ok = False
        self.digital = 0
        self.analog = [0] * self.image.analog_inputs
        self._emit("station.down")

    def _emit(self, kind: str) -> None:
        if self._history is not None:
            self._history.emit(self.name, kind)


class StationInputs:
    """Switches of an axis that are wired to a station, in place of those at its drive (`PositionLimits_HW`).

    Args:
        link: The station.
        channels: Number of the digital input by `negative_limit`, `positive_limit`, `home`.

    Raises:
        ConfigurationError: There is no such switch or channel.

    """

    def __init__(self, link: StationLink, channels: Mapping[str, int]) -> None:
        for name, number in channels.items():
            if name not in SWITCHES:
                raise ConfigurationError("input of an axis", name, ", ".join(SWITCHES))
            if not 0 <= number < link.image.digital_inputs:
                raise ConfigurationError(
                    f"{link.name}: digital input", number, f"0..{link.image.digital_inputs - 1}"
                )
        self._link = link
        self._channels = tuple((1 << number, SWITCHES[name]) for name, number in channels.items())
        self._mask = ~sum(bit for _, bit in self._channels)

    def __call__(self, port: DrivePort) -> bool:
        """Put the levels into the inputs of a port; return whether the station
        answers, so that they mean something.
        """
        digital = self._link.digital
        inputs = port.inputs & self._mask
        for channel, bit in self._channels:
            if digital & channel:
                inputs |= bit
        port.inputs = inputs
        return self._link.ok


class StationAnswers:
    """What a port at a station sees of its exchange: whether there was an answer since the last cycle, and
    what the answers mean for the counter of its drive.

    Outputs are written and inputs sampled in the same exchange, and seen one cycle later.

    Args:
        station: Where the drive is wired to.
        counter: Number of the counter of its encoder; None: there is none.

    """

    __slots__ = ("_counter", "_seen", "_station", "_was_ok")

    def __init__(self, station: StationLink, counter: int | None) -> None:
        self._station = station
        self._counter = counter
        self._seen = station.answers
        self._was_ok = False

    @property
    def started(self) -> bool:
        """The station has answered."""
        return self._station.answers > 0

    @staticmethod
    def delay_ns(cycle_ns: int) -> int:
        """Return the delay from a setpoint to the actual value that shows it, ns; the setpoint is there at
        once, so that its middle counts.
        """
        return cycle_ns * 3 // 2

    def fresh(self) -> bool:
        """Return whether the station has answered since the last call."""
        answers = self._station.answers
        fresh = answers != self._seen
        self._seen = answers
        return fresh

    def returned(self, alive: bool) -> bool:
        """Take note of whether the drive is in reach; returns whether it is so again: nobody knows what the
        counter has missed.
        """
        returned = alive and not self._was_ok
        self._was_ok = alive
        return returned

    def increments(self, before: int) -> int:
        """Return the counter of the encoder; without one what was there before."""
        return before if self._counter is None else self._station.counters[self._counter]

"""Process data words of a telegram as objects of a CANopen slave, four in a PDO at most (PD-338 to PD-341).

Each word is an object: 5800h and following to the device, 5810h and following from it. At SYNC the words of
all RPDOs become one telegram, if every RPDO that carries some of them has come; the words of the answer go
into the TPDOs of the same SYNC.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from struct import Struct
from typing import Any, Final

from fieldbus.canopen.nmt import NmtState
from fieldbus.canopen.pdo import ReceivePdo
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import Telegram

_OPERATIONAL: Final = NmtState.OPERATIONAL
RECEIVE_WORD: Final = 0x5800
"""5800h..580Fh: words of the telegram from the controller."""
SEND_WORD: Final = 0x5810
"""5810h..581Fh: words of the telegram to the controller."""
WORDS: Final = 16
"""Words of a telegram in one direction, at most."""
FREE_RUNNING_PRIORITY: Final = 2
"""A free-running cycle follows the servo step and the control cycle of the same instant."""


class _Carrier:
    """An RPDO with words of the telegram, and how many of its frames have been taken."""

    __slots__ = ("pdo", "taken")

    def __init__(self, pdo: ReceivePdo) -> None:
        self.pdo = pdo
        self.taken = pdo.effective


class ProcessWords:
    """The words of one telegram in the objects of a slave.

    Args:
        slave: Whose objects they are.
        telegram: Layout of both directions.

    Raises:
        ConfigurationError: The telegram has more than 16 words in a direction.

    """

    def __init__(self, slave: CanopenSlave, telegram: Telegram) -> None:
        out, back = telegram.setpoint.words, telegram.actual.words
        for words in (out, back):
            if words > WORDS:
                raise ConfigurationError("telegram", f"{words} words", f"at most {WORDS} words")
        self._slave = slave
        self._keys_in = tuple(RECEIVE_WORD + word << 8 for word in range(out))
        # Any: compiled, an integer would be made again for every access.
        self._keys_out: list[Any] = [SEND_WORD + word << 8 for word in range(back)]
        first, *others = self._keys_in
        self._gather = itemgetter(first, *others) if others else lambda values: (values[first],)
        self._pack = Struct(f">{out}h").pack
        self._unpack = Struct(f">{back}h").unpack
        self._carriers: tuple[_Carrier, ...] = ()
        self._touches = False
        self._kept_back = False

    def begin(self) -> None:
        """Find the PDOs that carry the words, when the slave has become operational."""
        pdos = self._slave.pdos
        words = frozenset(self._keys_in)
        self._carriers = tuple(
            [_Carrier(pdo) for pdo in pdos.receive if pdo.valid and not words.isdisjoint(pdo.layout.keys)]
        )
        answers = frozenset(self._keys_out)
        self._touches = any(
            pdo.valid and pdo.event_driven and not answers.isdisjoint(pdo.layout.keys)
            for pdo in pdos.transmit
        )

    def take(self) -> bytes | None:
        """Return the telegram that has come since the last call; None: not all of it has."""
        complete = bool(self._carriers)
        for carrier in self._carriers:
            count = carrier.pdo.effective
            if count == carrier.taken:
                complete = False
            carrier.taken = count
        if not complete:
            return None
        return self._pack(*self._gather(self._slave.values))

    def give(self, frame: bytes) -> None:
        """Let an answer go with the next TPDOs."""
        if self._kept_back:
            self._kept_back = False
            self._slave.pdos.mute(frozenset())
        words = self._unpack(frame)
        values = self._slave.values
        for place, key in enumerate(self._keys_out):
            values[key] = words[place]
        if self._touches:
            for key in self._keys_out:
                self._slave.pdos.touch(key)

    def keep_back(self) -> None:
        """Send no TPDO that carries words, until the next answer: a fault has lost this one."""
        if not self._kept_back:
            self._kept_back = True
            self._slave.pdos.mute(frozenset(self._keys_out))


class SyncCycle:
    """Runs the bus cycle of an operational device at every SYNC, and by itself when SYNC is missing.

    Args:
        scheduler: Clock of the device.
        slave: Its node.
        words: Its process data words.
        run: Makes one bus cycle.
        free_running_ns: Bus cycle without SYNC, ns; None: without SYNC there is none.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        slave: CanopenSlave,
        words: ProcessWords,
        run: Callable[[], None],
        *,
        free_running_ns: int | None,
    ) -> None:
        self._scheduler = scheduler
        self._slave = slave
        self._words = words
        self._run = run
        self._sync_ns = 0
        self._silence_ns = 0
        slave.on_sync.append(self._on_sync)
        slave.on_nmt_state.append(self._on_nmt_state)
        if free_running_ns is not None:
            self._silence_ns = 2 * free_running_ns
            scheduler.every(free_running_ns, self._free_run, priority=FREE_RUNNING_PRIORITY)

    def _on_nmt_state(self, _old: NmtState, new: NmtState) -> None:
        if new is _OPERATIONAL:
            self._words.begin()

    def _on_sync(self, time_ns: int) -> None:
        self._sync_ns = time_ns
        if self._slave.nmt_state is _OPERATIONAL:
            self._run()

    def _free_run(self) -> None:
        late = self._scheduler.now - self._sync_ns > self._silence_ns
        if late and self._slave.nmt_state is _OPERATIONAL:
            self._run()

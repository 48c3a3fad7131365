"""A pulse module with a controller of two channels; the second one idles unless the test uses it."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from emulators.drive.profidrive.statemachine import AxisState
from emulators.drive.pto_settings import PtoSettings
from emulators.io.tm_pto import PtoConfig, PtoModule
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.profidrive import pto_telegram, telegram

CYCLE = 4 * MS
S1, S2, S3, S4, S5A, S5B = (
    AxisState.S1,
    AxisState.S2,
    AxisState.S3,
    AxisState.S4,
    AxisState.S5A,
    AxisState.S5B,
)
SEQUENCE = (0x0450, 0x0456, 0x0457, 0x045F)
RUN = 0x045F


SETTINGS = frozenset(one.name for one in fields(PtoSettings))


def channel_of(**keys: Any) -> PtoConfig:
    """Return a channel whose terminals are not used unless the keys say so."""
    settings: dict[str, Any] = {"use_ed": False, "use_dr": False} | {
        key: keys.pop(key) for key in SETTINGS & set(keys)
    }
    return PtoConfig(settings=PtoSettings(**settings), **keys)


class Rig:
    def __init__(self, *, other: PtoConfig | None = None, **config: Any) -> None:
        self.scheduler = VirtualScheduler()
        self.module = PtoModule(self.scheduler, [channel_of(**config), other or channel_of()])
        self.channel, self.second = self.module.channels
        self.telegram = telegram(3) if self.channel.config.settings.standard else pto_telegram()
        self.stw1 = 0
        self.g1 = 0
        self.nsoll = 0
        self.stw2 = 0
        self.got: dict[str, int] = {}

    def frame(self) -> bytes:
        wide = self.channel.config.settings.standard
        return self.telegram.setpoint.encode(
            {
                "STW1": self.stw1,
                "NSOLL_B" if wide else "NSOLL_A": self.nsoll,
                "STW2" if wide else "STW2_ENC": self.stw2,
                "G1_STW": self.g1,
            }
        )

    def __call__(
        self,
        stw1: int | None = None,
        *,
        g1: int | None = None,
        nsoll: int | None = None,
        cycles: int = 1,
        seconds: float | None = None,
        quiet: bool = False,
    ) -> AxisState:
        """Run bus cycles with these words (kept when None); returns the state. `seconds` in place of
        `cycles`.
        """
        self.stw1 = self.stw1 if stw1 is None else stw1
        self.g1 = self.g1 if g1 is None else g1
        self.nsoll = self.nsoll if nsoll is None else nsoll
        for _ in range(cycles if seconds is None else round(seconds * 1000 / 4)):
            self.scheduler.run_for(CYCLE)
            if not quiet:
                self.module.receive(0, self.frame())
            self.module.cycle()
        data, _ = self.module.transmit(0)
        self.got = self.telegram.actual.decode(data)
        return self.channel.state

    def start(self, nsoll: int = 0, seconds: float | None = None) -> None:
        """Bring the channel into S4, and let it run for some time."""
        for word in SEQUENCE:
            self(word, nsoll=nsoll)
        assert self.channel.state is S4
        if seconds is not None:
            self(seconds=seconds)

    @property
    def zsw1(self) -> int:
        return self.got["ZSW1"]

    @property
    def hertz(self) -> float:
        return self.channel.generator.frequency

    @property
    def count(self) -> int:
        return self.channel.generator.count

    @property
    def code(self) -> int:
        return self.got["G1_XIST2"] if self.got["G1_ZSW"] & 0x8000 else 0

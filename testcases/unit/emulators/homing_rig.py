"""A homing run as a controller on the bus makes and sees it, with what the true machine does meanwhile."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from struct import pack, unpack_from
from typing import Any, Final

from emulators.drive.cia402 import DriveConfig, EncoderConfig, SwitchesConfig
from emulators.drive.tuning import ServoTuning
from fieldbus.canopen import NmtCommand
from fieldbus.clock import US

COUNTS: Final = 4000
LEAD_MM: Final = 10.0
FAST_RPM: Final = 600
SLOW_RPM: Final = 60
FAST_MM_S: Final = FAST_RPM / 60 * LEAD_MM
SLOW_MM_S: Final = SLOW_RPM / 60 * LEAD_MM
ACCELERATION_MM_S2: Final = 10_000.0
HYSTERESIS_MM: Final = 0.25
LIMIT_MM: Final = 45.0
STOP_MM: Final = 55.0
NLS, PLS, HS = 1, 2, 4
NAMES: Final = {NLS: "NLS", PLS: "PLS", HS: "HS"}


def machine(
    *,
    start_mm: float = 0.0,
    home: tuple[float, float] | None = None,
    limits: bool = True,
    zero_mark: int = 0,
    servo_us: int = 1000,
    input_filter_ms: float = 0.0,
    **options: Any,
) -> DriveConfig:
    """Return a lead screw with 10 mm between +-55 mm, limit switches at +-45 mm and a home cam (mm); units:
    increments, 10^-3 rpm.
    """
    reference = DriveConfig.reference()
    switches = SwitchesConfig(
        negative_limit_mm=-LIMIT_MM if limits else None,
        positive_limit_mm=LIMIT_MM if limits else None,
        home_mm=None,
        home_from_mm=home[0] if home is not None and math.isfinite(home[0]) else None,
        home_to_mm=home[1] if home is not None and math.isfinite(home[1]) else None,
        hysteresis_mm=HYSTERESIS_MM,
        input_filter_ms=input_filter_ms,
    )
    configuration = replace(
        reference,
        servo_period_ns=servo_us * US,
        tuning=ServoTuning(velocity_time_constant_ms=4.0, velocity_integral_time_s=0.04, position_gain=50.0),
        mechanics=replace(
            reference.mechanics,
            start_position_mm=start_mm,
            negative_stop_mm=-STOP_MM,
            positive_stop_mm=STOP_MM,
        ),
        switches=switches,
        encoder=EncoderConfig(counts_per_revolution=COUNTS, zero_mark_counts=zero_mark),
        **options,
    )
    return configuration.with_objects(
        {
            (0x6092, 1): COUNTS,
            (0x6099, 1): FAST_RPM * 1000,
            (0x6099, 2): SLOW_RPM * 1000,
            (0x609A, 0): round(ACCELERATION_MM_S2 / LEAD_MM * 60_000),
        }
    )


def counts(position_mm: float) -> int:
    """Return the increments of the shaft at a position of the load, from zero of the load."""
    return math.floor(position_mm / LEAD_MM * COUNTS + 0.5)


@dataclass
class Run:
    """What a homing run looked like."""

    bench: Any
    statuses: list[int] = field(default_factory=list)
    """Bits 13, 12, 10 of the status words on the bus, as 0b000..0b111, each change once."""
    samples: list[tuple[float, float, float]] = field(default_factory=list)
    """Time s, true position mm, true velocity mm/s at every servo instant."""
    edges: list[tuple[float, str]] = field(default_factory=list)
    """Time s and name of every edge of a switch: sign of the true velocity, switch, up or down."""
    start_ns: int = 0

    @property
    def drive(self) -> Any:
        return self.bench.drive

    def command(self, word: int) -> None:
        """Send RPDO1."""
        self.bench.master.send(0x201, pack("<H", word))

    def to_end(self, timeout: float = 61.0) -> None:
        """Let time pass until bit 10 comes back: the run has ended and the axis stands."""
        self.bench.until(lambda: self.statuses and self.statuses[-1] & 1, timeout)
        self.bench.run(0.02)

    @property
    def home_counts(self) -> int:
        """The home position, increments of the shaft from zero of the load: the machine's place less 6064h
        and 607Ch.
        """
        actual = self.bench.read(0x6064)
        return counts(self.drive.mechanics.position * 1000) - actual - self.bench.read(0x607C)

    @property
    def seconds(self) -> float:
        return (self.bench.scheduler.now - self.start_ns) / 1e9


def prepare(bench: Any, method: int) -> Run:
    """Select a method and enable homing over the bus; the start bit is still 0."""
    bench.write(0x6098, method)
    bench.write(0x6060, 6)
    bench.master.nmt(NmtCommand.START, 1)
    run = Run(bench)
    bench.run(0.005)
    for word in (0x06, 0x07, 0x0F):
        run.command(word)
        bench.run(0.005)

    def status(data: bytes, _time_ns: int) -> None:
        word = unpack_from("<H", data)[0]
        bits = word >> 11 & 6 | word >> 10 & 1
        if not run.statuses or run.statuses[-1] != bits:
            run.statuses.append(bits)

    bench.master.subscribe(0x181, status)
    drive = bench.drive
    mechanics = drive.mechanics
    scheduler = bench.scheduler
    scheduler.every(
        drive.config.servo_period_ns,
        lambda: run.samples.append(
            (scheduler.now / 1e9, mechanics.position * 1000, mechanics.velocity * 1000)
        ),
        priority=5,
    )
    previous = [drive.inputs]

    def note(event: Any) -> None:
        if event.kind != "drive.inputs":
            return
        inputs = event.data["inputs"]
        for bit, name in NAMES.items():
            if (inputs ^ previous[0]) & bit:
                sign = "+" if mechanics.velocity > 0 else "-" if mechanics.velocity < 0 else "0"
                run.edges.append((scheduler.now / 1e9, f"{sign} {name} {'up' if inputs & bit else 'down'}"))
        previous[0] = inputs

    bench.history.listen(note)
    return run


def home(bench: Any, method: int, timeout: float = 61.0) -> Run:
    """Make a whole run."""
    run = prepare(bench, method)
    run.start_ns = bench.scheduler.now
    run.command(0x1F)
    if method in (35, 37):
        bench.run(0.01)
    else:
        bench.until(lambda: run.statuses, 0.1)
    run.to_end(timeout)
    return run

"""A bench for homing: cam, zero marks and switches at given places, and what an active homing made of
them.
"""

from __future__ import annotations

from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read

SWITCHES = {"home_from_mm": 100.0, "home_to_mm": 120.0, "hysteresis_mm": 0.0, "input_filter_ms": 0.0}
"""Without a filter, so that the place of an edge is that of the cam."""
STEEP = {"DynamicDefaults.Jerk": 0.0, "DynamicDefaults.Deceleration": 1000.0}
"""Ramps without jerk limit, in which the numbers of the specification are calculated."""


def toml(value):
    return str(value).lower() if isinstance(value, bool) else repr(value)


def homing_bench(
    name="profidrive", *, variables=None, drive=None, switches=None, mechanics=None, axis=None, tables=""
):
    """Return an embedded bench with other values; the cam lies from 100 to 120 mm, zero marks at 3 mm and
    every 10 mm.
    """
    text = read(name)[1]
    head, _, rest = text.partition("[drive.drive1.switches]")
    text = head + rest[rest.index("[axis.axis1]") :]
    counts = 2048 if name == "profidrive" else 131072
    own = {"index_increments": round(0.3 * counts)} | (drive or {})
    text = text.replace(
        "off3_ramp_s = 0.5\n", "off3_ramp_s = 0.5\n" + "".join(f"{k} = {toml(v)}\n" for k, v in own.items())
    )
    text = text.replace(
        'drive = "drive1"\n',
        'drive = "drive1"\n' + "".join(f"{k} = {toml(v)}\n" for k, v in (axis or {}).items()),
    )
    for path, value in (variables or {}).items():
        lines = [line for line in text.splitlines() if not line.startswith(f'"{path}" =')]
        text = "\n".join([*lines, f'"{path}" = {toml(value)}', ""])
    for table, values in (
        ("switches", SWITCHES | (switches or {})),
        ("mechanics", mechanics or {}),
    ):
        if values:
            text += f"[drive.drive1.{table}]\n" + "".join(f"{k} = {toml(v)}\n" for k, v in values.items())
    return Bench(parse(text + tables, "bench.toml"), seed=1)


class Machine:
    """The axis of such a bench, enabled, with what homing did."""

    def __init__(self, bench, *, enable=True):
        self.bench = bench
        self.axis = bench.axis()
        if enable:
            power = self.axis.power()
            assert bench.run_until(power.status, 2.0)
        else:
            bench.run_for(0.3)

    @property
    def place(self):
        """Where the load is, mm of the machine."""
        return self.bench.drive().mechanics.position * 1000.0

    @property
    def position(self):
        return self.axis.var("ActualPosition")

    def home(self, position=0.0, *, mode=3, timeout=30.0, sensor=0):
        """Run a homing to its end and return the instruction."""
        job = self.axis.home(position, mode=mode, sensor=sensor)
        assert self.bench.run_until(job.ended, timeout), "the homing did not end in time"
        return job

    def done(self, position=0.0, **inputs):
        job = self.home(position, **inputs)
        assert job.Done, f"ErrorID {job.ErrorID:04X}h, alarms {self.alarms()}"
        return job

    def run(self, seconds):
        self.bench.run_for(seconds)

    def until(self, predicate, timeout=10.0):
        assert self.bench.run_until(predicate, timeout), "the condition did not come true in time"

    def events(self, kind):
        return list(self.bench.history.select(kind=kind))

    def phases(self):
        """Return the parts of the motion up to the mark, such as `approach+`."""
        parts = [event.data for event in self.events("homing.phase") if event.data["phase"] != "home"]
        return [f"{part['phase']}{'+' if part['direction'] > 0 else '-'}" for part in parts]

    def alarms(self):
        return [event.data["number"] for event in self.events("alarm.raised")]

    def bit(self, number, word="StatusWord"):
        return self.axis.var(f"{word}.X{number}")

    def time_of(self, kind):
        """Return when the last event of a kind came, s."""
        return self.events(kind)[-1].time_ns / 1e9

    def speed_at(self, kind):
        """Return the speed setpoint when the last event of a kind came, mm/s."""
        times, speeds = self.column("velocity_setpoint")
        return abs(float(speeds[times <= self.time_of(kind)][-2]))

    def column(self, name):
        signal = self.bench.trace()[f"axis1.{name}"]
        return signal.time_s, signal.values

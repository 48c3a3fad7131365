"""What `hil benchmark` measures: the cyclic path of a whole bench, and single parts against other libraries.

Everything runs in rounds, ours and the peer's by turns, so that a noisy machine disturbs both alike; the
median of the rounds is the figure.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.can import CanFrame, CanMedium
from fieldbus.clock import S, VirtualScheduler
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from motion.s7.instructions import MC_MoveAbsolute

FRAMES: Final = 2000
UPLOADS: Final = 200
_PER_SEGMENT: Final = 8
"""Drives on one segment: with a bus cycle of 4 ms they take 72 % of 1 Mbit/s."""
PLANS: Final = 1000
AXES: Final = (1, 2, 4, 8, 16)
"""Numbers of axes for which the cost of each is measured."""


class Figure(NamedTuple):
    """One result."""

    name: str
    value: float
    unit: str


def with_axes(config: BenchConfig, count: int, *, cycle_ms: int | None = None) -> BenchConfig:
    """Return a bench configuration with `count` copies of its only drive and axis, on as many copies of its
    segment as they need, and another bus cycle if given.
    """
    drive, axis = next(iter(config.can_drives.values())), next(iter(config.axis.values()))
    segments = {f"can{number}": config.segment[drive.segment] for number in range(-(-count // _PER_SEGMENT))}
    drives = {
        f"drive{i}": drive.model_copy(
            update={
                "node_id": drive.node_id + (i - 1) % _PER_SEGMENT,
                "segment": f"can{(i - 1) // _PER_SEGMENT}",
            }
        )
        for i in range(1, count + 1)
    }
    axes = {f"axis{i}": axis.model_copy(update={"drive": f"drive{i}"}) for i in range(1, count + 1)}
    bench = config.bench if cycle_ms is None else config.bench.model_copy(update={"cycle_ms": cycle_ms})
    return config.model_copy(update={"bench": bench, "segment": segments, "drive": drives, "axis": axes})


def with_dsc(config: BenchConfig) -> BenchConfig:
    """Return a bench configuration with a bus cycle of 1 ms whose axes leave the position to their drives."""
    axes = {
        name: axis.model_copy(update={"variables": {**axis.variables, "PositionControl.EnableDSC": True}})
        for name, axis in config.s7_axes.items()
    }
    bench = config.bench.model_copy(update={"cycle_ms": 1})
    return config.model_copy(update={"bench": bench, "axis": axes})


def moving_benches() -> dict[str, BenchConfig]:
    """Return the benches whose axes travel to and fro, by the names of their figures."""
    from hil.bench import load_bench
    from hil.bench.makes import with_nc_axes

    reference = load_bench("reference")
    nc = with_nc_axes(reference, "reference")
    return {
        "sim_factor_1axis_cia402_1ms": load_bench("fast").config,
        "sim_factor_1axis_cia402_4ms": reference.config,
        "sim_factor_4axes_cia402_4ms": with_axes(reference.config, 4),
        "sim_factor_1axis_profidrive_dsc_1ms": with_dsc(load_bench("profidrive").config),
        "sim_factor_1axis_modbus_tcp_4ms": load_bench("profidrive_tcp").config,
        "sim_factor_1axis_cia402_2ms": with_axes(reference.config, 1, cycle_ms=2),
        "sim_factor_1axis_nc_2ms": with_axes(nc.config, 1, cycle_ms=2),
        "sim_factor_4axes_cia402_2ms": with_axes(reference.config, 4, cycle_ms=2),
    }


class MovingBench:
    """A bench whose axes travel to and fro, everything recorded; `advance` is what is timed."""

    def __init__(self, config: BenchConfig) -> None:
        from hil.bench.bench import Bench

        self.bench = Bench(config, seed=0)
        self._axes = [self.bench.axis(name) for name in config.axis]
        powers = [axis.power() for axis in self._axes]
        if not self.bench.run_until(lambda: all(power.Status for power in powers), 3.0):
            raise CannotRunError("the axes of the benchmark could not be enabled")
        homes = [axis.home(0.0) for axis in self._axes if axis.name not in self.bench.nc_axis_names]
        self.bench.run_until(lambda: all(home.Done for home in homes), 1.0)
        self._target = 100.0
        self._jobs: list[MC_MoveAbsolute] = []
        self._start()

    def _start(self) -> None:
        self._jobs = [axis.move_absolute(self._target, Velocity=300.0) for axis in self._axes]
        self._target = -self._target

    def advance(self, seconds: float) -> None:
        """Let `seconds` of bench time pass, with the axes always in motion."""
        left = seconds
        while left > 1e-9:
            step = min(left, 0.25)
            self.bench.run_for(step)
            left -= step
            if all(job.Done for job in self._jobs):
                self._start()
            elif any(job.Error for job in self._jobs):
                raise CannotRunError("an axis of the benchmark stopped with an alarm")


class GearedBench:
    """A bench whose first axis leads all others at constant velocity, everything recorded; `advance` is what
    is timed.
    """

    def __init__(self, config: BenchConfig) -> None:
        from hil.bench.bench import Bench

        self.bench = Bench(config, seed=0)
        leader, *followers = (self.bench.axis(name) for name in config.axis)
        powers = [axis.power() for axis in (leader, *followers)]
        if not self.bench.run_until(lambda: all(power.Status for power in powers), 3.0):
            raise CannotRunError("the axes of the benchmark could not be enabled")
        self._jobs = [axis.gear_in(leader, 1, 2) for axis in followers]
        leader.move_velocity(float(leader.var("DynamicDefaults.Velocity")))
        if not self.bench.run_until(lambda: all(job.InGear for job in self._jobs), 3.0):
            raise CannotRunError("the followers of the benchmark do not follow")

    def advance(self, seconds: float) -> None:
        """Let `seconds` of bench time pass, with all axes in gear."""
        self.bench.run_for(seconds)
        if not all(job.InGear for job in self._jobs):
            raise CannotRunError("a follower of the benchmark stopped")


def geared_speed(config: BenchConfig, seconds: float, rounds: int = 5) -> float:
    """Return simulated seconds per wall second of a bench whose axes follow the first one, the median of
    `rounds`.
    """
    geared = GearedBench(config)
    factors = []
    with geared.bench:
        geared.advance(0.2)
        for _ in range(rounds):
            started = time.perf_counter()
            geared.advance(seconds / rounds)
            factors.append(seconds / rounds / (time.perf_counter() - started))
    return statistics.median(factors)


def speed(config: BenchConfig, seconds: float, rounds: int = 5) -> tuple[float, float]:
    """Return simulated seconds per second of processor time, which is that of the wall on an idle machine and
    the same on a busy one, the median of `rounds`; and the load of the bus meanwhile, %, of a bench without
    CAN 0.
    """
    moving = MovingBench(config)
    with moving.bench:
        moving.advance(0.5)
        config = moving.bench.config
        segment = moving.bench.segment(next(iter(config.segment))) if config.can_drives else None
        medium = segment if isinstance(segment, CanMedium) else None
        begun, busy = moving.bench.now_s, 0 if medium is None else medium.busy_bits
        factors = []
        for _ in range(rounds):
            started = time.process_time()
            moving.advance(seconds / rounds)
            factors.append(seconds / rounds / (time.process_time() - started))
        passed = moving.bench.now_s - begun
        load = 0.0 if medium is None else 100.0 * (medium.busy_bits - busy) / medium.bitrate / passed
    return statistics.median(factors), load


def cost_per_axis(config: BenchConfig, seconds: float) -> list[Figure]:
    """Return what an axis with its drive costs in a cycle, us, by the number of axes."""
    figures = []
    for count in AXES:
        several = with_axes(config, count)
        factor, _ = speed(several, seconds / count)
        cost = several.bench.cycle_ms * 1000.0 / factor / count
        figures.append(Figure(f"cost_{count}axes_cia402_{several.bench.cycle_ms}ms", cost, "us/axis"))
    return figures


def alternately(*works: Callable[[], int], rounds: int = 7) -> tuple[float, ...]:
    """Return operations per second of each, median over `rounds` taken by turns."""
    rates: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for work, into in zip(works, rates, strict=True):
            started = time.perf_counter()
            done = work()
            into.append(done / (time.perf_counter() - started))
    return tuple(statistics.median(rate) for rate in rates)


def can_frames() -> list[Figure]:
    """Frames per second from one node to another: the medium, with bit timing,
    against python-can's virtual bus.
    """
    import can

    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, name="benchmark", keep_log=False)
    sender = medium.attach("sender", _ignore)
    received = 0

    def count(_frame: CanFrame, _time_ns: int) -> None:
        nonlocal received
        received += 1

    medium.attach("receiver", count)
    payloads = [number.to_bytes(8, "little") for number in range(FRAMES)]

    def ours() -> int:
        nonlocal received
        received = 0
        for payload in payloads:
            sender.send(CanFrame(0x181, payload))
            scheduler.run_for(200_000)
        return received

    with (
        can.Bus(interface="virtual", channel="hil-benchmark") as source,
        can.Bus(interface="virtual", channel="hil-benchmark") as sink,
    ):

        def peer() -> int:
            taken = 0
            for payload in payloads:
                source.send(can.Message(arbitration_id=0x181, data=payload, is_extended_id=False))
                if sink.recv(1.0) is not None:
                    taken += 1
            return taken

        mine, theirs = alternately(ours, peer)
    return [Figure("can_frames_ours", mine, "frames/s"), Figure("can_frames_peer", theirs, "frames/s")]


PORTS: Final = (2, 10, 16)
"""Numbers of ports on one bus that frames are counted with: one sends, all others receive."""


def can_ports() -> list[Figure]:
    """Frames on the wire and frames delivered per second, by the number of ports, with the full medium and
    its log off.

    A frame counts once on the wire, and once for every port that receives it. The peer is python-can's
    virtual bus.
    """
    figures: list[Figure] = []
    for count in PORTS:
        ours, peer = _ports(count)
        for who, rate in (("ours", ours), ("peer", peer)):
            figures.append(Figure(f"can_frames_{count}ports_{who}", rate, "frames/s"))
            figures.append(Figure(f"can_deliveries_{count}ports_{who}", rate * (count - 1), "deliveries/s"))
    return figures


def _ports(count: int) -> tuple[float, float]:
    """Return frames per second on the wire with `count` ports: ours, python-can's."""
    import can

    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, name=f"benchmark-{count}", keep_log=False)
    sender = medium.attach("sender", _ignore)
    received = 0

    def take(_frame: CanFrame, _time_ns: int) -> None:
        nonlocal received
        received += 1

    for number in range(1, count):
        medium.attach(f"receiver {number}", take)
    payloads = [number.to_bytes(8, "little") for number in range(FRAMES)]

    def ours() -> int:
        nonlocal received
        received = 0
        for payload in payloads:
            sender.send(CanFrame(0x181, payload))
            scheduler.run_for(200_000)
        if received != len(payloads) * (count - 1):
            raise CannotRunError(f"{received} frames were delivered to {count - 1} ports")
        return len(payloads)

    with ExitStack() as stack:
        source, *sinks = [
            stack.enter_context(can.Bus(interface="virtual", channel=f"hil-benchmark-{count}"))
            for _ in range(count)
        ]

        def peer() -> int:
            few = payloads[: FRAMES // count]
            for payload in few:
                source.send(can.Message(arbitration_id=0x181, data=payload, is_extended_id=False))
                for sink in sinks:
                    if sink.recv(1.0) is None:
                        raise CannotRunError("python-can's virtual bus lost a frame")
            return len(few)

        mine, theirs = alternately(ours, peer)
        return mine, theirs


def _ignore(_frame: CanFrame, _time_ns: int) -> None:
    pass


def sdo_uploads() -> list[Figure]:
    """SDO uploads per second from our slave in virtual time, by the canopen library and by our own client,
    and by the library from its own `LocalNode` over python-can's virtual bus.
    """
    import canopen

    from fieldbus.canopen import CanopenMaster, CanopenSlave
    from fieldbus.canopen.network import PumpedNetwork
    from fieldbus.canopen.sdo_client import SdoJob
    from hil.bench.drives import object_dictionary

    dictionary = object_dictionary()
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, name="benchmark-sdo", keep_log=False)
    slave = CanopenSlave(scheduler, medium, dictionary, 5, name="slave")
    slave.power_on()
    scheduler.run_for(S)
    network = PumpedNetwork(medium, name="client")
    entry = network.add_node(5, dictionary).sdo[0x1000]
    own = CanopenMaster(scheduler, medium).sdo(5)
    scheduler.run_for(S)  # nobody was there to acknowledge the boot-up

    def ours() -> int:
        for _ in range(UPLOADS):
            entry.raw  # noqa: B018 - the read is the work
        return UPLOADS

    def own_client() -> int:
        left = UPLOADS

        def ended(job: SdoJob) -> None:
            nonlocal left
            if not job.ok:
                raise CannotRunError(f"an upload of the benchmark failed: {job.reason}")
            left -= 1
            if left:
                own.upload(0x1000, 0, ended)

        own.upload(0x1000, 0, ended)
        scheduler.run_until(lambda: not left, 10 * S)
        return UPLOADS

    client, server = canopen.Network(), canopen.Network()
    client.connect(interface="virtual", channel="hil-benchmark-sdo")
    server.connect(interface="virtual", channel="hil-benchmark-sdo")
    try:
        server.create_node(5, dictionary)
        other = client.add_node(5, dictionary).sdo[0x1000]

        def peer() -> int:
            for _ in range(UPLOADS):
                other.raw  # noqa: B018 - the read is the work
            return UPLOADS

        mine, by_own_client, theirs = alternately(ours, own_client, peer)
    finally:
        client.disconnect()
        server.disconnect()
        network.disconnect()
    return [
        Figure("sdo_uploads_ours", mine, "uploads/s"),
        Figure("sdo_uploads_own_client", by_own_client, "uploads/s"),
        Figure("sdo_uploads_peer", theirs, "uploads/s"),
    ]


def position_plans() -> list[Figure]:
    """Jerk-limited point-to-point plans per second, against ruckig where it is installed."""
    try:
        import ruckig
    except ImportError:
        return []
    from motion.setpoint import plan_position

    def ours() -> int:
        for number in range(PLANS):
            plan_position(
                0.0,
                0.0,
                0.0,
                1.0 + number,
                max_velocity=100.0,
                acceleration=1000.0,
                deceleration=1000.0,
                jerk=10000.0,
            )
        return PLANS

    otg = ruckig.Ruckig(1)
    given = ruckig.InputParameter(1)
    given.max_velocity, given.max_acceleration, given.max_jerk = [100.0], [1000.0], [10000.0]
    trajectory = ruckig.Trajectory(1)

    def peer() -> int:
        for number in range(PLANS):
            given.target_position = [1.0 + number]
            otg.calculate(given, trajectory)
        return PLANS

    mine, theirs = alternately(ours, peer)
    return [Figure("position_plans_ours", mine, "plans/s"), Figure("position_plans_peer", theirs, "plans/s")]

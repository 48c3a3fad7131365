"""`hil emulate BENCH --ads`: the NC of a bench for ADS clients."""

from __future__ import annotations

import math
import signal
from contextlib import ExitStack
from types import FrameType
from typing import TYPE_CHECKING, Final

from fieldbus.ads import NC_PORT, PLC_PORT, TCP_PORT, AdsServer, net_id
from fieldbus.clock import MS, RealtimeScheduler, S
from fieldbus.errors import ConfigurationError
from fieldbus.modbus.sockets import SocketNetwork
from hil._commands.terminal import console
from hil._interrupt import note
from hil.bench.ads_face import ads_ports
from hil.campaign import load_bench_file
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from collections.abc import Callable

    from fieldbus.clock import Scheduler
    from hil.bench.bench import Bench

_SLICE_NS: Final = 2 * MS
"""How long clients wait at most until a virtual bench catches up with the clock."""
_ASKED_NS: Final = S // 5


def serve_ads(reference: str, *, host: str, port: int, net: str, seed: int, duration_s: float) -> int:
    """Run a bench in real time and serve its NC over ADS until Ctrl-C, SIGTERM or the end of `duration_s`;
    returns the exit code.

    Args:
        reference: Bench file or embedded name, with axes of an NC.
        host: Address of this machine at which clients are served.
        port: TCP port; 0: that of AMS/TCP.
        net: AMS NetID of the device.
        seed: Seed of the bench.
        duration_s: 0: until the end is asked for.

    Raises:
        CannotRunError: The bench has no axis of an NC.
        ConfigurationError: The NetID or the duration is wrong.
        BusError: The address cannot be used.

    """
    if not 0.0 <= duration_s < math.inf:
        raise ConfigurationError("--for", duration_s, "a number of seconds, 0 or more")
    try:
        own = net_id(net)
    except ValueError as error:
        raise ConfigurationError("--net-id", net, "an AMS NetID such as 127.0.0.1.1.1") from error
    ended = False

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of a signal handler
        nonlocal ended
        ended = True
        note()

    handlers = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with load_bench_file(reference).build(seed=seed) as bench, ExitStack() as stack:
            if not bench.nc_axis_names:
                raise CannotRunError(
                    f'--ads: the bench {reference!r} has no axis with controller = "nc"; '
                    f"nc-axes:{reference} is "
                    f"the same bench with axes of an NC"
                )
            live = isinstance(bench.scheduler, RealtimeScheduler)
            clock = bench.scheduler if live else RealtimeScheduler()
            network = SocketNetwork(clock)
            stack.callback(network.close)
            axes = {name: bench.axis(name, controller="nc") for name in bench.nc_axis_names}
            server = AdsServer(network, own, ads_ports(bench.nc, axes))
            stack.callback(bench.on_cycle(lambda: server.sample(bench.scheduler.now)))
            where = network.serve(host or "127.0.0.1", port or TCP_PORT)
            out = console()
            out.print(
                f"ADS on {where[0]}:{where[1]}, AMS NetID {net}: PLC on port {PLC_PORT}, NC on port "
                f"{NC_PORT}; "
                f"axes {', '.join(axes)}",
                markup=False,
                soft_wrap=True,
            )
            out.print("ready; end with Ctrl-C", style="dim", markup=False)
            _run(bench, clock, lambda: ended, duration_s or math.inf)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return 0


def _run(bench: Bench, clock: Scheduler, ended: Callable[[], bool], duration_s: float) -> None:
    """Let time pass; a virtual bench follows the clock of this machine."""
    begin_ns, bench_ns = clock.now, bench.scheduler.now
    forgotten_ns = 0
    while not ended():
        passed_ns = clock.now - begin_ns
        if passed_ns - forgotten_ns >= S:  # nobody asks for the recording
            bench.recorder.forget()
            forgotten_ns = passed_ns
        if passed_ns >= duration_s * S:
            return
        if clock is bench.scheduler:
            clock.run_until(ended, _ASKED_NS)
            continue
        clock.run_for(_SLICE_NS)
        behind_ns = bench_ns + clock.now - begin_ns - bench.scheduler.now
        if behind_ns > 0:
            bench.scheduler.run_for(behind_ns)

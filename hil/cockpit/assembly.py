"""The cockpit put together: a bench, its panes and the server."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from hil.cockpit.machine import Machine
from hil.cockpit.messages import RateLimit
from hil.cockpit.operator import Control
from hil.cockpit.panes.axis import AxisPane
from hil.cockpit.panes.bench import BenchPane
from hil.cockpit.panes.bus import BusPane
from hil.cockpit.panes.faults import FaultPane
from hil.cockpit.panes.scope import ScopePane
from hil.cockpit.panes.session import SessionPane
from hil.cockpit.panes.time_control import TimePane
from hil.cockpit.security import Admission
from hil.cockpit.server import application

if TYPE_CHECKING:
    from starlette.types import ASGIApp

    from hil.bench import BenchFile
    from hil.bench.bench import Bench
    from hil.cockpit.pane import Pane


def cockpit(
    bench_file: BenchFile,
    *,
    token: str,
    port: int,
    hosts: Iterable[str],
    folder: Path,
    allow_motion: bool = False,
    seed: int = 0,
    rate: Callable[[], RateLimit] = RateLimit,
    first: Callable[[], Bench] | None = None,
    further: Iterable[Pane] = (),
) -> ASGIApp:
    """Return a cockpit as an ASGI application.

    Args:
        bench_file: The bench that comes first.
        token: What opens it.
        port: Port of the server.
        hosts: Values of `Host` under which it is reached, with the port.
        folder: Bench files below it may be opened; what is saved goes there.
        allow_motion: Whether axes with a physical drive may be moved.
        seed: Seed of every bench.
        rate: Makes the count of the messages of one page.
        first: Brings up the first bench, in the middle of a case; None: it is built of the bench file.
        further: Panes besides those of the page, such as one that measures.

    """
    control = Control()
    machine = Machine(bench_file, control, seed=seed, first=first)
    axes = AxisPane(control, folder, allow_motion=allow_motion)
    session = SessionPane(machine, folder, axes.recorders)
    axes.on_away.append(session.operator_away)
    axes.on_disabled.append(session.disabled)
    machine.use(
        [
            TimePane(machine, control),
            BenchPane(machine, folder),
            axes,
            ScopePane(folder),
            session,
            FaultPane(session.the_session),
            BusPane(session.the_session, allow_motion=allow_motion),
            *further,
        ]
    )
    return application(machine, Admission(token, port), hosts, rate=rate)

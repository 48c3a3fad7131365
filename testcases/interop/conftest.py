"""An emulated drive on a virtual CAN segment, and the unmodified `canopen` library as its master."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from emulators.drive.cia402 import EDS_PATH, CiA402Drive, DriveConfig
from fieldbus.can import CanMedium
from fieldbus.canopen import PumpedNetwork, virtual_time
from fieldbus.clock import S, VirtualScheduler
from fieldbus.history import History
from testcases.interop_master import LibraryMaster

NODE = 5


def make_station(name, config=None):
    """Return a new reference axis at node 5, or another drive there, still switched off; `run(seconds)` lets
    time pass.

    Who is to hear the boot-up has to be on the bus before: alone, the drive would get no acknowledgement.
    """
    scheduler = VirtualScheduler()
    history = History(scheduler)
    medium = CanMedium(scheduler, name=name, history=history)
    drive = CiA402Drive(
        scheduler,
        medium,
        config or DriveConfig.reference(node_id=NODE),
        name="drive",
        history=history,
        rng=np.random.default_rng(1),
    )
    return SimpleNamespace(
        scheduler=scheduler,
        history=history,
        medium=medium,
        drive=drive,
        node_id=NODE,
        run=lambda seconds: scheduler.run_for(round(seconds * S)),
        transitions=lambda: [event.data["transition"] for event in history.select(kind="drive.state")],
    )


@contextmanager
def library_master(station):
    """Put the library on the segment of `station`, in virtual time."""
    with PumpedNetwork(station.medium) as network, virtual_time(station.scheduler):
        master = LibraryMaster(network, station.node_id, str(EDS_PATH), sleep=station.run)
        station.drive.power_on()
        station.run(0.01)
        yield master


@pytest.fixture
def station(request):
    """A drive of its own; the segment is named as the test."""
    return make_station(request.node.name)


@pytest.fixture
def master(station):
    """The library as the master of `station`, not yet commissioned."""
    with library_master(station) as master:
        yield master


@pytest.fixture
def new_pair():
    """Return a function that gives a context with a further station and its master."""

    @contextmanager
    def pair(name):
        station = make_station(name)
        with library_master(station) as master:
            yield station, master

    return pair

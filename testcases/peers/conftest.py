"""Software of others with the emulated devices; `install.py` installs it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from reports.qualification import SOFTWARE
from testcases.node_peer import MASTER, NODE, NodeStation, Station
from testcases.peers.versions import software_of


@pytest.hookimpl(tryfirst=True)  # before anything is selected by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder carries the mark `peers`."""
    here = str(Path(__file__).parent)
    for item in items:
        if str(item.path).startswith(here):
            item.add_marker(pytest.mark.peers)


@pytest.fixture(autouse=True)
def recorded_software(request: pytest.FixtureRequest) -> None:
    """Write into the JUnit file with which software of others a test runs, for `hil qualify --peers`."""
    request.node.user_properties.extend((SOFTWARE, text) for text in software_of(request.path.stem))


@pytest.fixture(scope="session")
def node_modules() -> Path:
    """Where `install.py` has installed; the test fails, and is never skipped, without it."""
    place = os.environ.get("HIL_PEERS", "")
    if not place or not (Path(place) / "node_modules" / "canopen").is_dir():
        pytest.fail(
            "HIL_PEERS does not name a directory with the software of others. Run these tests through "
            "`tox -e peers`, or install with `python testcases/peers/install.py DIRECTORY`.",
            pytrace=False,
        )
    return Path(place) / "node_modules"


@pytest.fixture
def station(request: pytest.FixtureRequest) -> Station:
    """A drive, still switched off."""
    return Station(request.node.name)


@pytest.fixture
def new_peer(station: Station, node_modules: Path) -> Iterator[Callable[[int, int], NodeStation]]:
    """Return a function that brings a station of the npm package with its own node-ID and that of its
    partner.
    """
    peers: list[NodeStation] = []

    def bring(own: int, other: int) -> NodeStation:
        peers.append(NodeStation(station.scheduler, station.segment, node_modules, own, other))
        return peers[-1]

    yield bring
    for peer in peers:
        peer.close()


@pytest.fixture
def peer(station: Station, new_peer: Callable[[int, int], NodeStation]) -> NodeStation:
    """The library as the master of the drive, which has just booted."""
    master = new_peer(MASTER, NODE)
    master.call("start")
    station.drive.power_on()
    master.until(lambda: [NODE, 0] in master.noticed("heartbeat"), "the boot-up")
    return master

"""The cockpit on a live bus with a physical drive: it moves with `--allow-motion` alone, and stops by itself
when the cockpit is killed.
"""

from __future__ import annotations

import pytest

from testcases import cockpit_rig
from testcases.physical_support import bench_text, emulate, multicast_place
from testcases.processes import Reader, hil_command

pytestmark = [pytest.mark.realtime, pytest.mark.exhaustive]


@pytest.fixture
def drives(tmp_path):
    """Drives in a process of their own, on a bus of their own, and a bench whose drive they are."""
    place = multicast_place()
    bench = bench_text(place, physical=True)
    assert "consumer_heartbeat_ms = 20000" in bench
    bench = bench.replace("consumer_heartbeat_ms = 20000", "consumer_heartbeat_ms = 3000")
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    running = emulate(tmp_path, place)
    yield running
    running.kill()


def serve(folder, *options: str) -> tuple[Reader, cockpit_rig.Served]:
    server = Reader(
        [*hil_command(), "cockpit", "bench.toml", "--port", "0", *options], stream="stderr", cwd=folder
    )
    found = server.wait_for(r"http://127\.0\.0\.1:(\d+)/#token=(\S+)")
    return server, cockpit_rig.Served(int(found[1]), token=found[2])


def test_physical_drive(drives, tmp_path):
    """Without `--allow-motion` it is not even enabled; with it a jog moves it, and the end of the server by
    SIGKILL makes the drive stop on the loss of the heartbeat.
    """
    server, cockpit = serve(tmp_path)
    try:
        with cockpit.page() as page:
            page.live()
            page.do("control.take")
            assert page.description["panes"]["axis"]["physical"] == ["axis1"]
            for command in ("take", "enable", "rel"):
                assert "--allow-motion" in page.refused(
                    "axis.command", axis="axis1", command=command, values=[]
                )
            assert "--allow-motion" in page.refused("axis.jog", axis="axis1", slider=10.0)
            assert "clock" in page.refused("time.pause")
    finally:
        server.end(2)
    server, cockpit = serve(tmp_path, "--allow-motion")
    try:
        with cockpit.page() as page:
            page.live()
            page.do("control.take")
            page.command("axis1", "take")
            page.command("axis1", "enable")
            page.until(lambda: page.state["axis"]["axis1"]["enabled"], "enabled")
            page.do("axis.jog", axis="axis1", slider=50.0)
            page.until(lambda: page.state["axis"]["axis1"]["position"] > 5.0, "moves")
            said = len(drives.lines)
            server.kill()
            drives.wait_for("drive.connection_lost.*heartbeat", since=said)
            drives.wait_for("Quick stop active -> Switch on disabled", since=said)
    finally:
        server.kill()

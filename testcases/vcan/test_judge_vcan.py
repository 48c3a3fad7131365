"""A log that candump itself has recorded from a SocketCAN interface is judged as the case from which its
frames come.
"""

import shutil
import subprocess
import time

import can
import pytest

from hil.bench import load_bench
from hil.expect import event, event_order, happens, never_happens, run_checkers
from hil.logs import read_bus_log, trace_of_log
from reports.model import Verdict

pytestmark = pytest.mark.vcan

PATIENCE_S = 60.0
PROBE_ID, LAST_ID = 0x7FE, 0x7FF


def test_a_log_by_candump(vcan_channel, tmp_path):
    """What candump writes is read, and the drive's states, faults and EMCYs come out as they were."""
    candump = shutil.which("candump")
    if candump is None:
        pytest.fail("candump is missing (Debian package can-utils)")
    file = load_bench("reference")
    with file.build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, 2.0)
        bench.drive().raise_fault(0x2310)
        bench.run_for(0.2)
        case = bench.trace()
    path = tmp_path / "machine.log"
    with (
        path.open("w") as stream,
        subprocess.Popen([candump, "-L", vcan_channel], stdout=stream) as process,
        can.Bus(interface="socketcan", channel=vcan_channel) as bus,
    ):
        try:
            send_until(bus, path, PROBE_ID)
            for _, _, frame, error in case.raw_frames("can0"):
                if not error:
                    bus.send(
                        can.Message(
                            arbitration_id=frame.can_id,
                            data=frame.data,
                            is_extended_id=False,
                            is_remote_frame=frame.remote,
                            dlc=frame.dlc,
                        )
                    )
            send_until(bus, path, LAST_ID)
        finally:
            process.terminate()
    log = trace_of_log(read_bus_log(path), file).trace
    trip = event("drive.fault", "drive1", code=0x2310)
    for expectation in (
        happens(trip),
        happens(event("emcy.raised", "drive1", code=0x2310)),
        event_order([event("drive.state", to="Operation enabled"), trip, event("drive.state", to="Fault")]),
    ):
        assert expectation.evaluate(case)[0].verdict is Verdict.PASSED
        assert expectation.evaluate(log)[0].verdict is Verdict.PASSED, expectation.title
    assert never_happens(trip).evaluate(log)[0].verdict is Verdict.FAILED
    assert [check.name for check in run_checkers(log) if check.verdict is not Verdict.PASSED] == []


def send_until(bus, path, can_id):
    """Send a frame again and again until candump has written one."""
    end = time.monotonic() + PATIENCE_S
    while f" {can_id:03X}#" not in path.read_text():
        assert time.monotonic() < end, "candump writes nothing"
        bus.send(can.Message(arbitration_id=can_id, is_extended_id=False))
        time.sleep(0.05)

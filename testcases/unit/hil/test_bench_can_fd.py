"""CAN FD on a bench: the key of the segment, drives beside FD programs, what is recorded of it."""

from __future__ import annotations

import can
import pytest

from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile, load_bench
from hil.campaign._files import write_candump
from hil.expect import run_checkers
from hil.logs import read_bus_log, trace_of_log
from hil.record import Trace
from reports.model import Verdict

REFERENCE = load_bench("reference").text


def bench_file(tmp_path, more: str) -> BenchFile:
    text = REFERENCE.replace("bitrate = 1_000_000\n", f"bitrate = 1_000_000\n{more}\n", 1)
    assert more in text
    return BenchFile(str(tmp_path / "bench.toml"), text)


def test_drives_work_beside_fd_programs(tmp_path):
    """An axis moves while programs exchange CAN FD with the identifiers of its PDOs."""
    with bench_file(tmp_path, "data_bitrate = 4_000_000").build() as bench:
        name = next(iter(bench.config.segment))
        with (
            can.Bus(interface="hil", channel=name, fd=True) as one,
            can.Bus(interface="hil", channel=name, fd=True) as other,
        ):
            message = can.Message(
                arbitration_id=0x205,
                is_extended_id=False,
                is_fd=True,
                bitrate_switch=True,
                data=bytes(range(64)),
            )
            one.send_periodic(message, 0.003)
            axis = bench.axis()
            power = axis.power()
            assert bench.run_until(lambda: bool(power.Status), 2.0)
            job = axis.move_relative(5.0)
            assert bench.run_until(job.done, 3.0)
            got = [other.recv(0) for _ in range(300)]
            assert bytes(message.data) in {bytes(one.data) for one in got if one is not None and one.is_fd}
        trace = bench.trace()
        assert all(check.verdict is Verdict.PASSED for check in run_checkers(trace))
        fd = [frame for frame in trace.frames if frame.fd]
        assert len(fd) > 100
        assert {(frame.can_id, frame.brs, len(frame.data)) for frame in fd} == {(0x205, True, 64)}
        assert "205##1" in bench.decode(next(frame for _, _, frame, _ in trace.can_log(name) if frame.fd))
        saved = Trace.load(trace.save(tmp_path / "trace")[0])
        assert saved.frames == trace.frames
        log = trace_of_log(read_bus_log(write_candump(trace, tmp_path / "bus.log")), bench_file(tmp_path, ""))
        assert any("CAN FD frames are shown, not judged" in note for note in log.notes)
        assert not any(event.kind.startswith("log.") for event in log.trace.events)


def test_a_classic_drive_on_an_fd_segment(tmp_path):
    """A drive among `classic_nodes` destroys the first CAN FD frame, with a form error."""
    drive = next(iter(load_bench("reference").config.drive))
    more = f'data_bitrate = 2_000_000\nclassic_nodes = ["{drive}"]'
    with bench_file(tmp_path, more).build() as bench:
        name = next(iter(bench.config.segment))
        with can.Bus(interface="hil", channel=name, fd=True) as bus:
            bench.run_for(0.1)
            bus.send(can.Message(arbitration_id=0x7F0, is_extended_id=False, is_fd=True, data=bytes(8)))
            bench.run_for(0.01)
        errors = list(bench.trace().select(kind="can.bus_error"))
        assert errors
        assert errors[0].data["code"] == "FORM_ERROR"


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("data_bitrate = 500_000", "1000000 (bitrate) to 8000000"),
        ('classic_nodes = ["drive1"]', "data_bitrate only"),
        ('data_bitrate = 2_000_000\nclassic_nodes = ["nobody"]', "controller"),
    ],
)
def test_wrong_keys_of_can_fd(tmp_path, more, says):
    """A data rate below the other, and names without meaning, are refused with what is allowed."""
    with pytest.raises(ConfigurationError) as refused, bench_file(tmp_path, more).build():
        pass
    assert says in str(refused.value)

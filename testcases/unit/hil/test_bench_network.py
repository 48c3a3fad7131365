"""The drives of a bench as nodes: identity, start-up, optional drives, guarding, and a drive that comes
back.
"""

from __future__ import annotations

import random

import numpy as np
import pytest

from emulators.drive.cia402 import CiA402Drive
from fieldbus.can import CanFrame
from fieldbus.can.hooks import HookResult
from fieldbus.canopen import BootState, NmtState
from fieldbus.clock import MS, S
from hil.bench import BenchFile
from hil.errors import BlockedError, ConfigurationError
from hil.faults import Injector, frame, state

TWO_AXES = """
[bench]
name = "two axes"
cycle_ms = 4

[segment.can0]

[drive.drive1]
segment = "can0"
node_id = 5
{first}

[drive.drive2]
segment = "can0"
node_id = 6
{second}

[axis.axis1]
drive = "drive1"

[axis.axis1.variables]
"Sensor[1].Parameter.StepsPerRevolution" = 131072
"Sensor[1].Parameter.FineResolutionXist1" = 0

[axis.axis2]
drive = "drive2"

[axis.axis2.variables]
"Sensor[1].Parameter.StepsPerRevolution" = 131072
"Sensor[1].Parameter.FineResolutionXist1" = 0
"""


def two_axes(*, first: str = "", second: str = ""):
    return BenchFile("two.toml", TWO_AXES.format(first=first, second=second)).build()


def events(bench, kind: str, node: int) -> list[dict]:
    return [
        e.data for e in bench.history.select(source="controller", kind=kind) if e.data.get("node") == node
    ]


def enable(bench, *names: str) -> None:
    jobs = [bench.axis(name).power() for name in names]
    assert bench.run_until(lambda: all(job.status() for job in jobs), 2.0)


# -- start
# -----------------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-146")
def test_drives_of_a_bench_are_nodes():
    """After the start every drive is in service; the network shows identity, what was written, and no
    failure.
    """
    with two_axes(first="vendor_id = 0") as bench:
        assert [node.name for node in bench.network().nodes.values()] == ["drive1", "drive2"]
        for name in ("drive1", "drive2"):
            node = bench.node(name)
            assert node.in_service
            assert node.failure is None
            assert node.report.written
            assert set(node.identity) == {"vendor_id", "product_code", "revision", "serial"}
            assert node.nmt_state is not NmtState.STOPPED
        assert bench.node() is bench.node("drive1")
        with pytest.raises(ConfigurationError, match="similar: drive2, drive1"):
            bench.node("drive3")


def test_drives_start_side_by_side(monkeypatch):
    """Two drives that take their time to answer are commissioned in the time of one."""
    original = CiA402Drive.power_on

    def slow(drive):
        drive.slave.sdo_response_delay_ns = 2 * MS
        original(drive)

    monkeypatch.setattr(CiA402Drive, "power_on", slow)
    with two_axes() as bench:
        durations = [events(bench, "node.booted", node)[0]["duration_ms"] for node in (5, 6)]
        assert min(durations) > 100
        assert bench.now_s < 1.3 * max(durations) / 1000


@pytest.mark.parametrize("key", ["vendor_id", "product_code", "revision", "serial"])
def test_another_drive_than_in_the_bench_file_blocks(key):
    """A drive with another identity than the bench file expects blocks the bench; the message says what
    differs.
    """
    with pytest.raises(
        BlockedError, match=r"drive2 \(node 6\) is another device: .*1018h:\d\) FFFFFFF0h is expected"
    ):
        two_axes(second=f"{key} = 0xFFFFFFF0")


def test_refused_parameter_is_named(monkeypatch):
    """A drive that refuses a parameter is reported with object, value, the reason in words, and what is done
    instead; one that a controller can do without does not end the start.
    """
    original = CiA402Drive.power_on

    def strict(drive):
        drive.slave.store.entry(0x1006, 0).high = 1000
        original(drive)

    monkeypatch.setattr(CiA402Drive, "power_on", strict)
    with two_axes() as bench:
        refused = [entry.data for entry in bench.history.select(kind="node.refused")]
    assert [(one["name"], one["object"], one["value"]) for one in refused] == [
        ("drive1", "1006h:0", 4000),
        ("drive2", "1006h:0", 4000),
    ]
    assert {(one["reason"], one["instead"]) for one in refused} == {
        ("06090031h value too high", "left as it is")
    }


def absent(monkeypatch, name: str) -> None:
    """Let a drive stay off when the bench starts."""
    original = CiA402Drive.power_on
    monkeypatch.setattr(
        CiA402Drive, "power_on", lambda drive: None if drive.slave.name == name else original(drive)
    )


@pytest.mark.exhaustive
def test_missing_drive_blocks(monkeypatch):
    """A drive that is not there blocks the bench after 5 s; the other one does not hide that."""
    absent(monkeypatch, "drive2")
    with pytest.raises(BlockedError, match=r"drive2 \(node 6\) does not answer on the bus within 5 s"):
        two_axes()


@pytest.mark.exhaustive
def test_optional_drive_may_be_missing(monkeypatch):
    """A bench is ready without an optional drive; when that comes, its axis can be used."""
    with monkeypatch.context() as patch:
        absent(patch, "drive2")
        bench = two_axes(second="optional = true")
    with bench:
        assert bench.now_s < 1.0
        assert bench.node("drive2").boot_state is BootState.WAITING
        enable(bench, "axis1")
        job = bench.axis("axis1").move_relative(10.0)
        bench.drive("drive2").power_on()
        assert bench.run_until(job.done, 3.0)
        assert bench.node("drive2").in_service
        if bench.axis("axis2").alarms.engine.number:
            assert bench.run_until(bench.axis("axis2").reset().done, 1.0)
        enable(bench, "axis2")
        assert bench.run_until(bench.axis("axis2").move_relative(10.0).done, 3.0)


# -- two segments
# ----------------------------------------------------------------------------------------------------

TWO_SEGMENTS = (
    TWO_AXES.format(first="", second="")
    .replace("[segment.can0]", "[segment.can0]\n\n[segment.can1]")
    .replace('[drive.drive2]\nsegment = "can0"', '[drive.drive2]\nsegment = "can1"')
)


@pytest.mark.parametrize("place", ["fault", "trigger"])
def test_messages_are_those_of_a_node_on_the_segment(place):
    """A message without a drive is one of the first drive on the segment; a drive of another segment is
    refused.
    """
    with BenchFile("two.toml", TWO_SEGMENTS).build() as bench:
        faults = Injector(bench)

        def drop(drive: str):
            if place == "fault":
                return faults.inject("frame.drop", "can1", count=1, message="tpdo1", drive=drive)
            return faults.inject(
                "frame.drop", "can1", count=1, trigger=frame(message="tpdo1", drive=drive, segment="can1")
            )

        for drive in ("", "drive2"):
            armed = drop(drive)
            bench.run_for(0.02)
            assert armed.over
        with pytest.raises(
            ConfigurationError, match=r"'drive1' is not allowed; allowed: drive2 \(nodes on can1\)"
        ):
            drop("drive1")


@pytest.mark.exhaustive
def test_state_of_a_component_that_there_is_not():
    """A trigger on the state of an unknown component would never come: refused, with the names that there
    are.
    """
    with (
        two_axes() as bench,
        pytest.raises(
            ConfigurationError,
            match=r"trigger\.component: 'drive3' is not allowed; allowed: axis1, axis2, drive1, drive2",
        ),
    ):
        Injector(bench).inject("drive.sto", "drive1", trigger=state("drive3", "Operation enabled"))


def test_frames_of_equal_node_ids_are_distinguished_by_their_segment():
    """Decoded for its segment, a frame is that of the node there; a segment that there is not is named."""
    text = TWO_SEGMENTS.replace("node_id = 6", "node_id = 5")
    with BenchFile("two.toml", text).build() as bench:
        heartbeat = CanFrame(0x705, b"\x05")
        for segment, drive in (("can0", "drive1"), ("can1", "drive2")):
            assert drive in bench.decode(heartbeat, segment=segment)
            assert "Statusword" in bench.decode(CanFrame(0x185, bytes(8)), segment=segment)
        with pytest.raises(ConfigurationError, match="can9"):
            bench.decode(heartbeat, segment="can9")


# -- supervision
# -----------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-024", "C301-030")
def test_bench_with_node_guarding():
    """A drive without heartbeat is guarded; when it falls silent the axis has alarm 431."""
    guarding = "heartbeat_ms = 0\nguard_time_ms = 20\nlife_time_factor = 3"
    with two_axes(first=guarding) as bench:
        enable(bench, "axis1", "axis2")
        bench.run_for(0.5)
        assert bench.node("drive1").nmt_state is NmtState.OPERATIONAL
        assert bench.drive("drive1").slave.get(0x1017) == 0
        assert bench.drive("drive1").slave.get(0x100D) == 3
        bench.drive("drive1").stop_heartbeat(True)
        assert bench.run_until(lambda: bench.axis("axis1").alarms.engine.number == 431, 0.2)
        assert events(bench, "guarding.lost", 5)
        bench.run_for(0.2)
        assert not bench.axis("axis1").port.link_ok  # though its PDOs go on
        assert bench.axis("axis2").port.link_ok
        assert bench.axis("axis2").alarms.engine.number == 0


def test_guarding_and_heartbeat_exclude_each_other():
    """The bench file says so with file, key and value."""
    with pytest.raises(
        ConfigurationError, match=r"two.toml: drive.drive1.guard_time_ms: 50 needs heartbeat_ms = 0"
    ):
        two_axes(first="guard_time_ms = 50")


def test_emcys_of_a_drive_are_collected():
    """A fault of the drive is among the EMCYs of its node, with its meaning."""
    with two_axes() as bench:
        bench.drive("drive2").raise_fault(0x2310)
        bench.run_for(0.05)
        assert [(e.code, e.text) for e in bench.node("drive2").emcys] == [(0x2310, "continuous overcurrent")]
        assert not bench.node("drive1").emcys


# -- a drive comes back
# ------------------------------------------------------------------------------------------------


def story(*, power_loss: bool, forgets: bool = True):
    """Move axis 1; meanwhile drive 2, enabled at rest, loses its supply and gets it back."""
    bench = two_axes(second="store_parameters = false" if forgets else "")
    enable(bench, "axis1", "axis2")
    bench.axis("axis2").home(0.0)
    bench.run_for(0.1)
    assert bench.axis("axis2").homed
    start_ns = bench.scheduler.now
    job = bench.axis("axis1").move_relative(150.0, Velocity=100.0)
    bench.run_for(0.3)
    if power_loss:
        drive = bench.drive("drive2")
        drive.power_off()
        bench.run_for(0.5)
        drive.power_on()
        bench.run_for(0.2)
    else:
        bench.run_for(0.7)
    assert bench.run_until(job.done, 5.0)
    bench.scheduler.run_for(start_ns + 3 * S - bench.scheduler.now)
    return bench


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-015", "C301-022")
@pytest.mark.parametrize("forgets", [True, False])
def test_drive_comes_back_while_the_other_axis_moves(forgets):
    """A drive loses its supply, with or without its stored parameters, and is taken in again in the running
    cycle.

    The other axis' motion is the same byte for byte as without all that. The alarm of the axis waits for its
    acknowledgement; then the axis is enabled and moves.
    """
    with story(power_loss=False, forgets=forgets) as bench:
        undisturbed = bench.trace()
    with story(power_loss=True, forgets=forgets) as bench:
        disturbed = bench.trace()
        for column in undisturbed.names():
            if column.startswith(("axis1.", "drive1.")):
                assert np.array_equal(undisturbed[column].values, disturbed[column].values), column

        node = bench.node("drive2")
        assert node.in_service
        assert node.losses == 1
        assert bool(node.report.written) is forgets
        assert node.report.verified is not forgets
        axis = bench.axis("axis2")
        assert axis.alarms.engine.number == 431
        assert axis.communication_ok
        assert not axis.homed  # the count of the incremental encoder has a new reference
        enabling = axis.power()
        bench.run_for(0.2)
        assert not enabling.status()
        axis.power(False)
        bench.run_for(0.05)
        assert bench.run_until(axis.reset().done, 1.0)
        enable(bench, "axis2")
        before = axis.feedback.position
        assert bench.run_until(axis.move_relative(20.0).done, 3.0)
        bench.run_for(0.1)
        assert axis.feedback.position == pytest.approx(before + 20.0, abs=0.1)


@pytest.mark.exhaustive
def test_drive_that_comes_back_as_another_one_stays_out():
    """A drive that was exchanged for another device while it was off is not started; its axis keeps the
    alarm.
    """
    with two_axes(second="serial = 1") as bench:
        enable(bench, "axis1", "axis2")
        drive = bench.drive("drive2")
        drive.power_off()
        bench.run_for(0.3)
        drive.slave.store.entry(0x1018, 4).default = 77
        drive.power_on()
        bench.run_for(0.5)
        node = bench.node("drive2")
        assert node.boot_state is BootState.FAILED
        assert "0000004Dh" in str(node.failure)
        assert drive.slave.nmt_state is NmtState.PRE_OPERATIONAL
        assert bench.axis("axis2").alarms.engine.number == 431
        assert not bench.axis("axis2").communication_ok
        assert bench.axis("axis1").communication_ok


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-113", "C301-027")
def test_cut_cable():
    """A drive that was cut off, with its own reaction to the missing controller, is taken in again when
    connected.
    """
    with two_axes() as bench:
        enable(bench, "axis1", "axis2")
        drive = bench.drive("drive2")
        cut = Injector(bench).inject("can.unplug", node="drive2")
        bench.run_for(1.0)
        assert bench.node("drive2").boot_state is BootState.LOST
        assert bench.axis("axis2").alarms.engine.number == 431
        assert drive.slave.nmt_state is NmtState.PRE_OPERATIONAL
        cut.remove()
        bench.run_for(0.5)
        node = bench.node("drive2")
        assert node.in_service
        assert node.report.verified
        assert node.bootups == 1
        bench.axis("axis2").power(False)
        bench.run_for(0.05)
        assert bench.run_until(bench.axis("axis2").reset().done, 1.0)
        enable(bench, "axis2")
        assert bench.run_until(bench.axis("axis2").move_relative(5.0).done, 3.0)


def test_old_actual_values_do_not_count():
    """A drive that is in service again has to send actual values before its axis has a link."""
    with two_axes() as bench:
        port = bench.axis("axis1").port
        assert port.link_ok
        lost = []

        def swallow(frame, *_rest):
            if frame.can_id != 0x185:
                return None
            lost.append(frame)
            return HookResult.drop()

        end = bench.segment().add_hook(swallow)
        port.leave_service()
        port.enter_service()
        bench.run_for(0.0081)
        assert lost
        assert not port.link_ok
        end()
        bench.run_for(0.008)
        assert port.link_ok


@pytest.mark.exhaustive
def test_quick_reset_is_noticed():
    """A drive that resets and is back within the grace cycles is noticed by its boot-up: alarm, not a silent
    restart.
    """
    with two_axes() as bench:
        enable(bench, "axis1", "axis2")
        bench.drive("drive2").power_off()
        bench.drive("drive2").power_on()
        bench.run_for(0.1)
        assert bench.node("drive2").in_service
        assert events(bench, "node.lost", 6)[0]["reason"] == "boot-up"
        assert bench.axis("axis2").alarms.engine.number == 431
        assert bench.axis("axis1").alarms.engine.number == 0


@pytest.mark.exhaustive
def test_controller_cut_off():
    """When it is the controller that was cut off, all drives are lost, and taken in again side by side."""
    with two_axes() as bench:
        enable(bench, "axis1", "axis2")
        cut = Injector(bench).inject("can.unplug", node="controller")
        bench.run_for(0.6)
        nodes = [bench.node(name) for name in ("drive1", "drive2")]
        assert [node.boot_state for node in nodes] == [BootState.LOST] * 2
        assert {bench.axis(name).alarms.engine.number for name in ("axis1", "axis2")} == {431}
        cut.remove()
        bench.run_for(0.5)
        assert all(node.in_service and node.report.verified for node in nodes)
        assert all(bench.axis(name).port.link_ok for name in ("axis1", "axis2"))
        for name in ("axis1", "axis2"):
            bench.axis(name).power(False)
        bench.run_for(0.05)
        resets = [bench.axis(name).reset() for name in ("axis1", "axis2")]
        assert bench.run_until(lambda: all(reset.done() for reset in resets), 1.0)
        enable(bench, "axis1", "axis2")


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(6))
def test_supply_that_comes_and_goes(seed):
    """However often and whenever a drive loses its supply, also in the middle of its boot, it is in service
    in the end.
    """
    stream = random.Random(seed)
    with two_axes(second="store_parameters = false" if seed % 2 else "") as bench:
        enable(bench, "axis1")
        drive = bench.drive("drive2")
        for _ in range(12):
            drive.power_off()
            bench.run_for(stream.choice((0.001, 0.01, 0.4)) * stream.random())
            drive.power_on()
            bench.run_for(stream.choice((0.001, 0.01, 0.03, 0.2)) * stream.random())
        bench.run_for(0.5)
        node = bench.node("drive2")
        assert node.in_service
        assert bench.axis("axis2").communication_ok
        assert drive.slave.get(0x6007) == 3
        assert bench.axis("axis1").alarms.engine.number == 0
        assert bench.node("drive1").losses == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize(("bitrate", "cycle_ms"), [(1_000_000, 2), (500_000, 4), (125_000, 20), (50_000, 60)])
def test_every_bit_rate(bitrate, cycle_ms):
    """At any bit rate a drive is configured again in the running cycle, and no SDO makes a SYNC wait."""
    text = TWO_AXES.format(first="", second="store_parameters = false")
    text = text.replace("cycle_ms = 4", f"cycle_ms = {cycle_ms}")
    text = text.replace("[segment.can0]", f"[segment.can0]\nbitrate = {bitrate}")
    with BenchFile("slow.toml", text).build() as bench:
        bench.run_for(0.5)
        bench.drive("drive2").power_off()
        bench.run_for(0.5)
        assert not bench.node("drive2").in_service
        log = bench.segment().log
        start = len(log)
        bench.drive("drive2").power_on()
        assert bench.run_until(lambda: bench.node("drive2").in_service, 8.0)
        assert bench.node("drive2").report.written
        ends = {n: log[n][0] % bench.cycle_ns for n in range(start, len(log)) if log[n][2].can_id == 0x80}
        before = [log[n - 1][2].can_id for n, end in ends.items() if end != min(ends.values())]
        assert len(ends) >= 3
        assert not [can_id for can_id in before if 0x580 <= can_id <= 0x67F]


@pytest.mark.exhaustive
def test_encoder_comes_back():
    """An encoder of its own is a node too: started, lost, and started again, without a word written to it."""
    text = TWO_AXES.format(first="", second="") + '\n[encoder.scale]\nsegment = "can0"\nnode_id = 30\n'
    with BenchFile("encoder.toml", text).build() as bench:
        node = bench.node("scale")
        assert node.in_service
        assert node.report.device_type is not None
        assert node.report.device_type & 0xFFFF == 406
        encoder = bench.encoder("scale")
        encoder.power_off()
        bench.run_for(0.5)
        assert node.boot_state is BootState.LOST
        encoder.power_on()
        bench.run_for(0.3)
        assert node.in_service
        assert encoder.slave.nmt_state is NmtState.OPERATIONAL
        assert node.report.written == []
        assert bench.axis("axis1").alarms.engine.number == 0
        sent = [frame.data[0] >> 5 for _, _, frame, _ in bench.segment().log if frame.can_id == 0x600 + 30]
        assert 1 not in sent  # no download

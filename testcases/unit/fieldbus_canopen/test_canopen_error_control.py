"""Heartbeat and guarding of the slave."""

from __future__ import annotations

import itertools

import pytest

from fieldbus.can import CanFrame
from fieldbus.canopen import AbortCode, NmtCommand, NmtState

OWN = 0x705
EMCY = 0x085
LOST = bytes.fromhex("30 81 11 00 00 00 00 00")
BACK = bytes(8)


def watch(bench, node: int = 127, time_ms: int = 50, sub: int = 1) -> int:
    return bench.write(0x1016, sub, node << 16 | time_ms, 4)


@pytest.mark.requirement("C301-010", "C301-023")
def test_heartbeat_has_its_period_and_the_state(bench):
    """With 1017h = 20 ms the state is sent every 20 ms, also in Stopped."""
    bench.write(0x1017, 0, 20, 2)
    for command, value in ((0x80, 0x7F), (0x01, 0x05), (0x02, 0x04)):
        bench.nmt(command)
        bench.received.clear()
        bench.run(200)
        times = bench.times(OWN)
        assert len(times) == 10
        assert all(abs(later - earlier - 20) < 0.5 for earlier, later in itertools.pairwise(times))
        assert set(bench.take(OWN)) == {bytes((value,))}


@pytest.mark.requirement("C301-023")
def test_new_heartbeat_time_restarts_the_timer(bench):
    """A new value counts from the moment of writing; 0 stops the heartbeat."""
    bench.write(0x1017, 0, 1000, 2)
    bench.run(500)
    bench.write(0x1017, 0, 50, 2)
    bench.received.clear()
    bench.run(60)
    assert len(bench.times(OWN)) == 1
    bench.write(0x1017, 0, 0, 2)
    bench.received.clear()
    bench.run(500)
    assert bench.times(OWN) == []


@pytest.mark.requirement("C301-024", "C301-028")
def test_node_guarding_answers_with_state_and_toggle(bench):
    """A remote request is answered with the state; bit 7 is 0 at first and alternates; reset starts it
    again.
    """
    answers = [bench.ask(OWN, remote=True, dlc=1)[0].data[0] for _ in range(3)]
    assert answers == [0x7F, 0xFF, 0x7F]
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert bench.ask(OWN, remote=True, dlc=1)[0].data[0] == 0x7F


@pytest.mark.requirement("C301-024")
def test_no_guarding_answer_with_heartbeat(bench):
    """With a heartbeat configured, guarding requests are not answered."""
    bench.write(0x1017, 0, 10_000, 2)
    assert bench.ask(OWN, remote=True, dlc=1) == []


@pytest.mark.requirement("C301-029", "C301-123")
def test_life_guarding(bench):
    """Life guarding starts with the first request, ends in EMCY 8130h, and a new request resolves it."""
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    bench.write(0x100C, 0, 20, 2)
    bench.write(0x100D, 0, 3, 1)
    bench.run(500)
    assert reasons == []
    for _ in range(5):
        bench.ask(OWN, remote=True, dlc=1)
        bench.run(30)
    bench.run(20)
    assert reasons == []
    bench.received.clear()
    bench.run(50)
    assert bench.take(EMCY) == [LOST]
    assert reasons == ["life_guarding"]
    bench.ask(OWN, remote=True, dlc=1)
    assert bench.take(EMCY) == [BACK]


@pytest.mark.requirement("C301-024", "C301-029")
@pytest.mark.parametrize(
    "change", [(0x1017, 100, 2), (0x100C, 0, 2), (0x100D, 0, 1)], ids=["heartbeat", "guard-time", "factor"]
)
@pytest.mark.parametrize("overdue", [False, True], ids=["in-time", "overdue"])
def test_life_guarding_ends_when_guarding_does(bench, change, overdue):
    """A master that goes over to heartbeat, or switches guarding off, is not missed; if it was, it is no
    longer.
    """
    bench.write(0x100C, 0, 20, 2)
    bench.write(0x100D, 0, 3, 1)
    bench.ask(OWN, remote=True, dlc=1)
    if overdue:
        bench.run(100)
        assert bench.take(EMCY) == [LOST]
    index, value, size = change
    bench.received.clear()
    bench.write(index, 0, value, size)
    bench.run(500)
    assert bench.take(EMCY) == ([BACK] if overdue else [])
    assert bench.slave.get(0x1001) == 0


@pytest.mark.requirement("C301-025", "C301-026", "C301-123")
def test_heartbeat_consumer(bench):
    """Monitoring starts with the first heartbeat; a missing one gives EMCY 8130h and tells the device; the
    next resolves it.
    """
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    assert watch(bench) == 0
    bench.run(500)
    assert reasons == []
    for _ in range(10):
        bench.send(0x77F, "05")
        bench.run(40)
    assert reasons == []
    bench.take()
    bench.run(20)
    assert bench.take(EMCY) == [LOST]
    assert reasons == ["heartbeat"]
    bench.run(500)
    assert bench.take(EMCY) == []
    bench.send(0x77F, "05")
    bench.run(5)
    assert bench.take(EMCY) == [BACK]
    bench.run(100)
    assert reasons == ["heartbeat", "heartbeat"]


@pytest.mark.requirement("C301-026")
def test_heartbeat_time_is_kept_exactly(bench):
    """The event comes when the consumer time has passed since the last heartbeat, to the microsecond."""
    watch(bench, time_ms=50)
    lost = []
    bench.slave.on_communication_error.append(lambda _reason: lost.append(bench.scheduler.now))
    bench.received.clear()
    last = []
    bench.slave.error_control.on_remote_state.append(lambda _node, _state: last.append(bench.scheduler.now))
    bench.send(0x77F, "05")
    bench.run(200)
    assert lost == [last[0] + 50_000_000]


@pytest.mark.requirement("C301-025")
def test_unused_consumer_entries(bench):
    """Entries with node 0, node above 127, time 0 or a reserved bit watch nothing."""
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    for sub, value in ((1, 0x0000_0032), (2, 0x0080_0032), (3, 0x007F_0000)):
        assert bench.write(0x1016, sub, value, 4) == 0
    for can_id in (0x700, 0x77F):
        bench.send(can_id, "05")
    bench.run(300)
    bench.write(0x1016, 3, 0x017F_0032, 4)
    bench.send(0x77F, "05")
    bench.run(300)
    assert reasons == []


@pytest.mark.requirement("C301-025", "C301-090")
def test_two_entries_for_one_node(bench):
    """A second entry for a node that is watched already is refused with 06040043h; the entry itself may
    change.
    """
    assert watch(bench, sub=1) == 0
    assert watch(bench, sub=2, time_ms=70) == AbortCode.PARAMETER
    assert watch(bench, sub=1, time_ms=70) == 0
    assert watch(bench, sub=2, time_ms=0) == 0


@pytest.mark.requirement("C301-027")
def test_remote_state_change_is_no_timeout(bench):
    """Boot-up and state changes of a watched node are reported as such; after a boot-up monitoring waits
    again.
    """
    changes, reasons = [], []
    bench.slave.error_control.on_remote_state.append(lambda node, state: changes.append((node, state)))
    bench.slave.on_communication_error.append(reasons.append)
    watch(bench)
    for state in ("7F", "05", "05", "04", "00"):
        bench.send(0x77F, state)
        bench.run(10)
    assert changes == [(127, 0x7F), (127, 0x05), (127, 0x04), (127, 0x00)]
    bench.run(500)
    assert reasons == []


@pytest.mark.requirement("C301-113")
@pytest.mark.parametrize(
    ("behaviour", "state"),
    [(0, NmtState.PRE_OPERATIONAL), (1, NmtState.OPERATIONAL), (2, NmtState.STOPPED)],
)
def test_error_behaviour(bench, behaviour, state):
    """1029h:1 decides the state after a communication error; the EMCY goes out before the node is stopped."""
    bench.write(0x1029, 1, behaviour, 1)
    watch(bench)
    bench.nmt(NmtCommand.START)
    bench.send(0x77F, "05")
    bench.run(5)
    bench.take()
    bench.run(100)
    assert bench.slave.nmt_state == state
    assert bench.take(EMCY) == [LOST]


@pytest.mark.requirement("C301-113", "C301-097")
@pytest.mark.parametrize("value", [3, 0x7F, 0x80, 0xFF])
def test_unknown_error_behaviour_is_refused(bench, value):
    """1029h takes 0, 1 and 2; anything else is an invalid value and changes nothing."""
    assert bench.write(0x1029, 1, 2, 1) == 0
    assert bench.write(0x1029, 1, value, 1) == AbortCode.VALUE
    assert bench.slave.get(0x1029, 1) == 2


@pytest.mark.requirement("C301-113")
def test_error_behaviour_to_pre_operational_only_from_operational(bench):
    """With 1029h:1 = 0 a stopped node stays stopped."""
    watch(bench)
    bench.nmt(NmtCommand.STOP)
    bench.send(0x77F, "05")
    bench.run(100)
    assert bench.slave.nmt_state == NmtState.STOPPED


@pytest.mark.requirement("C301-113", "C301-124", "CANP-058")
def test_bus_off_is_a_communication_error(bench):
    """When the CAN controller goes bus-off the device is informed and 1029h acts; coming back sends EMCY
    8140h.
    """
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    bench.nmt(NmtCommand.START)
    port = next(port for port in bench.segment.ports if port.name == "drive1")
    bench.take()
    port.set_error_counters(tec=256)
    assert reasons == ["bus_off"]
    assert bench.slave.nmt_state == NmtState.PRE_OPERATIONAL
    bench.run(20)
    codes = [data[:2] for data in bench.take(EMCY)]
    assert codes[0] == bytes.fromhex("40 81")
    assert bench.slave.errors.register == 0


@pytest.mark.requirement("C301-122", "CANP-058")
def test_error_passive_is_reported(bench):
    """EMCY 8120h tells that the controller is error passive; it ends when the counters have fallen."""
    port = next(port for port in bench.segment.ports if port.name == "drive1")
    bench.take()
    port.set_error_counters(tec=130)
    bench.run(5)
    assert bench.take(EMCY)[0][:3] == bytes.fromhex("20 81 11")
    for _ in range(5):
        bench.read(0x1000)
    assert bench.slave.errors.active == {}


@pytest.mark.requirement("CANP-058", "C301-121")
def test_overrun_is_reported_when_there_is_room_again(bench):
    """Frames that did not fit the transmit queue are reported by EMCY 8110h a little later, once, and it
    ends at once.
    """
    port = next(port for port in bench.segment.ports if port.name == "drive1")
    port.tx_buffers = 2
    bench.take()
    for number in range(8):
        port.send(CanFrame(0x7F0, bytes([number])))
    assert port.overruns > 0
    bench.run(50)
    assert [data[:2].hex() for data in bench.take(EMCY)] == ["1081", "0000"]
    assert bench.slave.errors.active == {}


def test_two_missing_nodes_are_one_error(bench):
    """A second missing node tells the device again but is no second EMCY; the error ends when both are
    back.
    """
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    watch(bench, 127, 50, sub=1)
    watch(bench, 126, 80, sub=2)
    bench.take()
    bench.send(0x77F, "05")
    bench.send(0x77E, "05")
    bench.run(200)
    assert reasons == ["heartbeat", "heartbeat"]
    assert bench.take(EMCY) == [LOST]
    bench.send(0x77F, "05")
    bench.run(5)
    assert bench.take(EMCY) == []
    bench.send(0x77E, "05")
    bench.run(5)
    assert bench.take(EMCY) == [BACK]


def test_silent_heartbeat_fault(bench):
    """`silent` suppresses heartbeat and guarding answers and nothing else."""
    bench.write(0x1017, 0, 10, 2)
    bench.slave.error_control.silent = True
    bench.received.clear()
    bench.run(100)
    assert bench.times(OWN) == []
    assert bench.read(0x1000) == 0x20192
    bench.slave.error_control.silent = False
    bench.run(100)
    assert len(bench.times(OWN)) >= 9


def test_removed_watch_resolves_its_error(bench):
    """Clearing the consumer entry of a lost node ends the error."""
    watch(bench)
    bench.send(0x77F, "05")
    bench.run(100)
    assert bench.slave.errors.active == {0x8130: 0x11}
    bench.write(0x1016, 1, 0, 4)
    assert bench.slave.errors.active == {}

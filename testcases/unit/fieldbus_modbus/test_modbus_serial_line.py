"""The serial line in simulated time: character times, pauses, collisions, parity, and master and stations on
it.
"""

import pytest

from fieldbus.clock import MS, S, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.modbus import (
    Area,
    Change,
    FrameAssembler,
    ModbusError,
    ModbusServer,
    Outcome,
    Parity,
    Request,
    RtuClient,
    RtuDecoder,
    RtuStation,
    SerialFormat,
    SerialLine,
    rtu_frame,
)
from testcases.unit.fieldbus_modbus.conftest import new_map

READ = Request(3, 10, 10)


class Listener:
    def __init__(self):
        self.heard = []

    def started(self, time_ns):
        pass

    def received(self, data, damaged, time_ns):
        self.heard.append((time_ns, data, damaged))


class Rig:
    """A line with a bare port, a station of unit 5 and, where wanted, a master."""

    def __init__(self, format_=None, **station):
        self.scheduler = VirtualScheduler()
        self.line = SerialLine(self.scheduler, format_=format_)
        self.listener = Listener()
        self.server = ModbusServer(new_map(), unit=5)
        self.station = RtuStation(self.scheduler, self.line, self.server, **station)

    def port(self):
        return self.line.attach("tester", self.listener)

    def master(self, **options):
        return RtuClient(self.scheduler, self.line, **options)

    def ask(self, master, request, unit=5, wait_ns=10 * S):
        job = master.submit(request, unit)
        assert self.scheduler.run_until(lambda: job.result, wait_ns)
        return job.result


@pytest.fixture
def rig():
    return Rig()


@pytest.mark.requirement("MODB-001")
@pytest.mark.parametrize(
    ("parity", "stop", "bits"),
    [
        (Parity.EVEN, None, 11),
        (Parity.ODD, None, 11),
        (Parity.NONE, None, 11),
        (Parity.NONE, 1, 10),
        (Parity.EVEN, 2, 12),
    ],
)
def test_characters(parity, stop, bits):
    """11 bits with parity or two stop bits, 10 with 8N1."""
    assert SerialFormat(parity=parity, stop_bits=stop).bits == bits


@pytest.mark.requirement("MODB-002", "MODB-003")
@pytest.mark.parametrize(
    ("baud", "char", "t35", "t15"),
    [
        (4800, 2.292, 8.021, 3.438),
        (9600, 1.146, 4.010, 1.719),
        (19200, 0.573, 2.005, 0.859),
        (38400, None, 1.75, 0.75),
        (115200, None, 1.75, 0.75),
    ],
)
def test_pauses_of_the_rates(baud, char, t35, t15):
    """The table of the specification, in milliseconds."""
    rate = SerialFormat(baud)
    if char:
        assert round(rate.duration_ns(1) / MS, 3) == char
    assert rate.t35_ns / MS == pytest.approx(t35, abs=0.0006)
    assert rate.t15_ns / MS == pytest.approx(t15, abs=0.0006)


@pytest.mark.requirement("MODB-011", "MODB-009")
def test_times_of_an_exchange(rig):
    """8 bytes take 4.58 ms and 25 bytes 14.3 ms at 19 200 bit/s; t3.5 and the processing lie between them."""
    port = rig.port()
    frame = rtu_frame(5, READ.encode())
    assert port.send(frame) == rig.line.format.duration_ns(8)
    rig.scheduler.run_for(S)
    request, response = rig.line.log
    assert (request.sender, request.data, request.start_ns) == ("tester", frame, 0)
    assert round((request.end_ns - request.start_ns) / MS, 2) == 4.58
    assert response.start_ns == request.end_ns + rig.line.format.t35_ns + rig.station.processing_ns
    assert len(response.data) == 25
    assert round((response.end_ns - response.start_ns) / MS, 1) == 14.3
    assert rig.listener.heard == [(response.end_ns, response.data, False)]


@pytest.mark.requirement("MODB-004", "MODB-044")
@pytest.mark.parametrize("at", range(1, 8))
@pytest.mark.parametrize(
    ("characters", "lenient", "answered"),
    [
        (1.4, False, True),
        (1.6, False, False),
        (3.4, False, False),
        (3.6, False, False),
        (1.4, True, True),
        (1.6, True, True),
        (3.4, True, True),
        (3.6, True, False),
    ],
)
def test_pauses_within_a_frame(characters, lenient, answered, at):
    """Up to t1.5 a pause at any byte is accepted, beyond it the frame is discarded or accepted as configured;
    t3.5 cuts.
    """
    rig = Rig(lenient=lenient)
    port = rig.port()
    port.send(rtu_frame(5, READ.encode()), {at: rig.line.format.duration_ns(characters)})
    rig.scheduler.run_for(S)
    assert bool(rig.listener.heard) is answered
    errors = rig.server.bus_errors
    assert errors == (0 if answered else 2 if characters == 3.6 else 1)
    port.send(rtu_frame(5, READ.encode()))
    rig.scheduler.run_for(S)
    assert rig.listener.heard[-1][1][:3] == b"\x05\x03\x14"


@pytest.mark.requirement("MODB-002", "MODB-004")
def test_the_end_of_a_frame_is_exact():
    """A pause of t3.5 ends a frame, one nanosecond less does not."""
    for less, frames in ((0, [b"ab", b"cd"]), (1, [b"abcd"])):
        rig = Rig()
        seen = []
        rate = rig.line.format
        listener = FrameAssembler(
            rig.scheduler,
            rate.t15_ns,
            rate.t35_ns,
            lambda frame, damaged, seen=seen: seen.append(frame),
            lenient=True,
        )
        rig.line.attach("listener", listener)
        rig.port().send(b"abcd", {2: rate.t35_ns - less})
        rig.scheduler.run_for(S)
        assert seen == frames


@pytest.mark.requirement("MODB-008")
def test_wrong_parity_is_not_answered(rig):
    """A damaged character at any place, or another parity or rate, silences the station; it is counted."""
    port = rig.port()
    frame = rtu_frame(5, READ.encode())
    for at in range(len(frame)):
        end = rig.line.add_hook(lambda sender, data, now, at=at: Change(damaged=(at,)))
        port.send(frame)
        rig.scheduler.run_for(S)
        end()
    assert rig.listener.heard == []
    assert rig.server.bus_errors == len(frame)
    for other in (SerialFormat(9600), SerialFormat(parity=Parity.ODD)):
        rig.line.attach("stranger", rig.listener, other).send(frame)
        rig.scheduler.run_for(S)
    assert "station" not in [entry.sender for entry in rig.line.log]
    assert rig.server.bus_errors == len(frame) + 2


@pytest.mark.requirement("MODB-010")
@pytest.mark.parametrize("offset", [0.0, 0.5, 3.2, 7.9])
def test_collisions_corrupt_both(rig, offset):
    """Two talkers at the same time: neither frame is understood, the log says so; then the line works
    again.
    """
    one, two = rig.port(), rig.line.attach("second", Listener())
    frame = rtu_frame(5, READ.encode())
    one.send(frame)
    rig.scheduler.at(rig.line.format.duration_ns(offset), lambda: two.send(frame))
    rig.scheduler.run_for(S)
    assert [entry.note for entry in rig.line.log] == ["collision", "collision"]
    assert rig.line.collisions == 2
    assert rig.server.bus_messages == 0
    one.send(frame)
    rig.scheduler.run_for(S)
    assert rig.line.log[-1].sender == "station"


@pytest.mark.requirement("MODB-010")
def test_frames_that_touch_do_not_collide(rig):
    """A frame that begins when another ends is no collision, but both are one frame, which is none."""
    one, two = rig.port(), rig.line.attach("second", Listener())
    end = one.send(rtu_frame(5, READ.encode()))
    rig.scheduler.at(end, lambda: two.send(rtu_frame(5, READ.encode())))
    rig.scheduler.run_for(S)
    assert rig.line.collisions == 0
    assert rig.server.bus_errors == 1


@pytest.mark.requirement("MODB-005")
def test_frames_beyond_256_bytes_are_discarded(rig):
    """A flood without a pause is one broken frame; the next request is answered."""
    port = rig.port()
    port.send(bytes(5000))
    rig.scheduler.run_for(5 * S)
    assert rig.server.bus_errors == 1
    assert rig.station.assembler.overruns == 1
    port.send(rtu_frame(5, READ.encode()))
    rig.scheduler.run_for(S)
    assert len(rig.listener.heard) == 1


def test_a_station_that_leaves_while_it_listens_comes_back(rig):
    """Unplugged in the middle of a frame and plugged in again, it answers the next request."""
    port = rig.port()
    port.send(rtu_frame(5, READ.encode()))
    rig.scheduler.run_for(2 * MS)
    rig.station.port.online = False
    rig.scheduler.run_for(20 * MS)
    port.send(rtu_frame(5, READ.encode()))
    rig.scheduler.run_for(S)
    assert rig.listener.heard == []
    rig.station.port.online = True
    port.send(rtu_frame(5, READ.encode()))
    rig.scheduler.run_for(S)
    assert len(rig.listener.heard) == 1


# ------------------------------------------------------------------------------------------------- the master


@pytest.mark.requirement("MODB-009", "MODB-010")
def test_the_queue_is_served_one_by_one(rig):
    """Each request waits for the response before it and t3.5; results come in order."""
    master = rig.master()
    results = []
    for number in range(5):
        master.submit(Request(3, 10 + number, 1), 5, results.append)
    rig.scheduler.run_for(S)
    assert [result.response.values for result in results] == [(0x100A + number,) for number in range(5)]
    assert rig.line.collisions == 0
    senders = [entry.sender for entry in rig.line.log]
    assert senders == ["master", "station"] * 5
    for before, behind in zip(rig.line.log, rig.line.log[1:], strict=False):
        assert behind.start_ns - before.end_ns >= rig.line.format.t35_ns


@pytest.mark.requirement("MODB-009", "MODB-007", "MODB-035")
def test_a_broadcast_has_its_pause(rig):
    """A broadcast is done after the turnaround delay without a response, and was carried out by all."""
    second = ModbusServer(new_map(), unit=6)
    RtuStation(rig.scheduler, rig.line, second, name="second")
    master = rig.master(turnaround_ns=150 * MS)
    assert rig.ask(master, Request(6, 10, 1, (77,)), unit=0).outcome is Outcome.DONE
    rig.ask(master, Request(3, 10, 1))
    first, following = rig.line.log[:2]
    assert following.start_ns == first.end_ns + 150 * MS
    for server in (rig.server, second):
        assert server.registers.get(Area.HOLDING_REGISTERS, 10) == 77
    with pytest.raises(ModbusError, match="no broadcast"):
        master.submit(READ, 0)


@pytest.mark.requirement("MODB-009", "MODB-008")
def test_silence_ends_with_a_time_out_and_retries(rig):
    """An absent unit is asked as often as configured, then the result is a time-out; the next request is
    served.
    """
    master = rig.master(timeout_ns=50 * MS, retries=2)
    result = rig.ask(master, READ, unit=9)
    assert (result.outcome, result.tries) == (Outcome.TIMEOUT, 3)
    assert [entry.sender for entry in rig.line.log] == ["master"] * 3
    gaps = {b.start_ns - a.end_ns for a, b in zip(rig.line.log, rig.line.log[1:], strict=False)}
    assert gaps == {50 * MS}
    assert rig.ask(master, READ).outcome is Outcome.DONE


def test_exceptions_are_results_and_are_not_repeated(rig):
    """An exception response ends the request at once."""
    result = rig.ask(rig.master(retries=3), Request(3, 0, 1))
    assert (result.outcome, result.response.exception, result.tries) == (Outcome.EXCEPTION, 2, 1)


@pytest.mark.requirement("MODB-043")
@pytest.mark.parametrize("at", range(25))
def test_a_response_broken_at_any_byte_is_asked_for_again(rig, at):
    """A wrong byte, a damaged character or a response cut short at any place costs a retry, no more."""
    master = rig.master(timeout_ns=50 * MS)
    changes = [
        lambda data: Change(data=data[:at] + bytes((data[at] ^ 1,)) + data[at + 1 :]),
        lambda data: Change(damaged=(at,)),
        lambda data: Change(data=data[:at]),
    ]
    for change in changes:
        todo = [change]
        end = rig.line.add_hook(
            lambda sender, data, now, todo=todo: todo.pop()(data) if sender == "station" and todo else None
        )
        result = rig.ask(master, READ)
        end()
        assert (result.outcome, result.tries) == (Outcome.DONE, 2)
        assert result.response.values == tuple(range(0x100A, 0x1014))


@pytest.mark.requirement("MODB-043", "MODB-041")
def test_a_late_response_is_discarded(rig):
    """A response that comes behind the time-out is counted and not taken for the one to the next request."""
    master = rig.master(timeout_ns=20 * MS, retries=0)
    end = rig.line.add_hook(
        lambda sender, data, now: Change(delay_ns=40 * MS) if sender == "station" else None
    )
    assert rig.ask(master, READ).outcome is Outcome.TIMEOUT
    end()
    rig.scheduler.run_for(S)
    assert master.late == 1
    assert rig.ask(master, READ).outcome is Outcome.DONE


@pytest.mark.requirement("MODB-043")
def test_a_response_of_another_unit_or_function_is_discarded(rig):
    """What does not fit the request is not taken, and the result says what came instead."""
    master = rig.master(timeout_ns=50 * MS, retries=0)
    for wrong in (
        rtu_frame(6, b"\x03\x02\x00\x01"),
        rtu_frame(5, b"\x04\x02\x00\x01"),
        rtu_frame(5, b"\x03\x04\x00\x01\x00\x02"),
    ):
        end = rig.line.add_hook(
            lambda sender, data, now, wrong=wrong: Change(data=wrong) if sender == "station" else None
        )
        result = rig.ask(master, Request(3, 10, 1))
        end()
        assert result.outcome is Outcome.INVALID


def test_the_master_waits_for_who_talks(rig):
    """A response that has begun before the time-out is waited for, however long it takes."""
    rig = Rig(SerialFormat(4800))
    master = rig.master(timeout_ns=15 * MS, retries=0)
    result = rig.ask(master, Request(3, 10, 125))
    assert result.outcome is Outcome.DONE
    assert rig.scheduler.now > 500 * MS


@pytest.mark.requirement("MODB-043")
def test_the_log_reads_in_words(rig):
    """Requests, responses, exceptions, broadcasts and broken frames have words, also any other bytes."""
    master = rig.master(timeout_ns=50 * MS, retries=0)
    rig.ask(master, Request(3, 10, 2))
    rig.ask(master, Request(6, 0, 1, (5,)))
    rig.ask(master, Request(6, 10, 1, (5,)), unit=0)
    decoder = RtuDecoder()
    assert [decoder.text(entry.data) for entry in rig.line.log] == [
        "unit 5 request 03 read holding registers 000Ah x 2",
        "unit 5 response 03 read holding registers: 100A 100B",
        "unit 5 request 06 write single register 0000h = 0005",
        "unit 5 response 06 write single register: exception 02h illegal data address",
        "broadcast request 06 write single register 000Ah = 0005",
    ]
    assert decoder.text(b"\x01\x02") == "broken frame: 01 02"
    assert "not understood" in decoder.text(rtu_frame(1, b"\x63"))


def test_two_runs_are_the_same():
    """The same requests and faults leave the same log, to the nanosecond."""

    def run():
        rig = Rig()
        master = rig.master(timeout_ns=50 * MS)
        todo = [Change(drop=True), Change(damaged=(3,)), Change(delay_ns=70 * MS)]
        rig.line.add_hook(lambda sender, data, now: todo.pop() if sender == "station" and todo else None)
        for number in range(20):
            master.submit(Request(3, 10 + number, 1), 5 + number % 2)
        rig.scheduler.run_for(10 * S)
        return rig.line.log

    assert run() == run()


def test_bad_settings_are_refused():
    """Rates, stop bits, time-outs and retries that cannot be say what is allowed."""
    rig = Rig()
    for options in ({"baud": 100}, {"baud": 2_000_000}, {"stop_bits": 3}):
        with pytest.raises(ConfigurationError):
            SerialFormat(**options)
    for options in ({"timeout_ns": 0}, {"retries": -1}):
        with pytest.raises(ConfigurationError):
            rig.master(**options)
    with pytest.raises(ModbusError, match="unit"):
        rig.master().submit(READ, 256)

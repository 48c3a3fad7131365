"""Faults of the CAN segment and its controllers on a small real bench: each does what it says, and ends."""

import json
from itertools import pairwise

import pytest

from fieldbus.can import CanFrame, NodeState, frame_bits, worst_case_bits
from fieldbus.clock import MS, US, S
from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.faults import CATALOGUE, Fault, Injector, after
from testcases.catalogue import each
from testcases.unit.hil.toybench import ToyBench

TPDO = 0x185
CAN_KINDS = [entry for entry in CATALOGUE if entry.name.startswith("can.")]


@pytest.fixture
def bench():
    return ToyBench(seed=7)


@pytest.fixture
def faults(bench):
    return Injector(bench)


def frames(bench, can_id=None, since_s=0.0, *, good=True):
    return [
        entry
        for entry in bench.medium.log
        if (can_id is None or entry[2].can_id == can_id)
        and entry[0] >= since_s * S
        and (entry[3] == "") is good
    ]


def port(bench, name):
    return bench.medium.port(name)


@pytest.mark.parametrize("entry", CAN_KINDS, ids=lambda entry: entry.name)
def test_every_kind_ends_and_the_bus_recovers(entry):
    """After the example of the catalogue, applied for 20 ms, every node works: frames flow, no node is off,
    no hook is left.
    """
    bench = ToyBench(seed=3)
    content = {**entry.example, "target": "", "duration_s": 0.02, "trigger": {"when": "after", "time_s": 0.1}}
    armed = Injector(bench).arm(Fault.from_dict(json.loads(json.dumps(content))))
    bench.run_for(0.121)
    assert armed.applied_ns == 100 * MS
    assert armed.removed_ns == 120 * MS
    bench.run_for(2.0)
    assert all(one.state is not NodeState.BUS_OFF for one in bench.medium.ports)
    since = bench.scheduler.now / S - 0.4
    assert len(frames(bench, TPDO, since)) == 100
    assert frames(bench, None, since, good=False) == []
    assert all(one.pending == 0 for one in bench.medium.ports)


@pytest.mark.parametrize("entry", CAN_KINDS, ids=lambda entry: entry.name)
def test_no_kind_claims_a_bench_that_it_cannot_reach(entry):
    """On live benches and physical drives these kinds are refused, with a reason, but for those that an
    adapter can do.
    """
    assert entry.target == "segment"
    possible = entry.name in ("can.load", "can.babble", "can.cable_break", "can.unplug")
    for place in ("live", "hardware"):
        assert bool(entry.injectable(place)) is not possible
        assert not possible or entry.remark
    if possible:
        return  # testcases/unit/hil/test_hil_live_segment.py
    bench = ToyBench(seed=1)
    bench.kind = "live"
    with pytest.raises(UnsupportedFaultError, match=entry.name):
        Injector(bench).arm(Fault.from_dict(entry.example))


@pytest.mark.parametrize("name", ["can.bus_off", "can.cable_break", "can.noise"])
def test_an_unknown_node_is_named_with_the_known_ones(bench, faults, name):
    """A node that is not on the segment is a mistake that names those that are."""
    key = "node" if name == "can.bus_off" else "nodes"
    more = {"bit_error_rate": 0.001} if name == "can.noise" else {}
    with pytest.raises(ConfigurationError, match=r"ghost.*drive1, controller"):
        faults.inject(name, **{key: "ghost"}, **more)


@pytest.mark.requirement("CANP-059", "CANP-078")
@pytest.mark.parametrize(
    ("field", "bit", "error"),
    [
        ("id", 4, "BIT_ERROR"), ("dlc", 0, "BIT_ERROR"), ("data", -1, "BIT_ERROR"), ("crc", 0, "BIT_ERROR"),
        ("crc_delimiter", 0, "FORM_ERROR"), ("ack_slot", 0, "ACK_ERROR"), ("ack_delimiter", 0, "FORM_ERROR"),
        ("eof", 0, "FORM_ERROR"),
    ],
)  # fmt: skip
def test_corrupt_aims_at_a_field(bench, faults, field, bit, error):
    """`frame.corrupt` with field and bit: the kind of the error follows from the place, and the frame is
    repeated.
    """
    bench.run_for(0.1)
    faults.inject("frame.corrupt", count=1, can_id=TPDO, field=field, bit=bit)
    bench.run_for(0.02)
    assert [entry[3] for entry in frames(bench, TPDO, good=False)] == [error]
    assert len(frames(bench, TPDO, 0.1)) == 5


@pytest.mark.requirement("CANP-013")
def test_corrupt_in_the_last_bit_of_a_frame_doubles_it(bench, faults):
    """A frame hit in the last bit of EOF arrives twice."""
    bench.run_for(0.1)
    faults.inject("frame.corrupt", count=1, can_id=TPDO, field="eof", bit=6)
    bench.run_for(0.02)
    assert len(frames(bench, TPDO, 0.1)) == 6


def test_corrupt_for_one_node_only(bench, faults):
    """`nodes` names who reads the bit wrongly: the receiver tells a CRC error, the sender has sent what it
    wanted.
    """
    bench.run_for(0.1)
    faults.inject("frame.corrupt", count=1, can_id=TPDO, field="data", bit=2, nodes="controller")
    bench.run_for(0.02)
    reported = [entry for entry in bench.history.events if entry.kind == "can.bus_error"]
    assert reported[0].data["code"] in ("ACK_ERROR", "CRC_ERROR")


@pytest.mark.parametrize(("field", "bit"), [("header", 0), ("id", 64)])
def test_corrupt_checks_its_place(field, bit):
    """A field or bit that no frame has is refused."""
    with pytest.raises(ConfigurationError, match=r"frame\.corrupt"):
        Fault("frame.corrupt", parameters={"field": field, "bit": bit})


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-078")
def test_noise_hits_about_as_many_bits_as_its_rate_says(bench, faults):
    """The error frames of a second come at the rate that the share of occupied bits and the idle ones make;
    seeded.
    """
    faults.inject("can.noise", duration_s=1.0, bit_error_rate=0.0005)
    bench.run_for(1.1)
    errors = len([entry for entry in bench.history.events if entry.kind == "can.bus_error"])
    assert 300 < errors < 700  # 500 wrong bits per second, of which some fall into the same error frame
    other = ToyBench(seed=7)
    Injector(other).inject("can.noise", duration_s=1.0, bit_error_rate=0.0005)
    other.run_for(1.1)
    assert other.medium.log == bench.medium.log


@pytest.mark.requirement("CANP-078")
def test_stuck_dominant_takes_a_sender_to_bus_off(bench, faults):
    """While it lasts nobody gets a frame through; who was sending goes bus-off."""
    faults.inject("can.stuck_dominant", trigger=after(0.10002), duration_s=0.05)
    bench.run_for(0.14)
    assert not [entry for entry in frames(bench) if 100_020 * US < entry[0] < 140 * MS]
    assert port(bench, "drive1").rec == 255 or port(bench, "drive1").state is NodeState.BUS_OFF


@pytest.mark.requirement("CANP-078")
def test_cable_break_leaves_two_working_parts(bench, faults):
    """Nodes of one side hear each other and nobody else; after the repair everybody hears everybody."""
    heard = {"near": [], "far": []}
    medium = bench.medium
    ears = {
        name: medium.attach(name, lambda frame, _t, name=name: heard[name].append(frame.can_id))
        for name in heard
    }
    armed = faults.inject("can.cable_break", nodes="drive1, far")
    bench.scheduler.run_for(500 * US)
    ears["near"].send(CanFrame(0x701))
    ears["far"].send(CanFrame(0x702))
    bench.scheduler.run_for(1 * MS)
    assert 0x702 not in heard["near"]
    assert 0x701 not in heard["far"]
    assert all(one.state is NodeState.ERROR_ACTIVE for one in medium.ports)
    starts = {entry[2].can_id: entry[0] - (frame_bits(entry[2]) - 3) * US for entry in medium.log}
    assert starts[0x701] == starts[0x702]  # at the same time, because they are two buses now
    assert {one.name for one in medium.ports} == {"drive1", "controller", "near", "far"}
    with pytest.raises(UnsupportedFaultError, match="cut off"):
        faults.inject("can.unplug", node="drive1")
    armed.remove()
    heard["near"].clear()
    ears["far"].send(CanFrame(0x703))
    bench.scheduler.run_for(2 * MS)
    assert 0x703 in heard["near"]


@pytest.mark.parametrize("nodes", ["drive1, controller", ""])
def test_a_break_has_two_sides(faults, nodes):
    """A break with all nodes on one side would break nothing: refused, with the names that there are."""
    with pytest.raises(ConfigurationError, match=r"can\.cable_break\.parameters\.nodes.*drive1.*not all"):
        faults.inject("can.cable_break", nodes=nodes)


@pytest.mark.requirement("CANP-056", "CANP-078")
def test_unplugged_node_stays_error_passive_and_comes_back(bench, faults):
    """Alone on its piece of cable it repeats without an acknowledge at 128; plugged in again it gets
    through.
    """
    bench.run_for(0.1)
    drive = port(bench, "drive1")
    armed = faults.inject("can.unplug", node="drive1")
    drive.send(CanFrame(0x6F5))
    bench.run_for(0.1)
    assert (drive.tec, drive.state) == (128, NodeState.ERROR_PASSIVE)
    assert frames(bench, 0x6F5) == []
    armed.remove()
    bench.run_for(0.01)
    assert len(frames(bench, 0x6F5)) == 1
    assert drive.state is NodeState.ERROR_ACTIVE


def check_cable_may_break_and_be_repaired_at_any_time(offset_us):
    bench = ToyBench(seed=1)
    bench.run_for(0.1)
    bench.scheduler.run_for(offset_us * US)
    repair = bench.medium.cut(["drive1"])
    bench.scheduler.run_for(offset_us * 3 * US)
    repair()
    repair()
    bench.run_for(0.2)
    now = bench.scheduler.now / S
    assert len(frames(bench, TPDO, now - 0.1)) == 25
    assert [one.name for one in bench.medium.ports].count("drive1") == 1


@pytest.mark.exhaustive
def test_cable_may_break_and_be_repaired_at_any_time(subtests):
    """In the middle of frames or between them: afterwards everybody talks with everybody again."""
    for label, values in each(range(0, 4200, 97)):
        with subtests.test(label):
            check_cable_may_break_and_be_repaired_at_any_time(*values)


@pytest.mark.requirement("CANP-078")
def test_babbling_node_keeps_everybody_else_off_the_bus(bench, faults):
    """With the lowest identifier and no pause the bus is full, and nothing of the others is on it; later
    everything goes on.
    """
    bench.run_for(0.1)
    faults.inject("can.babble", duration_s=0.05, can_id=0x001, data="0102")
    bench.run_for(0.05)
    assert bench.medium.bus_load(40 * MS) == pytest.approx(1.0, abs=0.01)
    assert {entry[2].can_id for entry in frames(bench, None, 0.101)} == {0x001}
    assert {entry[1] for entry in frames(bench, 0x001)} == {"babbler"}
    bench.run_for(0.05)
    assert len(frames(bench, 0x080, 0.15)) > 10
    assert not frames(bench, 0x001, 0.1505)


@pytest.mark.requirement("CANP-069")
@pytest.mark.parametrize("percent", [5.0, 40.0, 75.0])
def test_load_generator_reaches_its_load(bench, faults, percent):
    """The load that the bus shows is what was there before plus what was asked for."""
    bench.run_for(0.5)
    before = bench.medium.bus_load(400 * MS)
    faults.inject("can.load", load_percent=percent, lowest_id=0x600, highest_id=0x60F, shortest=2, longest=6)
    bench.run_for(0.5)
    assert bench.medium.bus_load(480 * MS) == pytest.approx(before + percent / 100, abs=0.01)
    made = [entry[2] for entry in frames(bench) if entry[1] == "load"]
    assert {frame.can_id for frame in made} == set(range(0x600, 0x610)) or percent == 5.0
    assert {len(frame.data) for frame in made} == {2, 3, 4, 5, 6}


@pytest.mark.requirement("CANP-054", "CANP-055", "CANP-078")
@pytest.mark.parametrize("recovery", ["at removal", "automatic"])
def test_forced_bus_off_and_recovery(bench, faults, recovery):
    """The node sends nothing and is back 1408 recessive bits after it begins to recover."""
    bench.run_for(0.1)
    drive = port(bench, "drive1")
    faults.inject("can.bus_off", duration_s=0.05, node="drive1", recovery=recovery)
    assert drive.state is NodeState.BUS_OFF
    bench.run_for(0.02)
    assert (drive.state is NodeState.BUS_OFF) is (recovery == "at removal")
    bench.run_for(0.05)
    assert drive.state is NodeState.ERROR_ACTIVE
    assert drive.auto_recovery


@pytest.mark.requirement("CANP-059", "CANP-078")
def test_missing_acknowledge(bench, faults):
    """While nobody acknowledges no frame of the others gets through cleanly, and the sender becomes
    error-passive.
    """
    bench.run_for(0.1)
    faults.inject("can.no_ack", duration_s=0.02)
    bench.run_for(0.02)
    errors = frames(bench, None, 0.1, good=False)
    assert errors
    assert {entry[3] for entry in errors} <= {"ACK_ERROR", "FORM_ERROR", "BIT_ERROR"}
    reported = {
        entry.data["port"]: entry.data["status"]
        for entry in bench.history.events
        if entry.kind == "can.status"
    }
    assert "controller" in reported


@pytest.mark.requirement("CANP-041")
def test_overload_frames_stretch_the_gap(bench, faults):
    """Each asked for costs 15 bits with the answer of the others, and no error is counted."""
    bench.run_for(0.1)
    faults.inject("can.overload", node="controller", frames=2)
    bench.scheduler.run_for(20 * MS)
    asked = [entry for entry in bench.history.events if entry.kind == "can.overload"]
    assert len(asked) == 2 * len([entry for entry in frames(bench, None, 0.1) if entry[1] == "drive1"])
    assert (port(bench, "drive1").tec, port(bench, "controller").rec) == (0, 0)


def test_receive_delay_of_one_node(bench, faults):
    """The controller's frames reach the drive later than they end on the bus; its answers come that much
    later.
    """
    bench.run_for(0.1)

    def distances(since):
        syncs = [entry[0] for entry in frames(bench, 0x080, since)]
        answers = [entry[0] for entry in frames(bench, TPDO, since)]
        return [answer - sync for sync, answer in zip(syncs, answers, strict=False)]

    usual = distances(0.0)[5]
    faults.inject("can.receive_delay", node="drive1", delay_s=0.001)
    bench.scheduler.run_for(20 * MS)
    assert distances(0.1)[-1] == usual + MS - 3 * US  # no intermission to wait for any more


def test_transmit_overrun(bench, faults):
    """With one buffer a node that sends four frames at once loses those that do not fit, and the overrun is
    reported.
    """
    bench.run_for(0.101)
    drive = port(bench, "drive1")
    faults.inject("can.transmit_overrun", duration_s=0.01, node="drive1", buffers=1)
    for number in range(4):
        drive.send(CanFrame(0x710 + number))
    bench.scheduler.run_for(1 * MS)
    assert drive.overruns == 2  # one on the wire, one waiting
    assert [entry for entry in bench.history.events if entry.kind == "can.overrun"]
    bench.run_for(0.02)
    assert drive.tx_buffers == 256


def test_arbitration_loss(bench, faults):
    """The frame loses as often as it was asked for, and then goes out."""
    bench.run_for(0.1)
    faults.inject("frame.lose_arbitration", count=1, can_id=TPDO, rivals=3, rival_id=0x07F)
    bench.run_for(0.004)
    after_sync = [entry[2].can_id for entry in frames(bench, None, 0.1)]
    assert after_sync[after_sync.index(0x07F) :][:4] == [0x07F, 0x07F, 0x07F, TPDO]


@pytest.mark.requirement("CANP-029", "CANP-078")
def test_second_node_with_the_same_identifiers(bench, faults):
    """Two nodes that send the same identifier with other content at the same time destroy each other's
    frames.
    """
    bench.run_for(0.1)
    faults.inject("frame.collide", count=1, can_id=TPDO)
    bench.run_for(0.02)
    errors = frames(bench, TPDO, 0.1, good=False)
    assert 1 <= len(errors) <= 16
    assert {entry[3] for entry in errors} == {"BIT_ERROR"}


@pytest.mark.exhaustive
@pytest.mark.requirement("CANP-070")
def test_sync_is_late_by_the_frame_in_progress_at_most(bench, faults):
    """Under load SYNC arrives between its undisturbed time and that plus the longest frame; the statistics
    tell both.
    """
    faults.inject("can.load", load_percent=60.0, lowest_id=0x600, highest_id=0x60F)
    bench.run_for(2.0)
    arrivals = [entry[0] for entry in frames(bench, 0x080)]
    own = (frame_bits(CanFrame(0x80)) - 3) * US
    late = [time_ns - round(time_ns / (4 * MS)) * 4 * MS - own for time_ns in arrivals]
    assert min(late) == 0
    assert 60 * US < max(late) <= worst_case_bits(8) * US
    assert all(later > earlier for earlier, later in pairwise(arrivals))

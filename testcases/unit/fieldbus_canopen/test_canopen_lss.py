"""LSS slave: raw frames of a master, and the unmodified `canopen` library as an independent one (CiA 305)."""

from __future__ import annotations

import itertools
import random

import canopen
import pytest
from canopen.lss import (
    CS_INQUIRE_PRODUCT_CODE,
    CS_INQUIRE_REVISION_NUMBER,
    CS_INQUIRE_SERIAL_NUMBER,
    CS_INQUIRE_VENDOR_ID,
    LssError,
)

from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenSlave, NmtCommand, NmtState, PumpedNetwork
from fieldbus.canopen.lss import BITRATES
from fieldbus.clock import MS, VirtualScheduler

IDENTITY = (0x1234, 0x5678, 0x00010000, 42)
MASTER, SLAVE = 0x7E5, 0x7E4


def lss(bench, service, content=b""):
    """Send a request of the master; return what slaves have answered."""
    answers = bench.ask(MASTER, (bytes((service,)) + content).ljust(8, b"\0"))
    return [frame.data for frame in answers if frame.can_id == SLAVE]


def number(value):
    return value.to_bytes(4, "little")


def configuration(bench):
    assert lss(bench, 0x04, b"\x01") == []


@pytest.fixture
def network(bench):
    with PumpedNetwork(bench.segment) as network:
        yield network


@pytest.fixture
def anonymous(kit):
    """A powered slave without a node-ID."""
    bench = kit.Bench(node_id=0xFF)
    bench.slave.power_on()
    bench.run(10)
    return bench


# -- states and identity
# --------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-011", "C301-153", "C301-162")
def test_switch_global_has_no_answer_and_opens_the_services(bench):
    """Inquiries are answered in configuration state only; switch mode global is never answered."""
    assert lss(bench, 0x5E) == []
    configuration(bench)
    assert lss(bench, 0x5E) == [b"\x5e\x05\0\0\0\0\0\0"]
    assert lss(bench, 0x04, b"\x02") == []  # no such mode
    assert lss(bench, 0x5A) == [b"\x5a" + number(IDENTITY[0]) + b"\0\0\0"]
    assert lss(bench, 0x04, b"\x00") == []
    assert lss(bench, 0x5A) == []


@pytest.mark.requirement("C301-162")
def test_inquiries_by_the_library(network):
    """The library reads the four parts of the identity and the node-ID."""
    network.lss.send_switch_state_global(network.lss.CONFIGURATION_STATE)
    asked = (
        CS_INQUIRE_VENDOR_ID,
        CS_INQUIRE_PRODUCT_CODE,
        CS_INQUIRE_REVISION_NUMBER,
        CS_INQUIRE_SERIAL_NUMBER,
    )
    assert tuple(network.lss.inquire_lss_address(part) for part in asked) == IDENTITY
    assert network.lss.inquire_node_id() == 5


@pytest.mark.requirement("C301-011")
def test_frames_of_another_length_and_unknown_services_are_ignored(bench):
    """LSS frames have eight bytes; others, and services that nobody knows, change and answer nothing."""
    for data in (b"\x04\x01", b"\x04\x01" + bytes(5), b""):
        assert bench.ask(MASTER, data) == []
    assert lss(bench, 0x5E) == []
    configuration(bench)
    for service in set(range(256)) - {0x04, 0x11, 0x13, 0x15, 0x17, *range(0x40, 0x5F)}:
        assert lss(bench, service) == []
    assert lss(bench, 0x5E) != []


@pytest.mark.requirement("C301-154")
@pytest.mark.parametrize("wrong", [None, 0, 1, 2, 3])
def test_switch_selective(bench, wrong):
    """Selected by vendor, product, revision and serial number: all four have to agree; only then 44h."""
    answers = []
    for part, value in enumerate(IDENTITY):
        answers.append(lss(bench, 0x40 + part, number(value ^ (part == wrong))))
    assert answers[:3] == [[], [], []]
    assert answers[3] == ([] if wrong is not None else [b"\x44" + bytes(7)])
    assert bool(lss(bench, 0x5E)) is (wrong is None)


@pytest.mark.requirement("C301-154")
def test_switch_selective_needs_the_order(bench):
    """Parts in another order, or with one left out, select nobody."""
    for order in itertools.permutations(range(4)):
        if order != (0, 1, 2, 3):
            assert [lss(bench, 0x40 + part, number(IDENTITY[part])) for part in order] == [[]] * 4
            assert lss(bench, 0x40, number(0)) == []  # nothing is left of it
    assert [lss(bench, 0x40 + part, number(IDENTITY[part])) for part in (0, 1, 3)] == [[]] * 3


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-154", "C301-155")
def test_selective_configuration_by_the_library(bench, network, kit):
    """The library selects one of two slaves by its identity, and gives only that one another node-ID."""
    od = kit.dictionary()
    od[0x1018][4].default = 43
    other = CanopenSlave(bench.scheduler, bench.segment, od, 6, name="drive2")
    other.power_on()
    network.lss.RESPONSE_TIMEOUT = 0.01
    # The library's method waits after each of its first three messages only if they are answered: send those
    # alone.
    for part in range(3):
        bench.send(MASTER, (bytes((0x40 + part,)) + number(IDENTITY[part])).ljust(8, b"\0"))
    bench.run()
    assert lss(bench, 0x43, number(43)) == [b"\x44" + bytes(7)]
    network.lss.configure_node_id(9)
    assert network.lss.inquire_node_id() == 6
    network.nmt.send_command(NmtCommand.RESET_COMMUNICATION)
    bench.run(5)
    assert (bench.slave.node_id, other.node_id) == (5, 9)


@pytest.mark.requirement("C301-154")
def test_switch_selective_by_the_library(bench, network):
    """The library's own call selects the slave."""
    assert network.lss.send_switch_state_selective(*IDENTITY) is True
    assert network.lss.inquire_node_id() == 5
    network.lss.send_switch_state_global(network.lss.WAITING_STATE)
    with pytest.raises(LssError):
        network.lss.send_switch_state_selective(*IDENTITY[:3], 41)


@pytest.mark.requirement("C301-159")
@pytest.mark.parametrize(
    ("ranges", "found"),
    [
        ((0x1234, 0x5678, 0, 0xFFFFFFFF, 0, 100), True),
        ((0x1234, 0x5678, 0x10000, 0x10000, 42, 42), True),
        ((0x1235, 0x5678, 0, 0xFFFFFFFF, 0, 100), False),
        ((0x1234, 0x5679, 0, 0xFFFFFFFF, 0, 100), False),
        ((0x1234, 0x5678, 0x10001, 0xFFFFFFFF, 0, 100), False),
        ((0x1234, 0x5678, 0, 0xFFFF, 0, 100), False),
        ((0x1234, 0x5678, 0, 0xFFFFFFFF, 43, 100), False),
        ((0x1234, 0x5678, 0, 0xFFFFFFFF, 0, 41), False),
    ],
)
def test_identify_in_ranges(bench, ranges, found):
    """4Fh is answered if vendor and product agree and revision and serial number lie in the ranges, ends
    included.
    """
    answers = [lss(bench, 0x46 + step, number(value)) for step, value in enumerate(ranges)]
    assert answers == [*[[]] * 5, [b"\x4f" + bytes(7)] if found else []]


@pytest.mark.requirement("C301-160")
def test_identify_unconfigured(bench, anonymous):
    """A node without node-ID answers 50h; one with a node-ID does not."""
    assert lss(bench, 0x4C) == []
    assert lss(anonymous, 0x4C) == [b"\x50" + bytes(7)]


# -- node-ID
# --------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-155")
@pytest.mark.parametrize(("wanted", "error"), [(0, 1), (1, 0), (127, 0), (128, 1), (254, 1), (255, 0)])
def test_configure_node_id(bench, wanted, error):
    """1 to 127 and FFh are accepted, everything else is out of range."""
    configuration(bench)
    assert lss(bench, 0x11, bytes((wanted,))) == [bytes((0x11, error)) + bytes(6)]
    assert bench.slave.lss.pending.node_id == (5 if error else wanted)


@pytest.mark.requirement("C301-155", "C301-163")
def test_new_node_id_comes_with_reset_communication(bench):
    """A configured node keeps its node-ID until reset communication; then all its identifiers are those of
    the new one.
    """
    assert bench.write(0x1017, 0, 50, 2) == 0
    configuration(bench)
    lss(bench, 0x11, b"\x09")
    lss(bench, 0x04, b"\x00")
    assert bench.slave.node_id == 5
    assert lss(bench, 0x5E) == []
    bench.take()
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert [frame.can_id for _, frame in bench.received] == [0x709]
    assert bench.slave.node_id == 9
    assert bench.ask(0x605, "40 00 10 00 00 00 00 00") == []
    (answer,) = bench.ask(0x609, "40 14 10 00 00 00 00 00")
    assert (answer.can_id, answer.data[4:]) == (0x589, b"\x89\0\0\0")
    get = bench.slave.get
    assert [get(0x1400, 1), get(0x1800, 1), get(0x1200, 1), get(0x1200, 2)] == [
        0x209,
        0x40000189,
        0x609,
        0x589,
    ]
    bench.received.clear()
    bench.slave.emcy(0x1000)
    bench.nmt(NmtCommand.START, 9)
    bench.run(5)
    assert {frame.can_id for _, frame in bench.received} == {0x089, 0x189}


@pytest.mark.requirement("C301-158", "C301-163")
@pytest.mark.parametrize("stored", [False, True])
def test_stored_node_id_survives_power_off(bench, stored):
    """Only a stored node-ID is there after power-on and reset node; the pending one is not."""
    configuration(bench)
    lss(bench, 0x11, b"\x09")
    if stored:
        assert lss(bench, 0x17) == [b"\x17" + bytes(7)]
    bench.slave.power_off()
    bench.slave.power_on()
    bench.run(5)
    assert bench.slave.node_id == (9 if stored else 5)
    bench.nmt(NmtCommand.RESET_NODE, 0)
    assert bench.slave.node_id == (9 if stored else 5)


@pytest.mark.requirement("C301-158")
def test_storage_error(kit, tmp_path):
    """A file that cannot be written is reported to the master: 2, and nothing is stored."""
    folder = tmp_path / "memory"
    folder.mkdir()
    bench = kit.Bench(storage=folder / "drive.json")
    bench.slave.power_on()
    bench.run()
    folder.rmdir()
    configuration(bench)
    lss(bench, 0x11, b"\x09")
    assert lss(bench, 0x17) == [b"\x17\x02" + bytes(6)]
    assert bench.slave.lss.stored.node_id == 5
    assert "storage.failed" in [event.kind for event in bench.history.events]


@pytest.mark.requirement("C301-158")
def test_stored_settings_survive_the_process(kit, tmp_path):
    """Node-ID and bit rate stored by LSS are in force in a new device on the same file."""
    path = tmp_path / "drive.json"
    bench = kit.Bench(storage=path)
    bench.slave.power_on()
    bench.run()
    configuration(bench)
    lss(bench, 0x11, b"\x09")
    lss(bench, 0x13, b"\x00\x00")
    lss(bench, 0x17)
    again = kit.Bench(storage=path)
    rates = []
    again.slave.settings.on_bitrate.append(rates.append)
    again.slave.power_on()
    again.run()
    assert [frame.can_id for _, frame in again.received] == [0x709]
    assert (again.slave.node_id, rates, again.slave.settings.bitrate) == (9, [1_000_000], 1_000_000)


@pytest.mark.requirement("C301-163")
def test_unconfigured_node_is_silent(anonymous):
    """A node without node-ID sends no boot-up and no heartbeat, takes no NMT command and no SDO, but LSS."""
    bench = anonymous
    bench.slave.values[0x101700] = 10
    for command in NmtCommand:
        bench.nmt(command, 0)
    for can_id in (0x600, 0x6FF, 0x67F, 0x605, 0x080):
        bench.send(can_id, bytes(8))
    bench.slave.emcy(0x1000)
    bench.run(100)
    assert bench.received == []
    assert bench.slave.nmt_state == NmtState.INITIALISING
    assert lss(bench, 0x4C) != []


@pytest.mark.requirement("C301-155", "C301-163")
def test_unconfigured_node_starts_with_its_node_id(anonymous):
    """A node that gets its first node-ID boots with it when it is sent back to waiting, not before."""
    bench = anonymous
    configuration(bench)
    assert lss(bench, 0x5E) == [b"\x5e\xff" + bytes(6)]
    lss(bench, 0x11, b"\x07")
    bench.run(100)
    assert bench.slave.nmt_state == NmtState.INITIALISING
    bench.received.clear()
    bench.send(MASTER, b"\x04" + bytes(7))
    bench.run(5)
    assert [(frame.can_id, frame.data) for _, frame in bench.received] == [(0x707, b"\0")]
    assert bench.slave.nmt_state == NmtState.PRE_OPERATIONAL
    assert bench.slave.get(0x1014) == 0x87
    assert [event.data for event in bench.history.events if event.kind == "lss.node_id"] == [{"node_id": 7}]


@pytest.mark.requirement("C301-163")
def test_node_id_taken_away(bench):
    """FFh makes a configured node an unconfigured one with the next reset communication."""
    configuration(bench)
    lss(bench, 0x11, b"\xff")
    bench.take()
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    bench.run(100)
    assert bench.take() == []
    assert bench.slave.node_id == 0xFF
    assert lss(bench, 0x4C) == [b"\x50" + bytes(7)]


def test_stored_identifiers_follow_the_node_id(bench):
    """Stored COB-IDs that are those of the predefined set follow a later node-ID; one that was chosen
    stays.
    """
    assert bench.write(0x1014, 0, 0x800000A5, 4) == 0
    assert bench.write(0x1014, 0, 0xA5, 4) == 0
    assert bench.write(0x1010, 1, 0x65766173, 4) == 0
    configuration(bench)
    lss(bench, 0x11, b"\x09")
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert (bench.slave.get(0x1400, 1), bench.slave.get(0x1014)) == (0x209, 0xA5)


def test_device_without_lss(kit):
    """An EDS with LSS_Supported=0 makes a device that does not know LSS."""
    od = kit.dictionary()
    od.device_information.LSS_supported = False
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    configuration(bench)
    assert lss(bench, 0x5E) == []


# -- bit timing
# -----------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-156")
@pytest.mark.parametrize("supported", [(), (250_000, 1_000_000)])
def test_configure_bit_timing(kit, supported):
    """Index 0 to 8 but 5 of table 0 are bit rates; what the EDS does not list, 5, 9 and other tables are
    refused.
    """
    od = kit.dictionary()
    od.device_information.allowed_baudrates = set(supported)
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    configuration(bench)
    table = {0: 1_000_000, 1: 800_000, 2: 500_000, 3: 250_000, 4: 125_000, 6: 50_000, 7: 20_000, 8: 10_000}
    for index in (*range(12), 255):
        allowed = index in table and (not supported or table[index] in supported)
        assert lss(bench, 0x13, bytes((0, index))) == [bytes((0x13, not allowed)) + bytes(6)], index
        if allowed:
            assert bench.slave.lss.pending.bitrate == table[index] == BITRATES[index]
    assert lss(bench, 0x13, b"\x01\x00") == [b"\x13\x01" + bytes(6)]


@pytest.mark.requirement("C301-157")
def test_activate_bit_timing(kit):
    """Silent for one delay, then the other bit rate, silent for a second delay, then back; no answer."""
    od = kit.dictionary()
    od.device_information.allowed_baudrates = {250_000, 1_000_000}
    bench = kit.Bench(od, bitrate=1_000_000)
    bench.slave.power_on()
    bench.run()
    changes = []
    bench.slave.settings.on_bitrate.append(lambda rate: changes.append((bench.scheduler.now, rate)))
    configuration(bench)
    lss(bench, 0x13, b"\x00\x03")
    bench.run(20)
    assert changes == []  # configured is not activated
    bench.received.clear()
    begin = bench.scheduler.now
    presence = []
    bench.scheduler.every(MS, lambda: presence.append((bench.scheduler.now, bench.slave._port.online)))
    bench.send(MASTER, b"\x15" + (100).to_bytes(2, "little") + bytes(5))
    bench.run(190)
    ((changed_ns, rate),) = changes
    assert rate == bench.slave.settings.bitrate == 250_000
    assert 100 * MS <= changed_ns - begin < 101 * MS
    bench.run(60)
    silent = [time_ns - begin for time_ns, online in presence if not online]
    assert silent
    assert 0 < min(silent) <= 2 * MS
    assert 199 * MS <= max(silent) < 201 * MS
    assert len(silent) >= 198
    assert bench.slave._port.online


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-157")
def test_other_bit_rate_on_the_segment(kit):
    """After the change the node works at the other bit rate: a master at the old one does not reach it, one
    at the new one does.
    """
    od = kit.dictionary()
    od.device_information.allowed_baudrates = set()
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    configuration(bench)
    lss(bench, 0x13, b"\x00\x03")
    bench.send(MASTER, b"\x15\x0a" + bytes(6))
    bench.run(15)
    bench.port.set_bitrate(250_000)  # the master changes meanwhile
    bench.run(15)
    assert bench.read(0x1018, 1) == IDENTITY[0]
    bench.port.set_bitrate(None)
    bench.received.clear()
    bench.send(0x605, "40 18 10 01 00 00 00 00")
    bench.run(20)
    assert bench.take(0x585) == []


@pytest.mark.requirement("C301-157")
def test_activate_without_a_configured_bit_rate_does_nothing(bench):
    """Nothing to change to: the node stays on the bus as it is."""
    configuration(bench)
    bench.send(MASTER, b"\x15\x64" + bytes(6))
    bench.run(10)
    assert bench.read(0x1000) == 0x20192


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-157")
def test_power_off_during_the_switch_delay(kit):
    """A power cycle while the bit rate changes leaves a node that works, with the bit rate that it came
    with.
    """
    od = kit.dictionary()
    od.device_information.allowed_baudrates = set()
    bench = kit.Bench(od, bitrate=1_000_000)
    rates = []
    bench.slave.settings.on_bitrate.append(rates.append)
    bench.slave.power_on()
    bench.run()
    configuration(bench)
    lss(bench, 0x13, b"\x00\x02")
    bench.send(MASTER, b"\x15\x64" + bytes(6))
    bench.run(150)
    bench.slave.power_off()
    bench.run(10)
    assert bench.slave._port.online is False
    bench.slave.power_on()
    bench.run(300)
    assert rates == [500_000, 1_000_000]
    assert bench.read(0x1000) == 0x20192


# -- fastscan
# -------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-161")
def test_configured_nodes_take_no_part_in_fastscan(bench, network):
    """Fastscan finds nobody where every node has its node-ID."""
    network.lss.RESPONSE_TIMEOUT = 0.01
    assert network.lss.fast_scan() == (False, None)
    assert lss(bench, 0x5E) == []


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-011", "C301-155", "C301-160", "C301-161", "C301-163")
def test_fastscan_by_the_library_names_all_nodes(kit):
    """The library finds node after node among several by fastscan, and gives each a node-ID of its own."""
    scheduler = VirtualScheduler()
    segment = CanMedium(scheduler)
    rng = random.Random(7)
    identities = {
        tuple(rng.choice((0, 1, 0x80000000, 0xFFFFFFFF, rng.getrandbits(32))) for _ in range(4))
        for _ in range(5)
    }
    slaves = {}
    for place, identity in enumerate(sorted(identities)):
        od = kit.dictionary()
        for sub, value in enumerate(identity, 1):
            od[0x1018][sub].default = value
        slaves[identity] = CanopenSlave(scheduler, segment, od, 0xFF, name=f"node{place}")
        slaves[identity].power_on()
    with PumpedNetwork(segment) as network:
        network.lss.RESPONSE_TIMEOUT = 0.005
        found = []
        while True:
            hit, address = network.lss.fast_scan()
            if not hit:
                break
            found.append(tuple(address))
            network.lss.configure_node_id(10 + len(found))
            assert network.lss.inquire_node_id() == 0xFF
            network.lss.send_switch_state_global(network.lss.WAITING_STATE)
            scheduler.run_for(5 * MS)
            assert slaves[found[-1]].node_id == 10 + len(found)
        assert sorted(found) == sorted(identities)
        assert found == sorted(found)  # the lowest identity answers first
        assert sorted(network.scanner.nodes) == [11, 12, 13, 14, 15]
        node = network.add_node(11, kit.dictionary(11))
        assert node.sdo[0x1018][4].raw == found[0][3]


@pytest.mark.requirement("C301-161")
def test_fastscan_requests_out_of_order_are_ignored(anonymous):
    """A part that is not the one being scanned, and numbers out of range, get no answer and select nobody."""
    bench = anonymous
    assert lss(bench, 0x51, number(0) + b"\x80\0\0") == [b"\x4f" + bytes(7)]
    for bit, part, following in ((31, 1, 0), (32, 0, 0), (5, 4, 0), (5, 0, 4), (0, 3, 0)):
        assert lss(bench, 0x51, number(IDENTITY[0]) + bytes((bit, part, following))) == []
    assert lss(bench, 0x51, number(IDENTITY[0]) + b"\0\0\x01") == [b"\x4f" + bytes(7)]
    assert lss(bench, 0x51, number(IDENTITY[0]) + b"\0\0\x01") == []  # the first part is done
    assert lss(bench, 0x5E) == []


def test_library_names_the_error_of_the_slave(network):
    """What the slave refuses is an LssError of the library."""
    network.lss.send_switch_state_global(network.lss.CONFIGURATION_STATE)
    with pytest.raises(canopen.lss.LssError, match="1"):
        network.lss.configure_node_id(200)

"""NMT state machine of the slave and what each state allows."""

from __future__ import annotations

import pytest

from fieldbus.canopen import CanopenSlave, NmtCommand, NmtState
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError

BOOT_UP = 0x705


@pytest.mark.requirement("C301-015", "C301-022")
def test_power_on_ends_with_the_boot_up(kit):
    """After power-on the node sends one boot-up frame, one byte 00h, and is Pre-operational."""
    bench = kit.Bench()
    assert bench.slave.nmt_state == NmtState.INITIALISING
    bench.run()
    assert bench.take() == []
    bench.slave.power_on()
    bench.run()
    assert bench.take(BOOT_UP) == [b"\0"]
    assert bench.received == []
    assert bench.slave.nmt_state == NmtState.PRE_OPERATIONAL


def test_boot_time(kit):
    """With a boot time the node is deaf and silent until it has passed."""
    bench = kit.Bench(boot_time_ns=100 * MS)
    bench.slave.power_on()
    assert bench.ask(0x605, "40 00 10 00 00 00 00 00") == []
    bench.nmt(NmtCommand.START)
    bench.run(90)
    assert bench.slave.nmt_state == NmtState.INITIALISING
    assert bench.take() == []
    bench.run(10)
    assert bench.take(BOOT_UP) == [b"\0"]
    assert bench.slave.nmt_state == NmtState.PRE_OPERATIONAL


@pytest.mark.requirement("C301-001", "C301-016")
@pytest.mark.parametrize("node", [0, 5])
def test_commands_lead_into_their_states(bench, node):
    """Start, stop and enter pre-operational act on the addressed node and on all nodes with 0."""
    changes = []
    bench.slave.on_nmt_state.append(lambda old, new: changes.append((old, new)))
    for command, state in (
        (NmtCommand.START, NmtState.OPERATIONAL),
        (NmtCommand.STOP, NmtState.STOPPED),
        (NmtCommand.ENTER_PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (NmtCommand.STOP, NmtState.STOPPED),
        (NmtCommand.START, NmtState.OPERATIONAL),
    ):
        bench.nmt(command, node)
        assert bench.slave.nmt_state == state
    assert changes[0] == (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)
    assert len(changes) == 5


@pytest.mark.requirement("C301-016", "C301-017")
@pytest.mark.parametrize("data", ["", "01", "01 05 00", "03 05", "7F 05", "FF 00", "01 06"])
def test_malformed_commands_are_ignored(bench, data):
    """A node control frame of another length, with an unknown command or for another node changes nothing."""
    bench.send(0x000, data)
    bench.run()
    assert bench.slave.nmt_state == NmtState.PRE_OPERATIONAL
    assert bench.take(BOOT_UP) == [b"\0"]  # from power-on alone


@pytest.mark.requirement("C301-016", "C301-018", "C301-022")
@pytest.mark.parametrize("command", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_reset_boots_again(bench, command):
    """Both resets go through initialising, tell the device which one it is, and send the boot-up."""
    bench.nmt(NmtCommand.START)
    bench.take()
    resets, changes = [], []
    bench.slave.on_reset.append(resets.append)
    bench.slave.on_nmt_state.append(lambda old, new: changes.append(new))
    bench.nmt(command)
    assert bench.take(BOOT_UP) == [b"\0"]
    assert resets == [command == NmtCommand.RESET_NODE]
    assert changes == [NmtState.INITIALISING, NmtState.PRE_OPERATIONAL]


@pytest.mark.requirement("C301-018")
def test_reset_communication_keeps_application_objects(bench):
    """Reset communication restores 1000h to 1FFFh only; reset node restores the application objects too."""
    for index, sub, value, size in (
        (0x1017, 0, 500, 2),
        (0x2000, 0, 5, 2),
        (0x6083, 0, 77, 4),
        (0x1400, 2, 1, 1),
    ):
        assert bench.write(index, sub, value, size) == 0
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert (bench.read(0x1017), bench.read(0x1400, 2)) == (0, 255)
    assert (bench.read(0x2000), bench.read(0x6083)) == (5, 77)
    bench.nmt(NmtCommand.RESET_NODE)
    assert (bench.read(0x2000), bench.read(0x6083)) == (3, 1000)


def test_values_object_stays_the_same(bench):
    """The device may keep a reference to `values`: resets and power cycles change its content only."""
    values = bench.slave.values
    bench.nmt(NmtCommand.RESET_NODE)
    bench.slave.power_off()
    bench.slave.power_on()
    assert bench.slave.values is values


@pytest.mark.requirement("C301-009")
def test_sdo_by_state(bench):
    """SDO is served in Pre-operational and Operational, not in Stopped."""
    request = "40 00 10 00 00 00 00 00"
    (answer,) = bench.ask(0x605, request)
    assert (answer.can_id, len(answer.data)) == (0x585, 8)
    bench.nmt(NmtCommand.START)
    assert len(bench.ask(0x605, request)) == 1
    bench.nmt(NmtCommand.STOP)
    assert bench.ask(0x605, request) == []
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert len(bench.ask(0x605, request)) == 1


def test_stopped_ends_a_transfer(bench):
    """A transfer that runs when the node is stopped is gone afterwards."""
    bench.sdo("40 08 10 00 00 00 00 00")
    bench.nmt(NmtCommand.STOP)
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert bench.sdo("60 00 00 00 00 00 00 00")[0] == 0x80


@pytest.mark.requirement("C301-019", "C301-056")
def test_pdos_only_in_operational(bench):
    """Neither RPDOs are taken nor TPDOs sent outside Operational."""
    for command in (NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP):
        bench.nmt(command)
        bench.take()
        bench.send(0x205, "0F 00")
        bench.send(0x080)
        bench.slave.set(0x6041, 0, bench.slave.get(0x6041) + 1)
        bench.run()
        assert bench.slave.get(0x6040) == 0
        assert bench.take() == []
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "0F 00")
    bench.run()
    assert bench.slave.get(0x6040) == 0x0F


@pytest.mark.requirement("C301-019")
def test_event_driven_tpdos_are_sent_on_entering_operational(bench):
    """Entering Operational sends each valid event-driven TPDO once, and no synchronous one."""
    bench.take()
    bench.nmt(NmtCommand.START)
    assert [frame.can_id for _, frame in bench.received] == [0x185]


@pytest.mark.requirement("C301-019")
def test_leaving_operational_drops_a_waiting_rpdo(bench):
    """A synchronous RPDO that waits for its SYNC has no effect after Operational was left and entered
    again.
    """
    bench.nmt(NmtCommand.START)
    bench.send(0x305, "0F 00 10 27 00 00 09")
    bench.run()
    bench.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.nmt(NmtCommand.START)
    bench.send(0x080)
    bench.run()
    assert bench.slave.get(0x60FF) == 0


@pytest.mark.parametrize(
    ("command", "reported"),
    [(0x80, ["nmt"]), (0x02, ["nmt"]), (0x81, ["nmt"]), (0x82, ["nmt"]), (0x01, [])],
)
def test_leaving_operational_is_reported_to_the_device(bench, command, reported):
    """The device is informed once when Operational is left by NMT, and not otherwise."""
    reasons = []
    bench.slave.on_communication_error.append(reasons.append)
    bench.nmt(NmtCommand.STOP)
    assert reasons == []
    bench.nmt(NmtCommand.START)
    bench.nmt(command)
    assert reasons == reported


def test_power_off_is_silence_at_once(bench):
    """After power-off nothing is sent or received, not even what a timer had planned; power-on boots
    again.
    """
    bench.write(0x1017, 0, 10, 2)
    bench.nmt(NmtCommand.START)
    bench.slave.power_off()
    assert bench.slave.nmt_state == NmtState.INITIALISING
    bench.take()
    bench.send(0x605, "40 00 10 00 00 00 00 00")
    bench.run(100)
    assert bench.take() == []
    bench.slave.power_on()
    bench.run(100)
    assert bench.take(BOOT_UP) == [b"\0"]
    assert bench.slave.get(0x1017) == 0


def test_reset_forgets_queued_frames(bench):
    """What is queued when the node is reset is not sent after it; the boot-up is the next frame."""
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.send(0x000, "81 05")
    # While this holds the bus the slave has something to say.
    bench.scheduler.after(20_000, lambda: bench.slave.emcy(0x8611))
    bench.run()
    assert bench.take(0x085) == []
    assert bench.take(BOOT_UP) == [b"\0"]


def test_power_off_while_booting(kit):
    """Power-off before the boot-up takes the boot-up back."""
    bench = kit.Bench(boot_time_ns=100 * MS)
    bench.slave.power_on()
    bench.run(50)
    bench.slave.power_off()
    bench.run(200)
    assert bench.take() == []


@pytest.mark.requirement("C301-021")
@pytest.mark.parametrize(("value", "state"), [(0x00, NmtState.OPERATIONAL), (0x04, NmtState.PRE_OPERATIONAL)])
def test_nmt_startup_object(kit, value, state):
    """With 1F80h bit 2 clear the node starts by itself, with the bit set it waits for the master."""
    od = kit.dictionary()
    import canopen

    startup = canopen.objectdictionary.ODVariable("NMT startup", 0x1F80)
    startup.data_type = 0x07
    startup.default = value
    od.add_object(startup)
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.run()
    assert bench.slave.nmt_state == state


def test_history_has_the_state_changes(bench):
    """Every change of the NMT state is an event with both names."""
    bench.nmt(NmtCommand.START)
    events = [event.data for event in bench.history.select(source="drive1", kind="nmt.state")]
    assert events == [
        {"from": "INITIALISING", "to": "PRE_OPERATIONAL"},
        {"from": "PRE_OPERATIONAL", "to": "OPERATIONAL"},
    ]


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("node_id", "options", "where"),
    [(0, {}, "node_id"), (128, {}, "node_id"), (5, {"boot_time_ns": -1}, "boot_time_ns")],
)
def test_bad_arguments_are_named(kit, node_id, options, where):
    """A node-ID or time out of range is refused at once with its name and what is allowed."""
    bench = kit.Bench()
    with pytest.raises(ConfigurationError, match=where):
        CanopenSlave(bench.scheduler, bench.segment, kit.dictionary(), node_id, name="other", **options)


def test_callback_on_an_unknown_entry_is_refused(bench):
    """Registering a callback for an entry that the dictionary does not have is a configuration error."""
    with pytest.raises(ConfigurationError, match="5000h:0"):
        bench.slave.on_write(0x5000, 0, print)
    with pytest.raises(ConfigurationError, match="6040h:3"):
        bench.slave.on_read(0x6040, 3, int)

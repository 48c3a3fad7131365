"""Nodes taken into service: checks, configuration where it differs, start, supervision, and what goes
wrong.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.can.hooks import HookResult
from fieldbus.canopen import CanopenMaster, CanopenSlave, NmtCommand, NmtState
from fieldbus.canopen.abort import AbortCode
from fieldbus.canopen.boot import BootState
from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History

pytestmark = pytest.mark.exhaustive

PDOS = (
    PdoSetup(False, 1, 0x205, 1, (0x60400010, 0x60FF0020, 0x60600008)),
    PdoSetup(True, 1, 0x185, 1, (0x60410010, 0x60640020)),
    PdoSetup(True, 2, 0x285),
)
PARAMETERS = (
    Parameter(0x1017, 0, 50, 2),
    Parameter(0x6083, 0, 5000, 4),
    Parameter(0x607D, 1, -1000, 4),
    Parameter(0x60FF, 0, 0, 4),
)


class User:
    """Notes what a node tells its user."""

    def __init__(self) -> None:
        self.reported: list[str] = []

    def node_restarted(self):
        self.reported.append("restarted")

    def node_in_service(self):
        self.reported.append("in service")

    def node_lost(self, reason):
        self.reported.append(f"lost: {reason}")

    def node_state(self, state):
        pass

    def node_emcy(self, code):
        self.reported.append(f"emcy {code:04X}")


class Net:
    """A master with one managed node, the node, and an ear on the bus."""

    def __init__(self, kit, **changes) -> None:
        self.kit = kit
        self.scheduler = VirtualScheduler()
        self.segment = CanMedium(self.scheduler)
        self.history = History(self.scheduler)
        self.master = CanopenMaster(self.scheduler, self.segment, history=self.history)
        self.heard: list[CanFrame] = []
        self.port = self.segment.attach("ear", lambda frame, _time_ns: self.heard.append(frame))
        self.slave = CanopenSlave(self.scheduler, self.segment, kit.dictionary(), 5, name="slave")
        self.user = User()
        options = {
            "node_id": 5,
            "name": "drive1",
            "device_profile": 402,
            "pdos": PDOS,
            "parameters": PARAMETERS,
            "store": True,
            "heartbeat_timeout_ms": 120,
        }
        self.node = self.master.add_node(NodeSetup(**(options | changes)), self.user)

    def run(self, milliseconds: float) -> None:
        self.scheduler.run_for(round(milliseconds * MS))

    def start(self) -> None:
        """Switch the slave on, boot it, and let SYNC run."""
        self.slave.power_on()
        self.node.boot()
        self.master.start_sync(4 * MS)
        self.run(60)

    def lose(self, matches) -> None:
        """Lose the first frame for which `matches` is true."""
        lost: list[CanFrame] = []

        def hook(frame, *_rest):
            if not lost and matches(frame):
                lost.append(frame)
                return HookResult.drop()
            return None

        self.segment.add_hook(hook)

    def written(self) -> list[tuple[int, int]]:
        """Return what has been downloaded, in the order on the bus."""
        return [
            (int.from_bytes(frame.data[1:3], "little"), frame.data[3])
            for frame in self.heard
            if frame.can_id == 0x605 and frame.data[0] & 0xE0 == 0x20
        ]

    def commands(self) -> list[int]:
        """Return the NMT commands on the bus."""
        return [frame.data[0] for frame in self.heard if frame.can_id == 0]

    def events(self, kind: str) -> list[dict]:
        return [event.data for event in self.history.select(source="controller", kind=kind)]


@pytest.fixture
def net(kit):
    return Net(kit)


@pytest.mark.requirement("C301-015", "C301-016", "C301-146", "C301-052")
def test_boot_from_the_factory(net):
    """A node with default values is checked, configured, stored and started, in this order; its user is
    reported.
    """
    net.start()
    assert net.node.in_service
    assert net.slave.nmt_state is NmtState.OPERATIONAL
    assert net.user.reported == ["restarted", "in service"]
    assert [data["step"] for data in net.events("node.boot")] == [
        "waiting",
        "device type",
        "identity",
        "verification",
        "configuration",
        "storing",
        "starting",
    ]
    assert net.node.identity == {
        "vendor_id": 0x1234,
        "product_code": 0x5678,
        "revision": 0x10000,
        "serial": 42,
    }
    assert net.node.report.device_type == 0x00020192
    for parameter in PARAMETERS:
        assert net.slave.get(parameter.index, parameter.sub) == parameter.value
    assert [net.slave.get(0x1600, sub) for sub in range(4)] == [3, 0x60400010, 0x60FF0020, 0x60600008]
    assert net.slave.get(0x1801, 1) >> 31 == 1
    assert net.commands() == [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.START]
    assert net.slave.store.stored


@pytest.mark.requirement("C301-052")
def test_pdo_is_set_up_in_the_order_of_the_standard(net):
    """Not valid, no entries, the entries, their number, the type, valid."""
    net.start()
    rpdo = [entry for entry in net.written() if entry[0] in (0x1400, 0x1600)]
    assert rpdo == [
        (0x1400, 1),
        (0x1600, 0),
        (0x1600, 1),
        (0x1600, 2),
        (0x1600, 3),
        (0x1600, 0),
        (0x1400, 2),
        (0x1400, 1),
    ]


PREPARE = (Parameter(0x6040, 0, 0, 2),)


def test_node_is_prepared_before_anything_is_written(kit):
    """A node that has started again gets what makes it safe first, and in Pre-operational; also if nothing
    else differs.
    """
    net = Net(kit, prepare=PREPARE)
    net.start()
    assert net.written()[0] == (0x6040, 0)
    sent = [frame for frame in net.heard if frame.can_id in (0, 0x605)]
    first_write = next(
        n for n, frame in enumerate(sent) if frame.can_id == 0x605 and frame.data[0] & 0xE0 == 0x20
    )
    assert CanFrame(0, bytes((NmtCommand.ENTER_PRE_OPERATIONAL, 5))) in sent[:first_write]
    net.heard.clear()
    net.slave.power_off()
    net.slave.power_on()
    net.run(20)
    assert net.node.report.verified
    assert net.written() == [(0x6040, 0)]


@pytest.mark.parametrize("changed", [False, True])
def test_node_that_has_not_started_again_is_prepared_only_if_it_differs(kit, changed):
    """A node whose heartbeat was missing is not touched; if its parameters have changed it is prepared before
    they are put right.
    """
    net = Net(kit, prepare=PREPARE)
    net.start()
    net.run(60)
    net.slave.error_control.silent = True
    net.run(200)
    assert net.node.boot_state is BootState.LOST
    if changed:
        net.slave.store.assign(net.slave.store.entry(0x6083, 0), 77)
    net.heard.clear()
    net.slave.error_control.silent = False
    net.run(120)
    assert net.node.in_service
    assert net.written() == (
        [(0x6040, 0), (0x6083, 0), (0x1020, 1), (0x1020, 2), (0x1010, 1)] if changed else []
    )
    assert (NmtCommand.ENTER_PRE_OPERATIONAL in net.commands()) is changed
    assert ("restarted" in net.user.reported[1:]) is changed


def test_a_node_that_is_only_compared_is_never_written(kit):
    """What differs is named and keeps the node out of service; once it is equal the node is started, and no
    download and no Pre-operational has been on the bus.
    """
    net = Net(kit, prepare=PREPARE, compare_only=True, store=False)
    net.start()
    failure = net.node.failure
    assert net.node.boot_state is BootState.FAILED
    assert failure is not None
    assert "1017h:0 is 0000h, 0032h is wanted" in failure.differences
    assert any(text.startswith("1801h:1 is ") for text in failure.differences)
    assert not any("60FFh" in text for text in failure.differences)
    assert (net.written(), net.commands()) == ([], [])
    net = Net(kit, prepare=PREPARE)
    net.start()
    net.node.setup = replace(net.node.setup, compare_only=True)
    net.slave.power_off()
    net.run(200)
    net.heard.clear()
    net.slave.power_on()
    net.run(100)
    assert net.node.in_service
    assert (net.written(), net.commands()) == ([], [NmtCommand.START])


def test_equal_entries_are_not_written(net):
    """What is as it should be is compared and left alone; what differs is reported."""
    net.start()
    assert (0x60FF, 0) not in net.written()
    report = net.node.report
    assert not report.verified
    assert {(p.index, p.sub) for p in report.written} >= {(0x1017, 0), (0x6083, 0), (0x607D, 1), (0x1801, 1)}
    configured = net.events("node.configured")[0]
    assert configured["written"] == len(report.written)
    assert "607Dh:1" in configured["objects"]
    assert "60FFh:0" not in configured["objects"]


@pytest.mark.requirement("C301-140", "C301-148")
def test_stored_configuration_is_recognised_by_its_date(net):
    """A node that comes back with the configuration it has stored shows it by 1020h: nothing else is
    compared.
    """
    net.start()
    net.slave.power_off()
    net.run(200)
    net.heard.clear()
    net.slave.power_on()
    net.run(20)
    assert net.node.in_service
    assert net.node.report.verified
    assert net.written() == []
    assert len([frame for frame in net.heard if frame.can_id == 0x605]) == 7
    assert net.user.reported[-2:] == ["restarted", "in service"]


@pytest.mark.requirement("C301-148")
def test_one_changed_parameter_is_put_right(net):
    """A parameter that somebody has changed is found, because 1020h is 0 then, and is the only one to be
    written.
    """
    net.start()
    net.slave.store.assign(net.slave.store.entry(0x6083, 0), 77)
    assert net.slave.get(0x1020, 1) == 0
    net.heard.clear()
    net.node.boot()
    net.run(60)
    assert net.node.in_service
    assert net.slave.get(0x6083) == 5000
    assert net.written() == [(0x6083, 0), (0x1020, 1), (0x1020, 2), (0x1010, 1)]


@pytest.mark.requirement("C301-148")
@pytest.mark.parametrize("sub", [1, 2])
def test_date_and_time_both_count(net, sub):
    """A node with another date or another time in 1020h is compared entry by entry."""
    net.start()
    net.slave.set(0x1020, sub, net.slave.get(0x1020, sub) ^ 1)
    net.slave.set(0x6083, 0, 77)
    net.node.boot()
    net.run(60)
    assert not net.node.report.verified
    assert net.slave.get(0x6083) == 5000


def test_node_without_1020h(net):
    """A node that has no 1020h is compared entry by entry every time, and stores only if something was
    written.
    """
    for sub in (1, 2):
        del net.slave.store.entries[0x102000 | sub]
    net.start()
    assert net.node.in_service
    assert net.written()[-1] == (0x1010, 1)
    net.heard.clear()
    net.node.boot()
    net.run(60)
    assert net.node.in_service
    assert net.node.report.compared > 10
    assert net.written() == []


def test_what_cannot_be_read_is_written(kit):
    """A write-only parameter cannot be compared: it is written in every boot that compares."""
    net = Net(kit, parameters=(Parameter(0x2003, 0, 0, 2),))
    net.start()
    assert (0x2003, 0) in net.written()
    assert net.node.in_service


@pytest.mark.requirement("C301-046", "C301-055")
def test_remote_requests_make_no_difference(net):
    """A TPDO that would answer remote requests is as good as one that does not; any other bit matters."""
    cob_id = PDOS[1].wanted[-1]
    assert PDOS[1].satisfied(cob_id, 0x40000185)
    assert PDOS[1].satisfied(cob_id, 0x00000185)
    assert not PDOS[1].satisfied(cob_id, 0xC0000185)
    assert not PDOS[1].satisfied(cob_id, 0x40000186)


def test_node_that_can_show_nothing(kit):
    """A node without PDOs and without supervision counts as in service a second after the command to
    start.
    """
    net = Net(kit, pdos=(), parameters=(), heartbeat_timeout_ms=0)
    net.start()
    assert net.node.boot_state is BootState.STARTING
    net.run(1000)
    assert net.node.in_service


def test_node_without_memory_is_configured_again(kit):
    """A node that has not stored anything is configured from the beginning whenever it comes back."""
    net = Net(kit, store=False)
    net.start()
    first = list(net.node.report.written)
    net.slave.power_off()
    net.run(200)
    net.slave.power_on()
    net.run(60)
    assert net.node.in_service
    assert net.node.report.written == first
    assert net.slave.get(0x6083) == 5000
    assert not net.slave.store.stored


@pytest.mark.requirement("C301-132", "C301-146")
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"device_profile": 406}, "no device of profile 406: 1000h is 00020192h"),
        ({"vendor_id": 0x9A}, "vendor-ID (1018h:1) 0000009Ah is expected, it has 00001234h"),
        ({"product_code": 1}, "product code (1018h:2) 00000001h is expected, it has 00005678h"),
        ({"revision": 2}, "revision (1018h:3) 00000002h is expected, it has 00010000h"),
        ({"serial": 3}, "serial number (1018h:4) 00000003h is expected, it has 0000002Ah"),
    ],
)
def test_another_device_is_left_alone(kit, changes, words):
    """A node that is not the expected one gets no parameter and no command; the failure says what differs."""
    net = Net(kit, **changes)
    net.start()
    net.run(3000)
    assert net.node.boot_state is BootState.FAILED
    assert words in str(net.node.failure)
    assert str(net.node.failure).startswith("drive1 (node 5) ")
    assert net.written() == net.commands() == []
    failed = net.events("node.failed")
    assert len(failed) == 1
    assert failed[0]["message"] == str(net.node.failure)
    assert failed[0]["step"] in ("device type", "identity")
    assert "in service" not in net.user.reported


def test_expected_identity_is_accepted(kit):
    """The identity that the node has lets it in."""
    net = Net(kit, vendor_id=0x1234, product_code=0x5678, revision=0x10000, serial=42)
    net.start()
    assert net.node.in_service


@pytest.mark.requirement("C301-098")
def test_refused_parameter(kit):
    """A parameter that the node refuses ends the boot with object, value and reason; it is not started."""
    net = Net(kit, parameters=(Parameter(0x2000, 0, 9, 2),))
    net.start()
    net.run(1000)
    failure = net.node.failure
    assert net.node.boot_state is BootState.FAILED
    assert str(failure) == "drive1 (node 5) refuses 2000h:0 = 9 (9h): 06090031h value too high"
    assert (failure.state, failure.index, failure.expected) == (BootState.CONFIGURATION, 0x2000, 9)
    assert failure.abort_code == AbortCode.VALUE_HIGH
    assert NmtCommand.START not in net.commands()
    assert net.slave.nmt_state is NmtState.PRE_OPERATIONAL


def test_value_that_does_not_fit_its_object(kit):
    """A value beyond the object's type is reported like a refusal, before anything wrong is on the bus."""
    net = Net(kit, parameters=(Parameter(0x2000, 0, 70000, 2),))
    net.start()
    assert "refuses 2000h:0 = 70000" in str(net.node.failure)
    assert "16 bits" in str(net.node.failure)


@pytest.mark.requirement("C301-022")
def test_late_node(net):
    """A node that is not there is asked now and then, and taken in at its boot-up."""
    net.node.boot()
    net.run(3000)
    assert net.node.boot_state is BootState.WAITING
    assert net.node.failure.silent
    questions = len([frame for frame in net.heard if frame.can_id == 0x605 and frame.data[0] == 0x40])
    assert 4 <= questions <= 12
    net.slave.power_on()
    net.run(40)
    assert net.node.started
    net.master.start_sync(4 * MS)
    net.run(10)
    assert net.node.in_service
    assert net.node.failure is None


def test_node_that_was_there_before(net):
    """A node whose boot-up nobody has heard answers the question for 1000h."""
    net.slave.power_on()
    net.run(100)
    net.node.boot()
    net.master.start_sync(4 * MS)
    net.run(60)
    assert net.node.in_service
    assert net.node.bootups == 1


@pytest.mark.parametrize("number", range(0, 44, 3))
def test_lost_frames_do_not_end_a_boot(net, number):
    """Whichever request or answer is lost on the bus, the boot ends well."""
    seen = []
    net.lose(lambda frame: frame.can_id in (0x605, 0x585) and (seen.append(1), len(seen) > number)[1])
    net.start()
    net.run(1000)
    assert len(seen) > number
    assert net.node.in_service
    assert net.slave.get(0x6083) == 5000
    assert [net.slave.get(0x1600, sub) for sub in range(4)] == [3, 0x60400010, 0x60FF0020, 0x60600008]


def test_lost_start_command(net):
    """A node that goes on reporting Pre-operational is commanded to start again."""
    net.lose(lambda frame: frame.can_id == 0 and frame.data[0] == NmtCommand.START)
    net.start()
    net.run(200)
    assert net.node.in_service
    assert net.commands().count(NmtCommand.START) == 1  # the other one was lost


def test_reset_in_the_middle_of_a_boot(net):
    """A boot-up during the boot lets it begin again."""
    net.slave.power_on()
    net.node.boot()
    net.run(6)
    assert net.node.boot_state is BootState.CONFIGURATION
    net.slave.power_off()
    net.slave.power_on()
    net.master.start_sync(4 * MS)
    net.run(60)
    assert net.node.in_service
    assert net.slave.get(0x6083) == 5000
    assert net.user.reported == ["restarted", "restarted", "in service"]


@pytest.mark.parametrize("stored", [False, True])
def test_node_that_somebody_stops_during_its_boot(kit, stored, subtests):
    """Whenever a stop command of somebody else meets a boot, the node comes into service, also one that shows
    no heartbeat until it is configured.
    """
    net = Net(kit, store=stored)
    net.start()
    for microseconds in range(200, 15_000, 1700):
        with subtests.test(microseconds=microseconds):
            assert net.node.in_service
            net.port.send(CanFrame(0, bytes((NmtCommand.RESET_NODE, 5))))
            net.run(microseconds / 1000)
            net.port.send(CanFrame(0, bytes((NmtCommand.STOP, 5))))
            net.run(1500)
            assert net.node.in_service, net.node.describe()
            assert net.slave.nmt_state is NmtState.OPERATIONAL


# -- supervision
# -----------------------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-023", "C301-026", "C301-027")
def test_lost_heartbeat_and_return(net):
    """A lost heartbeat takes the node out of service; when it is back the node is verified in place, nothing
    written.
    """
    net.start()
    net.run(100)
    net.heard.clear()
    net.slave.error_control.silent = True
    net.run(400)
    assert net.node.boot_state is BootState.LOST
    assert net.node.losses == 1
    assert net.user.reported[-1] == "lost: heartbeat"
    assert len(net.events("heartbeat.lost")) == len(net.events("node.lost")) == 1
    net.run(4000)  # it goes on answering and sending PDOs: that does not count
    assert net.node.boot_state is BootState.LOST
    net.slave.error_control.silent = False
    net.run(70)
    assert net.node.in_service
    assert net.user.reported[-1] == "in service"
    assert net.written() == []
    assert NmtCommand.ENTER_PRE_OPERATIONAL not in net.commands()
    assert len(net.events("heartbeat.back")) == 1


@pytest.mark.requirement("C301-026")
def test_node_that_never_sends_a_heartbeat(kit):
    """A node that is expected to send heartbeats is lost when none has come since it was started."""
    net = Net(kit, parameters=())
    net.start()
    assert net.node.in_service
    net.run(120)
    assert not net.node.in_service
    assert net.user.reported[-1] == "lost: heartbeat"


def test_pdos_do_not_make_up_for_the_heartbeat(net):
    """A node that is configured again while its heartbeat is missing is not in service by its PDOs alone."""
    net.start()
    net.run(60)
    net.slave.error_control.silent = True
    net.run(200)
    net.slave.store.assign(net.slave.store.entry(0x6083, 0), 77)
    net.heard.clear()
    net.run(1500)
    assert net.slave.get(0x6083) == 5000
    assert [frame for frame in net.heard if frame.can_id == 0x185]
    assert "in service" not in net.user.reported[net.user.reported.index("lost: heartbeat") :]
    net.slave.error_control.silent = False
    net.run(2500)
    assert net.node.in_service


def test_node_that_lost_its_parameters_unseen(kit):
    """A node that was off while nobody heard its boot-up, and sends nothing any more, is found and configured
    again.
    """
    net = Net(kit, store=False)
    net.start()
    net.slave.power_off()
    net.lose(lambda frame: frame.can_id == 0x705 and frame.data == b"\0")
    net.run(300)
    assert net.node.boot_state is BootState.LOST
    net.slave.power_on()
    net.run(3000)
    assert net.node.bootups == 1
    assert net.node.in_service
    assert net.slave.get(0x6083) == 5000
    assert net.user.reported[-3:] == ["lost: heartbeat", "restarted", "in service"]


@pytest.mark.requirement("C301-022", "C301-027")
def test_reset_in_operation(net):
    """A boot-up in operation is noticed as an unexpected reset, and the node taken in again."""
    net.start()
    net.slave.power_off()
    net.slave.power_on()
    net.run(30)
    assert net.events("node.bootup")[-1]["unexpected"] is True
    assert net.user.reported[-3:] == ["restarted", "lost: boot-up", "in service"]
    assert net.node.bootups == 2
    assert net.node.in_service


@pytest.mark.requirement("C301-016", "C301-113")
@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
def test_node_that_leaves_operational_by_itself(net, command):
    """A node in another state than the commanded one is out of service, is verified and started again."""
    net.start()
    net.run(60)
    net.port.send(CanFrame(0, bytes((command, 5))))
    net.run(100)
    assert net.node.in_service
    assert net.slave.nmt_state is NmtState.OPERATIONAL
    assert (
        f"lost: state {'STOPPED' if command == NmtCommand.STOP else 'PRE_OPERATIONAL'}" in net.user.reported
    )


@pytest.mark.parametrize("node", [0, 5])
def test_command_of_the_program_is_respected(net, node):
    """A node that the program itself has stopped is not started by the master, until the program does."""
    net.start()
    net.master.nmt(NmtCommand.STOP, node)
    net.run(1000)
    assert net.node.boot_state is BootState.HELD
    assert net.slave.nmt_state is NmtState.STOPPED
    assert net.user.reported[-1] == "lost: command"
    net.master.nmt(NmtCommand.START, node)
    net.run(20)
    assert net.node.in_service
    assert net.user.reported[-1] == "in service"


@pytest.mark.requirement("C301-024", "C301-028", "C301-029", "C301-030")
def test_node_guarding(kit):
    """Guarding asks by remote frames, checks the toggle bit, and finds a silent node after the life time."""
    guarding = (Parameter(0x100C, 0, 20, 2), Parameter(0x100D, 0, 3, 1))
    net = Net(kit, heartbeat_timeout_ms=0, guard_time_ms=20, life_time_factor=3, parameters=guarding)
    net.start()
    net.run(500)
    assert net.node.in_service
    assert net.node.nmt_state is NmtState.OPERATIONAL
    answers = [frame.data[0] for frame in net.heard if frame.can_id == 0x705 and frame.data and frame.data[0]]
    assert len(answers) > 20
    assert [value >> 7 for value in answers] == [n % 2 for n in range(len(answers))]
    net.slave.error_control.silent = True
    since = net.scheduler.now
    assert net.scheduler.run_until(lambda: not net.node.in_service, 200 * MS)
    assert 40 * MS <= net.scheduler.now - since <= 60 * MS
    assert net.events("guarding.lost") == [{"node": 5, "name": "drive1", "reason": "no answer"}]
    net.run(100)
    assert not net.node.in_service
    net.slave.error_control.silent = False
    net.run(50)
    assert net.node.in_service
    assert len(net.events("guarding.back")) == 1


@pytest.mark.requirement("C301-028")
def test_toggle_bit_begins_again_with_the_node(kit):
    """After a reset the first answer has toggle bit 0, whatever came before; that is no error."""
    guarding = (Parameter(0x100C, 0, 20, 2), Parameter(0x100D, 0, 3, 1))
    net = Net(kit, heartbeat_timeout_ms=0, guard_time_ms=20, life_time_factor=3, parameters=guarding)
    net.start()
    for _ in range(4):
        net.run(130)
        net.master.nmt(NmtCommand.RESET_NODE, 5)
        net.run(110)
        assert net.node.in_service
    assert net.node.bootups == 5
    assert net.node._guard.toggle_errors == 0


@pytest.mark.requirement("C301-030")
def test_toggle_bit_that_does_not_change(kit):
    """Answers whose toggle bit stays the same count as none: after the life time the node is lost."""
    net = Net(kit, heartbeat_timeout_ms=0, guard_time_ms=20, life_time_factor=3, parameters=())
    net.start()
    assert net.node.in_service

    def same_toggle(frame, *_rest):
        if frame.can_id == 0x705 and frame.data and frame.data[0] != 0x05:
            return HookResult.replace(CanFrame(0x705, b"\x05"))
        return None

    net.segment.add_hook(same_toggle)
    net.run(200)
    assert net.events("guarding.lost")[0]["reason"] == "toggle bit"
    assert "lost: guarding" in net.user.reported


@pytest.mark.requirement("C301-108", "C301-109")
def test_emcy_collection(net):
    """EMCYs are kept with time, code, register and meaning; frames of another length are not."""
    net.start()
    net.slave.emcy(0x2310, data=b"\x01\x02")
    net.run(5)
    net.slave.emcy_clear()
    net.run(5)
    net.slave._port.send(CanFrame(0x85, b"\x10\x23\x01"))
    net.run(5)
    assert [(e.code, e.register & 1, e.data) for e in net.node.emcys] == [
        (0x2310, 1, b"\x01\x02\0\0\0"),
        (0, 0, bytes(5)),
    ]
    assert net.node.error_register == 0
    assert [e.text for e in net.node.emcys] == ["continuous overcurrent", "error reset or no error"]
    assert [data["text"] for data in net.events("emcy.received")] == [
        "continuous overcurrent",
        "error reset or no error",
    ]
    assert net.user.reported[-2:] == ["emcy 2310", "emcy 0000"]
    for _ in range(300):
        net.port.send(CanFrame(0x85, bytes(8)))
        net.run(1)
    assert len(net.node.emcys) == 254


def test_view_of_a_node(net):
    """The view of a node is made of plain values and says what state it is in and why."""
    net.node.boot()
    net.run(1000)
    view = net.node.describe()
    assert (view["state"], view["nmt_state"], view["identity"]) == ("waiting", None, {})
    assert "does not answer to 1000h" in view["failure"]
    net.slave.power_on()
    net.master.start_sync(4 * MS)
    net.run(60)
    view = net.node.describe()
    assert (view["state"], view["failure"], view["identity"]["serial"]) == ("in service", None, 42)


@pytest.mark.parametrize("seed", range(12))
def test_noise_never_wedges_a_node(kit, seed):
    """Foreign frames on every identifier of the node, at any time, raise nothing; after a reset the node is
    taken in.
    """
    guarding = {"guard_time_ms": 20, "heartbeat_timeout_ms": 0, "parameters": PARAMETERS[1:]}
    net = Net(kit, **(guarding if seed % 3 == 0 else {}))
    stream = random.Random(seed)
    net.slave.power_on()
    net.node.boot()
    net.master.start_sync(4 * MS)
    heads = [bytes.fromhex(text) for text in ("43001000", "80001000", "60001400", "41181001", "80000000")]
    for _ in range(400):
        can_id = stream.choice((0x585, 0x585, 0x705, 0x085, 0x185))
        data = stream.randbytes(stream.choice((0, 1, 2, 3, 7, 8)))
        if can_id == 0x585 and stream.random() < 0.5:
            data = stream.choice(heads) + stream.randbytes(4)
        elif can_id == 0x705:
            data = bytes((stream.choice((0, 4, 5, 0x7F, 0x85, 3, 0xFF)),)) * stream.choice((0, 1, 1, 1, 2))
        net.port.send(CanFrame(can_id, data))
        net.run(stream.choice((0.1, 0.3, 2)))
    net.run(2500)
    net.slave.power_off()
    net.run(10)
    net.slave.power_on()
    net.run(200)
    assert net.node.in_service
    assert net.slave.nmt_state is NmtState.OPERATIONAL
    assert net.slave.get(0x6083) == 5000


def test_nodes_boot_side_by_side(kit):
    """Slow nodes are configured at the same time; one that is missing does not hold up the others."""
    scheduler = VirtualScheduler()
    segment = CanMedium(scheduler)
    master = CanopenMaster(scheduler, segment)
    slaves = [CanopenSlave(scheduler, segment, kit.dictionary(), n, name=f"n{n}") for n in (5, 6, 7)]
    nodes = []
    for slave in slaves:
        n = slave.node_id
        pdo = PdoSetup(True, 1, 0x180 + n, 1, (0x60410010,))
        nodes.append(master.add_node(NodeSetup(n, f"n{n}", pdos=(pdo,), parameters=PARAMETERS)))
        slave.sdo_response_delay_ns = 3 * MS
    slaves[0].power_on()
    slaves[1].power_on()
    for node in nodes:
        node.boot()
    assert scheduler.run_until(lambda: nodes[0].started and nodes[1].started, 120 * MS)
    assert nodes[2].boot_state is BootState.WAITING


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"node_id": 0}, "node_id"),
        ({"node_id": 127}, "node_id"),
        ({"guard_time_ms": 20}, "one of the two"),
        ({"heartbeat_timeout_ms": -1}, "0 or more"),
        ({"heartbeat_timeout_ms": 0, "guard_time_ms": 20, "life_time_factor": 0}, "1..255"),
    ],
)
def test_bad_setup(kit, changes, words):
    """A setup that cannot work is refused at once."""
    with pytest.raises(ConfigurationError, match=words):
        Net(kit, **changes)


def test_date_depends_on_every_value():
    """The date that stands for a configuration changes with any of its values, and is never 0."""
    base = NodeSetup(5, "a", pdos=PDOS, parameters=PARAMETERS)
    others = [NodeSetup(5, "a", pdos=PDOS[:2], parameters=PARAMETERS), NodeSetup(5, "a", pdos=PDOS)]
    for number, parameter in enumerate(PARAMETERS):
        changed = list(PARAMETERS)
        changed[number] = parameter._replace(value=parameter.value + 1)
        others.append(NodeSetup(5, "a", pdos=PDOS, parameters=tuple(changed)))
    signatures = {base.signature, *(other.signature for other in others)}
    assert len(signatures) == 1 + len(others)
    assert NodeSetup(5, "b", pdos=PDOS, parameters=PARAMETERS).signature == base.signature
    assert all(1 <= days <= 0xFFFF and 1 <= ms < 86_400_000 for days, ms in signatures)

"""Drive parameters through SDO (PD-343), read and written by the `canopen` library; kept by 1010h and
p0971.
"""

from __future__ import annotations

import struct
from dataclasses import replace

import canopen
import pytest

from emulators.drive.profidrive import ProfidriveCanDrive, ProfidriveConfig, ProfidriveNodeConfig
from fieldbus.can import CanMedium
from fieldbus.canopen.network import PumpedNetwork
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.errors import ParameterAccessError

NODE = 9
P1121 = 0x2000 + 1121
P8630 = 0x2000 + 8630
SAVE, LOAD = b"save", b"load"


class Node:
    """The drive on a segment, and the library's SDO client for it."""

    def __init__(self, storage=None):
        self.scheduler = VirtualScheduler()
        self.segment = CanMedium(self.scheduler, name="can0")
        config = ProfidriveNodeConfig(
            node_id=NODE, drive=ProfidriveConfig.reference(operating_mode=1), storage=storage
        )
        self.drive = ProfidriveCanDrive(self.scheduler, self.segment, config, name="drive")
        self.network = PumpedNetwork(self.segment)
        self.sdo = self.network.add_node(NODE, canopen.ObjectDictionary()).sdo
        self.drive.power_on()
        self.scheduler.run_for(MS)

    @property
    def settings(self):
        return self.drive.drive.settings

    def abort(self, action):
        """Return the abort code of a transfer."""
        with pytest.raises(canopen.SdoAbortedError) as refused:
            action()
        return refused.value.code

    def restart(self):
        """Switch off and on."""
        self.drive.power_off()
        self.drive.power_on()
        self.scheduler.run_for(MS)


@pytest.fixture
def node():
    return Node()


@pytest.mark.requirement("PD-343", "PD-270")
def test_a_parameter_is_an_object(node):
    """Index 2000h + number, sub-index = element: p1121 is 2461h, a REAL32; what is written acts on the
    drive.
    """
    assert struct.unpack("<f", node.sdo.upload(P1121, 0)) == (1.0,)
    node.sdo.download(P1121, 0, struct.pack("<f", 0.5))
    assert node.settings.ramp_down_s == 0.5
    assert node.sdo.upload(0x200A, 0) == b"\0\0"
    assert [int.from_bytes(node.sdo.upload(0x2000 + 964, sub), "little") for sub in (0, 5)] == [0x2A, 1]


@pytest.mark.requirement("PD-343", "PD-346")
@pytest.mark.parametrize(
    ("index", "sub", "data", "code"),
    [
        (0x2000 + 7, 0, b"\0\0", 0x06020000),  # no such parameter
        (P1121, 1, b"\0\0\0\0", 0x06090011),  # no array
        (0x2000 + 964, 6, b"\0\0", 0x06090011),  # beyond its end
        (0x2000 + 964, 0, b"\0\0", 0x06010002),  # read only
        (P1121, 0, b"\0\0", 0x06070010),  # wrong size
        (P1121, 0, struct.pack("<f", -1.0), 0x06090030),  # limit
        (0x2000 + 304, 0, struct.pack("<f", 1.0), 0x08000022),  # not in commissioning
    ],
)
def test_what_is_refused_has_its_abort_code(node, index, sub, data, code):
    """The error number of the parameter as abort code of CiA 301."""
    assert node.abort(lambda: node.sdo.download(index, sub, data)) == code


@pytest.mark.requirement("PD-343")
def test_the_window_moves(node):
    """p8630[2] shifts it by 10 000 parameters, p8630[0] = 0 closes it; p8630 itself is always there."""
    node.sdo.download(P8630, 2, struct.pack("<H", 1))
    assert node.abort(lambda: node.sdo.upload(P1121, 0)) == 0x06020000
    node.sdo.download(P8630, 2, struct.pack("<H", 0))
    node.sdo.download(P8630, 1, struct.pack("<H", 1))
    assert node.abort(lambda: node.sdo.upload(P1121, 0)) == 0x06090011
    node.sdo.download(P8630, 1, struct.pack("<H", 0))
    node.sdo.download(P8630, 0, struct.pack("<H", 0))
    assert node.abort(lambda: node.sdo.upload(P1121, 0)) == 0x06020000
    assert node.sdo.upload(0x2000 + 2131, 0) == b"\0\0"  # an object of the dictionary, not of the window
    node.sdo.download(P8630, 0, struct.pack("<H", 1))
    assert node.sdo.upload(P1121, 0)


@pytest.mark.requirement("PD-344", "PD-250", "PD-285")
@pytest.mark.parametrize("how", ["1010h:1", "1010h:3", "p0971", "p0977"])
def test_what_is_saved_survives_power_off(node, how):
    """1010h and p0971 are the same memory; what was not saved is as configured again."""
    node.sdo.download(P1121, 0, struct.pack("<f", 0.25))
    if how.startswith("p"):
        node.sdo.download(0x2000 + int(how[1:]), 0, b"\1\0")
    else:
        node.sdo.download(0x1010, int(how[-1]), SAVE)
    node.sdo.download(0x2000 + 1120, 0, struct.pack("<f", 7.0))
    node.restart()
    assert (node.settings.ramp_down_s, node.settings.ramp_up_s) == (0.25, 1.0)


@pytest.mark.requirement("PD-344")
def test_restoring_brings_the_configuration_back(node):
    """1011h acts with the next reset; 1010h:2 does not save parameters of the drive."""
    node.sdo.download(P1121, 0, struct.pack("<f", 0.25))
    node.sdo.download(0x1010, 2, SAVE)
    node.restart()
    assert node.settings.ramp_down_s == 1.0
    node.sdo.download(P1121, 0, struct.pack("<f", 0.25))
    node.sdo.download(0x1010, 1, SAVE)
    node.sdo.download(0x1011, 1, LOAD)
    assert node.settings.ramp_down_s == 0.25
    node.restart()
    assert node.settings.ramp_down_s == 1.0


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-344", "PD-250")
@pytest.mark.parametrize("how", ["1010h", "p0971"])
def test_the_file_keeps_the_parameters(tmp_path, how):
    """With a storage file they outlive the process, as the objects do."""
    path = tmp_path / "drive.json"
    node = Node(path)
    node.sdo.download(P1121, 0, struct.pack("<f", 0.25))
    if how == "p0971":
        node.sdo.download(0x2000 + 971, 0, b"\1\0")
    else:
        node.sdo.download(0x1010, 1, SAVE)
    other = Node(path)
    assert other.settings.ramp_down_s == 0.25
    other.sdo.download(0x1011, 1, LOAD)
    other.restart()
    assert other.settings.ramp_down_s == 1.0
    assert Node(path).settings.ramp_down_s == 1.0


@pytest.mark.requirement("PD-251")
def test_p0972_restarts_the_drive(node):
    """The axis begins again, with what is saved."""
    node.sdo.download(P1121, 0, struct.pack("<f", 0.25))
    node.sdo.download(0x2000 + 972, 0, b"\1\0")
    assert node.settings.ramp_down_s == 1.0
    assert not node.drive.drive.controlled_cyclically


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-256", "PD-257")
def test_every_listed_parameter_can_be_read(node):
    """PNU 980 and its followers list what there is; each element of what the window shows answers an SDO."""
    listed: list[int] = []
    number = 980
    while number:
        page = [int.from_bytes(node.sdo.upload(0x2000 + number, at), "little") for at in range(117)]
        listed += [one for one in page[:-1] if one]
        number = page[-1]
    assert listed == sorted(listed)
    assert set(listed) == set(node.drive.parameters.store.numbers())
    for number in (one for one in listed if one < 10_000):
        definition = node.drive.parameters.store.definition(number)
        for at in {0, definition.elements - 1}:
            assert node.sdo.upload(0x2000 + number, at)


@pytest.mark.requirement("PD-256")
def test_parameters_for_a_test(node):
    """`drive.parameters` reads and writes by name or number, and refuses with the number of the profile."""
    parameters = node.drive.parameters
    parameters.write("p1121", 0.5)
    assert parameters.read(1121) == parameters.read("P1121") == node.settings.ramp_down_s == 0.5
    with pytest.raises(ParameterAccessError) as refused:
        parameters.write("r0002", 1)
    assert refused.value.error == 0x01
    with pytest.raises(ConfigurationError, match="p1121"):
        parameters.read("ramp")
    parameters.store.refusals[1121] = 0x65
    with pytest.raises(ParameterAccessError):
        parameters.read(1121)
    assert node.abort(lambda: node.sdo.upload(P1121, 0)) == 0x08000000


def test_a_configuration_counts_as_saved_as_it_is():
    """Loading at power-on leaves a setting alone that single precision cannot hold."""
    config = ProfidriveConfig.reference(ramp_down_s=0.1)
    scheduler = VirtualScheduler()
    drive = ProfidriveCanDrive(
        scheduler,
        CanMedium(scheduler, name="c"),
        ProfidriveNodeConfig(drive=replace(config)),
        name="d",
    )
    drive.power_on()
    assert drive.drive.settings.ramp_down_s == 0.1

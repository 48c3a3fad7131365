"""Drives with the EDS of a vendor, devices of any EDS, stored parameters from run to run, and `hil eds`."""

from __future__ import annotations

import contextlib
import json
import math
import re
import time
from importlib.resources import files
from pathlib import Path

import can
import canopen
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from emulators.drive.cia402.objects.rules import REQUIRED
from emulators.drive.cia402.objects.table import all_objects
from fieldbus.canopen import NmtCommand, PumpedNetwork, load_dictionary
from fieldbus.canopen import eds as eds_reader
from fieldbus.canopen.abort import SdoAbort
from fieldbus.canopen.dictionary import entries_of
from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile, BenchFileError, load_bench
from hil.cli import main
from hil.faults import Injector, frame

SERVO = Path(str(files("emulators.drive.cia402"))) / "servo.eds"

STATION = """\
[DeviceInfo]
VendorName=I/O AG
BaudRate_1000=1

[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
DefaultValue=0x00030191

[1001]
ParameterName=Error register
DataType=0x0005
AccessType=ro

[1010]
ParameterName=Store
ObjectType=8
DataType=0x0007
AccessType=rw
CompactSubObj=1

[1800]
ParameterName=TPDO 1
ObjectType=9
[1800sub0]
ParameterName=Count
DataType=5
AccessType=const
DefaultValue=2
[1800sub1]
ParameterName=COB-ID
DataType=7
AccessType=rw
DefaultValue=$NODEID+0x180
[1800sub2]
ParameterName=Type
DataType=5
AccessType=rw
DefaultValue=255

[1a00]
ParameterName=TPDO 1 mapping
ObjectType=9
[1a00sub0]
ParameterName=Count
DataType=5
AccessType=rw
DefaultValue=1
[1a00sub1]
ParameterName=First
DataType=7
AccessType=rw
DefaultValue=0x60000108

[6000]
ParameterName=Inputs
ObjectType=8
DataType=5
AccessType=ro
PDOMapping=1
CompactSubObj=2

[6200]
ParameterName=Outputs
ObjectType=8
DataType=5
AccessType=rw
PDOMapping=1
HighLimit=0x3F
CompactSubObj=2
"""

HEAD = '[bench]\nname = "devices"\n\n[segment.can0]\n\n'
NODE = '[device.io]\nsegment = "can0"\nnode_id = 20\neds = "station.eds"\n'
DRIVE = '[drive.d]\nsegment = "can0"\nnode_id = 5\n'
AXIS = """
[axis.a]
drive = "d"

[axis.a.variables]
"Sensor[1].Parameter.StepsPerRevolution" = 131072
"Sensor[1].Parameter.FineResolutionXist1" = 0
"""


@pytest.fixture
def bench_file(tmp_path):
    """Write a bench file with the station's EDS next to it; return it, loaded."""

    def write(text):
        (tmp_path / "station.eds").write_text(STATION)
        path = tmp_path / "bench.toml"
        path.write_text(HEAD + text)
        return load_bench(path)

    return write


# -- a device of any EDS
# --------------------------------------------------------------------------------------


@pytest.mark.requirement("C301-013", "C301-132")
def test_node_on_a_virtual_bench(bench_file):
    """A device of its EDS boots, answers SDO with the limits of the file, keeps what is written, and sends
    its PDOs.
    """
    with bench_file(NODE).build() as bench, PumpedNetwork(bench.segment(), name="client") as network:
        io = bench.device("io")
        od = load_dictionary(bench.config.device["io"].eds, 20)
        node = network.add_node(20, od)
        assert node.sdo[0x1000].raw == 0x30191
        node.sdo[0x6200][2].raw = 0x15
        assert io.get(0x6200, 2) == 0x15
        with pytest.raises(canopen.SdoAbortedError, match="06090031"):
            node.sdo[0x6200][1].raw = 0x40
        with pytest.raises(canopen.SdoAbortedError, match="06010002"):
            node.sdo[0x6000][1].raw = 1
        with pytest.raises(canopen.SdoAbortedError, match="06020000"):
            node.sdo.upload(0x6040, 0)
        received = []
        network.subscribe(0x194, lambda _can_id, data, _time: received.append(bytes(data)))
        network.nmt.send_command(NmtCommand.START)
        bench.run_for(0.01)
        io.set(0x6000, 1, 5)
        bench.run_for(0.01)
        assert received == [b"\x00", b"\x05"]
        with pytest.raises(ConfigurationError, match="6001h:0"):
            io.set(0x6001, 0, 1)
        with pytest.raises(ConfigurationError, match="io"):
            bench.device("other")


@pytest.mark.parametrize("place", ["fault", "trigger"])
def test_messages_of_a_device_can_be_named(bench_file, place):
    """Frame faults and triggers know the messages of a device by name; a name that nothing has is refused
    with those that are.
    """
    with bench_file(NODE).build() as bench:
        faults = Injector(bench)

        def drop(drive: str):
            if place == "fault":
                return faults.inject("frame.drop", message="sdo_tx", drive=drive)
            return faults.inject("frame.drop", can_id=0x594, trigger=frame(message="sdo_tx", drive=drive))

        armed = drop("io")
        with PumpedNetwork(bench.segment()) as network:
            node = network.add_node(20, canopen.ObjectDictionary())
            with pytest.raises(canopen.SdoCommunicationError):
                node.sdo.upload(0x1000, 0)
        assert armed.applied_ns is not None
        with pytest.raises(ConfigurationError, match="'ghost' is not allowed; allowed: io"):
            drop("ghost")


def test_node_next_to_a_drive_changes_nothing_for_the_axis(bench_file):
    """A bench with drive, axis and node comes up, and its decoder knows the node's name."""
    with bench_file(DRIVE + NODE + AXIS).build() as bench:
        assert (bench.drive_names, bench.device_names) == (("d",), ("io",))
        bench.device().stop_heartbeat(True)
        assert bench.axis().communication_ok
        frames = {frame.can_id for _, _, frame, _ in bench.segment().log}
        assert 0x714 in frames


def test_node_in_a_drive_process(bench_file):
    """`hil emulate` brings nodes as well: the host answers an SDO request on a python-can bus."""
    from hil.bench.drive_host import DriveHost
    from hil.bench.remote_calls import RemoteError

    channel = "devices of a bench"
    host = DriveHost(
        bench_file(NODE).config, place={"interface": "virtual", "channel": channel}, record=False
    )
    try:
        with can.Bus(interface="virtual", channel=channel) as bus:
            assert host.run_until(lambda: host.booted, 5.0)
            bus.send(can.Message(arbitration_id=0x614, data=b"\x40\0\x10\0\0\0\0\0", is_extended_id=False))
            answers = []
            deadline = time.monotonic() + 5.0
            while not answers and time.monotonic() < deadline:
                host.run_until(lambda: False, 0.01)
                message = bus.recv(0)
                while message is not None:
                    if message.arbitration_id == 0x594:
                        answers.append(bytes(message.data))
                    message = bus.recv(0)
            assert answers == [b"\x43\0\x10\0\x91\x01\x03\0"]
        host.execute({"call": "stop_heartbeat", "drive": "io", "args": [True]})
        with pytest.raises(RemoteError, match="jam"):
            host.execute({"call": "jam", "drive": "io", "args": [True]})
    finally:
        host.close()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "needs at least one"),
        (NODE.replace("can0", "can9"), "device.io.segment: 'can9'"),
        (NODE.replace("20", "5") + DRIVE, "device.io.node_id: 5 is already taken by drive.d"),
        (NODE + DRIVE.replace("drive.d", "drive.io"), "device.io: a drive has this name"),
        (
            NODE + 'storage = "m"\n' + DRIVE + 'storage = "m"\n',
            "device.io.storage: .* already the file of drive.d",
        ),
        (NODE.replace("node_id = 20", "node_id = 0"), "device.io.node_id: 0"),
        (
            NODE.replace("eds =", "edz ="),
            "device.io.edz: unknown key; did you mean eds\\? allowed: segment, node_id, eds, storage",
        ),
        ('[device.io]\nsegment = "can0"\nnode_id = 2\n', "device.io.eds: the key is missing"),
        ("[device.io]\nsegment = 1\nnode_id = 2\neds = 3\n", "device.io.eds: 3"),
    ],
)
def test_mistakes_in_the_bench_file(bench_file, text, message):
    """Every mistake about nodes and memories is named with its key."""
    with pytest.raises(BenchFileError, match=message):
        bench_file(text)


def test_files_that_are_not_there(bench_file):
    """An EDS that does not exist is named with bench file and device when the bench is built."""
    file = bench_file(NODE.replace("station", "none"))
    with pytest.raises(
        ConfigurationError, match=r"bench\.toml: device\.io: eds: .*none\.eds' cannot be read"
    ):
        file.build()


def test_digest_of_a_bench_covers_its_eds_files(bench_file, tmp_path):
    """A replay token is for this bench file and these EDS files."""
    before = bench_file(NODE).digest
    assert bench_file(NODE).digest == before
    (tmp_path / "station.eds").write_text(STATION.replace("0x3F", "0x3E"))
    assert load_bench(tmp_path / "bench.toml").digest != before


@pytest.mark.parametrize("name", ["io", "d"])
def test_an_eds_is_read_once_until_it_changes(bench_file, tmp_path, monkeypatch, name):
    """Benches of one process share what they read of an EDS, and take the file again when somebody has
    changed it.
    """
    eds = tmp_path / "own.eds"
    eds.write_text(STATION if name == "io" else SERVO.read_text())
    file = bench_file(NODE.replace("station", "own") if name == "io" else DRIVE + 'eds = "own.eds"\n')

    def slave(bench):
        return (bench.device(name) if name == "io" else bench.drive(name)).slave

    file.build().close()
    read = []
    original = eds_reader.EdsFile
    monkeypatch.setattr(eds_reader, "EdsFile", lambda path: read.append(str(path)) or original(path))
    with file.build() as bench:
        assert slave(bench).store.entry(0x1001, 0).name == "Error register"
    assert str(eds) not in read
    eds.write_text(eds.read_text().replace("ParameterName=Error register", "ParameterName=Changed"))
    with file.build() as bench:
        assert slave(bench).store.entry(0x1001, 0).name == "Changed"
    assert read.count(str(eds)) == 1


# -- the drive that the user has
# ------------------------------------------------------------------------------


def vendor_eds(**changes):
    """Return the EDS of the product's drive with identity, names and some objects of a vendor."""
    text = (
        SERVO.read_text()
        .replace("Emulated servo drive CiA 402", "Vendor drive")
        .replace(
            "[1018sub1]\nParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0\n",
            "[1018sub1]\nParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x2A\n",
        )
    )
    text += (
        "\n[4711]\nParameterName=Vendor's own\nDataType=6\nAccessType=rw\nDefaultValue=0x0b\nHighLimit=20\n"
    )
    for index in changes.get("without", ()):
        sections = text.split("\n[")
        text = "\n[".join(part for part in sections if not part.lower().startswith(index.lower()))
    for old, new in changes.get("replace", ()):
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.exhaustive
@pytest.mark.parametrize("without", [(), ("60B8", "60B9", "60BA", "6502", "607E", "60F4")])
def test_drive_with_a_vendors_eds(bench_file, tmp_path, without):
    """The drive presents the vendor's identity and objects, keeps what is written to his own, and is moved by
    its axis all the same.
    """
    (tmp_path / "vendor.eds").write_bytes(vendor_eds(without=without).encode("cp1252"))
    with bench_file(DRIVE + 'eds = "vendor.eds"\n' + AXIS).build() as bench:
        slave = bench.drive().slave
        assert (slave.get(0x1018, 1), slave.get(0x1008), slave.get(0x4711)) == (0x2A, "Vendor drive", 11)
        with PumpedNetwork(bench.segment(), name="client") as network:
            node = network.add_node(5, slave.store.dictionary)
            node.sdo[0x4711].raw = 20
            with pytest.raises(canopen.SdoAbortedError, match="06090031"):
                node.sdo[0x4711].raw = 21
            for index in without:
                with pytest.raises(canopen.SdoAbortedError, match="06020000"):
                    node.sdo.upload(int(index, 16), 0)
        axis = bench.axis()
        power = axis.power(True)
        assert bench.run_until(lambda: power.Status, 2.0)
        before = bench.drive().mechanics.motor_angle
        axis.move_relative(5.0)  # half a revolution
        bench.run_for(1.0)
        assert bench.drive().mechanics.motor_angle - before == pytest.approx(math.pi, abs=0.01)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"without": ["6040"]}, "6040h.*CiA 402"),
        (
            {
                "replace": [
                    (
                        "Statusword\nObjectType=0x7\nDataType=0x0006",
                        "Statusword\nObjectType=0x7\nDataType=0x0008",
                    )
                ]
            },
            "6041h that is no whole number",
        ),
    ],
)
def test_eds_that_cannot_be_that_of_a_drive(bench_file, tmp_path, changes, message):
    """An object without which no drive can be commanded, or that is no whole number, is named."""
    (tmp_path / "vendor.eds").write_text(vendor_eds(**changes))
    with pytest.raises(ConfigurationError, match=message):
        bench_file(DRIVE + 'eds = "vendor.eds"\n').build()


def test_sign_of_a_profile_object_is_the_profiles(bench_file, tmp_path):
    """An EDS that calls the target velocity unsigned still gets a drive that can run backwards."""
    old = "[60FF]\nParameterName=Target velocity\nObjectType=0x7\nDataType=0x0004"
    (tmp_path / "vendor.eds").write_text(vendor_eds(replace=[(old, old.replace("0x0004", "0x0007"))]))
    with bench_file(DRIVE + 'eds = "vendor.eds"\n').build() as bench:
        slave = bench.drive().slave
        slave.store.write(0x60FF, 0, (-1000).to_bytes(4, "little", signed=True))
        assert slave.get(0x60FF) == -1000


MANUFACTURER = [
    *(f"{index:04X}" for index in range(0x2100, 0x210A)), "2000", "2010",
]  # fmt: skip


def with_objects(**objects):
    """Return the EDS of a vendor with these objects in place of those of the same index."""
    text = vendor_eds(without=tuple(index + end for index in objects for end in ("]", "sub")))
    return text + "".join(f"\n[{index}]\nParameterName=Vendor's\n{keys}\n" for index, keys in objects.items())


def test_manufacturer_objects_are_the_vendors(bench_file, tmp_path):
    """What the product has between 2000h and 5FFFh means something else to a vendor: his objects are read and
    written as his EDS says, whatever their type, and the drive goes on without them.
    """
    kinds = [
        ("5", "7"),
        ("6", "500"),
        ("7", "70000"),
        ("3", "-5"),
        ("8", "1.5"),
        ("9", "abc"),
        ("0xA", "0102"),
    ]
    chosen = {index: kinds[at % len(kinds)] for at, index in enumerate(MANUFACTURER)}
    (tmp_path / "vendor.eds").write_text(
        with_objects(
            **{
                index: f"DataType={kind}\nAccessType=rw\nDefaultValue={default}\nPDOMapping=1"
                for index, (kind, default) in chosen.items()
            }
        )
    )
    with bench_file(DRIVE + 'eds = "vendor.eds"\n').build() as bench:
        drive = bench.drive()
        drive.raise_fault(0x2310)
        bench.run_for(0.1)
        faults = drive.faults.log.packed(0)
        with PumpedNetwork(bench.segment(), name="client") as network:
            sdo = network.add_node(5, drive.slave.store.dictionary).sdo
            for index, (_kind, default) in chosen.items():
                thing = sdo[int(index, 16)]
                assert str(thing.raw) in {default, str(bytes.fromhex("0102"))}, index
                content = b"\x01" * len(thing.data)
                thing.data = content
                assert thing.data == content, index
            sdo[0x2101].raw = 1  # would clear the history, were it the product's 2107h
        assert faults
        assert drive.faults.log.packed(0) == faults


@pytest.mark.exhaustive
@settings(max_examples=40, deadline=None)
@example(changes={"608F": (1, "8")}, content=b"")
@example(changes={"608F": (5, "8"), "6092": (2, "8"), "6076": (1, "7")}, content=b"\x01")
@given(
    changes=st.dictionaries(
        st.sampled_from(
            [f"{row.index:04X}" for row in all_objects() if row.index >= 0x2000 and row.index not in REQUIRED]
        ),
        st.tuples(
            st.sampled_from([1, 2, 3, 4, 5, 6, 7, 8, 9, 0xA, 0xB, 0xC, 0xF, 0x10, 0x11, 0x15, 0x1B]),
            st.sampled_from(["7", "7", "8", "9"]),
        ),
        min_size=1,
        max_size=12,
    ),
    content=st.binary(max_size=9),
)
def test_no_type_of_any_object_ends_the_drive(tmp_path_factory, changes, content):
    """Whatever type a file gives the objects, the drive starts, and every SDO is served or aborted."""
    objects = {}
    for index, (kind, code) in changes.items():
        keys = f"DataType={kind}\nAccessType=rw\nPDOMapping=1\nObjectType={code}"
        objects[index] = keys + ("\nCompactSubObj=3" if code != "7" else "")
    path = tmp_path_factory.mktemp("any") / "vendor.eds"
    path.write_text(with_objects(**objects))
    with BenchFile(str(path.with_name("bench.toml")), HEAD + DRIVE + 'eds = "vendor.eds"\n').build() as bench:
        bench.run_for(0.02)
        store = bench.drive().slave.store
        for index in changes:
            for sub in range(4):
                with contextlib.suppress(SdoAbort):
                    store.write(int(index, 16), sub, content)
                with contextlib.suppress(SdoAbort):
                    store.read(int(index, 16), sub)
        bench.run_for(0.02)


@pytest.mark.requirement("C301-140")
@pytest.mark.parametrize("section", [DRIVE, NODE])
def test_stored_parameters_from_run_to_run(bench_file, tmp_path, section):
    """What one bench has stored, the next one on the same file begins with."""
    file = bench_file(section + 'storage = "memory.json"\n')
    index, node_id = (0x6083, 5) if section is DRIVE else (0x6200, 20)
    sub = 0 if section is DRIVE else 1
    for expected in (None, 33):
        with file.build() as bench, PumpedNetwork(bench.segment(), name="client") as network:
            slave = (bench.drive() if section is DRIVE else bench.device()).slave
            node = network.add_node(node_id, slave.store.dictionary)
            if expected is None:
                node.sdo.download(index, sub, (33).to_bytes(slave.store.entry(index, sub).size, "little"))
                node.sdo.download(0x1010, 1, b"save")
            else:
                assert slave.get(index, sub) == expected
    assert (tmp_path / "memory.json").exists()


# -- hil eds
# --------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
def test_eds_of_the_reference_drive(capsys, tmp_path):
    """`hil eds` writes an EDS that the library reads, with the defaults that the bench file gives the
    drive.
    """
    assert main(["eds", "reference"]) == 0
    path = tmp_path / "drive.eds"
    path.write_text(capsys.readouterr().out)
    entries = entries_of(canopen.import_od(str(path), 7), 7)
    assert len(entries) == len(entries_of(load_dictionary(SERVO), 7))
    assert entries[0x608000].default == 3000
    assert entries[0x140001].default == 0x207


def test_dcf_of_a_node(bench_file, tmp_path, capsys):
    """`hil eds --dcf -o FILE` writes a DCF with node-ID, bit rate and stored values."""
    file = bench_file(NODE + 'storage = "memory.json"\n')
    with file.build() as bench:
        bench.device().set(0x6200, 1, 7)
        bench.device().slave.store.write(0x1010, 1, b"save")
    path = tmp_path / "io.dcf"
    assert main(["eds", file.source, "io", "--dcf", "-o", str(path)]) == 0
    assert capsys.readouterr().out == ""
    od = load_dictionary(path)
    assert (od.node_id, od.bitrate, od[0x6200][1].value) == (20, 1_000_000, 7)
    assert "FileName=io.dcf" in path.read_text()


@pytest.mark.exhaustive
def test_eds_of_an_encoder(bench_file, tmp_path):
    """Encoders of their own have an EDS too, on the machine of a drive as on a shaft of their own."""
    file = bench_file(DRIVE + '[encoder.e]\nsegment = "can0"\nnode_id = 9\non = "d"\n')
    path = tmp_path / "e.dcf"
    assert main(["eds", file.source, "e", "--dcf", "-o", str(path)]) == 0
    od = load_dictionary(path)
    assert (od.node_id, od[0x1000].default & 0xFFFF) == (9, 406)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none"], "'none' is no emulated CANopen device.* there are: io"),
        (["io", "-o", "/nowhere/io.eds"], "cannot be written"),
    ],
)
def test_eds_says_what_is_wrong(bench_file, capsys, arguments, message):
    """An unknown device and a file that cannot be written end with code 2 and a message."""
    file = bench_file(NODE)
    assert main(["eds", file.source, *arguments]) == 2
    assert re.search(message, capsys.readouterr().err)


def test_bench_files_from_text_are_anchored_at_their_source(tmp_path):
    """Names of files are relative to the bench file, absolute ones stay."""
    config = BenchFile(str(tmp_path / "b.toml"), HEAD + NODE + f'storage = "{tmp_path}/m.json"\n').config
    assert config.device["io"].eds == str(tmp_path / "station.eds")
    assert config.device["io"].storage == f"{tmp_path}/m.json"


def test_eds_of_a_bench_without_canopen(capsys):
    """A bench whose drives are all on Modbus has nothing to write, and a sentence says so."""
    assert main(["eds", "profidrive_tcp"]) == 2
    assert "has no emulated CANopen device" in capsys.readouterr().err


# -- defaults and units of a vendor's EDS
# ----------------------------------------------------------------------------------


def section(index, name, kind, default=None, *more):
    """Return a section of an object or sub-object."""
    lines = [
        f"[{index}]",
        f"ParameterName={name}",
        f"DataType={kind}",
        "AccessType=rw",
        "PDOMapping=1",
        *more,
    ]
    return "\n".join([*lines, *([] if default is None else [f"DefaultValue={default}"])]) + "\n\n"


def record(index, name, *members):
    """Return the sections of a record of U32."""
    text = f"[{index}]\nParameterName={name}\nObjectType=9\n\n" + section(
        f"{index}sub0", "Count", 5, len(members)
    )
    return text + "".join(
        section(f"{index}sub{sub}", f"{name} {sub}", 7, value) for sub, value in enumerate(members, 1)
    )


RPM_DRIVE = (
    "[DeviceInfo]\nVendorName=Rpm AG\n\n"
    + section("1000", "Device type", 7)
    + section("1001", "Error register", 5)
    + record("1018", "Identity", 0x2A, 1, 1, 1)
    + section("6040", "Controlword", 6)
    + section("6041", "Statusword", 6)
    + section("6060", "Mode", 2)
    + section("6061", "Mode display", 2)
    + section("606C", "Velocity actual value", 4)
    + section("6076", "Rated torque", 7, 500)
    + section("607F", "Max profile velocity", 7, 4500, "HighLimit=5000")
    + section("6080", "Max motor speed", 7, 5000)
    + section("6083", "Profile acceleration", 7, 1111)
    + section("6084", "Profile deceleration", 7, 9000)
    + section("6085", "Quick stop deceleration", 7, 18000)
    + record("608F", "Encoder", 20000, 5)
    + record("6091", "Gear", None, None)
    + record("6099", "Homing speeds", 70, 7)
    + section("609A", "Homing acceleration", 7, 50, "LowLimit=1", "HighLimit=32000")
    + section("60A9", "Velocity unit", 7, "0x00B44700")
    + section("60C5", "Max acceleration", 7, 30000)
    + section("60C6", "Max deceleration", 7, 0)
    + section("60FF", "Target velocity", 4)
)
"""EDS of a drive whose velocities are in rpm."""
SAYS = {
    (0x1000, 0): 0x00020192, (0x6076, 0): 500, (0x607F, 0): 4500, (0x6080, 0): 5000, (0x6083, 0): 1111,
    (0x6084, 0): 9000, (0x6085, 0): 18000, (0x608F, 1): 20000, (0x608F, 2): 5, (0x6091, 1): 1, (0x6091, 2): 1,
    (0x6099, 1): 70, (0x6099, 2): 7, (0x609A, 0): 50, (0x60A9, 0): 0x00B44700, (0x60C5, 0): 30000,
}  # fmt: skip


@pytest.fixture
def rpm_drive(bench_file, tmp_path):
    """Return a bench file with the drive whose velocities are in rpm, and further keys."""
    (tmp_path / "rpm.eds").write_text(RPM_DRIVE)
    return lambda keys="": bench_file(DRIVE + 'eds = "rpm.eds"\n' + keys)


def test_defaults_of_the_eds_count(rpm_drive):
    """What the bench file does not say is as in the EDS, on the bus and in the bench. What the EDS leaves
    open, or sets to a 0 with which no drive would move, has the default of the bench.
    """
    file = rpm_drive()
    drive = file.config.drive["d"]
    assert (drive.increments_per_revolution, drive.rated_torque_nm) == (4000, 0.5)
    assert (drive.max_speed_rpm, drive.off1_ramp_s, drive.off3_ramp_s) == (4500, 0.5, 0.25)
    with file.build() as bench:
        slave = bench.drive().slave
        assert {key: slave.get(*key) for key in SAYS} == SAYS
        assert slave.get(0x60C6) > 0
        assert bench.drive().encoder.counts_per_revolution == 4000


def test_a_master_that_works_from_the_eds_gets_the_speed_it_commands(rpm_drive):
    """60FFh = 600 in profile velocity are 600 rpm, and 606Ch says so."""
    with rpm_drive().build() as bench:
        drive = bench.drive()
        slave = drive.slave
        slave.store.write(0x6060, 0, b"\x03")
        for word in (0x06, 0x07, 0x0F):
            slave.store.write(0x6040, 0, word.to_bytes(2, "little"))
            bench.run_for(0.05)
        slave.store.write(0x60FF, 0, (600).to_bytes(4, "little"))
        bench.run_for(2.0)
        assert drive.core.velocity == pytest.approx(600 * math.tau / 60.0, rel=1e-3)
        assert slave.get(0x606C) == 0 or abs(int.from_bytes(slave.store.read(0x606C, 0), "little") - 600) <= 1


def test_keys_of_the_bench_file_go_before_the_eds(rpm_drive):
    """A key that is written changes the objects that it stands for, in the units of the EDS, no others."""
    with rpm_drive("max_speed_rpm = 3000\noff3_ramp_s = 1.0\nrated_torque_nm = 1.5\n").build() as bench:
        slave = bench.drive().slave
        changed = {(0x607F, 0): 3000, (0x6080, 0): 3000, (0x6085, 0): 3000, (0x6076, 0): 1500}
        changed |= {(0x6099, 1): 200, (0x6099, 2): 20}
        assert {key: slave.get(*key) for key in SAYS} == SAYS | changed


def test_a_key_beyond_the_limits_of_the_eds_is_refused(rpm_drive):
    """A speed that the EDS does not allow is named with its object and the limits."""
    with pytest.raises(BenchFileError, match=r"max_speed_rpm.*6000.*0 to 5000 in 607Fh:0"):
        rpm_drive("max_speed_rpm = 6000\n")


def test_a_changed_velocity_unit_changes_numbers_and_no_limits(rpm_drive):
    """A master that sets 60A9h finds the same speeds and ramps in the new unit."""
    with rpm_drive().build() as bench:
        slave = bench.drive().slave
        slave.store.write(0x60A9, 0, (0xFDB44700).to_bytes(4, "little"))  # 10^-3 rpm
        assert (slave.get(0x607F), slave.get(0x6084), slave.get(0x6099, 2)) == (4_500_000, 9_000_000, 7000)


@pytest.mark.parametrize(("exponent", "unit", "rpm"), [(0, 0xA4, 1.0), (0xFD, 0xA4, 1e-3), (0, 0xA3, 60.0)])
def test_velocity_units_of_older_drives(bench_file, tmp_path, exponent, unit, rpm):
    """Without 60A9h the unit is that of 608Bh and 608Ch."""
    older = RPM_DRIVE.replace("[60A9]\nParameterName=Velocity unit", "[60A8]\nParameterName=Position unit")
    older += section("608B", "Notation index", 2, exponent) + section("608C", "Dimension index", 5, unit)
    (tmp_path / "older.eds").write_text(older)
    drive = bench_file(DRIVE + 'eds = "older.eds"\n').config.drive["d"]
    assert drive.max_speed_rpm == pytest.approx(min(5000, 4500 * rpm))


def test_export_and_reload_change_nothing(rpm_drive, tmp_path, capsys):
    """The exported EDS has the same defaults, and none where the file has none."""
    rpm_drive()
    assert main(["eds", str(tmp_path / "bench.toml"), "--output", str(tmp_path / "again.eds")]) == 0
    first, second = (entries_of(load_dictionary(tmp_path / name), 5) for name in ("rpm.eds", "again.eds"))
    assert list(first) == list(second)
    left_open = {0x100000, 0x60C600, 0x609101, 0x609102}  # the bench gives these a value
    differing = {
        key
        for key in first
        if (first[key].default, first[key].given) != (second[key].default, second[key].given)
    }
    assert differing <= left_open
    assert not second[0x604000].given


# -- hil eds FILE...
# ----------------------------------------------------------------------------------


def look(capsys, *names):
    """Return exit code and JSON of `hil eds NAMES --json`."""
    code = main(["eds", *map(str, names), "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_a_good_file_is_commissioned_and_moved(capsys):
    """The EDS of the product has no finding, and the drive works."""
    code, found = look(capsys, SERVO)
    assert code == 0
    assert (found["readable"], found["good"], found["drives"], found["working"]) == (1, 1, 1, 1)
    assert found["files"][0]["drive"] == "as a drive: commissioned, enabled and moved"


def test_what_is_wrong_with_a_file_is_said(tmp_path, capsys):
    """Files of a folder: one that cannot be read, one that lacks and contradicts, one that is no drive."""
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "broken.EDS").write_text(RPM_DRIVE.replace("DefaultValue=500", "DefaultValue=five"))
    (tmp_path / "station.eds").write_text(STATION)
    wrong = RPM_DRIVE.replace("DefaultValue=50\n", "DefaultValue=0\n") + section("6502", "Modes", 7, "0x81")
    wrong += record("1800", "TPDO", 0x185, 1) + record("1A00", "Mapping", "0x60410010", "0x60FF0010")
    wrong += record("1401", "RPDO", 0x305, 1)
    (tmp_path / "wrong.eds").write_text(wrong)
    code, found = look(capsys, tmp_path)
    assert code == 1
    broken, station, lacking = found["files"]
    assert "[6076] DefaultValue: 'five'" in broken["refused"]
    assert (station["good"], station["drive"]) == (True, "")
    assert lacking["missing"] == [
        "607Ah, 6081h, which mode pp (6502h bit 0) needs",
        "607Ah, 6064h, 60C2h, which mode csp (6502h bit 7) needs",
    ]
    assert [text.partition(":")[0] for text in lacking["contradictions"]] == ["609Ah", "RPDO2", "TPDO1"]
    assert not lacking["works"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.eds"], "nothing.eds: no such file"),
        (["empty"], "no EDS or DCF"),
        (["a.eds", "--dcf"], "--dcf"),
        (["reference", "--json"], "--json"),
        (["reference", "one", "two"], "one device"),
    ],
)
def test_eds_arguments_that_do_not_fit(tmp_path, monkeypatch, capsys, arguments, message):
    """What cannot be looked at, or written, is named."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.eds").write_text(RPM_DRIVE)
    assert main(["eds", *arguments]) == 2
    assert message in capsys.readouterr().err

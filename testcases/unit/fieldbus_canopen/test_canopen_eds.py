"""EDS and DCF files as vendors write them, and the ones that a device writes of itself."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import canopen
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.can import CanMedium
from fieldbus.canopen import CanopenSlave, PumpedNetwork, load_dictionary
from fieldbus.canopen.dictionary import entries_of
from fieldbus.canopen.eds_export import device_eds
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.errors import ConfigurationError
from testcases.campaigns._eds_forms import HEAD, variable

pytestmark = pytest.mark.exhaustive

SERVO = Path(str(files("emulators.drive.cia402"))) / "servo.eds"


@pytest.fixture
def load(tmp_path):
    """Write a file with these sections behind a minimal head; return the entries for node 5."""

    def load(text, *, ending="eds", encoding="utf-8", node_id=5):
        path = tmp_path / f"device.{ending}"
        path.write_bytes((HEAD + text).encode(encoding))
        return entries_of(load_dictionary(path, node_id), 5)

    return load


# -- what is understood
# ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["servo", "test drive"])
@pytest.mark.parametrize("node_id", [None, 7])
def test_same_dictionary_as_the_library(kit, tmp_path, name, node_id):
    """Files that the library reads completely give the same entries with ours, field by field."""
    path = SERVO
    if name != "servo":
        path = tmp_path / "drive.eds"
        path.write_text(kit.eds_text())
    ours, theirs = load_dictionary(path, node_id), canopen.import_od(str(path), node_id)
    assert list(ours.indices) == list(theirs.indices)
    first, second = entries_of(ours, 9), entries_of(theirs, 9)
    assert list(first) == list(second)
    for key, entry in first.items():
        for field in set(entry.__slots__) - {"storable"}:  # by ObjFlags, which the library does not read
            assert getattr(entry, field) == getattr(second[key], field), (f"{key:06X}", field)
    for field in set(vars(ours.device_information)) - {"granularity"}:  # a number, not a truth value
        assert getattr(ours.device_information, field) == getattr(theirs.device_information, field), field


def test_manufacturer_type_by_its_definition(load):
    """A data type of the manufacturer's own stands for the type that its definition names."""
    text = (
        variable(DataType="0x00A0", DefaultValue="7")
        + "\n[A0sub1]\nParameterName=Type\nDefaultValue=0x0005\n"
    )
    assert load(text)[0x200000].data_type == 0x05


@pytest.mark.requirement("C301-098", "C301-099")
def test_limits_of_reals_are_enforced(kit, tmp_path):
    """A REAL32 beyond its limits is refused over SDO as an integer is."""
    path = tmp_path / "drive.eds"
    path.write_text(HEAD + variable(DataType="0x0008", LowLimit="-1.5", HighLimit="2.5"))
    bench = kit.Bench(load_dictionary(path))
    bench.slave.power_on()
    bench.run()
    with PumpedNetwork(bench.segment) as network:
        sdo = network.add_node(kit.NODE, bench.slave.store.dictionary).sdo
        for value, code in ((2.75, 0x06090031), (-1.75, 0x06090032)):
            with pytest.raises(canopen.SdoAbortedError) as caught:
                sdo[0x2000].raw = value
            assert caught.value.code == code
        sdo[0x2000].raw = 2.25
    assert bench.slave.get(0x2000) == 2.25


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_encodings(load, encoding):
    """Names with umlauts arrive whatever the tool has written."""
    entries = load(
        variable(ParameterName="Größe in µm", DataType="0x0009", DefaultValue="für"), encoding=encoding
    )
    assert (entries[0x200000].name, entries[0x200000].default) == ("Größe in µm", "für")


def test_case_and_layout(load):
    """Case of keys, sections and hexadecimal digits, blanks, comments and Windows line ends do not matter."""
    text = (
        "\r\n; comment\r\n[ 20aB ]  ; object\r\n  parametername = Record\r\nOBJECTTYPE=9\r\nsubnumber=2\r\n"
        "[20ABSUB0]\r\nParameterName=Count\r\nDataType=5\r\nAccessType=RO\r\nDefaultValue=1\r\n"
        "# comment\r\n[20absub01]\r\nParameterName=Member\r\nDataType=0X0006\r\nACCESSTYPE=Rw\r\ndefaultvalue=0xfF\r\n"  # noqa: E501
    )
    entries = load(text)
    assert (entries[0x20AB00].default, entries[0x20AB01].default) == (1, 255)
    assert entries[0x20AB01].writable
    assert not entries[0x20AB00].writable


def test_compact_arrays_with_names_and_values(load):
    """An array in compact form gets all elements, with the names and values that the file lists."""
    text = variable(ObjectType="8", CompactSubObj="0x3", DefaultValue="7", ParameterName="Compact")
    text += "\n[2000Name]\nNrOfEntries=1\n2=Second\n\n[2000Value]\nNrOfEntries=1\n3=0x20\n"
    entries = load(text)
    assert [entries[0x200000 | sub].default for sub in range(4)] == [3, 7, 7, 32]
    assert entries[0x200002].name == "Compact: Second"
    assert 0x200004 not in entries


def test_domain_objects(load):
    """An object of type 2 is a domain, whether it says its data type or not."""
    entries = load(
        variable(ObjectType="2", DataType=None, AccessType=None) + variable("2001", ObjectType="2")
    )
    assert entries[0x200000].data_type == 0x0F
    assert entries[0x200000].maximum_length >= 1 << 20


def test_definitions_and_null_objects_are_no_entries(load):
    """Objects that define a type or are there in name only are left out."""
    entries = load(
        variable(ObjectType="0") + variable("2001", ObjectType="5") + variable("2002", ObjectType="6")
    )
    assert list(entries) == [0x100000]


def test_dcf_commissioning(load, tmp_path):
    """A DCF brings node-ID, bit rate and parameter values, which go before the defaults."""
    text = "[DeviceComissioning]\nNodeID=0x11\nBaudrate=250\n" + variable(
        DataType="7", DefaultValue="$NODEID+0x100", ParameterValue="$NODEID+0x300"
    )
    assert load(text, ending="dcf", node_id=None)[0x200000].default == 0x305
    od = load_dictionary(tmp_path / "device.dcf")
    assert (od.node_id, od.bitrate, od[0x2000].value, od[0x2000].default) == (17, 250_000, 0x311, 0x111)


def test_device_information(load, tmp_path):
    """Names, numbers and bit rates of the device are those of the file."""
    load("")
    path = tmp_path / "device.eds"
    path.write_text(
        HEAD.replace(
            "VendorName=x", "vendorname=Motor AG\nProductNumber=0x10\nBaudRate_500=1\nLSS_SUPPORTED=0"
        )
    )
    device = load_dictionary(path).device_information
    assert (device.vendor_name, device.product_number, device.allowed_baudrates) == (
        "Motor AG",
        16,
        {500_000},
    )
    assert device.LSS_supported is False


def refusal(path, otherwise):
    """Return the message with which a file is refused, or `otherwise` if it is read."""
    try:
        load_dictionary(path)
    except ConfigurationError as error:
        return str(error)
    return otherwise


@given(
    content=st.one_of(
        st.binary(max_size=200), st.text(alphabet="[]=;0x12ab\n\r $NODEIDsubProductNamevalue", max_size=200)
    )
)
def test_any_content_is_read_or_refused(tmp_path_factory, content):
    """No content whatever leads to anything but a dictionary or a ConfigurationError."""
    path = tmp_path_factory.getbasetemp() / "any.eds"
    path.write_bytes(content if isinstance(content, bytes) else (HEAD + content).encode())
    assert "any.eds" in refusal(path, "any.eds")


@given(
    place=st.integers(0, 20_000), what=st.sampled_from(["", "0", "x", "=", "[", "]", "\n", ";", "$", "\xff"])
)
def test_any_change_of_a_file_is_read_or_refused(tmp_path_factory, place, what):
    """A character replaced anywhere in a real file leads to a dictionary or to a named mistake."""
    text = SERVO.read_text()
    place %= len(text)
    path = tmp_path_factory.getbasetemp() / "changed.eds"
    path.write_text(text[:place] + what + text[place + 1 :], encoding="utf-8")
    assert "changed.eds" in refusal(path, "changed.eds")


# -- what a device writes of itself
# ---------------------------------------------------------------------------

FIELDS = (
    "name",
    "data_type",
    "readable",
    "writable",
    "maps_receive",
    "maps_transmit",
    "low",
    "high",
    "base",
    "storable",
)


def slave_of(od, node_id=5, **options):
    scheduler = VirtualScheduler()
    slave = CanopenSlave(scheduler, CanMedium(scheduler), od, node_id, name="drive1", **options)
    slave.power_on()
    scheduler.run_for(5 * MS)
    return slave


def assert_same(first, second, *, node_id=5, library=False):
    assert list(first) == list(second)
    fields = {*FIELDS, "default"} - ({"storable"} if library else set())
    for key, entry in first.items():
        for field in fields:
            assert getattr(entry, field) == getattr(second[key], field), (f"{key:06X}", field)
        assert (entry.default == entry.base + node_id) if entry.base is not None else True


@pytest.mark.parametrize("reader", [canopen.import_od, load_dictionary])
@pytest.mark.parametrize("name", ["servo", "test drive"])
def test_eds_of_a_device_reads_back_the_same(kit, tmp_path, reader, name):
    """The EDS that a device writes gives the same entries again, with the library's reader as with ours, for
    any node-ID.
    """
    od = load_dictionary(SERVO) if name == "servo" else kit.dictionary()
    slave = slave_of(od)
    path = tmp_path / "drive1.eds"
    path.write_text(device_eds(slave), encoding="utf-8")
    again = entries_of(reader(str(path), 5), 5)
    assert_same(again, slave.store.entries, library=reader is canopen.import_od)
    assert {key: entry.default for key, entry in entries_of(reader(str(path), None), 77).items()} == {
        key: entry.default for key, entry in slave_of(od, 77).store.entries.items()
    }


@pytest.mark.parametrize("reader", [canopen.import_od, load_dictionary])
def test_dcf_of_a_device_brings_its_configuration(kit, tmp_path, reader):
    """The DCF has node-ID, bit rate and present values; a device made of it begins with them."""
    slave = slave_of(kit.dictionary(), bitrate=500_000)
    values = {
        (0x2000, 0): 4,
        (0x2001, 0): "axis one",
        (0x2004, 0): 1,
        (0x2006, 0): -5,
        (0x2007, 0): -(1 << 60),
        (0x2008, 0): 0.25,
        (0x200B, 0): b"\x01\xff",
        (0x607D, 1): -100,
        (0x6083, 0): 77,
        (0x1017, 0): 250,
        (0x1400, 1): 0x80000225,
        (0x1600, 0): 0,
    }
    for (index, sub), value in values.items():
        slave.values[index << 8 | sub] = value
    path = tmp_path / "drive1.dcf"
    path.write_text(device_eds(slave, dcf=True), encoding="utf-8")
    od = reader(str(path))
    assert (od.node_id, od.bitrate) == (5, 500_000)
    again = slave_of(od)
    for (index, sub), value in values.items():
        assert again.get(index, sub) == value, f"{index:04X}:{sub}"
    changed = {
        key for key in slave.values if key in slave.store.entries and slave.values[key] != again.values[key]
    }
    assert changed == set()


def test_dcf_configures_a_device_over_the_bus(kit, tmp_path):
    """The library writes the DCF of one device into another, which has the same configuration then."""
    od = kit.dictionary()
    del od[0x2009]  # its limits allow no value
    slave = slave_of(od)
    slave.values[0x608300] = 77
    slave.values[0x101700] = 250
    path = tmp_path / "drive1.dcf"
    path.write_text(device_eds(slave, dcf=True))
    bench = kit.Bench()
    bench.slave.power_on()
    bench.run()
    with PumpedNetwork(bench.segment) as network:
        node = network.add_node(kit.NODE, canopen.import_od(str(path)))
        node.load_configuration()
    assert (bench.slave.get(0x6083), bench.slave.get(0x1017)) == (77, 250)


def test_commands_and_states_are_no_configuration(kit):
    """1010h, 1011h, the error history and read-only values have no ParameterValue: writing them back would
    act, or fail.
    """
    text = device_eds(slave_of(kit.dictionary()), dcf=True)
    sections = {part.partition("]")[0]: part for part in text.split("\n[")}
    for section in ("1001", "1003sub0", "1010sub1", "1011sub1", "6041", "1018sub1", "1008"):
        assert "ParameterValue" not in sections[section], section
    assert "ParameterValue=1000" in sections["6083"].replace("0x3E8", "1000")


@given(
    text=st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=255), max_size=30),
    real=st.floats(allow_nan=False, width=32),
    number=st.integers(-(1 << 63), (1 << 63) - 1),
    octets=st.binary(max_size=20),
)
def test_any_value_survives_a_dcf(kit, tmp_path_factory, text, real, number, octets):
    """Every value of the DCF reads back as it was; a text that a line cannot carry is refused with its
    object.
    """
    slave = slave_of(kit.dictionary())
    slave.values.update({0x200100: text, 0x200800: real, 0x200700: number, 0x200B00: octets})
    path = tmp_path_factory.getbasetemp() / "any.dcf"
    if text != text.strip() or not text.isprintable() or " ;" in text or text.startswith(";"):
        with pytest.raises(ConfigurationError, match="2001h"):
            device_eds(slave, dcf=True)
        return
    path.write_text(device_eds(slave, dcf=True), encoding="utf-8")
    again = entries_of(load_dictionary(path), 5)
    assert [again[key].default for key in (0x200100, 0x200800, 0x200700, 0x200B00)] == [
        text,
        real,
        number,
        octets,
    ]

"""Dictionary, defaults, and non-volatile memory of the slave."""

from __future__ import annotations

import pytest
from canopen.objectdictionary import ODVariable, datatypes

from fieldbus.canopen import AbortCode, NmtCommand, SdoAbort, load_dictionary
from fieldbus.canopen.dictionary import BOOLEAN, INTEGERS, entries_of
from fieldbus.errors import ConfigurationError

SAVE = 0x65766173
LOAD = 0x64616F6C


@pytest.mark.requirement("C301-003", "C301-005", "C301-009")
@pytest.mark.parametrize("read_for", [None, 5, 77])
def test_defaults_relative_to_the_node_id(kit, read_for):
    """$NODEID in a default means the node that the table is made for, whatever node the file was read for."""
    entries = entries_of(kit.dictionary(read_for), 5)
    assert entries[0x101400].default == 0x85
    assert entries[0x140001].default == 0x205
    assert entries[0x180101].default == 0x40000285


def test_signed_defaults_in_hexadecimal(kit):
    """80000000h as default of an INTEGER32 is the smallest number, not a large positive one."""
    entries = entries_of(kit.dictionary(), 5)
    assert (entries[0x607D01].default, entries[0x607D02].default) == (-(1 << 31), (1 << 31) - 1)


def test_identifier_without_default(kit):
    """A COB-ID without a default in the EDS gets that of the predefined connection set, never 0."""
    od = kit.dictionary()
    for index, sub in ((0x1014, 0), (0x1005, 0), (0x1800, 1), (0x1404, 1)):
        variable = od.get_variable(index, sub)
        variable.default = None
        variable.default_raw = None
    bench = kit.Bench(od)
    slave = bench.slave
    assert [slave.get(0x1014), slave.get(0x1005), slave.get(0x1800, 1), slave.get(0x1404, 1)] == [
        0x85,
        0x80,
        0x40000185,
        0x80000000,
    ]


def test_parameter_values_of_a_dcf_win(kit):
    """ParameterValue of a DCF is taken in place of DefaultValue."""
    od = kit.dictionary()
    od[0x6083].value = 4711
    assert entries_of(od, 5)[0x608300].default == 4711


@pytest.mark.requirement("C301-014")
def test_integer_types_agree_with_the_library():
    """Length and sign of every integer type are those of the library's table."""
    for code, (bits, signed) in INTEGERS.items():
        if code == BOOLEAN:
            assert (bits, signed) == (1, False)
            continue
        assert ODVariable.STRUCT_TYPES[code].size * 8 == bits
        assert (code in datatypes.SIGNED_TYPES) == signed
        assert (code in datatypes.UNSIGNED_TYPES) != signed


@pytest.mark.requirement("C301-014")
@pytest.mark.parametrize(
    ("index", "size"),
    [(0x2004, 1), (0x6060, 1), (0x6040, 2), (0x2006, 3), (0x6083, 4), (0x2008, 4), (0x2007, 8)],
)
def test_sizes_of_types(kit, index, size):
    """Each type has its length on the bus."""
    entry = entries_of(kit.dictionary(), 5)[index << 8]
    assert len(entry.encode(entry.default)) == size
    assert entry.decode(bytes(size)) == 0


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("access", "receive", "transmit"),
    [
        ("rw", True, True),
        ("rww", True, False),
        ("rwr", False, True),
        ("ro", False, True),
        ("wo", True, False),
        ("const", False, False),
    ],
)
def test_mapping_direction_by_access(kit, access, receive, transmit):
    """The access type of the EDS says into which direction a mappable object may be mapped."""
    od = kit.dictionary()
    od[0x6040].access_type = access
    entry = entries_of(od, 5)[0x604000]
    assert (entry.maps_receive, entry.maps_transmit) == (receive, transmit)


def test_empty_dictionary_is_refused(kit):
    """A dictionary without objects is a configuration error, not an empty device."""
    import canopen

    with pytest.raises(ConfigurationError, match="1000h"):
        kit.Bench(canopen.ObjectDictionary())


def test_strings_keep_any_byte(bench):
    """A string with bytes above 7Fh comes back as it went in."""
    content = bytes(range(0x80, 0x100))[:4]
    bench.sdo(b"\x23\x01\x20\x00" + content)
    assert bench.sdo(b"\x40\x01\x20\x00\0\0\0\0")[4:] == content


# -- 1010h and 1011h
# ------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.requirement("C301-140", "C301-141")
@pytest.mark.parametrize("index", [0x1010, 0x1011])
def test_capability_and_signature(bench, index):
    """Both objects read 1; without the right signature they refuse with 08000020h, and the value stays 1."""
    assert bench.read(index, 1) == 1
    assert bench.write(index, 1, 0x12345678, 4) == AbortCode.CANNOT_STORE
    signature = SAVE if index == 0x1010 else LOAD
    assert bench.write(index, 1, signature, 4) == 0
    assert bench.read(index, 1) == 1


@pytest.mark.requirement("C301-140")
@pytest.mark.parametrize(
    ("group", "communication", "application"),
    [(1, 500, 77), (2, 500, 1000), (3, 0, 77)],
)
def test_stored_groups_survive_power_off(bench, group, communication, application):
    """Sub-index 1 saves everything, 2 the communication objects, 3 the application's."""
    bench.write(0x1017, 0, 500, 2)
    bench.write(0x6083, 0, 77, 4)
    bench.write(0x2000, 0, 5, 2)
    assert bench.write(0x1010, group, SAVE, 4) == 0
    bench.write(0x1017, 0, 900, 2)
    bench.slave.power_off()
    bench.run()
    bench.slave.power_on()
    bench.run()
    assert (bench.read(0x1017), bench.read(0x6083)) == (communication, application)
    assert bench.read(0x2000) == (3 if group == 2 else 5)


@pytest.mark.requirement("C301-018", "C301-140")
def test_stored_mapping_is_in_force_after_reset(bench):
    """A stored PDO mapping is the one that the node uses after reset communication."""
    bench.map_pdo(1, [0x60600008], 255, transmit=False, cob_id=0x225)
    bench.write(0x1010, 2, SAVE, 4)
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    bench.nmt(NmtCommand.START)
    bench.send(0x225, "06")
    bench.run()
    assert bench.slave.get(0x6060) == 6


@pytest.mark.requirement("C301-141")
def test_restore_takes_effect_with_reset_node(bench):
    """1011h:1 changes nothing at once; after reset node the defaults are back, and for good."""
    bench.write(0x6083, 0, 77, 4)
    bench.write(0x1017, 0, 500, 2)
    bench.write(0x1010, 1, SAVE, 4)
    assert bench.write(0x1011, 1, LOAD, 4) == 0
    assert bench.read(0x6083) == 77
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert (bench.read(0x1017), bench.read(0x6083)) == (500, 77)
    bench.nmt(NmtCommand.RESET_NODE)
    assert (bench.read(0x1017), bench.read(0x6083)) == (0, 1000)
    bench.slave.power_off()
    bench.slave.power_on()
    bench.run()
    assert bench.read(0x6083) == 1000


@pytest.mark.requirement("C301-141")
def test_restore_communication_takes_effect_with_reset_communication(bench):
    """1011h:2 gives the communication defaults after reset communication and leaves the application's
    values.
    """
    bench.write(0x6083, 0, 77, 4)
    bench.write(0x1017, 0, 500, 2)
    bench.write(0x1010, 1, SAVE, 4)
    bench.write(0x1011, 2, LOAD, 4)
    bench.nmt(NmtCommand.RESET_COMMUNICATION)
    assert (bench.read(0x1017), bench.read(0x6083)) == (0, 77)
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6083) == 77


def test_save_after_restore_wins(bench):
    """Saving again before the reset takes the restore back."""
    bench.write(0x6083, 0, 77, 4)
    bench.write(0x1011, 1, LOAD, 4)
    bench.write(0x1010, 1, SAVE, 4)
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6083) == 77


def test_save_of_one_area_leaves_the_restore_of_the_other(bench):
    """After 1011h:1 and 1010h:3 a reset gives the communication defaults and the saved application values."""
    bench.write(0x1017, 0, 500, 2)
    bench.write(0x6083, 0, 77, 4)
    bench.write(0x1010, 1, SAVE, 4)
    bench.write(0x1011, 1, LOAD, 4)
    bench.write(0x6083, 0, 88, 4)
    bench.write(0x1010, 3, SAVE, 4)
    bench.nmt(NmtCommand.RESET_NODE)
    assert (bench.read(0x1017), bench.read(0x6083)) == (0, 88)


@pytest.mark.requirement("C301-140", "C301-141")
def test_capability_without_a_default_in_the_eds(kit):
    """1010h and 1011h read 1 although the EDS gives them no default."""
    od = kit.dictionary()
    for index in (0x1010, 0x1011):
        od[index][1].default = None
    bench = kit.Bench(od)
    assert (bench.slave.get(0x1010, 1), bench.slave.get(0x1011, 1)) == (1, 1)


@pytest.mark.requirement("C301-140")
def test_device_may_refuse_to_store(bench):
    """The device refuses storing, for example while its power stage is on, with 08000022h."""

    def refuse(_value):
        raise SdoAbort(AbortCode.DEVICE_STATE)

    bench.slave.on_write(0x1010, 1, refuse)
    bench.write(0x6083, 0, 77, 4)
    assert bench.write(0x1010, 1, SAVE, 4) == AbortCode.DEVICE_STATE
    assert bench.slave.store.stored == {}


def test_volatile_objects_are_not_saved(bench):
    """What the device names volatile, such as its controlword, is not saved."""
    bench.slave.store.volatile.add(0x604000)
    bench.write(0x6040, 0, 0x0F, 2)
    bench.write(0x1010, 1, SAVE, 4)
    bench.nmt(NmtCommand.RESET_NODE)
    assert bench.read(0x6040) == 0


@pytest.mark.requirement("C301-148")
def test_verify_configuration_is_reset_by_a_change(bench):
    """1020h falls to 0 when a parameter changes, and stays when the same value is written."""
    bench.write(0x1020, 1, 12345, 4)
    bench.write(0x1020, 2, 678, 4)
    bench.write(0x6083, 0, 1000, 4)
    assert (bench.read(0x1020, 1), bench.read(0x1020, 2)) == (12345, 678)
    bench.write(0x6083, 0, 1001, 4)
    assert (bench.read(0x1020, 1), bench.read(0x1020, 2)) == (0, 0)


# -- EDS files
# ------------------------------------------------------------------------------------------------


def test_load_dictionary(kit, tmp_path):
    """An EDS file is read; arrays in compact form are complete."""
    path = tmp_path / "drive.eds"
    path.write_text(
        kit.eds_text()
        + "\n[2100]\nParameterName=Compact\nObjectType=8\nDataType=0x0006\nAccessType=rw\nDefaultValue=7\n"
        "PDOMapping=0\nCompactSubObj=5\n"
    )
    entries = entries_of(load_dictionary(path, 5), 5)
    assert entries[0x101400].default == 0x85
    assert [entries[0x210000 | sub].default for sub in range(6)] == [5, 7, 7, 7, 7, 7]
    assert 0x210006 not in entries


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.eds", None, "cannot be read"),
        ("drive.txt", "", "ending"),
        ("broken.eds", "[1000]\nno value here\n", "well-formed"),
        (
            "broken.eds",
            "[1000]\nParameterName=x\nObjectType=7\nDataType=banana\nAccessType=ro\n",
            r"\[1000\] DataType: 'banana'",
        ),
        ("empty.eds", "[DeviceInfo]\n", "1000h"),
    ],
)
def test_unusable_files_are_named(tmp_path, name, content, message):
    """A file that is missing, of another kind or broken is refused with its name and the reason."""
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigurationError, match=message) as caught:
        load_dictionary(path)
    assert name in str(caught.value)

"""The parameter list of the drive, and the parameters that the profile itself needs."""

from __future__ import annotations

import struct

import pytest

from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from emulators.drive.profidrive.parameters.definitions import WriteRule, load_definitions
from emulators.drive.profidrive.parameters.profile import (
    Identification,
    ParameterMemory,
    connect_faults,
    connect_warnings,
    identify,
    show_telegram,
)
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import LIST_LENGTH, ParameterStore
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TypeCode, telegram
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import Address, Refusal, Request, Values, decode_answer
from testcases.catalogue import each, requirements_in


@pytest.fixture
def store():
    """The parameters of the emulated drive."""
    return ParameterStore()


def stw1_bit(bit):
    """Return a binector that is a bit of process data word 1."""
    return 2090 << 16 | 0xFC00 | bit


FACTORY = [
    pytest.param(number, value, marks=pytest.mark.requirement(rule))
    for rule, rows in {
        "PD-261": {9: 0, 10: 0, 15: 0},
        "PD-263": {418: 11, 419: 9},
        "PD-264": {840: stw1_bit(0), 844: stw1_bit(1), 848: stw1_bit(2), 852: stw1_bit(3), 854: stw1_bit(10)},
        "PD-265": {922: 1, 2079: 1},
        "PD-266": {925: 1},
        "PD-267": {1058: 150, 1059: -150},
        "PD-268": {1082: 1500},
        "PD-269": {1083: 210_000, 1086: -210_000},
        "PD-270": {1120: 10, 1121: 10},
        "PD-271": {1130: 0, 1131: 0, 1134: 0},
        "PD-272": {1135: 0},
        "PD-273": {1136: 0, 1137: 0},
        "PD-274": {1138: 1, 1139: 1},
        "PD-275": {1140: stw1_bit(4), 1141: stw1_bit(5), 1142: stw1_bit(6)},
        "PD-277": {1544: 100},
        "PD-278": {2000: 3000},
        "PD-280": {2040: 100},
        "PD-282": {2103: stw1_bit(7)},
    }.items()
    for number, value in rows.items()
]


def check_factory_values(store, number, value):
    assert store.value(number) == value
    assert store.is_writable(number)


@requirements_in(FACTORY)
def test_factory_values(store, subtests):
    """The value of the table, and the parameter can be set."""
    for label, values in each(FACTORY):
        with subtests.test(label):
            check_factory_values(store, *values)


DISPLAYED = {
    "PD-233": [915, 916],
    "PD-236": [923],
    "PD-240": [944],
    "PD-241": [945, 946],
    "PD-242": [947, 948, 949],
    "PD-243": [950],
    "PD-244": [951],
    "PD-246": list(range(953, 961)),
    "PD-247": [964],
    "PD-248": [965],
    "PD-249": [967, 968],
    "PD-252": [974],
    "PD-253": [975],
    "PD-254": [978],
    "PD-255": [979],
    "PD-256": list(range(980, 990)),
    "PD-257": list(range(990, 1000)),
    "PD-259": [2],
    "PD-260": [20, 21, 22, 26, 27, 31],
    "PD-281": [2050, 2053],
    "PD-283": [898, 899, 2139, 2197, 2199],
    "PD-284": [2122, 2131, 2132],
}
SET = {
    "PD-234": [918],
    "PD-235": [922],
    "PD-237": [925],
    "PD-238": [927, 928],
    "PD-239": [930],
    "PD-245": [952],
    "PD-250": [970, 971, 976, 977],
    "PD-251": [972],
    "PD-262": [304, 305, 307, 310, 311],
    "PD-276": [1520, 1521],
    "PD-279": [2001, 2002, 2003],
}


ACCESS_CASES = [
    pytest.param(number, displayed, marks=pytest.mark.requirement(rule))
    for table, displayed in ((DISPLAYED, True), (SET, False))
    for rule, numbers in table.items()
    for number in numbers
]


def check_access(store, number, displayed):
    answer = ParameterServer({1: store}).request(Request(1, 1, 1, (Address(number, 0, 1),)).encode())
    assert decode_answer(answer).positive
    if displayed:
        with pytest.raises(ParameterAccessError) as caught:
            store.write(number, 0)
        assert caught.value.error == 0x01
    else:
        assert store.is_writable(number)


@pytest.mark.exhaustive
@requirements_in(ACCESS_CASES)
def test_access(store, subtests):
    """What the profile only shows is refused with 01h; the rest can be set in some state."""
    for label, values in each(ACCESS_CASES):
        with subtests.test(label):
            check_access(store, *values)


# ---------------------------------------------------------------------------------------- lists of parameters


@pytest.mark.requirement("PD-256")
def test_the_list_of_all_parameters(store):
    """Followed from PNU 980 by the last element of each list: every parameter once, ascending, 0 ends."""
    server = ParameterServer({1: store})
    found, number = [], 980
    while number:
        request = Request(1, 1, 1, (Address(number, 0, LIST_LENGTH),)).encode()
        values = decode_answer(server.request(request)).results[0].values
        found += values[:-1]
        number = values[-1]
    entries = found[: found.index(0)]
    assert set(found[len(entries) :]) == {0}
    assert entries == sorted(set(entries))
    assert entries == [n for n in range(1, 0x10000) if store.definition(n) is not None]


@pytest.mark.requirement("PD-257")
def test_the_list_of_changed_parameters(store):
    """A setting that differs from the factory; not what the drive shows, and not a command."""
    assert store.value(990) == 0
    store.write(1120, 2.5)
    store.set(31, 1.0)
    store.write(925, 5)
    assert [store.value(990, at) for at in range(3)] == [925, 1120, 0]
    store.write(925, 1)
    assert [store.value(990, at) for at in range(2)] == [1120, 0]


# ----------------------------------------------------------------------------------- identification, telegram


@pytest.mark.requirement("PD-247", "PD-248", "PD-252", "PD-253", "PD-254")
def test_identification(store):
    """PNU 964, 965, 974, 975, 978 from one description of the device."""
    identify(
        store,
        Identification(
            manufacturer=0x0153,
            device_type=4,
            object_type=9,
            version=471,
            year=2025,
            day_month=3012,
            object_class=5,
            object_sub_class=0xC000,
            object_id=3,
            object_ids=(1, 3),
            profile_version=41,
            multi=False,
            latency_ms=20,
        ),
    )

    def row(number, count):
        return [store.value(number, at) for at in range(count)]

    assert row(964, 6) == [0x0153, 4, 471, 2025, 3012, 2]
    assert row(965, 2) == [3, 41]
    assert row(974, 3) == [240, 1, 20]
    assert row(975, 8) == [0x0153, 9, 471, 2025, 3012, 5, 0xC000, 3]
    assert row(978, 8) == [1, 3, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"manufacturer": 70_000}, "manufacturer"),
        ({"object_ids": ()}, "object_ids"),
        ({"object_id": 2}, "object_id"),
        ({"profile_version": 256}, "profile_version"),
    ],
)
def test_a_wrong_identification_is_refused(options, named):
    """The message names the field."""
    with pytest.raises(ConfigurationError, match=named):
        Identification(**options)


@pytest.mark.requirement("PD-031", "PD-233", "PD-235", "PD-236")
def test_the_telegram_is_shown_and_locked(store):
    """Signal numbers of the words, double words twice; PNU 922 can only be read when the bus configuration
    chose it.
    """
    show_telegram(store, telegram(5))
    assert [store.value(915, at) for at in range(10)] == [1, 7, 7, 3, 9, 25, 25, 26, 26, 0]
    assert [store.value(916, at) for at in range(10)] == [2, 8, 8, 4, 10, 11, 11, 12, 12, 0]
    assert [store.value(923, at) for at in range(13)] == [1, 2, 3, 4, 7, 8, 9, 10, 11, 12, 25, 26, 0]
    assert (store.value(922), store.value(2079)) == (5, 5)
    with pytest.raises(ParameterAccessError) as caught:
        store.write(922, 1)
    assert caught.value.error == 0x01
    free = ParameterStore()
    show_telegram(free, telegram(1), by_bus=False)
    free.write(922, 3)
    assert free.value(922) == 3


@pytest.mark.requirement("PD-239", "PD-121")
def test_the_operating_mode_is_changed_in_s1_only(store):
    """11h outside S1, 14h for a mode that the drive does not have."""
    store.switching_on_inhibited = lambda: False
    for value, error in ((1, 0x11), (2, 0x14)):
        with pytest.raises(ParameterAccessError) as caught:
            store.write(930, value)
        assert caught.value.error == error
    store.switching_on_inhibited = lambda: True
    store.write(930, 1)
    assert store.value(930) == 1


# ------------------------------------------------------------------------------------------- faults, warnings

CATALOGUE = {7900: (3, "motor blocked"), 1912: (8, "sign of life"), 30001: (2, "overcurrent")}


@pytest.mark.requirement("PD-134", "PD-135", "PD-137", "PD-240", "PD-241", "PD-242", "PD-243", "PD-284")
def test_the_fault_buffer_in_parameters(store):
    """Sub-index 0..7 is the present situation, 8..15 the one before; 944 counts messages and
    acknowledgements.
    """
    buffer = FaultBuffer()
    connect_faults(store, buffer, CATALOGUE)
    buffer.enter(FaultMessage(7900, value=-5, time_ms=70_000, code=3))
    buffer.enter(FaultMessage(30001, value=8, time_ms=70_001, code=2))
    assert [store.value(number, 0) for number in (945, 947, 948, 949)] == [3, 7900, 70_000, -5]
    assert [store.value(number, 1) for number in (945, 947, 948, 949)] == [2, 30001, 70_001, 8]
    assert (store.value(944), store.value(2131)) == (2, 7900)
    buffer.acknowledge()
    assert (store.value(944), store.value(2131), store.value(947, 0)) == (3, 0, 0)
    assert (store.value(947, 8), store.value(949, 9)) == (7900, 8)
    assert (store.value(950, 0), store.value(950, 1)) == (8, 8)
    assert store.definition(947).size == store.value(950, 0) * store.value(950, 1)


@pytest.mark.requirement("PD-136", "PD-245", "PD-216")
def test_writing_zero_to_952_clears_the_buffer(store):
    """Any other value is refused with 06h; the drive is informed."""
    buffer, reported = FaultBuffer(), []
    connect_faults(store, buffer, CATALOGUE, cleared=lambda: reported.append(True))
    buffer.enter(FaultMessage(7900))
    buffer.acknowledge()
    buffer.enter(FaultMessage(1912))
    assert store.value(952) == 2
    request = Request(1, 2, 1, (Address(952),), (Values(0x42, (1,)),)).encode()
    assert decode_answer(ParameterServer({1: store}).request(request)).results == (Refusal(0x06, 0),)
    assert buffer.present
    store.write(952, 0)
    assert (store.value(952), store.value(947), buffer.present, reported) == (0, 0, (), [True])


@pytest.mark.requirement("PD-136", "PD-244")
def test_the_list_of_fault_numbers_has_texts(store):
    """PNU 951 lists what the drive knows, ascending; attribute 30h gives the texts."""
    connect_faults(store, FaultBuffer(), CATALOGUE)
    assert [store.value(951, at) for at in range(3)] == [1912, 7900, 30001]
    assert [store.value(946, at) for at in range(3)] == [8, 3, 2]
    request = Request(1, 1, 1, (Address(951, 1, 1, 0x30),)).encode()
    results = decode_answer(ParameterServer({1: store}).request(request)).results
    assert results == (Values(TypeCode.VISIBLE_STRING, tuple(b"motor blocked   ")),)


@pytest.mark.requirement("PD-138", "PD-246", "PD-284")
def test_warnings_as_bits(store):
    """The n-th warning has bit n % 16 of word 953 + n // 16; r2132 shows the oldest."""
    active = []
    numbers = [7910, *range(100, 130)]
    connect_warnings(store, numbers, lambda: active)
    assert [store.value(number) for number in range(953, 961)] == [0] * 8
    active += [116, 7910]
    assert [store.value(number) for number in range(953, 961)] == [0x0001, 0x0002, 0, 0, 0, 0, 0, 0]
    assert [store.value(2122, at) for at in range(3)] == [116, 7910, 0]
    assert store.value(2132) == 116
    with pytest.raises(ConfigurationError, match="128"):
        connect_warnings(store, range(129), lambda: active)


# ----------------------------------------------------------------------------------------- loading and saving


@pytest.mark.requirement("PD-250", "PD-285")
def test_saving_and_loading(store):
    """What was saved comes back; what was changed afterwards does not; 1 to p0970 brings the factory
    settings.
    """
    memory = ParameterMemory(store)
    seen = []
    store.writers[1120] = lambda _, value: seen.append(value)
    store.write(1120, 2.0)
    store.write(971, 1)
    assert store.value(971) == 0
    store.write(1120, 3.0)
    store.write(925, 4)
    store.write(970, 10)
    assert (store.value(1120), store.value(925), store.value(970)) == (2.0, 1, 0)
    store.write(1121, 9.0)
    memory.restart()
    assert (store.value(1120), store.value(1121)) == (2.0, 10)
    store.write(970, 1)
    assert store.value(1120) == 10
    assert seen == [2.0, 3.0, 2.0, 10]
    memory.restart()
    assert store.value(1120) == 2.0


def test_settings_are_not_loaded_while_the_motor_turns(store):
    """p0970 needs pulse inhibit."""
    ParameterMemory(store)
    store.pulses_enabled = lambda: True
    with pytest.raises(ParameterAccessError) as caught:
        store.write(970, 1)
    assert caught.value.error == 0x77


def test_what_the_machine_does_not_take_back_stays(store):
    """A setting that is refused while loading leaves the others loaded."""
    ParameterMemory(store)
    store.write(1120, 2.0)
    store.write(1121, 2.0)

    def refuse(_sub_index, _value):
        raise ParameterAccessError("no", 0x11)

    store.writers[1120] = refuse
    store.write(970, 1)
    assert (store.value(1120), store.value(1121)) == (2.0, 10)


@pytest.mark.requirement("PD-251")
def test_drive_reset(store):
    """1 at once, 2 is prepared, 3 waits for the end of communication."""
    restarts = []
    memory = ParameterMemory(store, lambda: restarts.append(store.value(1120)))
    store.write(1120, 2.0)
    store.write(972, 2)
    assert (store.value(972), memory.end_of_communication(), restarts) == (2, False, [])
    store.write(972, 3)
    assert (store.value(972), restarts) == (3, [])
    assert memory.end_of_communication()
    assert (store.value(972), restarts) == (0, [10])
    assert not memory.end_of_communication()
    store.write(972, 1)
    assert (store.value(972), len(restarts)) == (0, 2)


# --------------------------------------------------------------------------------------------- hooks and file


def test_computed_values_fit_their_type(store):
    """What the device computes is rounded and held at the ends of the type; not-a-number is 0."""
    present = {"value": 0.0}
    store.readers[2] = lambda _: present["value"]
    for given, shown in ((1.6, 2), (1e9, 32767), (-1e9, -32768), (float("nan"), 0), (float("inf"), 32767)):
        present["value"] = given
        assert store.value(2) == shown
    store.readers[20] = lambda _: 1e300
    assert store.value(20) < float("inf")


def test_factory_values_and_limits_are_those_of_single_precision(store):
    """A decimal fraction that comes over the bus equals the one of the file: unchanged, and not beyond the
    limit.
    """
    store.write(10, 1)
    for number, value in ((305, 2.2), (1082, 0.1)):
        single = struct.pack(">f", value)
        address = Request(1, 2, 1, (Address(number),)).encode()
        answer = ParameterServer({1: store}).request(address + b"\x08\x01" + single)
        assert decode_answer(answer).positive
        assert struct.pack(">f", store.value(number)) == single
    assert store.changed() == (1082,)


def test_every_parameter_of_the_file_has_a_text_that_fits():
    """Sixteen characters on the wire, so that no name is cut."""
    for definition in load_definitions():
        assert 0 < len(definition.text) <= 16, definition.name
        assert all(0 < len(text) <= 16 for text in definition.texts), definition.name


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ('x1 = { type = "U16" }', "x1"),
        ('p70000 = { type = "U16" }', "65535"),
        ('p1 = { type = "U17" }', "U17"),
        ('p1 = { type = "U16", size = 0 }', "size"),
        ('p1 = { type = "U16", size = 2, default = [1] }', "default"),
        ('p1 = { type = "U16", default = 70000 }', "70000"),
        ('p1 = { type = "U16", default = 1.5 }', "default"),
        ('p1 = { type = "U16", values = [1, 2] }', "1, 2"),
        ('p1 = { type = "U16", low = 5, high = 4 }', "low <= high"),
        ('p1 = { type = "F32", low = nan }', "low"),
        ('p1 = { type = "U16", write = "never" }', "write"),
        ('r1 = { type = "U16", write = "always" }', "write"),
        ('p1 = { type = "U16", colour = "red" }', "colour"),
        ('p1 = { type = "U16" }\nr1 = { type = "U16" }', "once"),
        ('p1 = { type = "STRING", size = 3, default = "long" }', "3 characters"),
        ("p1 = 5", "p1"),
        ("p1 = ", "TOML"),
    ],
)
def test_a_wrong_parameter_file_is_refused(tmp_path, row, message):
    """The error names the file or the parameter, and what is allowed."""
    path = tmp_path / "mine.toml"
    path.write_text(f"[parameters]\n{row}\n")
    with pytest.raises(ConfigurationError, match=message):
        load_definitions(path)


def test_a_parameter_file_of_the_users(tmp_path):
    """A drive with other parameters is a file."""
    path = tmp_path / "mine.toml"
    path.write_text(
        '[parameters]\nr0007 = { type = "STRING", size = 6, default = "abc", text = "name" }\n'
        'p0100 = { type = "I32", size = 2, default = [-1, 4], write = "pulses_off" }\n'
    )
    store = ParameterStore(load_definitions(path))
    assert store.text(7) == "abc"
    assert [store.value(100, at) for at in (0, 1)] == [-1, 4]
    assert store.definition(100).write is WriteRule.PULSES_OFF
    store.set_text(7, "longer than six")
    assert store.text(7) == "longer"

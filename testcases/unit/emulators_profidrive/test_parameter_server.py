"""Parameter access of a drive: every check with its error number, arrays, several parameters, any bytes."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.profidrive.parameters.definitions import ParameterDefinition, WriteRule
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import Address, Attribute, Format, Refusal, Request, Values, decode_answer
from testcases.catalogue import each

(
    PLAIN,
    ARRAY,
    READ_ONLY,
    TEXTS,
    BARE,
    CHOICE,
    RESET,
    S1,
    PULSES,
    COMMISSIONING,
    NAME,
    REAL,
    LONG,
    HOOKED,
    SIGNED,
    NARROW,
) = range(100, 116)


def parameter(number, code=TypeCode.UNSIGNED16, **options):
    """Return a definition, writable at any time unless said otherwise."""
    options.setdefault("write", WriteRule.ALWAYS)
    options.setdefault("text", f"parameter {number}")
    size = options.get("size")
    options.setdefault("defaults", (0,) * (size or 1))
    return ParameterDefinition(number=number, type=code, **options)


def make_store():
    """Return a store with one parameter of each kind."""
    store = ParameterStore(
        [
            parameter(10),
            parameter(PLAIN, low=5, high=50, defaults=(7,)),
            parameter(ARRAY, size=4, defaults=(1, 2, 3, 4), high=100),
            parameter(READ_ONLY, write=WriteRule.NEVER),
            parameter(TEXTS, size=2, texts=("first", "second")),
            parameter(BARE, text=""),
            parameter(CHOICE, values=frozenset({0, 2, 9})),
            parameter(RESET, write=WriteRule.RESET),
            parameter(S1, write=WriteRule.INHIBITED),
            parameter(PULSES, write=WriteRule.PULSES_OFF),
            parameter(COMMISSIONING, write=WriteRule.COMMISSIONING),
            parameter(NAME, TypeCode.VISIBLE_STRING, size=12),
            parameter(REAL, TypeCode.FLOAT32, low=-10, high=10),
            parameter(LONG, TypeCode.UNSIGNED32, size=234),
            parameter(HOOKED),
            parameter(SIGNED, TypeCode.INTEGER16),
            parameter(NARROW),
            parameter(927, TypeCode.V2, defaults=(1,)),
        ]
    )
    store.limits[NARROW] = lambda: (10, 20)

    def refuse(_sub_index, value):
        if value == 13:
            raise ParameterAccessError("the machine does not want it", 0x87)

    store.writers[HOOKED] = refuse
    return store


@pytest.fixture
def store():
    """A store with one parameter of each kind."""
    return make_store()


@pytest.fixture
def server(store):
    """A server for it as drive object 1."""
    return ParameterServer({1: store})


def read(number, sub_index=0, elements=0, attribute=Attribute.VALUE):
    """Return a request to read."""
    return Request(0x80, 1, 1, (Address(number, sub_index, elements, attribute),)).encode()


def write(number, *values, code=Format.WORD, sub_index=0, elements=None, attribute=Attribute.VALUE):
    """Return a request to write."""
    address = Address(number, sub_index, len(values) if elements is None else elements, attribute)
    return Request(7, 2, 1, (address,), (Values(code, values),)).encode()


def result(server, request):
    """Return the only result of a request."""
    answer = decode_answer(server.request(request))
    assert answer.reference == request[0]
    assert answer.drive_object == request[2]
    assert len(answer.results) == 1
    return answer.results[0]


# ------------------------------------------------------------------------------------------ single parameters


@pytest.mark.requirement("PD-199", "PD-200", "PD-202", "PD-203")
def test_the_bytes_of_reading_and_writing(server):
    """Header mirrored, format and number in front of the values; a good answer to writing is the header
    alone.
    """
    assert server.request(bytes.fromhex("80 01 01 01 10 01 0064 0000")) == bytes.fromhex(
        "80 01 01 01 06 01 0007"
    )
    assert server.request(bytes.fromhex("81 02 01 01 10 01 0064 0000 42 01 0009")) == bytes.fromhex(
        "81 02 01 01"
    )
    assert server.request(bytes.fromhex("82 01 01 01 10 00 0064 0000")) == bytes.fromhex(
        "82 01 01 01 06 01 0009"
    )
    assert server.request(bytes.fromhex("83 01 01 01 10 01 FFFF 0000")) == bytes.fromhex(
        "83 81 01 01 44 01 0000"
    )
    assert server.request(bytes.fromhex("84 02 01 01 10 01 0064 0000 42 01 0001")) == bytes.fromhex(
        "84 82 01 01 44 02 0002 0000"
    )


REFUSED = [
    # request, error, sub-index
    pytest.param(
        "01 03 01 01 1001 0064 0000", 0x21, None, marks=pytest.mark.requirement("PD-229"), id="service"
    ),
    pytest.param(
        "01 01 07 01 1001 0064 0000", 0x19, None, marks=pytest.mark.requirement("PD-227"), id="drive object"
    ),
    pytest.param(
        "01 01 01 28" + "1001 0064 0000" * 39,
        0x22,
        None,
        marks=pytest.mark.requirement("PD-230"),
        id="too many",
    ),
    pytest.param("01 01 01 00", 0x18, None, marks=pytest.mark.requirement("PD-226"), id="none"),
    pytest.param("01 01 01", 0x18, None, marks=pytest.mark.requirement("PD-226"), id="no header"),
    pytest.param(
        "01 01 01 02 1001 0064 0000",
        0x18,
        None,
        marks=pytest.mark.requirement("PD-208"),
        id="address missing",
    ),
    pytest.param(
        "01 01 01 01 1001 0064 0000 00", 0x18, None, marks=pytest.mark.requirement("PD-208"), id="too long"
    ),
    pytest.param(
        "01 01 01 01 4001 0064 0000", 0x16, None, marks=pytest.mark.requirement("PD-224"), id="attribute"
    ),
    pytest.param(
        "01 01 01 01 10EB 0065 0000", 0x16, None, marks=pytest.mark.requirement("PD-224"), id="235 elements"
    ),
    pytest.param(
        "01 01 01 01 1000 0065 0000",
        0x16,
        None,
        marks=pytest.mark.requirement("PD-208"),
        id="array, 0 elements",
    ),
    pytest.param(
        "01 01 01 01 1001 0101 0000", 0x00, None, marks=pytest.mark.requirement("PD-210"), id="unknown"
    ),
    pytest.param(
        "01 01 01 01 1001 0064 0001",
        0x04,
        None,
        marks=pytest.mark.requirement("PD-214"),
        id="no array, sub-index",
    ),
    pytest.param(
        "01 01 01 01 1002 0064 0000",
        0x04,
        None,
        marks=pytest.mark.requirement("PD-208"),
        id="no array, elements",
    ),
    pytest.param(
        "01 01 01 01 1002 0065 0003",
        0x03,
        4,
        marks=pytest.mark.requirement("PD-213", "PD-205"),
        id="beyond the end",
    ),
    pytest.param(
        "01 01 01 01 1001 0065 0009", 0x03, 9, marks=pytest.mark.requirement("PD-213"), id="behind the end"
    ),
    pytest.param(
        "01 01 01 01 3000 0064 0000", 0x0F, None, marks=pytest.mark.requirement("PD-220"), id="no text"
    ),
    pytest.param(
        "01 01 01 01 2000 0068 0000", 0x09, None, marks=pytest.mark.requirement("PD-218"), id="no description"
    ),
    pytest.param(
        "01 01 01 01 10EA 0070 0000",
        0x15,
        None,
        marks=pytest.mark.requirement("PD-223"),
        id="answer too long",
    ),
    pytest.param(
        "01 02 01 01 2001 0064 0000 42 01 0009",
        0x07,
        0,
        marks=pytest.mark.requirement("PD-217"),
        id="description",
    ),
    pytest.param(
        "01 02 01 01 3001 0064 0000 42 01 0009",
        0x0F,
        None,
        marks=pytest.mark.requirement("PD-220"),
        id="no text to write",
    ),
    pytest.param(
        "01 02 01 01 3001 0067 0000 42 01 0009",
        0x20,
        None,
        marks=pytest.mark.requirement("PD-228"),
        id="text",
    ),
    pytest.param(
        "01 02 01 01 1001 0066 0000 42 01 0009",
        0x01,
        0,
        marks=pytest.mark.requirement("PD-211"),
        id="read-only",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 42 02 0009 0009",
        0x18,
        None,
        marks=pytest.mark.requirement("PD-226"),
        id="values",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 42 01 00",
        0x18,
        None,
        marks=pytest.mark.requirement("PD-208"),
        id="half a value",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 42 01 0009 00",
        0x18,
        None,
        marks=pytest.mark.requirement("PD-208"),
        id="a byte more",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000", 0x18, None, marks=pytest.mark.requirement("PD-208"), id="no values"
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 99 01 0009",
        0x17,
        None,
        marks=pytest.mark.requirement("PD-225"),
        id="format",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 40 00",
        0x17,
        None,
        marks=pytest.mark.requirement("PD-225"),
        id="format zero",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 44 01 0009",
        0x17,
        None,
        marks=pytest.mark.requirement("PD-225"),
        id="format error",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 43 01 00000009",
        0x05,
        None,
        marks=pytest.mark.requirement("PD-215"),
        id="size",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 03 01 0009",
        0x05,
        None,
        marks=pytest.mark.requirement("PD-215"),
        id="type",
    ),
    pytest.param(
        "01 02 01 01 1001 0064 0000 42 01 0033", 0x02, 0, marks=pytest.mark.requirement("PD-212"), id="above"
    ),
    pytest.param(
        "01 02 01 01 1002 0065 0001 42 02 0001 0065",
        0x02,
        2,
        marks=pytest.mark.requirement("PD-212"),
        id="above, element 2",
    ),
    pytest.param(
        "01 02 01 01 1001 006C 0000 42 01 0003",
        0x77,
        None,
        marks=pytest.mark.requirement("PD-231"),
        id="pulses",
    ),
    pytest.param(
        "01 02 01 01 1001 006D 0000 42 01 0003",
        0x6B,
        None,
        marks=pytest.mark.requirement("PD-231"),
        id="commissioning",
    ),
    pytest.param(
        "01 02 01 01 1001 0069 0000 42 01 0003", 0x14, 0, marks=pytest.mark.requirement("PD-222"), id="value"
    ),
    pytest.param(
        "01 02 01 01 1001 006A 0000 42 01 0003",
        0x06,
        0,
        marks=pytest.mark.requirement("PD-216"),
        id="only to 0",
    ),
    pytest.param(
        "01 02 01 01 1001 006B 0000 42 01 0003",
        0x11,
        None,
        marks=pytest.mark.requirement("PD-221"),
        id="state",
    ),
    pytest.param(
        "01 02 01 01 1001 0073 0000 42 01 0009",
        0xC8,
        None,
        marks=pytest.mark.requirement("PD-231"),
        id="below in force",
    ),
    pytest.param(
        "01 02 01 01 1001 0073 0000 42 01 0015",
        0xC9,
        None,
        marks=pytest.mark.requirement("PD-231"),
        id="above in force",
    ),
    pytest.param(
        "01 02 01 01 1001 0071 0000 42 01 000D",
        0x87,
        None,
        marks=pytest.mark.requirement("PD-231"),
        id="device",
    ),
    pytest.param(
        "01 02 01 01 1001 006F 0000 43 01 7FC00000",
        0x02,
        0,
        marks=pytest.mark.requirement("PD-212"),
        id="not a number",
    ),
]


def everything(store):
    """Return all values."""
    return {number: store.values(number, 0, store.definition(number).elements) for number in store.numbers()}


@pytest.mark.parametrize(("request_hex", "error", "sub_index"), REFUSED)
def test_what_is_refused(server, store, request_hex, error, sub_index):
    """Each mistake has its number, some with the sub-index; the answer is negative, and nothing has
    changed.
    """
    store.pulses_enabled = lambda: True
    store.switching_on_inhibited = lambda: False
    before = everything(store)
    request = bytes.fromhex(request_hex)
    answer = server.request(request)
    assert answer[1] == request[1] | 0x80
    assert decode_answer(answer).results == (Refusal(error, sub_index),)
    assert everything(store) == before
    assert server.refused == {error: 1}


@pytest.mark.requirement("PD-207")
@pytest.mark.parametrize(
    ("request_hex", "error"),
    [
        ("01 03 07 29", 0x21),  # service before drive object, number of parameters and length
        ("01 01 07 29", 0x19),  # drive object before number of parameters
        ("01 02 01 01 4001 0101 0000 42 01 0009", 0x16),  # attribute before unknown number
        ("01 02 01 01 2001 0101 0000 42 01 0009", 0x07),  # description before unknown number
        ("01 02 01 01 3001 0101 0000 42 01 0009", 0x00),  # unknown number before text
        ("01 02 01 01 3001 0066 0000 42 01 0009", 0x0F),  # text before read-only
        ("01 02 01 01 1002 0066 0009 99 01 0009", 0x01),  # read-only before index and format
        ("01 02 01 01 1001 0064 0009 99 01 0009", 0x04),  # index before format
        ("01 02 01 01 1001 0065 0009 42 02 0009", 0x03),  # index before length
        ("01 02 01 01 1001 0064 0000 43 02 00000001 00000001", 0x18),  # length before format
        ("01 02 01 01 1001 0064 0000 03 01 0001", 0x05),  # format before limits
        ("01 02 01 01 1001 0064 0009 42 01 0001", 0x04),  # index before limits
    ],
)
def test_the_order_of_the_checks(server, request_hex, error):
    """A request with several mistakes is refused for the first one in the order of the profile."""
    assert decode_answer(server.request(bytes.fromhex(request_hex))).results[0].error == error


@pytest.mark.requirement("PD-230")
def test_a_drive_without_multi_parameter_access(store):
    """Two parameters are refused with 23h where only one is possible."""
    request = Request(1, 1, 1, (Address(PLAIN), Address(PLAIN))).encode()
    assert decode_answer(ParameterServer({1: store}, multi=False).request(request)).results == (
        Refusal(0x23),
    )
    assert decode_answer(ParameterServer({1: store}).request(request)).positive


@pytest.mark.requirement("PD-204")
@pytest.mark.parametrize(
    ("number", "code", "written", "value"),
    [
        (PLAIN, Format.WORD, 9, 9),
        (PLAIN, TypeCode.UNSIGNED16, 9, 9),
        (SIGNED, Format.WORD, 0xFFFE, -2),
        (SIGNED, TypeCode.INTEGER16, -2, -2),
        (REAL, Format.DOUBLE_WORD, struct.unpack(">I", struct.pack(">f", 2.5))[0], 2.5),
        (REAL, TypeCode.FLOAT32, -2.5, -2.5),
    ],
)
def test_formats_of_a_written_value(server, store, number, code, written, value):
    """The data type itself, or byte, word and double word of the same size."""
    assert result(server, write(number, written, code=code)) is None
    assert store.value(number) == value


@pytest.mark.requirement("PD-201", "PD-209")
def test_a_string_is_an_array_of_bytes(server, store):
    """An odd number of bytes is filled up in both directions."""
    name = b"spindle"
    assert result(server, write(NAME, *name, code=Format.BYTE)) is None
    assert store.text(NAME) == "spindle"
    answer = result(server, read(NAME, sub_index=1, elements=3))
    assert answer == Values(TypeCode.VISIBLE_STRING, tuple(b"pin"))


@pytest.mark.requirement("PD-219", "PD-238")
def test_control_of_parameters(server, store):
    """PNU 927 = 0: everything is refused with 0Bh but the way back."""
    assert result(server, write(927, 0)) is None
    assert result(server, write(PLAIN, 9)) == Refusal(0x0B)
    assert result(server, read(PLAIN)).values == (7,)
    assert result(server, write(927, 1)) is None
    assert result(server, write(PLAIN, 9)) is None
    assert store.value(PLAIN) == 9


@pytest.mark.requirement("PD-231", "PD-261")
def test_states_in_which_parameters_may_be_written(server, store):
    """What is refused in a state passes in the one that it needs."""
    store.pulses_enabled = lambda: True
    store.switching_on_inhibited = lambda: False
    assert [result(server, write(one, 3)).error for one in (S1, PULSES, COMMISSIONING)] == [0x11, 0x77, 0x6B]
    store.pulses_enabled = lambda: False
    store.switching_on_inhibited = lambda: True
    assert result(server, write(10, 1)) is None
    assert [result(server, write(one, 3)) for one in (S1, PULSES, COMMISSIONING)] == [None] * 3


def test_elements_are_written_all_or_none(server, store):
    """A wrong value in the middle of an array leaves the ones before it alone."""
    assert result(server, write(ARRAY, 9, 101, 9, sub_index=1)) == Refusal(0x02, 2)
    assert [store.value(ARRAY, at) for at in range(4)] == [1, 2, 3, 4]
    assert result(server, write(ARRAY, 9, 8, 7, sub_index=1)) is None
    assert [store.value(ARRAY, at) for at in range(4)] == [1, 9, 8, 7]


@pytest.mark.requirement("PD-231", "PD-349")
def test_a_parameter_can_be_taken_away(server, store):
    """A deactivated parameter refuses reading and writing; its description of access rules is unchanged."""
    store.refusals[PLAIN] = 0x65
    assert result(server, read(PLAIN)) == Refusal(0x65)
    assert result(server, write(PLAIN, 9)) == Refusal(0x65)
    del store.refusals[PLAIN]
    assert result(server, read(PLAIN)).values == (7,)


# ----------------------------------------------------------------------------------------- several parameters


@pytest.mark.requirement("PD-202", "PD-203")
def test_several_parameters_are_answered_each(server, store):
    """One that is refused stands between those that are not."""
    request = Request(
        3, 1, 1, (Address(PLAIN), Address(1), Address(ARRAY, 1, 2), Address(ARRAY, 3, 2))
    ).encode()
    answer = decode_answer(server.request(request))
    assert not answer.positive
    assert answer.results == (
        Values(TypeCode.UNSIGNED16, (7,)),
        Refusal(0),
        Values(TypeCode.UNSIGNED16, (2, 3)),
        Refusal(3, 4),
    )
    request = Request(
        4,
        2,
        1,
        (Address(PLAIN), Address(READ_ONLY), Address(ARRAY, 0, 2)),
        (Values(Format.WORD, (9,)), Values(Format.WORD, (9,)), Values(Format.WORD, (5, 6))),
    ).encode()
    assert decode_answer(server.request(request)).results == (None, Refusal(1, 0), None)
    assert (store.value(PLAIN), store.value(ARRAY, 1)) == (9, 6)


@pytest.mark.requirement("PD-208")
def test_a_broken_record_writes_nothing(server, store):
    """When the values of one parameter cannot be distinguished from those of the next, none is written; own
    mistakes go first.
    """
    request = Request(
        4, 2, 1, (Address(PLAIN), Address(1)), (Values(Format.WORD, (9,)), Values(Format.WORD, (9,)))
    ).encode()
    assert decode_answer(server.request(request[:-1])).results == (Refusal(0x18), Refusal(0))
    assert store.value(PLAIN) == 7


def check_an_answer_never_exceeds_240_bytes(server, count):
    elements = 27
    block = 2 + 4 * elements
    room_for_error = 6
    fitting = max(k for k in range(count) if 4 + block * k + room_for_error * (count - k) <= 240)
    addresses = (*(Address(LONG, 0, elements) for _ in range(count - 1)), Address(PLAIN))
    answer = server.request(Request(1, 1, 1, addresses).encode())
    assert len(answer) <= 240
    results = decode_answer(answer).results
    good = Values(TypeCode.UNSIGNED32, (0,) * elements)
    assert list(results[:-1]) == [good] * fitting + [Refusal(0x15)] * (count - 1 - fitting)
    assert results[-1] == Values(TypeCode.UNSIGNED16, (7,))


@pytest.mark.requirement("PD-223")
def test_an_answer_never_exceeds_240_bytes(server, subtests):
    """What does not fit is refused with 15h, and whatever fits behind it is given."""
    for label, values in each(range(1, 40)):
        with subtests.test(label):
            check_an_answer_never_exceeds_240_bytes(server, *values)


# ------------------------------------------------------------------------------------- descriptions and texts


def test_the_description_of_a_parameter(server):
    """46 bytes: identifier, elements, standardisation, name, limits; each of its parts has a sub-index."""
    whole = bytes(result(server, read(ARRAY, attribute=Attribute.DESCRIPTION)).values)
    assert len(whole) == 46
    identifier, elements = struct.unpack(">HH", whole[:4])
    assert identifier == 0x4000 | 0x0100 | TypeCode.UNSIGNED16
    assert elements == 4
    assert whole[14:30] == b"parameter 101   "
    assert struct.unpack(">II", whole[30:38]) == (0, 100)
    parts = [bytes(result(server, read(ARRAY, at, 1, Attribute.DESCRIPTION)).values) for at in range(1, 13)]
    assert b"".join(parts) == whole
    assert parts[5] == b"parameter 101   "
    assert result(server, read(ARRAY, 13, 1, Attribute.DESCRIPTION)) == Refusal(3, 13)


@pytest.mark.parametrize(
    ("number", "bits"),
    [(PLAIN, 0x0100), (READ_ONLY, 0x0300), (RESET, 0x2100), (TEXTS, 0x4500), (NAME, 0x4100)],
)
def test_the_identifier_tells_the_kind(server, number, bits):
    """Array, only to reset, texts, read-only."""
    values = bytes(result(server, read(number, 1, 1, Attribute.DESCRIPTION)).values)
    assert struct.unpack(">H", values)[0] & 0xFF00 == bits


def test_the_identifier_tells_what_was_changed(server):
    """Bit 12 is set after the factory setting was left."""
    assert result(server, read(PLAIN, 1, 1, Attribute.DESCRIPTION)).values == (0x01, 0x06)
    result(server, write(PLAIN, 9))
    assert result(server, read(PLAIN, 1, 1, Attribute.DESCRIPTION)).values == (0x11, 0x06)


def test_texts_of_elements(server):
    """Sixteen characters each."""
    both = bytes(result(server, read(TEXTS, 0, 2, Attribute.TEXT)).values)
    assert both == b"first           second          "
    assert bytes(result(server, read(TEXTS, 1, 1, Attribute.TEXT)).values) == b"second          "
    assert result(server, read(TEXTS, 1, 2, Attribute.TEXT)) == Refusal(3, 2)


# ------------------------------------------------------------------------------------------------- any bytes


def shaped():
    """Return requests that are nearly right."""
    address = st.tuples(
        st.sampled_from([0x10, 0x20, 0x30, 0x40]),
        st.sampled_from([0, 1, 2, 4, 30, 234, 235, 255]),
        st.integers(95, 120) | st.sampled_from([980, 990, 927, 0, 0xFFFF]),
        st.sampled_from([0, 1, 2, 3, 12, 116, 0xFFFF]),
    )

    def assemble(service, drive_object, addresses, count, tail):
        packed = b"".join(struct.pack(">BBHH", *one) for one in addresses)
        return (
            bytes((1, service, drive_object, count if count is not None else len(addresses))) + packed + tail
        )

    block = st.builds(
        lambda code, count, data: bytes((code, count)) + data,
        st.integers(0, 130),
        st.integers(0, 6),
        st.binary(max_size=14),
    )
    return st.builds(
        assemble,
        st.sampled_from([1, 1, 2, 2, 3]),
        st.sampled_from([1, 1, 1, 0]),
        st.lists(address, max_size=39),
        st.none() | st.integers(0, 255),
        st.lists(block, max_size=3).map(b"".join),
    )


@pytest.mark.exhaustive
@settings(max_examples=300, derandomize=True, deadline=None)
@given(st.binary(max_size=300) | shaped())
def test_any_bytes_are_answered(data):
    """Whatever comes: one answer of at most 240 bytes, which decodes, mirrors the request and keeps the
    values legal.
    """
    store = make_store()
    server = ParameterServer({1: store})
    answer = server.request(data)
    assert 4 < len(answer) <= 240 or (len(answer) == 4 and answer[1] == 2)
    decoded = decode_answer(answer)
    assert answer[0] == (data[0] if data else 0)
    assert bool(answer[1] & 0x80) is not decoded.positive
    assert sum(server.refused.values()) == sum(isinstance(one, Refusal) for one in decoded.results)
    for number in store.numbers():
        definition = store.definition(number)
        low, high = definition.limits
        values = store.values(number, 0, definition.elements)
        assert all(low <= value <= high and math.isfinite(value) for value in values)

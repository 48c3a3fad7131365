"""Data record 47 in registers, and parameters as objects of a dictionary."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.profidrive.canopen.sdo_parameters import ParameterWindow, abort_code
from emulators.drive.profidrive.parameters.access import ChannelError, ParameterChannel
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError


def words(text):
    """Return registers from hexadecimal groups."""
    return [int(group, 16) for group in text.split()]


@pytest.fixture
def store():
    """The parameters of the emulated drive."""
    return ParameterStore()


@pytest.fixture
def channel(store):
    """A channel that answers after 20 ms."""
    return ParameterChannel(ParameterServer({1: store}), latency_ns=20 * MS)


READ_DISPLAY = "0001 2F0A 8001 0101 1001 0002 0000"


@pytest.mark.requirement("PD-326", "PD-327", "PD-328", "PD-332", "PD-206")
def test_the_worked_sequence(channel):
    """Seven registers written, "not ready" until the answer is there, then r0002 = 31 in eight bytes."""
    assert channel.write(40601, words(READ_DISPLAY), 0)
    for now in (0, 10 * MS, 20 * MS - 1):
        assert channel.read(40601, 16, now) == words("0001 2F00 0004") + [0] * 13
    ready = words("0002 2F08 8001 0101 0301 001F") + [0] * 10
    assert channel.read(40601, 16, 20 * MS) == ready
    assert channel.read(40601, 1, 90 * MS) == [2]
    assert channel.read(40606, 1, 90 * MS) == [31]


@pytest.mark.requirement("PD-326", "PD-327")
def test_a_write_is_answered_with_four_bytes(channel, store):
    """The answer to a good write is the header alone."""
    channel.write(40601, words("0001 2F10 8002 0101 1001 0460 0000 0801 40A0 0000"), 0)
    assert store.value(1120) == 5.0
    assert channel.read(40601, 4, 20 * MS) == words("0002 2F04 8002 0101")


@pytest.mark.requirement("PD-326")
def test_a_request_in_pieces(channel):
    """Control 0 only stores; the register of control alone starts what is stored."""
    channel.write(40601, words("0000 2F0A 8001 0101"), 0)
    channel.write(40605, words("1001 0002 0000"), 1)
    assert channel.read(40601, 7, 2) == words("0000 2F0A 8001 0101 1001 0002 0000")
    channel.write(40601, [1], 3)
    assert channel.read(40601, 6, 3 + 20 * MS) == words("0002 2F08 8001 0101 0301 001F")


@pytest.mark.parametrize(
    ("request_text", "error"),
    [
        pytest.param("0001 2F00 8001 0101", 1, marks=pytest.mark.requirement("PD-329"), id="no length"),
        pytest.param("0001 2FF1" + " 0000" * 120, 1, marks=pytest.mark.requirement("PD-329"), id="241 bytes"),
        pytest.param(
            "0001 2F0B 8001 0101 1001 0002 0000",
            1,
            marks=pytest.mark.requirement("PD-329"),
            id="not all there",
        ),
        pytest.param("0001 2F0A", 1, marks=pytest.mark.requirement("PD-329"), id="nothing there"),
        pytest.param(
            "0002 2F0A 8001 0101 1001 0002 0000", 2, marks=pytest.mark.requirement("PD-330"), id="control 2"
        ),
        pytest.param(
            "0001 2E0A 8001 0101 1001 0002 0000", 3, marks=pytest.mark.requirement("PD-331"), id="function"
        ),
    ],
)
def test_mistakes_are_answered_at_once(channel, request_text, error):
    """Header 2F00 and the number of the error."""
    assert channel.write(40601, words(request_text), 0)
    assert channel.read(40601, 4, 0) == [2, 0x2F00, error, 0]
    assert channel.write(40601, words(READ_DISPLAY), 0)
    assert channel.read(40601, 3, 20 * MS) == words("0002 2F08 8001")


@pytest.mark.requirement("PD-329")
def test_data_of_the_last_request_does_not_count(channel):
    """A length is right only with data that was written since."""
    channel.write(40601, words(READ_DISPLAY), 0)
    channel.write(40601, words("0001 2F0A"), 30 * MS)
    assert channel.read(40601, 3, 30 * MS) == [2, 0x2F00, 1]


@pytest.mark.requirement("PD-330")
def test_a_drive_that_takes_no_requests(store):
    """Error 2, and nothing is written."""
    channel = ParameterChannel(ParameterServer({1: store}), available=lambda: False)
    channel.write(40601, words("0001 2F10 8002 0101 1001 0460 0000 0801 40A0 0000"), 0)
    assert channel.read(40601, 3, 0) == [2, 0x2F00, 2]
    assert store.value(1120) == 10


@pytest.mark.requirement("PD-333", "PD-349")
def test_injected_errors(channel):
    """Any error in place of the answer."""
    channel.injected = ChannelError.INTERNAL
    channel.write(40601, words(READ_DISPLAY), 0)
    assert channel.read(40601, 3, 0) == [1, 0x2F00, 4]
    assert channel.read(40601, 3, 20 * MS) == [2, 0x2F00, 5]


@pytest.mark.requirement("PD-206")
def test_one_request_at_a_time(channel, store):
    """While one is being carried out, another one has no effect; the first is answered."""
    channel.write(40601, words(READ_DISPLAY), 0)
    assert not channel.write(40601, words("0001 2F10 8002 0101 1001 0460 0000 0801 40A0 0000"), 10 * MS)
    assert store.value(1120) == 10
    assert channel.read(40601, 6, 20 * MS) == words("0002 2F08 8001 0101 0301 001F")


@pytest.mark.parametrize(("first", "count"), [(40600, 1), (40722, 2), (40723, 1)])
def test_registers_outside(channel, first, count):
    """Are the business of the register map, not of the channel."""
    with pytest.raises(IndexError):
        channel.read(first, count, 0)
    with pytest.raises(IndexError):
        channel.write(first, [0] * count, 0)


@pytest.mark.exhaustive
@settings(max_examples=200, derandomize=True, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 121), st.lists(st.integers(0, 0xFFFF), max_size=8), st.integers(0, 30)),
        max_size=8,
    )
)
def test_the_channel_always_comes_back(writes):
    """Whatever was written: after the latency a plain request is answered."""
    channel = ParameterChannel(ParameterServer({1: ParameterStore()}), latency_ns=20 * MS)
    now = 0
    for start, values, pause in writes:
        channel.write(40601 + start, values[: 122 - start], now)
        now += pause * MS
        assert len(channel.read(40601, 122, now)) == 122
    now += 20 * MS
    assert channel.write(40601, words(READ_DISPLAY), now)
    assert channel.read(40601, 6, now + 20 * MS) == words("0002 2F08 8001 0101 0301 001F")


# ------------------------------------------------------------------------------------ objects of a dictionary


@pytest.mark.requirement("PD-343")
@pytest.mark.parametrize(
    ("window", "number", "element", "where"),
    [
        (ParameterWindow(), 10, 0, (0x200A, 0)),
        (ParameterWindow(offset=1), 11_000, 0, (0x23E8, 0)),
        (ParameterWindow(), 9_999, 255, (0x470F, 255)),
        (ParameterWindow(page=1), 2051, 256 + 3, (0x2803, 3)),
        (ParameterWindow(offset=2), 20_001, 1, (0x2001, 1)),
        (ParameterWindow(offset=3, page=255), 39_999, 65_535, (0x470F, 255)),
    ],
)
def test_parameters_as_objects(window, number, element, where):
    """Both ways."""
    assert window.object(number, element) == where
    assert window.parameter(*where) == (number, element)


@pytest.mark.requirement("PD-343")
@pytest.mark.parametrize(
    ("window", "number", "element"),
    [
        (ParameterWindow(enabled=False), 10, 0),
        (ParameterWindow(), 11_000, 0),
        (ParameterWindow(), 10, 256),
        (ParameterWindow(page=1), 10, 255),
        (ParameterWindow(offset=1), 9_999, 0),
        (ParameterWindow(), 0, 0),
    ],
)
def test_what_cannot_be_seen(window, number, element):
    """Outside the window, or none enabled."""
    assert window.object(number, element) is None


@pytest.mark.requirement("PD-343")
@pytest.mark.parametrize("index", [0x1FFF, 0x2000, 0x4710, 0x6040])
def test_objects_that_are_no_parameters(index):
    """Below and above; there is no parameter 0."""
    assert ParameterWindow().parameter(index, 0) is None
    assert ParameterWindow(enabled=False).parameter(0x200A, 0) is None


@pytest.mark.parametrize("options", [{"page": 256}, {"page": -1}, {"offset": 4}])
def test_a_wrong_window(options):
    """Names the index of p8630."""
    with pytest.raises(ConfigurationError, match="p8630"):
        ParameterWindow(**options)


def test_abort_codes():
    """Of CiA 301 where it has one."""
    assert abort_code(0x00) == 0x06020000
    assert abort_code(0x01) == 0x06010002
    assert abort_code(0x11) == 0x08000022
    assert abort_code(0x87) == 0x08000000

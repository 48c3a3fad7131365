"""Where a register map has the telegram of a drive, and with which requests the controller carries it."""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.modbus import MapFile, Request, load_map, process_data
from fieldbus.profidrive import telegram

FRAME = bytes(range(1, 11))


def of(name, number=3):
    """Return the requests for a telegram behind a shipped map."""
    return process_data(load_map(name), telegram(number))


@pytest.mark.requirement("PD-286", "PD-295", "PD-299", "PD-334")
def test_a_sinamics_has_its_telegram_at_40100_and_40110():
    """Two requests, functions 16 and 3, addresses 0063h and 006Dh; function 23 is none that it has."""
    found = of("sinamics_g120")
    assert not found.combined
    assert found.write(FRAME) == Request(16, 0x63, 5, (0x0102, 0x0304, 0x0506, 0x0708, 0x090A))
    assert found.read() == Request(3, 0x6D, 9)


def test_a_festo_drive_takes_and_gives_in_one_request():
    """Function 23: outputs at 0, inputs at 100, the low word of NSOLL_B and XIST first, as in the time-out at
    400.
    """
    found = of("festo")
    assert found.combined
    assert found.exchange(FRAME) == Request(23, 100, 9, (0x0102, 0x0506, 0x0304, 0x0708, 0x090A), 0)
    assert found.frame(tuple(range(1, 10))).hex() == "000100030002000400050007000600090008"
    assert found.write_timeout(0x12345) == Request(16, 400, 2, (0x2345, 1))


@pytest.mark.parametrize(("number", "words", "hook"), [(106, 11, "setpoints"), (4, 14, "actual_values")])
def test_a_telegram_that_does_not_fit_is_refused(number, words, hook):
    """The message has the telegram, its words, and what the map has."""
    message = f"telegram {number}: '{words} words of {hook}' is not allowed; allowed: at most 10 in the map SINAMICS"  # noqa: E501
    with pytest.raises(ConfigurationError, match=message):
        of("sinamics_g120", number)


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"functions": [6]}, "23, or 3 and 16"), ({"block": []}, "no setpoints")],
)
def test_a_map_that_cannot_carry_a_telegram_is_refused(changes, message):
    """A map without process data, or without a function for it."""
    whole = load_map("festo").model_dump(by_alias=True)
    with pytest.raises(ConfigurationError, match=message):
        process_data(MapFile.model_validate({**whole, **changes}), telegram(1))

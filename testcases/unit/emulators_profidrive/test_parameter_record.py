"""Parameter access in data records: one request at a time, and why access is refused."""

from __future__ import annotations

import pytest

from emulators.drive.profidrive import DriveParameters
from emulators.drive.profidrive.parameters.access import ParameterRecord
from fieldbus.clock import MS
from fieldbus.profidrive.record_errors import RecordError, RecordRefusedError
from testcases.unit.emulators_profidrive.profidrive_rig import Rig

READ_P1121 = bytes.fromhex("80010101100104610000")


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def record(rig):
    return ParameterRecord(DriveParameters(rig.drive).server, available=lambda: rig.drive.powered)


def refused(action):
    """Return the code with which access is refused."""
    with pytest.raises(RecordRefusedError) as error:
        action()
    return error.value.code


@pytest.mark.requirement("PD-199", "PD-206")
@pytest.mark.parametrize("number", [0x2F, 0xB02E, 0xB02F])
def test_a_request_is_written_and_its_answer_read(record, number):
    """Before it is ready, and when it has been read: state conflict; a second request has to wait."""
    record.write(number, READ_P1121, 0)
    assert refused(lambda: record.read(number, 19 * MS)) is RecordError.STATE_CONFLICT
    assert refused(lambda: record.write(number, READ_P1121, 19 * MS)) is RecordError.STATE_CONFLICT
    assert record.read(number, 20 * MS) == bytes.fromhex("8001010108013F800000")
    assert refused(lambda: record.read(number, 20 * MS)) is RecordError.STATE_CONFLICT
    record.write(number, READ_P1121, 20 * MS)
    record.reset()
    assert refused(lambda: record.read(number, 99 * MS)) is RecordError.STATE_CONFLICT


@pytest.mark.requirement("PD-206", "PD-232")
@pytest.mark.parametrize(
    ("number", "data", "code"),
    [
        (0x30, READ_P1121, RecordError.INDEX),
        (0x2F, b"\1\1\1", RecordError.LENGTH),
        (0x2F, READ_P1121 + bytes(231), RecordError.LENGTH),
        (0x2F, b"\x80\x03" + READ_P1121[2:], RecordError.RANGE),
        (0x2F, b"\x00" + READ_P1121[1:], RecordError.RANGE),
    ],
)
def test_what_is_refused(record, number, data, code):
    """B0h, B1h, B7h; nothing is carried out."""
    assert refused(lambda: record.write(number, data, 0)) is code
    assert refused(lambda: record.read(0x2F, 99 * MS)) is RecordError.STATE_CONFLICT


@pytest.mark.requirement("PD-232")
def test_a_drive_without_supply_is_a_failed_module(rig, record):
    """A2h in both directions."""
    rig.drive.power_off()
    assert refused(lambda: record.write(0x2F, READ_P1121, 0)) is RecordError.MODULE
    assert refused(lambda: record.read(0x2F, 0)) is RecordError.MODULE


@pytest.mark.requirement("PD-232")
def test_every_code_has_its_number_and_words():
    """As PROFINET counts them."""
    assert [int(code) for code in RecordError] == [
        0xA0,
        0xA1,
        0xA2,
        0xA7,
        0xA8,
        0xA9,
        0xB0,
        0xB1,
        0xB2,
        0xB3,
        0xB5,
        0xB6,
        0xB7,
        0xB8,
        0xB9,
    ]
    assert all(code.text for code in RecordError)
    assert str(RecordRefusedError(RecordError.INDEX)) == "B0h: no such record"

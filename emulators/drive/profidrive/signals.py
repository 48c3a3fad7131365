"""Where the signals to the controller come from, by family: a table of functions per family, joined for the
telegram.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.faults.catalogue import namur_word
from emulators.drive.profidrive.modes.position import PositionMode
from fieldbus.profidrive.formats import to_int32, to_n2, to_n4

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

Getter = Callable[[], int]
Family = Callable[["ProfidriveDrive"], dict[str, Getter]]


def _status(drive: ProfidriveDrive) -> dict[str, Getter]:
    words = drive.words
    return {
        "ZSW1": words.zsw1,
        "ZSW2": words.zsw2,
        "MELDW": words.meldw,
        "MELD_NAMUR": lambda: namur_word([one.number for one in drive.faults.buffer.present]),
        "FAULT_CODE": lambda: drive.faults.number,
        "WARN_CODE": lambda: drive.faults.warning_number,
        "E_DIGITAL": lambda: drive.inputs & 0xFFFF,
    }


def _speed(drive: ProfidriveDrive) -> dict[str, Getter]:
    core, settings = drive.core, drive.settings

    def speed_n4() -> int:
        return to_n4(core.velocity / (settings.reference_speed_rpm * RPM))

    def speed_n2() -> int:
        return to_n2(core.velocity / (settings.reference_speed_rpm * RPM))

    return {"NIST_A": speed_n2, "NIST_A_GLATT": speed_n2, "NIST_B": speed_n4}


def _torque(drive: ProfidriveDrive) -> dict[str, Getter]:
    core, settings = drive.core, drive.settings

    def torque() -> int:
        return to_n2(core.torque / settings.reference_torque_Nm)

    def power() -> int:
        rated = settings.reference_torque_Nm * settings.reference_speed_rpm * RPM
        return to_n2(core.torque * core.velocity / rated)

    return {
        "M_ACT": torque,
        "MIST_GLATT": torque,
        "IAIST_GLATT": lambda: to_n2(abs(core.torque) / settings.reference_torque_Nm),
        "PIST_GLATT": power,
    }


def _encoders(drive: ProfidriveDrive) -> dict[str, Getter]:
    known: dict[str, Getter] = {
        "G1_ZSW": lambda: drive.g1_words[0],
        "G1_XIST1": lambda: drive.g1_words[1],
        "G1_XIST2": lambda: drive.g1_words[2],
    }
    second = drive.second
    if second is None:
        # A second encoder that is not fitted shows itself as parked (PD-151).
        return {**known, "G2_ZSW": lambda: 0x4000}
    return {
        **known,
        "G2_ZSW": lambda: second.words[0],
        "G2_XIST1": lambda: second.words[1],
        "G2_XIST2": lambda: second.words[2],
    }


def _position(drive: ProfidriveDrive) -> dict[str, Getter]:
    mode = drive.mode
    if not isinstance(mode, PositionMode):
        return {}
    positioner = mode.positioner
    return {
        "AKTSATZ": lambda: positioner.aktsatz,
        "POS_ZSW1": lambda: positioner.pos_zsw1,
        "POS_ZSW2": lambda: positioner.pos_zsw2,
        "POS_ZSW": lambda: positioner.pos_zsw2,
        "XIST_A": lambda: to_int32(positioner.position),
        "VIST_A": lambda: to_int32(positioner.velocity),
    }


def _safety(drive: ProfidriveDrive) -> dict[str, Getter]:
    safety, settings = drive.safety, drive.settings
    return {
        "S_ZSW1B": safety.s_zsw1b,
        "S_ZSW2B": safety.s_zsw2b,
        "S_ZSW3B": safety.s_zsw3b,
        "S_V_LIMIT_B": lambda: to_n4(safety.speed_limit() / (settings.reference_speed_rpm * RPM)),
    }


FAMILIES: Final[tuple[Family, ...]] = (_status, _speed, _torque, _encoders, _position, _safety)


def getters(drive: ProfidriveDrive, names: Iterable[str]) -> tuple[Getter, ...]:
    """Return one function per signal; a signal that the drive does not know is 0."""
    known = {name: get for family in FAMILIES for name, get in family(drive).items()}
    return tuple(known.get(name, _zero) for name in names)


def _zero() -> int:
    return 0

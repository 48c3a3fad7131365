"""Where the signals to the controller come from, and the telegram that they form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.inputs import DigitalInputs
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.faults.catalogue import namur_word
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.profidrive.positioner.positioner import Positioner
from emulators.drive.profidrive.safety.functions import SafetyFunctions
from emulators.drive.profidrive.second_encoder import SecondEncoder
from emulators.drive.profidrive.status_words import StatusWords
from fieldbus.profidrive import Layout
from fieldbus.profidrive.formats import to_int32, to_n2, to_n4

Getter = Callable[[], int]
_G1: Final = ("G1_ZSW", "G1_XIST1", "G1_XIST2")


def status_signals(words: StatusWords, faults: FaultState, inputs: DigitalInputs) -> dict[str, Getter]:
    """Return status words, fault and warning numbers, digital inputs."""
    return {
        "ZSW1": words.zsw1,
        "ZSW2": words.zsw2,
        "MELDW": words.meldw,
        "MELD_NAMUR": lambda: namur_word([one.number for one in faults.buffer.present]),
        "FAULT_CODE": lambda: faults.fault_code,
        "WARN_CODE": lambda: faults.warning_code,
        "E_DIGITAL": lambda: inputs.value & 0xFFFF,
    }


def motor_signals(core: ServoCore, settings: DriveSettings) -> dict[str, Getter]:
    """Return speed, torque, current and power."""

    def speed_n4() -> int:
        return to_n4(core.velocity / (settings.reference_speed_rpm * RPM))

    def speed_n2() -> int:
        return to_n2(core.velocity / (settings.reference_speed_rpm * RPM))

    def torque() -> int:
        return to_n2(core.torque / settings.reference_torque_nm)

    def power() -> int:
        rated = settings.reference_torque_nm * settings.reference_speed_rpm * RPM
        return to_n2(core.torque * core.velocity / rated)

    return {
        "NIST_A": speed_n2,
        "NIST_A_GLATT": speed_n2,
        "NIST_B": speed_n4,
        "M_ACT": torque,
        "MIST_GLATT": torque,
        "IAIST_GLATT": lambda: to_n2(abs(core.torque) / settings.reference_torque_nm),
        "PIST_GLATT": power,
    }


def second_encoder_signals(second: SecondEncoder | None) -> dict[str, Getter]:
    """Return the signals of G2; one that is not fitted shows itself as parked (PD-151)."""
    if second is None:
        return {"G2_ZSW": lambda: 0x4000}
    return {
        "G2_ZSW": lambda: second.words[0],
        "G2_XIST1": lambda: second.words[1],
        "G2_XIST2": lambda: second.words[2],
    }


def position_signals(positioner: Positioner) -> dict[str, Getter]:
    """Return the signals of the basic positioner."""
    return {
        "AKTSATZ": lambda: positioner.aktsatz,
        "POS_ZSW1": lambda: positioner.pos_zsw1,
        "POS_ZSW2": lambda: positioner.pos_zsw2,
        "POS_ZSW": lambda: positioner.pos_zsw2,
        "XIST_A": lambda: to_int32(positioner.position),
        "VIST_A": lambda: to_int32(positioner.velocity),
    }


def safety_signals(safety: SafetyFunctions, settings: DriveSettings) -> dict[str, Getter]:
    """Return the safety info words."""
    return {
        "S_ZSW1B": safety.s_zsw1b,
        "S_ZSW2B": safety.s_zsw2b,
        "S_ZSW3B": safety.s_zsw3b,
        "S_V_LIMIT_B": lambda: to_n4(safety.speed_limit() / (settings.reference_speed_rpm * RPM)),
    }


class ActualTelegram:
    """The telegram to the controller.

    Args:
        layout: Its signals.
        sources: Function of every signal that the drive knows but G1; any other signal is 0.

    """

    def __init__(self, layout: Layout, sources: Mapping[str, Getter]) -> None:
        self.g1_words: tuple[int, int, int] = (0, 0, 0)
        """G1_ZSW, G1_XIST1, G1_XIST2 of this bus cycle."""
        names = layout.names
        self._pack = layout.pack
        # The usual place of G1: no calls for its three signals.
        self._ends_with_g1 = names[-3:] == _G1
        known = {**sources, **self._encoder_signals()}
        self._getters = tuple(
            known.get(name, _zero) for name in (names[:-3] if self._ends_with_g1 else names)
        )

    def _encoder_signals(self) -> dict[str, Getter]:
        return {
            "G1_ZSW": lambda: self.g1_words[0],
            "G1_XIST1": lambda: self.g1_words[1],
            "G1_XIST2": lambda: self.g1_words[2],
        }

    def frame(self) -> bytes:
        """Return the telegram with the values of now."""
        if self._ends_with_g1:
            return self._pack(*[get() for get in self._getters], *self.g1_words)
        return self._pack(*[get() for get in self._getters])


def _zero() -> int:
    return 0

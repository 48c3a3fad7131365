"""Tables within `[drive.NAME]` that choose between models, or serve controller and drive: `encoder2` and
`profidrive`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag

from emulators.drive.second_encoder_config import LinearSecondEncoder, RotarySecondEncoder
from hil.bench._table import Table


class NoSecondEncoder(Table, frozen=True):
    """`[drive.NAME.encoder2]` with `type = "none"`: there is no second encoder."""

    label: ClassVar[str] = 'an encoder2 with type = "none"'

    type: Literal["none"] = "none"
    """`none`: not fitted."""


def second_encoder_variables(encoder: SecondEncoderTable, prefix: str) -> dict[str, int | float]:
    """Return the variables that an axis takes over from a second encoder, as an
    offline transfer does (CFG-356).
    """
    form = encoder.form()
    values: dict[str, int | float] = {
        f"{prefix}.Type": int(form.absolute),
        f"{prefix}.Parameter.FineResolutionXist1": form.shift_xist1,
        f"{prefix}.Parameter.FineResolutionXist2": form.shift_xist2,
        f"{prefix}.System": int(not form.linear),
        f"{prefix}.MountingMode": 0 if encoder.mounting == "motor" else 1,
    }
    if isinstance(encoder, LinearSecondEncoder):
        values[f"{prefix}.Parameter.Resolution"] = encoder.measuring_step_um / 1000.0
    else:
        values[f"{prefix}.Parameter.StepsPerRevolution"] = encoder.steps_per_revolution
        values[f"{prefix}.Parameter.DeterminableRevolutions"] = form.revolutions
    return values


def _second_encoder(table: Any) -> Any:
    kind = table.get("type", "none") if isinstance(table, dict) else getattr(table, "type", None)
    if kind in ("none", None):
        return kind
    return "linear" if str(kind).endswith("_linear") else "rotary"


SecondEncoderTable = RotarySecondEncoder | LinearSecondEncoder
AnySecondEncoder = Annotated[
    Annotated[NoSecondEncoder, Tag("none")]
    | Annotated[RotarySecondEncoder, Tag("rotary")]
    | Annotated[LinearSecondEncoder, Tag("linear")],
    Discriminator(_second_encoder),
]
"""`[drive.NAME.encoder2]`, chosen by its key `type`."""


class ProfidriveTable(Table, frozen=True):
    """`[drive.NAME.profidrive]`: supplements, references and monitoring of a PROFIdrive axis."""

    torque_telegram: bool = False
    """Telegram 750 follows: additive torque, torque limits, actual torque."""
    safety_telegram: Literal[700, 701] | None = None
    """Telegram 700 or 701 follows: the safety information channel. On CAN a telegram with its supplements
    has at most 16 words.
    """
    reference_speed_rpm: Annotated[float, Field(ge=6.0, le=210_000.0)] = 3000.0
    """Speed that 4000h stands for (p2000)."""
    reference_torque_nm: Annotated[float, Field(ge=0.001, le=1_000_000.0)] = 2.0
    """Torque that 4000h stands for (p2003)."""
    fine_resolution_bits: Annotated[int, Field(ge=0, le=20)] = 11
    """Fine resolution of G1_XIST1 (p0418); `increments_per_revolution` are without it (P979[2])."""
    operating_mode: Literal[1, 3] = 3
    """PNU 930 of the emulated drive: 1 with ramp-function generator, 3 without."""
    ramp_up_s: Annotated[float, Field(ge=0.0, le=1000.0)] = 10.0
    """p1120 of the emulated drive, which acts in operating mode 1; 0 = at once."""
    interpolation: bool = True
    """The emulated drive reaches a setpoint of operating mode 3 linearly within
    the bus cycle; false: at once.
    """
    sign_of_life_tolerance: Annotated[int, Field(ge=0, le=65_535)] = 1
    """Failures of the sign of life that the emulated drive tolerates (PNU 925); 65535 = not monitored."""
    sign_of_life: bool | None = None
    """Whether drive and controller watch each other's counter; none: where the telegram has one, but not on
    live Modbus.
    """
    setpoint_monitoring_ms: Annotated[float, Field(ge=0.0, le=2_000_000.0)] = 100.0
    """The emulated drive trips with F01910 when no telegram comes for this long (p2040); 0 = never."""

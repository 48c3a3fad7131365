"""`[drive.NAME.encoder2]`: the second encoder of a PROFIdrive axis, or none."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Tag

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


def _second_encoder(table: object) -> str | None:
    if isinstance(table, NoSecondEncoder | RotarySecondEncoder | LinearSecondEncoder):
        kind: object = table.type
    elif isinstance(table, dict):
        kind = table.get("type", "none")
    else:
        return None
    if kind in ("none", None):
        return None if kind is None else "none"
    return "linear" if str(kind).endswith("_linear") else "rotary"


SecondEncoderTable = RotarySecondEncoder | LinearSecondEncoder
AnySecondEncoder = Annotated[
    Annotated[NoSecondEncoder, Tag("none")]
    | Annotated[RotarySecondEncoder, Tag("rotary")]
    | Annotated[LinearSecondEncoder, Tag("linear")],
    Discriminator(_second_encoder),
]
"""`[drive.NAME.encoder2]`, chosen by its key `type`."""

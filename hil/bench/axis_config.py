"""`[axis.NAME]` and `[external_encoder.NAME]` of a bench file: which drives and encoders a technology object
may have.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from motion.s7.axis.configuration import encoders_of_telegram
from motion.s7.compatibility import LEVELS

if TYPE_CHECKING:
    from hil.bench._profidrive_encoder import Encoder2Section
    from hil.bench.config import AxisSection, BenchConfig
    from hil.bench.drive_config import DriveSection
    from hil.bench.encoder_config import EncoderSection


WITH_G2: Final = (4, 6, 103, 106)
"""Telegrams with a second encoder."""


def second_of(drive: str) -> str:
    """Return the name of the second encoder of a drive."""
    return f"{drive}.encoder2"


def check_axis_encoders(name: str, axis: AxisSection, config: BenchConfig) -> None:
    """Check the encoders of an axis (CFG-174, CFG-175, CFG-201).

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    where = f"axis.{name}.encoders"
    drive = config.drive[axis.drive]
    if axis.connection == "data_block" and drive.profile != "profidrive":
        raise ValueError(
            f"axis.{name}.connection: 'data_block' holds a telegram; profile of {axis.drive!r} is "
            f"{drive.profile}"
        )
    speed_only = drive.profile == "profidrive" and drive.telegram in (1, 2)
    if axis.type == "speed":
        if axis.encoders is not None:
            raise ValueError(f"{where}: a speed axis has no encoder (CFG-174)")
        return
    encoders = encoders_of_axis(axis, drive, config.bench.cpu) or (axis.drive,)
    if axis.encoders == ():
        encoders = ()
    if not encoders:
        raise ValueError(f"{where}: a positioning axis needs an encoder")
    if len(set(encoders)) != len(encoders):
        raise ValueError(f"{where}: an encoder stands twice in {', '.join(encoders)}")
    level = LEVELS[config.bench.cpu]
    if len(encoders) > level.encoders:
        raise ValueError(
            f'{where}: {len(encoders)} encoders need bench.cpu = "S7-1500T"; an {level.name} has one per axis'
        )
    for one in encoders:
        if one == axis.drive:
            if speed_only:
                raise ValueError(
                    f"axis.{name}.drive: telegram {drive.telegram} of {axis.drive!r} has no encoder value "
                    f"for a positioning "
                    "axis; allowed: 3, 4, 5, 6, 102, 103, 105, 106, or `encoders` of its own"
                )
        elif one == second_of(axis.drive):
            if drive.encoder2.type == "none" or drive.telegram not in WITH_G2:
                raise ValueError(
                    f"{where}: {one!r} needs encoder2 of {axis.drive!r} and one of its telegrams "
                    f"{', '.join(map(str, WITH_G2))}"
                )
        elif one not in config.encoder:
            known = ", ".join((axis.drive, *config.encoder))
            raise ValueError(f"{where}: {one!r} is neither its drive nor an encoder; there are: {known}")
        elif not config.leads(config.encoder[one].segment):
            raise ValueError(
                f"{where}: {one!r} is on {config.encoder[one].segment!r}, which somebody else leads"
            )


def encoders_of_axis(axis: AxisSection, drive: DriveSection, cpu: str) -> tuple[str, ...] | None:
    """Return where the encoders of an axis come from: as it says, or both of telegram 6 and 106 (CFG-282);
    None: the drive.
    """
    if axis.encoders is not None or axis.type == "speed":
        return axis.encoders
    both = drive.profile == "profidrive" and encoders_of_telegram(drive.telegram, cpu) == 2
    return (axis.drive, second_of(axis.drive)) if both and drive.encoder2.type != "none" else None


def check_external_encoders(config: BenchConfig) -> None:
    """Check what external encoders say of encoders (CFG-176).

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    for name, section in config.external_encoder.items():
        if section.encoder not in config.encoder:
            known = ", ".join(config.encoder) or "none"
            raise ValueError(
                f"external_encoder.{name}.encoder: {section.encoder!r} is not an encoder; there are: {known}"
            )
        if not config.leads(config.encoder[section.encoder].segment):
            raise ValueError(
                f"external_encoder.{name}.encoder: {section.encoder!r} is on a segment that somebody "
                f"else leads"
            )
        led = [axis.drive for axis in config.axis.values()]
        if section.drive is not None and section.drive not in led:
            raise ValueError(
                f"external_encoder.{name}.drive: {section.drive!r} is not the drive of an axis; there are: "
                f"{', '.join(led) or 'none'}"
            )


def from_drive(drive: DriveSection) -> dict[str, Any]:
    """Return what the controller takes over from the configuration of a drive, as an offline transfer does
    (CFG-356).
    """
    if drive.profile == "profidrive":
        own = drive.profidrive
        speed, torque = own.reference_speed_rpm, own.reference_torque_nm
    else:
        own_speed = {
            "analog": drive.analog.reference_speed_rpm,
            "tm_pto": drive.tm_pto.reference_speed_rpm,
        }
        speed, torque = own_speed.get(drive.profile, drive.max_speed_rpm), drive.rated_torque_nm
    return {
        "Actor.DriveParameter.ReferenceSpeed": speed,
        "Actor.DriveParameter.ReferenceTorque": torque,
    }


def from_second_encoder(encoder: Encoder2Section, prefix: str) -> dict[str, Any]:
    """Return what the controller takes over from the configuration of a drive's second encoder (CFG-356)."""
    from hil.bench._profidrive_encoder import encoder_format

    form = encoder_format(encoder, encoder.fine_xist1_bits, encoder.fine_xist2_bits)
    values: dict[str, Any] = {
        f"{prefix}.Type": int(form.absolute),
        f"{prefix}.Parameter.FineResolutionXist1": form.shift_xist1,
        f"{prefix}.Parameter.FineResolutionXist2": form.shift_xist2,
        f"{prefix}.System": int(not form.linear),
        f"{prefix}.MountingMode": 0 if encoder.mounting == "motor" else 1,
    }
    if form.linear:
        values[f"{prefix}.Parameter.Resolution"] = encoder.measuring_step_um / 1000.0
    else:
        values[f"{prefix}.Parameter.StepsPerRevolution"] = encoder.steps_per_revolution
        values[f"{prefix}.Parameter.DeterminableRevolutions"] = form.revolutions
    return values


def from_encoder(encoder: EncoderSection, prefix: str) -> dict[str, Any]:
    """Return what the controller takes over from the configuration of an encoder (CFG-356)."""
    kind = 1 if "incremental" not in encoder.type else 0
    values: dict[str, Any] = {f"{prefix}.Type": kind, f"{prefix}.Parameter.FineResolutionXist1": 0}
    if encoder.profile == "profidrive":
        from hil.bench._profidrive_encoder import encoder_format

        own = encoder.profidrive
        form = encoder_format(encoder, own.fine_xist1_bits, own.fine_xist2_bits)
        values[f"{prefix}.Parameter.FineResolutionXist1"] = form.shift_xist1
        values[f"{prefix}.Parameter.FineResolutionXist2"] = form.shift_xist2
        if encoder.linear:
            values[f"{prefix}.Parameter.ReferenceVelocity"] = own.reference_speed * 0.06  # m/min, there mm/s
        else:
            values[f"{prefix}.Parameter.ReferenceSpeed"] = own.reference_speed
    if encoder.linear:
        values[f"{prefix}.System"] = 0
        values[f"{prefix}.Parameter.Resolution"] = encoder.measuring_step_um / 1000.0
        values[f"{prefix}.MountingMode"] = 1
    else:
        values[f"{prefix}.System"] = 1
        values[f"{prefix}.Parameter.StepsPerRevolution"] = encoder.steps_per_revolution
        values[f"{prefix}.Parameter.DeterminableRevolutions"] = 0
        if kind:
            counts = encoder.type in ("multi_turn", "single_turn_counting")
            values[f"{prefix}.Parameter.DeterminableRevolutions"] = encoder.revolutions if counts else 1
        if encoder.on is not None:
            values[f"{prefix}.MountingMode"] = 0 if encoder.mounting == "motor" else 1
    return values

"""Machines: the axis plant with the transmission of a lead screw or of a gear."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from emulators.mechanics._axis import AxisMechanics
from emulators.mechanics._checks import checked
from emulators.mechanics._switch import SwitchModel

_TAU: Final = 2.0 * math.pi
_LARGEST_SHARE: Final = 0.99


class LinearAxisMechanics(AxisMechanics):
    """A load on a lead screw: motor, gear, screw, slide. Positions in m, forces in N.

    Args:
        lead_screw_m: Travel per revolution of the screw, m, > 0.
        gear_ratio: Motor revolutions per revolution of the screw, > 0.
        motor_inertia_kgm2: Rotor (and whatever turns at motor speed), kg m^2, > 0.
        screw_inertia_kgm2: Screw (and whatever turns at its speed), kg m^2, >= 0.
        load_mass_kg: Moved mass, kg, >= 0.
        viscous_friction: N per m/s.
        coulomb_friction: N.
        static_friction: N; default: as `coulomb_friction`.
        gravity_force: Force of the weight along the travel, N, positive in positive direction.
        lower_stop_m: Lower end stop, m, or None.
        upper_stop_m: Upper end stop, m, or None.
        stop_stiffness: N/m.
        stop_damping: Ns/m.
        position_m: Start position, m.
        switches: Switches on the travel, positions in m.
        backlash_m: Play between nut and slide, from one side to the other, m, >= 0; motor and screw are
            on one side of it.
        reversed_direction: The slide goes backwards while the motor turns forwards.

    """

    __slots__ = ()

    def __init__(
        self,
        *,
        lead_screw_m: float,
        motor_inertia_kgm2: float,
        gear_ratio: float = 1.0,
        screw_inertia_kgm2: float = 0.0,
        load_mass_kg: float = 0.0,
        viscous_friction: float = 0.0,
        coulomb_friction: float = 0.0,
        static_friction: float | None = None,
        gravity_force: float = 0.0,
        lower_stop_m: float | None = None,
        upper_stop_m: float | None = None,
        stop_stiffness: float = 1e7,
        stop_damping: float = 2e4,
        position_m: float = 0.0,
        switches: Iterable[SwitchModel] = (),
        backlash_m: float = 0.0,
        reversed_direction: bool = False,
    ) -> None:
        lead = checked("lead_screw_m", lead_screw_m, positive=True)
        gear = checked("gear_ratio", gear_ratio, positive=True)
        motor = checked("motor_inertia_kgm2", motor_inertia_kgm2, positive=True)
        screw = checked("screw_inertia_kgm2", screw_inertia_kgm2, minimum=0.0)
        mass = checked("load_mass_kg", load_mass_kg, minimum=0.0)
        per_screw = lead / _TAU
        ratio = per_screw / gear
        turning = screw / (per_screw * per_screw) + motor / (ratio * ratio)
        super().__init__(
            ratio=-ratio if reversed_direction else ratio,
            inertia=mass + turning,
            backlash=backlash_m,
            motor_share=_motor_share(turning, mass),
            viscous_friction=viscous_friction,
            coulomb_friction=coulomb_friction,
            static_friction=static_friction,
            gravity_force=gravity_force,
            lower_stop=lower_stop_m,
            upper_stop=upper_stop_m,
            stop_stiffness=stop_stiffness,
            stop_damping=stop_damping,
            position=position_m,
            switches=switches,
        )


class RotaryAxisMechanics(AxisMechanics):
    """A rotary load behind a gear. Positions in rad of the load, torques at the load in Nm.

    Args:
        gear_ratio: Motor revolutions per revolution of the load, > 0.
        motor_inertia_kgm2: Rotor, kg m^2, > 0.
        load_inertia_kgm2: Load at its own shaft, kg m^2, >= 0.
        viscous_friction: Nm per rad/s at the load.
        coulomb_friction: Nm at the load.
        static_friction: Nm; default: as `coulomb_friction`.
        load_torque: Constant torque on the load, Nm, positive in positive direction.
        lower_stop_rad: Lower end stop, rad, or None.
        upper_stop_rad: Upper end stop, rad, or None.
        stop_stiffness: Nm/rad.
        stop_damping: Nms/rad.
        position_rad: Start position, rad.
        switches: Switches on the travel, positions in rad.
        backlash_rad: Play between gear and load, from one side to the other, rad, >= 0.
        reversed_direction: The load turns backwards while the motor turns forwards.

    """

    __slots__ = ()

    def __init__(
        self,
        *,
        motor_inertia_kgm2: float,
        gear_ratio: float = 1.0,
        load_inertia_kgm2: float = 0.0,
        viscous_friction: float = 0.0,
        coulomb_friction: float = 0.0,
        static_friction: float | None = None,
        load_torque: float = 0.0,
        lower_stop_rad: float | None = None,
        upper_stop_rad: float | None = None,
        stop_stiffness: float = 1e4,
        stop_damping: float = 1e1,
        position_rad: float = 0.0,
        switches: Iterable[SwitchModel] = (),
        backlash_rad: float = 0.0,
        reversed_direction: bool = False,
    ) -> None:
        gear = checked("gear_ratio", gear_ratio, positive=True)
        motor = checked("motor_inertia_kgm2", motor_inertia_kgm2, positive=True)
        load = checked("load_inertia_kgm2", load_inertia_kgm2, minimum=0.0)
        super().__init__(
            ratio=(-1.0 if reversed_direction else 1.0) / gear,
            inertia=load + motor * gear * gear,
            backlash=backlash_rad,
            motor_share=_motor_share(motor * gear * gear, load),
            viscous_friction=viscous_friction,
            coulomb_friction=coulomb_friction,
            static_friction=static_friction,
            gravity_force=load_torque,
            lower_stop=lower_stop_rad,
            upper_stop=upper_stop_rad,
            stop_stiffness=stop_stiffness,
            stop_damping=stop_damping,
            position=position_rad,
            switches=switches,
        )


def _motor_share(motor: float, load: float) -> float:
    """Return the share of the motor's side; a load without inertia has still a little, which keeps it apart
    from nothing.
    """
    return min(motor / (motor + load), _LARGEST_SHARE)

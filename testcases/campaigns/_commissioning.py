"""What the cases of `commissioning` share: an operator at the control panel of the axis, and what he gets to
see.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import CaseContext
from hil.errors import HilError
from hil.expect import Expectation, golden, happens, ramp, status_word_bit, value_at
from hil.record import event
from testcases.campaigns.support import axis_name, settle_s, tolerance

MONITORING_S: Final = 0.5
"""Monitoring time of the life sign in the cases, s; an operator takes 1 to 2 s (COM-024)."""
JOG: Final = 200.0
"""Velocity at which something happens, mm/s."""


class Operator:
    """Somebody at the control panel of the default axis.

    Args:
        ctx: Context of the case.
        alive: Whether the panel gives signs of life by itself.

    """

    def __init__(self, ctx: CaseContext, *, alive: bool = True) -> None:
        self._ctx = ctx
        self.axis = ctx.axis
        self.panel: Any = ctx.axis.control_panel(monitoring_s=MONITORING_S, alive=alive)

    def take(self) -> Operator:
        """Take master control and enable."""
        self._ctx.do("take master control and enable in the panel")
        self.panel.take_control()
        self.panel.enable()
        self._ctx.wait_until(lambda: self.panel.enabled, 5.0, "the axis is enabled by the panel")
        self._ctx.run_for(0.05)
        return self

    def jog(self, velocity: float = JOG) -> Any:
        """Jog with `velocity`, mm/s, and wait until the axis has it."""
        panel = self.panel
        panel.velocity, panel.acceleration, panel.jerk = abs(velocity), 1000.0, 0.0
        self._ctx.do(f"jog with {velocity:g} mm/s")
        job = panel.jog(100.0 if velocity > 0.0 else -100.0)
        self._ctx.wait_until(lambda: abs(self.axis.var("Velocity") - velocity) < 1e-6, 3.0, "the axis jogs")
        self._ctx.run_for(0.1)
        return job

    def give_back(self) -> None:
        """Disable, return control, and wait for it."""
        self._ctx.do("return master control")
        self.panel.release()
        self._ctx.wait_until(lambda: not self.panel.active, 5.0, "control is returned")
        self._ctx.run_for(0.02)

    def refused(self, act: Callable[[], object], text: str) -> None:
        """Expect a command refused in words that hold `text`."""
        reported = "it was carried out"
        try:
            act()
        except HilError as error:
            reported = str(error)
        self._ctx.observe(reported)
        self._ctx.measure(f"refused: {text}", float(text in reported), low=1.0)

    def has_control(self, *, at: float, control: bool = True) -> Expectation:
        """Expect `StatusWord.X4` (COM-023)."""
        return status_word_bit(4, control, at=at, axis=axis_name(self._ctx)).covers("COM-023")

    def returned(self, *, since: Any, within_s: float, error_id: int = 0) -> Expectation:
        """Expect control back with the user program."""
        return happens(
            event("panel.control", axis_name(self._ctx), what="returned", error_id=error_id),
            since=since,
            within_s=within_s,
        )


def greatest_deceleration(ctx: CaseContext, since: Any) -> Expectation:
    """Expect the setpoint to come to zero on the ramp of the greatest deceleration and jerk (COM-031), from
    200 mm/s.
    """
    read = ctx.axis.variables.read
    expected = golden.stop_ramp(JOG, read("DynamicLimits.MaxDeceleration"), read("DynamicLimits.MaxJerk"))
    allowed = tolerance(ctx)
    return ramp(
        since,
        expected,
        axis=axis_name(ctx),
        made_by="controller",
        time_tolerance_s=allowed.time_s,
        distance_tolerance=allowed.distance,
    ).covers("COM-031")


def at_rest(ctx: CaseContext) -> Expectation:
    """Expect the setpoint at zero now."""
    ctx.run_for(settle_s(ctx))
    return value_at(f"{axis_name(ctx)}.velocity_setpoint", ctx.now_s, 0.0, tolerance=1e-9)

"""Which signal goes where in the plot."""

from __future__ import annotations

import numpy as np

from reports import Signal
from reports.html.signals import arrange, bands, is_setpoint


def signal(name: str, unit: str = "", values=(0.0, 2.5), enum=None) -> Signal:
    array = np.array(values, dtype=np.float64)
    return Signal(name, unit, np.arange(len(array)) * 0.004, array, enum or {})


def test_setpoint_and_actual_value_share_a_panel():
    """A panel is one quantity in one unit, setpoint first."""
    panels, _lanes = arrange(
        [
            signal("axis1.actual_position", "mm"),
            signal("axis1.position_setpoint", "mm"),
            signal("drive1.position", "m"),
        ]
    )
    assert [(panel.title, panel.unit, [item.name for item in panel.signals]) for panel in panels] == [
        ("Position", "mm", ["axis1.position_setpoint", "axis1.actual_position"]),
        ("Position", "m", ["drive1.position"]),
    ]


def test_first_sight_is_the_controllers_view():
    """Shown at once: position, velocity, following error, torque, each once, of the axis rather than of the
    drive.
    """
    panels, lanes = arrange(
        [
            signal("drive1.position", "m"),
            signal("drive1.motor_speed", "rpm"),
            signal("drive1.torque", "Nm"),
            signal("drive1.following_error", "inc"),
            signal("axis1.position_setpoint", "mm"),
            signal("axis1.velocity_setpoint", "mm/s"),
            signal("axis1.following_error", "mm"),
            signal("axis1.acceleration_setpoint", "mm/s2"),
            signal("axis1.state", enum={0: "A"}),
        ]
    )
    shown = [(panel.title, panel.unit) for panel in panels if panel.shown]
    assert shown == [("Position", "mm"), ("Velocity", "mm/s"), ("Following error", "mm"), ("Torque", "Nm")]
    assert [lane.shown for lane in lanes] == [True]


def test_many_axes_get_panels_of_their_own():
    """More than three curves of several components are divided, and the axis of interest is the one shown."""
    signals = [
        signal(f"axis{number}.{name}", "mm")
        for number in (1, 2, 3)
        for name in ("actual_position", "position_setpoint")
    ]
    panels, _ = arrange(signals, {"axis2"})
    assert [[item.name for item in panel.signals] for panel in panels if panel.shown] == [
        ["axis2.position_setpoint", "axis2.actual_position"]
    ]
    assert len(panels) == 3


def test_speed_axis_shows_its_speed():
    """Without a velocity the speed stands in; with nothing known the first panels are shown."""
    panels, _ = arrange([signal("axis1.actual_speed", "rpm"), signal("axis1.actual_torque", "Nm")])
    assert [panel.title for panel in panels if panel.shown] == ["Torque", "Speed"]
    panels, _ = arrange([signal("plant.humidity", "%")])
    assert [panel.shown for panel in panels] == [True]


def test_numbers_that_stand_for_something_become_lanes():
    """States, words, codes and bits are bands, not curves; a quantity with a unit never is."""
    _panels, lanes = arrange(
        [
            signal("drive1.statusword", values=(0x0637, 0x0218)),
            signal("axis1.alarm_number", values=(0, 521)),
            signal("axis1.power_status", values=(0, 1)),
            signal("axis1.state", values=(3, 4), enum={3: "STANDSTILL", 4: "MOTION"}),
            signal("axis1.position", "mm", values=(0, 1)),
            signal("axis1.ratio", values=(0.5, 1.0)),
        ]
    )
    assert [(lane.signal.name, lane.kind) for lane in lanes] == [
        ("axis1.state", "state"),
        ("axis1.alarm_number", "code"),
        ("axis1.power_status", "bit"),
        ("drive1.statusword", "word"),
    ]


def test_bands_are_exact_changes():
    """A band starts at the sample that changed; NaN is one gap."""
    _, (lane,) = arrange([signal("axis1.state", values=(3, 3, 4, np.nan, np.nan, 4), enum={3: "a", 4: "b"})])
    assert bands(lane) == ([0.0, 0.008, 0.012, 0.02], [3.0, 4.0, None, 4.0])


def test_restless_word_is_bounded():
    """A sign-of-life counter does not blow up the page."""
    _, (lane,) = arrange([signal("drive1.stw2_word", values=np.arange(50_000) % 16)])
    starts, values = bands(lane)
    assert len(starts) == len(values) <= 3000
    assert starts[0] == 0.0


def test_empty_and_ragged_signals_are_left_out():
    """A recording that never got a sample breaks nothing."""
    panels, lanes = arrange(
        [signal("axis1.position", "mm", values=()), Signal("x", "mm", np.zeros(2), np.zeros(3))]
    )
    assert (panels, lanes) == ([], [])


def test_setpoints_are_known_by_name():
    """Dashed is what was asked for."""
    assert is_setpoint("axis1.velocity_setpoint")
    assert is_setpoint("drive1.torque_demand")
    assert is_setpoint("axis1.speed_output")
    assert not is_setpoint("axis1.actual_velocity")


def test_axes_at_rest_are_not_shown_while_others_move():
    """Who moves a thousandth of the others, or not at all, is at rest; unless something happened to it."""
    signals = [
        signal(f"{axis}.{name}", "mm", values)
        for axis, values in (("x", (0.0, 100.0)), ("y", (5.0, 5.01)), ("z", (7.0, 7.0)))
        for name in ("actual_position", "position_setpoint")
    ]
    signals += [signal(f"{axis}.state", values=(0, 1), enum={0: "A", 1: "B"}) for axis in "xyz"]
    panels, lanes = arrange(signals, involved=["z"])
    assert [(panel.signals[0].name[0], panel.idle) for panel in panels] == [
        ("x", False),
        ("z", False),
        ("y", True),
    ]
    assert {lane.signal.name[0]: lane.shown for lane in lanes} == {"x": True, "y": False, "z": True}
    _panels, lanes = arrange([one for one in signals if one.name[0] == "z"])
    assert [lane.shown for lane in lanes] == [True], "where nothing moves nothing is hidden"

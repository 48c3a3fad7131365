"""What is kept over RUN-STOP-RUN, restart, download, power-off, memory reset and factory reset (MC-606,
CFG-616, HOM 2.21).
"""

from __future__ import annotations

import pytest

from fieldbus.errors import ConfigurationError
from motion.s7.controller import OperatingState

INCREMENTAL, ABSOLUTE, CYCLIC = 0, 1, 2
EVENTS = ("run_stop_run", "restart", "download", "power_cycle", "memory_reset", "factory_reset")


def happen(rig, event):
    """Let one of `EVENTS` happen to the controller of an axis, and wait until it is over."""
    if event == "restart":
        if rig.axis.enabling.enable:
            rig.axis.power(False)
            rig.until(rig.axis.power_instance.off)
        rig.until(rig.axis.reset(restart=True).done)
        rig.cycles(2)
    elif event == "power_cycle":
        rig.power_cycled()
    else:
        rig.stopped()
        if event == "download":
            rig.controller.download("axis1")
        elif event != "run_stop_run":
            getattr(rig.controller, event)()
        rig.running()


def table(*kept):
    """Parametrise with every event and whether it keeps something."""
    return pytest.mark.parametrize(("event", "kept"), [(one, one in kept) for one in EVENTS], ids=EVENTS)


@pytest.mark.requirement("MC-460", "MC-606", "VAR-013", "STP-081", "LIM-066", "LIM-067", "CFG-003")
@table("run_stop_run")
def test_parameters_that_act_at_once(rig, event, kept):
    """1000 and 1020 of MC_WriteParameter."""
    rig.until(rig.axis.write_parameter(1020, 5).done)
    rig.until(rig.axis.write_parameter(1000, True).done)
    before = (7, False)  # as configured
    happen(rig, event)
    now = rig.axis.var("Actor.RemoveEnableReaction"), rig.axis.var("PositionLimits_HW.Active")
    assert now == ((5, True) if kept else before)


@pytest.mark.requirement("VAR-227", "CTL-106", "VAR-224")
@table("run_stop_run")
def test_assigned_values(rig, event, kept):
    """DIR and CAL values of the program."""
    rig.axis.write("Override.Velocity", 35.0)
    rig.axis.write("PositionControl.Kv", 33.0)
    rig.axis.write("DynamicDefaults.Velocity", 77.0)
    rig.cycles(1)
    happen(rig, event)
    now = [
        rig.axis.var(path) for path in ("Override.Velocity", "PositionControl.Kv", "DynamicDefaults.Velocity")
    ]
    assert now == ([35.0, 33.0, 77.0] if kept else [100.0, 20.0, 100.0])


@pytest.mark.requirement("VAR-227", "VAR-229")
@table(*EVENTS)
def test_start_values_in_load_memory(rig, event, kept):
    """What WRIT_DBL has written lasts, and the controller puts it into force at RUN -> STOP, too."""
    rig.axis.variables.write_start("PositionControl.Kv", 44.0)
    rig.axis.variables.write_start("Actor.RemoveEnableReaction", 3)
    happen(rig, event)
    assert kept
    assert rig.axis.var("Actor.RemoveEnableReaction") == 3
    assert rig.axis.var("PositionControl.Kv") == 44.0


@pytest.mark.requirement("MC-461", "MC-606", "VAR-012", "MON-034", "CFG-270", "CFG-271", "CFG-616")
@table("run_stop_run", "restart")
def test_communication_times(make_rig, event, kept):
    """1010 to 1012, which act after a restart."""
    rig = make_rig(connection="data_block")
    for number, value in ((1010, 0.001), (1011, 0.002), (1012, 0.003)):
        rig.until(rig.axis.write_parameter(number, value).done)
    rig.until(rig.axis.reset(restart=True).done)
    times = [rig.axis.variables.parameter(number).cell.value for number in (1010, 1011, 1012)]
    assert times == [0.001, 0.002, 0.003]
    happen(rig, event)
    now = [rig.axis.variables.parameter(number).cell.value for number in (1010, 1011, 1012)]
    assert now == (times if kept else [0.0, 0.0, 0.0])
    assert rig.axis.object.delay_s == pytest.approx(0.004 + (0.006 if kept else 0.0))


@pytest.mark.requirement(
    "CFG-616", "CFG-108", "VAR-111", "HOM-183", "HOM-184", "HOM-186", "HOM-187", "VAR-158", "CFG-294"
)
@table("run_stop_run")
def test_incremental_encoder(make_rig, event, kept):
    """Position, modulo counter and homed state; after power-on the position is 0."""
    rig = make_rig(variables={"Properties.MotionType": 1, "Modulo.Enable": True, "Modulo.Length": 360.0})
    rig.enabled()
    rig.until(rig.axis.home(100.0).done)
    rig.until(rig.axis.move_absolute(100.0 + 720.0 % 360.0, Velocity=2000.0).done)
    rig.until(rig.axis.move_relative(730.0, Velocity=2000.0).done, 10.0)
    assert rig.axis.var("ActualModuloCycle") == 2
    position = rig.axis.var("ActualPosition")
    happen(rig, event)
    assert rig.axis.var("StatusWord.X5") is kept
    assert rig.axis.var("ActualModuloCycle") == (2 if kept else 0)
    if kept:
        assert rig.axis.var("ActualPosition") == pytest.approx(position, abs=0.01)
    elif event in {"power_cycle", "memory_reset", "factory_reset"}:
        assert rig.axis.var("ActualPosition") == 0.0


@pytest.mark.requirement(
    "HOM-153", "HOM-183", "HOM-184", "HOM-186", "HOM-187", "VAR-159", "HOM-148", "CFG-293", "MC-206", "MC-587"
)
@table("run_stop_run", "restart", "download", "power_cycle", "memory_reset")
def test_absolute_encoder(make_rig, event, kept):
    """The adjustment outlasts everything but the factory reset, and the position follows a shaft that is
    turned meanwhile.
    """
    rig = make_rig(variables={"Sensor[1].Type": ABSOLUTE}).enabled()
    rig.until(rig.axis.move_relative(20.0).done)
    rig.until(rig.axis.home(50.0, mode=7).done)
    happen(rig, event)
    assert rig.axis.var("StatusWord.X5") is kept
    assert rig.axis.var("StatusSensor[1].Adjusted") == int(kept)
    assert rig.axis.var("ActualPosition") == pytest.approx(50.0 if kept else 20.0, abs=0.01)


@pytest.mark.requirement("HOM-155", "CFG-292", "CFG-297", "HOM-184", "HOM-187")
@pytest.mark.parametrize(
    ("event", "position"), [("power_cycle", 27.0), ("memory_reset", 27.0), ("factory_reset", 7.0)]
)
def test_measuring_ranges_passed(make_rig, event, position):
    """A cyclic absolute encoder with a range of 10 mm has gone 27 mm, and shows 7 mm from then on: the ranges
    are retentive.
    """
    rig = make_rig(
        variables={"Sensor[1].Type": CYCLIC, "Sensor[1].Parameter.DeterminableRevolutions": 1}
    ).enabled()
    rig.until(rig.axis.move_relative(27.0).done)
    if event == "power_cycle":
        rig.controller.power_off()
        rig.turn(-2.0)
        rig.controller.power_on()
    else:
        rig.stopped()
        getattr(rig.controller, event)()
        rig.turn(-2.0)
        rig.controller.run()
    rig.reach(OperatingState.RUN)
    rig.cycles(3)
    assert rig.axis.var("ActualPosition") == pytest.approx(position, abs=0.01)


@pytest.mark.requirement("HOM-157", "HOM-185", "VAR-159", "HOM-037")
def test_another_encoder_type_deletes_the_adjustment(make_rig):
    """To incremental and back: the offset is gone; other settings leave it."""
    rig = make_rig(
        variables={"Sensor[1].Type": ABSOLUTE, "Sensor[1].Parameter.DeterminableRevolutions": 4096}
    ).enabled()
    rig.until(rig.axis.home(50.0, mode=7).done)
    rig.stopped()
    rig.controller.download("axis1", {"PositionControl.Kv": 12.0, "Sensor[1].Type": CYCLIC})
    assert rig.axis.var("PositionControl.Kv") == 12.0
    assert rig.axis.var("StatusSensor[1].Adjusted") == 1
    rig.controller.download("axis1", {"Sensor[1].Type": INCREMENTAL})
    rig.controller.download("axis1", {"Sensor[1].Type": ABSOLUTE})
    rig.running()
    assert rig.axis.var("StatusSensor[1].AbsEncoderOffset") == 0.0
    assert not rig.axis.var("StatusWord.X5")


@pytest.mark.requirement("MC-606", "MC-444")
@table("factory_reset")  # nothing keeps them; see below
def test_bits_of_control_words(rig, event, kept):
    """Bits of MC_SetAxisSTW are given back."""
    rig.port.speaks_telegram = True
    rig.until(rig.axis.set_axis_stw(STW1=0x0100, STW1BitMask=0x0100, STW2=0x0020, STW2BitMask=0x0020).done)
    rig.cycles(2)
    assert int(rig.column("stw1")[-1]) & 0x0100
    assert rig.port.stw2 == 0x0020
    happen(rig, event)
    del kept
    assert not int(rig.column("stw1")[-1]) & 0x0100
    assert rig.port.stw2 == 0


@pytest.mark.requirement("VAR-014", "CFG-127")
def test_a_virtual_axis_by_download(rig):
    """VirtualAxis.Mode is read only for the program and changes with a download in STOP."""
    rig.stopped()
    rig.controller.download("axis1", {"VirtualAxis.Mode": 1})
    rig.running().enabled()
    assert rig.axis.object.servo.virtual
    assert rig.reported("axis1 loaded")


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("axis7", {}, "axis7.*axis1"),
        ("axis1", {"PositionControl.Kw": 1.0}, "PositionControl.Kw.*similar: PositionControl.Kv"),
        ("axis1", {"PositionControl.Kv": 1.0, "Override.Velocity": 900.0}, "Override.Velocity"),
        ("axis1", {"PositionControl.Kv": 1.0, "Mechanics.LeadScrew": 0.0}, "LeadScrew"),
    ],
)
def test_a_download_that_does_not_fit(rig, name, values, message):
    """It is refused as a whole."""
    rig.stopped()
    with pytest.raises(ConfigurationError, match=message):
        rig.controller.download(name, values)
    assert rig.axis.var("PositionControl.Kv") == 20.0
    assert rig.axis.variables.start_value("PositionControl.Kv") == 20.0
    rig.running().enabled()


@pytest.mark.requirement("VAR-182", "CTL-011")
def test_the_operative_encoder(make_two_encoders):
    """STOP to RUN without restart leaves the encoder that was chosen; power-on takes the configured one."""
    rig = make_two_encoders()
    rig.until(rig.axis.set_sensor(2, mode=1).done)
    assert rig.axis.var("OperativeSensor") == 2
    rig.stopped().running()
    assert rig.axis.var("OperativeSensor") == 2
    rig.power_cycled()
    assert rig.controller.state is OperatingState.RUN
    assert rig.axis.var("OperativeSensor") == 1


@pytest.mark.requirement("CFG-269", "CFG-268")
def test_a_time_in_milliseconds_is_reported(make_rig):
    """0.125 instead of 0.000125 s is used as it is, and doubted; the axis lags by as much, because the
    controller reckons with it.
    """
    rig = make_rig(connection="data_block")
    rig.until(rig.axis.write_parameter(1010, 0.125).done)
    assert not rig.events("axis.doubt")
    rig.until(rig.axis.reset(restart=True).done)
    assert [event.data["text"].split(" =")[0] for event in rig.events("axis.doubt")] == ["parameter 1010 T_i"]
    assert rig.axis.object.delay_s == pytest.approx(0.129)
    rig.travelling(20.0)
    rig.run(1.0)
    lag = rig.axis.var("Position") - rig.axis.var("ActualPosition")
    assert lag == pytest.approx(20.0 * 0.129, rel=0.02)


@pytest.mark.requirement("HOM-182")
@pytest.mark.parametrize("kind", [INCREMENTAL, ABSOLUTE], ids=["incremental", "absolute"])
def test_another_memory_card(make_rig, tmp_path, kind):
    """It is put in without supply: an absolute encoder keeps its adjustment, an incremental one has to be
    homed again.
    """
    rig = make_rig(variables={"Sensor[1].Type": kind}).enabled()
    rig.until(rig.axis.home(50.0, mode=7 if kind else 0).done)
    rig.controller.power_off()
    assert not rig.runtime.insert_card(tmp_path / "other")
    rig.controller.power_on()
    rig.reach(OperatingState.RUN)
    rig.cycles(3)
    assert rig.axis.var("StatusWord.X5") is (kind == ABSOLUTE)
    assert rig.axis.var("ActualPosition") == pytest.approx(50.0 if kind else 0.0, abs=0.01)


@pytest.mark.requirement("HOM-181")
@pytest.mark.parametrize("kind", [INCREMENTAL, ABSOLUTE], ids=["incremental", "absolute"])
@pytest.mark.parametrize("saved", [False, True], ids=["no backup", "backup"])
def test_another_controller(make_rig, tmp_path, kind, saved):
    """A new CPU on the same drive knows nothing of an adjustment, unless a backup is on its card; an
    incremental encoder never.
    """
    rig = make_rig(variables={"Sensor[1].Type": kind})
    rig.runtime.insert_card(tmp_path)
    rig.enabled()
    rig.until(rig.axis.home(50.0, mode=7 if kind else 0).done)
    if saved:
        assert rig.runtime.card.save(rig.runtime.objects) == 0
    rig.runtime.stop()
    new = make_rig(variables={"Sensor[1].Type": kind}, port=rig.port)
    new.runtime.stop()
    new.runtime.insert_card(tmp_path)
    new.runtime.start()
    new.cycles(5)
    assert new.axis.var("StatusWord.X5") is (kind == ABSOLUTE and saved)


@pytest.mark.requirement("HOM-188", "HOM-189")
@pytest.mark.parametrize("kind", [INCREMENTAL, ABSOLUTE], ids=["incremental", "absolute"])
@pytest.mark.parametrize("upgraded", [False, True], ids=["another", "upgraded"])
def test_another_project(make_rig, kind, upgraded):
    """Another project knows no adjustment; the upgraded one keeps that of an absolute encoder."""
    rig = make_rig(variables={"Sensor[1].Type": kind}).enabled()
    rig.until(rig.axis.move_relative(20.0).done)
    rig.until(rig.axis.home(50.0, mode=7 if kind else 13).done)
    rig.stopped()
    rig.controller.load_project(upgraded=upgraded)
    rig.running()
    kept = kind == ABSOLUTE and upgraded
    assert rig.axis.var("StatusWord.X5") is kept
    assert rig.axis.var("StatusSensor[1].Adjusted") == (1 if kept else 0)
    if kind == ABSOLUTE:
        assert rig.axis.var("ActualPosition") == pytest.approx(50.0 if kept else 20.0, abs=0.01)


@pytest.mark.requirement("HOM-038", "HOM-190")
def test_another_encoder(make_rig):
    """An absolute encoder that was replaced shows another place, and nobody notices: homed, wrong, until it
    is adjusted again.
    """
    rig = make_rig(variables={"Sensor[1].Type": ABSOLUTE}).enabled()
    rig.until(rig.axis.home(50.0, mode=7).done)
    rig.controller.power_off()
    rig.turn(3.7)  # the shaft stays; the new encoder sits on it in another place
    rig.controller.power_on()
    rig.reach(OperatingState.RUN)
    rig.cycles(3)
    assert rig.axis.var("StatusWord.X5") is True
    assert rig.axis.var("StatusSensor[1].Adjusted") == 1
    assert rig.axis.var("ActualPosition") == pytest.approx(87.0, abs=0.01)
    rig.until(rig.axis.home(50.0, mode=7).done)
    rig.power_cycled()
    assert rig.axis.var("ActualPosition") == pytest.approx(50.0, abs=0.01)


@pytest.mark.requirement("HOM-166", "HOM-183")
def test_adjustment_of_an_incremental_encoder_is_lost(make_rig):
    """What mode 13 sets is not retentive: neither position nor `Adjusted` outlast power-off."""
    rig = make_rig(variables={"Sensor[1].Type": INCREMENTAL}).enabled()
    rig.until(rig.axis.move_relative(20.0).done)
    rig.until(rig.axis.home(50.0, mode=13).done)
    assert (rig.axis.var("StatusWord.X5"), rig.axis.var("StatusSensor[1].Adjusted")) == (True, 1)
    rig.power_cycled()
    assert (rig.axis.var("StatusWord.X5"), rig.axis.var("StatusSensor[1].Adjusted")) == (False, 0)
    assert rig.axis.var("ActualPosition") != pytest.approx(50.0, abs=1.0)

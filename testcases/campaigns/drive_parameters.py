"""Parameters that a controller reads from its drive: refused, unanswered and changed ones, data record 47 on
Modbus, a Modbus line with one request for both directions, and torque data through a data block.
"""

from __future__ import annotations

from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.drives.data_block import DataBlock
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import drive_name, equal, restart

_HERE: Final = "testcases.campaigns.drive_parameters"
_ADAPTED: Final = {"Actor.DataAdaption": 1, "Sensor[1].DataAdaption": 1}
ON_MODBUS: Final[BenchFile] = load_bench("profidrive_tcp").configured(
    {"axis": {"axis1": {"variables": _ADAPTED | {"Actor.DriveParameter.ReferenceSpeed": 1000.0}}}}
)
ON_LINE: Final[BenchFile] = load_bench("profidrive_rtu").configured(
    {
        "drive": {"drive1": {"map": "festo"}},
        "axis": {"axis1": {"variables": {"PositionLimits_HW.Active": False, "PositionControl.Kv": 4.0}}},
    }
)
ABSOLUTE: Final[BenchFile] = load_bench("profidrive").configured(
    {
        "drive": {"drive1": {"encoder": "absolute"}},
        "axis": {"axis1": {"variables": _ADAPTED | {"Sensor[1].Type": 1}}},
    }
)
TORQUE_BLOCK: Final[BenchFile] = load_bench("profidrive").configured(
    {
        "drive": {"drive1": {"telegram": 105, "profidrive": {"torque_telegram": True}}},
        "axis": {
            "axis1": {
                "connection": "data_block",
                "variables": {"Actor.DriveParameter.ReferenceTorque": 2.0},
            }
        },
    }
)
OF_FAULTS: Final = Campaign(
    "drive parameters with faults", tags=("profidrive",), bench="testcases.campaigns.controllers:SERVO"
)
OF_MODBUS: Final = Campaign("data record 47", tags=("profidrive", "modbus"), bench=f"{_HERE}:ON_MODBUS")
OF_LINE: Final = Campaign("one request for both", tags=("profidrive", "modbus"), bench=f"{_HERE}:ON_LINE")
OF_ABSOLUTE: Final = Campaign("encoder of the drive", tags=("profidrive",), bench=f"{_HERE}:ABSOLUTE")
OF_BLOCK: Final = Campaign("torque data in a data block", tags=("profidrive",), bench=f"{_HERE}:TORQUE_BLOCK")

_PARAMETERS: Final = 0x2000
"""Index of the object of parameter 0."""
_CAUSES: Final = {922: 9, 108: 8, 2000: 6, 1082: 2, 2003: 7, 1520: 3, 1521: 4}
"""Parameters of the drive, and the cause that alarm 102 has when one cannot be read (TA-013)."""
_PATHS: Final = ("StatusDrive.AdaptionState", "StatusSensor[1].AdaptionState")


def _restarted(ctx: CaseContext) -> tuple[int, int]:
    """Restart the axis, and return how the transfer of drive and encoder ends."""
    restart(ctx, {})
    axis = ctx.axis
    ctx.wait_until(lambda: all(axis.var(path) in (2, 4) for path in _PATHS), 3.0, "the transfer is over")
    return tuple(int(axis.var(path)) for path in _PATHS)  # type: ignore[return-value]


def _pending(ctx: CaseContext) -> dict[int, int]:
    """Return the pending alarms, and their causes."""
    return {alarm.number: alarm.info for alarm in ctx.axis.object.engine.pending}


@OF_FAULTS.case("unreadable", requirements=("CFG-355", "TA-013", "TA-025", "VAR-106", "VAR-150"))
def unreadable(ctx: CaseContext) -> None:
    """A parameter that cannot be read ends the transfer with alarm 102 or 103 and its cause, and keeps the
    axis from being enabled until a restart finds it; inertias may be missing.
    """
    ctx.run_for(0.3)
    axis, drive = ctx.axis, drive_name(ctx)
    for number, cause in (*_CAUSES.items(), (979, 0)):
        refused = ctx.inject("drive.sdo_abort", drive, index=_PARAMETERS + number)
        states = _restarted(ctx)
        shown = _pending(ctx)
        if number == 979:
            equal(ctx, "states without p0979", states == (2, 4), 1.0, "VAR-150")
            equal(ctx, f"alarms without p0979 {shown}", shown == {103: 2}, 1.0, "TA-013")
        else:
            both = number == 2000  # the encoder wants it, too
            equal(ctx, f"states without p{number:04d}", states == (4, 4 if both else 2), 1.0, "VAR-150")
            wanted = {102: cause, 103: 7} if both else {102: cause}
            equal(ctx, f"alarms without p{number:04d} {shown}", shown == wanted, 1.0, "TA-013")
        refused.remove()
        power = axis.power()
        ctx.run_for(0.1)
        equal(ctx, f"Status without p{number:04d}", power.Status, 0.0, "CFG-355")
        axis.power(False)
        ctx.run_for(cycles(ctx, 3))
    for number, path in ((341, "Actor.DriveParameter.MotorInertia"), (1498, "Actor.LoadInertia")):
        before = float(axis.variables.start_value(path))
        refused = ctx.inject("drive.sdo_abort", drive, index=_PARAMETERS + number)
        equal(ctx, f"states without p{number:04d}", _restarted(ctx) == (2, 2), 1.0, "CFG-580")
        equal(ctx, f"alarms without p{number:04d}", len(_pending(ctx)), 0.0)
        equal(ctx, f"{path} without p{number:04d}", axis.var(path), before, "CFG-580", within=1e-9)
        refused.remove()
    equal(ctx, "states in the end", _restarted(ctx) == (2, 2), 1.0, "VAR-150")
    ctx.wait_until(axis.power().status, 3.0, "the axis can be enabled again")


@OF_FAULTS.case("unanswered", requirements=("CFG-353", "CFG-354", "TA-013"))
def unanswered(ctx: CaseContext) -> None:
    """Without an answer the transfer waits, and so does the enable; it ends with an alarm, or goes on with
    the answer.
    """
    ctx.run_for(0.3)
    axis, drive = ctx.axis, drive_name(ctx)
    silent = ctx.inject("drive.sdo_timeout", drive)
    restart(ctx, {})
    ctx.run_for(0.02)
    equal(ctx, "state while nothing is answered", axis.var(_PATHS[0]), 1.0, "CFG-353")
    power = axis.power()
    ctx.run_for(0.05)
    equal(ctx, "Status meanwhile", power.Status, 0.0, "CFG-353")
    silent.remove()
    ctx.wait_until(lambda: axis.var(_PATHS[0]) in (2, 4), 5.0, "the transfer is over")
    adapted = axis.var(_PATHS[0]) == 2
    equal(ctx, "alarm", axis.var("ErrorDetail.Number"), 0.0 if adapted else 102.0, "TA-013")
    axis.power(False)
    ctx.run_for(0.02)
    equal(ctx, "states after a restart", _restarted(ctx) == (2, 2), 1.0, "CFG-354")


@OF_FAULTS.case(
    "changed",
    requirements=("CFG-345", "CFG-346", "TA-020"),
    without=("CTL-038", "CFG-336", "PD-035"),  # they take the reference speed from the bench file
)
def changed(ctx: CaseContext) -> None:
    """Parameters that the drive has changed while it was away are taken over when it comes back; other data
    of its encoder raise alarm 552, because positions mean something else.
    """
    ctx.run_for(0.3)
    axis, drive = ctx.axis, drive_name(ctx)
    equal(ctx, "states", _restarted(ctx) == (2, 2), 1.0)
    parameters = ctx.bench.drive(drive).parameters
    parameters.write("p2003", 1.25 * float(parameters.read("p2003")))
    equal(ctx, "before its restart", axis.var("Actor.DriveParameter.ReferenceTorque") ==
          float(parameters.read("p2003")), 0.0, "CFG-345")  # fmt: skip
    for name, path, alarm in (
        ("p2003", "Actor.DriveParameter.ReferenceTorque", 0.0),
        ("p2000", "Actor.DriveParameter.ReferenceSpeed", 552.0),
    ):
        if name == "p2000":
            parameters.write(name, 0.8 * float(parameters.read(name)))
        gone = ctx.inject("can.unplug", str(ctx.bench.config.drive[drive].segment), node=drive)
        ctx.run_for(0.5)
        equal(ctx, "state without the drive", axis.var(_PATHS[0]), 0.0, "CFG-345")
        gone.remove()
        ctx.wait_until(lambda: all(axis.var(one) == 2 for one in _PATHS), 5.0, "the transfer is over")
        equal(ctx, path, axis.var(path), float(parameters.read(name)), "CFG-346", within=1e-3)
        ctx.run_for(0.05)
        shown = _pending(ctx)
        equal(ctx, f"alarm 552 after another {name} {shown}", 552 in shown, float(alarm == 552.0), "CFG-346")
        ctx.wait_until(axis.reset().done, 3.0, "the alarms are acknowledged")
    ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
    begun = float(axis.var("ActualPosition"))
    ctx.wait_until(axis.move_relative(15.0).done, 3.0, "it moves")
    equal(ctx, "way", float(axis.var("ActualPosition")) - begun, 15.0, "CFG-346", within=0.1)


@OF_ABSOLUTE.product(
    "type/{what}",
    parameters=[
        {"what": "as-it-is", "kind": 1, "cause": 0},
        {"what": "as-cyclic", "kind": 2, "cause": 0},
        {"what": "as-incremental", "kind": 0, "cause": 5},
    ],
    title="An absolute encoder of the drive, configured {what}",
    requirements=("TA-013", "VAR-106"),
)
def encoder_type(ctx: CaseContext, what: str, kind: int, cause: int) -> None:
    """An encoder of another type than the configured one is warned of with 112 and its cause; the axis works
    all the same, with what the drive says of the encoder.
    """
    del what
    if kind != 1:
        bench = ABSOLUTE.configured({"axis": {"axis1": {"variables": {
            "Sensor[1].Type": kind, "Sensor[1].Parameter.DeterminableRevolutions": 4096,
        }}}}).build(seed=1)  # fmt: skip
        ctx.bench.on_close(bench.close)
    else:
        bench = ctx.bench
    axis = bench.axis()
    bench.wait_until(lambda: all(axis.var(path) in (2, 4) for path in _PATHS), 3.0)
    bench.run_for(0.02)
    shown = {alarm.number: alarm.info for alarm in axis.object.engine.pending}
    equal(ctx, f"alarms {shown}", shown == ({112: cause} if cause else {}), 1.0, "TA-013")
    equal(ctx, "transferred", axis.var(_PATHS[1]), 2.0, "VAR-106")
    turns = axis.var("Sensor[1].Parameter.DeterminableRevolutions")
    ctx.measure("revolutions", float(turns), low=1.0, requirements=("VAR-106",))
    bench.wait_until(axis.power().status, 3.0)
    begun = float(axis.var("ActualPosition"))
    bench.wait_until(axis.move_relative(-7.5).done, 3.0)
    equal(ctx, "way", float(axis.var("ActualPosition")) - begun, -7.5, within=0.1)


# -- Modbus --------------------------------------------------------------------------------------------------


@OF_MODBUS.case("accesses", requirements=("PD-326", "CFG-346", "CFG-353"))
def accesses(ctx: CaseContext) -> None:
    """Data record 47 carries what the transfer needs, and accesses of the program: in their order, each with
    its value or its reason.
    """
    axis, drive = ctx.axis, drive_name(ctx)
    port, parameters = ctx.bench.port(drive), ctx.bench.drive(drive).parameters
    ctx.wait_until(lambda: all(axis.var(path) in (2, 4) for path in _PATHS), 3.0, "the transfer is over")
    equal(ctx, "transferred", [axis.var(path) for path in _PATHS] == [2, 2], 1.0, "CFG-353")
    speed = axis.var("Actor.DriveParameter.ReferenceSpeed")
    equal(ctx, "ReferenceSpeed", speed, float(parameters.read("p2000")), "CFG-346")
    found: list[tuple[str, float | None, str]] = []

    def keep(name: str) -> Any:
        return lambda value, reason: found.append((name, value, reason))

    port.read_parameter(2000, 0, keep("p2000"))
    port.write_parameter(1121, 0, 8, 0.75, keep("write p1121"))
    port.read_parameter(1121, 0, keep("p1121"))
    port.read_parameter(99, 0, keep("p0099"))
    port.write_parameter(2, 0, 8, 0.75, keep("write r0002"))
    port.read_parameter(979, 3, keep("p0979[3]"))
    equal(ctx, "answers at once", len(found), 0.0, "PD-326")
    ctx.run_for(0.6)
    wanted: list[tuple[str, float | None]] = [
        ("p2000", 3000.0), ("write p1121", 0.75), ("p1121", 0.75), ("p0099", None), ("write r0002", None),
        ("p0979[3]", 11.0),
    ]  # fmt: skip
    equal(ctx, f"answers {found}", [one[:2] for one in found] == wanted, 1.0, "PD-326")
    reasons = {name: reason for name, _, reason in found}
    equal(ctx, "reason for p0099", "parameter number" in reasons["p0099"], 1.0, "PD-326")
    equal(ctx, "reason for r0002", "cannot be changed" in reasons["write r0002"], 1.0, "PD-326")
    equal(ctx, "no reason where there is a value", reasons["p2000"] == "", 1.0)
    equal(ctx, "p1121 of the drive", float(parameters.read("p1121")), 0.75, "PD-326")
    ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
    job = axis.move_velocity(80.0)
    ctx.wait_until(job.in_velocity, 3.0, "the velocity is there")
    for number in range(6):
        port.read_parameter(1121, 0, keep(f"again {number}"))
    missed = port.missed
    ctx.run_for(0.5)
    equal(ctx, "answers beside the motion", sum(one[1] == 0.75 for one in found[6:]), 6.0, "PD-326")
    equal(ctx, "cycles missed by it", port.missed - missed, 0.0)


@OF_MODBUS.case("disturbed", requirements=("PD-326", "CFG-355", "TA-013"))
def disturbed(ctx: CaseContext) -> None:
    """What is under way when the drive is lost ends with a reason, once; behind it accesses work again. A
    transfer that is answered with exceptions ends with alarm 102.
    """
    axis, drive = ctx.axis, drive_name(ctx)
    port = ctx.bench.port(drive)
    ctx.wait_until(lambda: all(axis.var(path) == 2 for path in _PATHS), 3.0, "the transfer is over")
    found: list[tuple[float | None, str]] = []
    for _ in range(3):
        port.read_parameter(1121, 0, lambda value, reason: found.append((value, reason)))
    ctx.run_for(cycles(ctx, 1))
    gone = ctx.inject("drive.power_off", drive)
    ctx.run_for(1.0)
    equal(ctx, f"ends {found}", len(found), 3.0, "PD-326")
    equal(
        ctx,
        "ends with a reason",
        sum(value is None and bool(reason) for value, reason in found),
        3.0,
        "PD-326",
    )
    gone.remove()
    ctx.wait_until(lambda: axis.var(_PATHS[0]) == 2, 10.0, "the drive is back, and its parameters are read")
    port.read_parameter(1120, 0, lambda value, reason: found.append((value, reason)))
    ctx.run_for(0.3)
    equal(ctx, "an access afterwards", len(found), 4.0, "PD-326")
    equal(ctx, "has a value", found[-1][0] is not None, 1.0, "PD-326")


@OF_LINE.case("travels", requirements=("PD-322", "PD-323", "CFG-201"))
def travels(ctx: CaseContext) -> None:
    """One request per cycle writes the telegram and reads the actual values, without an exception, and the
    axis goes its way; a drive that restarts is taken into service again.
    """
    axis, drive = ctx.axis, drive_name(ctx)
    port = ctx.bench.port(drive)
    for target in (22.0, -9.0):
        ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
        begun = float(ctx.trace()[f"{drive}.position"].values[-1])
        ctx.wait_until(axis.move_relative(target).done, 6.0, "the axis is there")
        ctx.run_for(0.4)
        way = float(ctx.trace()[f"{drive}.position"].values[-1]) - begun
        equal(ctx, "way of the machine, mm", way * 1000.0, target, within=0.1)
        equal(ctx, "exceptions", port.exceptions, 0.0)
        axis.power(False)
        ctx.run_for(0.5)
        off = ctx.inject("drive.power_off", drive)
        ctx.run_for(1.0)
        equal(ctx, "in service without its supply", port.started, 0.0)
        off.remove()
        ctx.wait_until(lambda: port.started, 10.0, "it is in service again")
        ctx.wait_until(axis.reset().done, 3.0, "the loss is acknowledged")


# -- data block ----------------------------------------------------------------------------------------------


@OF_BLOCK.case("through", requirements=("CFG-253", "CFG-255", "CFG-256", "CFG-405"))
def block(ctx: CaseContext) -> None:
    """A program that copies telegram and torque data makes an axis as any other, which limits its torque and
    adds one; in STOP nothing goes through, and nothing is sent.
    """
    axis, drive = ctx.axis, drive_name(ctx)
    data = DataBlock("DB1", {"main": "PD_TEL105", "torque": "PD_TEL750"})
    for wrong in (
        {"block": data["torque"]},
        {"block": data["main"]},
        {"block": data["main"], "torque": data["main"]},
    ):
        refused = 0
        try:
            axis.object.port.connect_block(*wrong.values())
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            ctx.do(f"refused: {error}")
            refused = 1
        equal(ctx, f"{list(wrong)} alone or twice is refused", refused, 1.0, "CFG-405")
    axis.object.port.connect_block(data["main"], data["torque"])
    ctx.run_for(0.1)
    equal(ctx, "communication without a program", axis.var("StatusDrive.CommunicationOK"), 0.0, "CFG-253")
    for one in (data["main"], data["torque"]):
        one.pass_through()
    ctx.run_for(0.3)
    if axis.var("ErrorDetail.Number"):
        ctx.wait_until(axis.reset().done, 2.0, "the alarm is acknowledged")
    ctx.wait_until(axis.power().status, 3.0, "the axis is enabled")
    job = axis.torque_range(0.2, -0.1)
    ctx.run_for(cycles(ctx, 4))
    sent = data["torque"].sent
    equal(
        ctx, "upper limit that is sent", sent["M_LIMIT_POS"], round(0.2 / 2.0 * 0x4000), "CFG-256", within=1.0
    )
    low = sent["M_LIMIT_NEG"]
    low -= 0x10000 if low > 0x7FFF else 0
    equal(ctx, "lower limit that is sent", low, round(-0.1 / 2.0 * 0x4000), "CFG-256", within=1.0)
    job.set(Enable=False)
    begun = float(axis.var("ActualPosition"))
    ctx.wait_until(axis.move_relative(-12.0, Velocity=100.0).done, 4.0, "the axis has moved")
    equal(ctx, "way", float(axis.var("ActualPosition")) - begun, -12.0, "CFG-255", within=0.1)
    controller = ctx.bench.controller
    controller.stop()
    ctx.run_for(0.5)
    equal(ctx, "control word in STOP", data["main"].sent["STW1"] & 1, 0.0)
    shown = dict(data["main"].Input)
    ctx.run_for(0.05)
    equal(ctx, "input stands in STOP", dict(data["main"].Input) == shown, 1.0)
    controller.run()
    ctx.wait_until(lambda: controller.state.name == "RUN", 5.0, "RUN")
    ctx.run_for(0.3)
    ctx.wait_until(axis.reset().done, 3.0, "axis and drive are acknowledged")
    ctx.wait_until(axis.power().status, 5.0, "enabled again through the same program")
    ctx.measure("ZSW1", float(data["main"].Input["ZSW1"]), low=1.0)
    del drive

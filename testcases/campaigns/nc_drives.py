"""NC axes on drives of other kinds: position and torque interface, two speeds, fast stop, encoder axis."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

from emulators.drive.two_speed_config import CONTACTORS, INVERTER
from hil.bench import BenchFile
from hil.campaign import Campaign, CaseContext
from motion.nc.blocks import JogMode
from testcases.campaigns.nc_axes import axis, until
from testcases.campaigns.support import equal

_HERE: Final = "testcases.campaigns.nc_drives"


def _bench(name: str, drive: str, own: str, parameters: str, more: str = "") -> BenchFile:
    text = f"""
[bench]
name = "{name}"
kind = "virtual"
cycle_ms = 2
[segment.can0]
bitrate = 1_000_000
[drive.motor]
segment = "can0"
node_id = 5
{drive}
[axis.x]
controller = "nc"
drive = "motor"
{own}
[axis.x.parameters]
{parameters}
{more}
"""
    return BenchFile(name, text)


_STEP: Final = '"ctrl.pos_kv" = 20.0\n"axis.position_correction" = true'
POSITION: Final = _bench("nc position", "", 'interface = "position"', _STEP)
EXTERN: Final = _bench(
    "nc position, error of the drive",
    "",
    'interface = "position"',
    f'{_STEP}\n"drv.following_error_calculation" = "Extern"\n"drv.smoothing_type" = "Moving Average"\n'
    '"drv.smoothing_time" = 0.02\n"axis.position_lag_max" = 50.0',
)
SERVO: Final = _bench(
    "nc dynamic servo control",
    'profile = "profidrive"\ntelegram = 5',
    'interface = "position"',
    '"ctrl.pos_kv" = 30.0',
)
_TORQUE: Final = (
    '"ctrl.type" = "Position P and velocity {} (Torque)"\n"ctrl.pos_kv" = 15.0\n"ctrl.velo_kv" = 0.5\n'
    '"ctrl.velo_tn" = 0.05\n"ctrl.velo_i_limit" = 1.0\n"axis.position_lag_max" = 20.0'
)
TORQUE: Final = _bench("nc torque", "", 'interface = "torque"', _TORQUE.format("PID controller"))
OBSERVER: Final = _bench(
    "nc torque, observer", "", 'interface = "torque"', _TORQUE.format("PI controller with Observer")
)
INPUT: Final = _bench(
    "nc fast stop",
    "[drive.motor.switches]\nhome_mm = 30.0\ninput_filter_ms = 0.0\n",
    'fast_stop_input = "home"',
    '"ctrl.pos_kv" = 20.0\n"axis.fast_axis_stop_signal_type" = "Falling Edge"\n'
    '"axis.fast_deceleration" = 4000.0\n"axis.fast_jerk" = 1e6',
    """
[encoder.tacho]
profile = "cia406"
segment = "can0"
node_id = 20
[encoder.tacho.shaft]
speed_rpm = 60.0
[axis.v]
controller = "nc"
[axis.e]
controller = "nc"
encoder = "tacho"
[axis.e.parameters]
"enc.scaling_numerator" = 0.01
""",
)
_SPEEDS: Final = {
    "drv.creep_distance_pos": 31.0,
    "drv.creep_distance_neg": 27.0,
    "drv.braking_distance_pos": 2.0,
    "drv.braking_distance_neg": 2.4,
    "drv.brake_delay_pos": 0.2,
    "drv.brake_delay_neg": 0.25,
    "drv.delay_fast_to_slow": 0.1,
    "drv.creep_distance_stop": 5.0,
    "drv.brake_release_delay": 0.12,
}


def _hoist(control: str, outputs: tuple[str, ...], **more: object) -> BenchFile:
    lines = "\n".join(f'"{key}" = {str(value).lower()}' for key, value in {**_SPEEDS, **more}.items())
    names = ", ".join(f'"hoist.{name}"' for name in outputs)
    text = f"""
[bench]
name = "hoist, {control}"
kind = "virtual"
cycle_ms = 2
[segment.net0]
kind = "modbus_tcp"
[station.io]
segment = "net0"
digital_outputs = [{names}]
counters = ["hoist.encoder"]
[drive.hoist]
profile = "two_speed"
segment = "net0"
[drive.hoist.mechanics]
backlash_mm = 1.0
[drive.hoist.two_speed]
control = "{control}"
fast_rpm = 600.0
slow_rpm = 60.0
[axis.x]
controller = "nc"
drive = "hoist"
[axis.x.parameters]
{lines}
"""
    return BenchFile(f"hoist {control}", text)


HOIST: Final = _hoist("contactors", CONTACTORS)
LIFT: Final = _hoist("inverter", INVERTER)
LOOP: Final = _hoist("contactors", CONTACTORS, **{"drv.looping_enable": True, "drv.looping_distance": 20.0})

OF_POSITION: Final = Campaign(
    "nc position interface", tags=("nc",), controller="nc", bench=f"{_HERE}:POSITION"
)
OF_EXTERN: Final = Campaign("nc drive error", tags=("nc",), controller="nc", bench=f"{_HERE}:EXTERN")
OF_SERVO: Final = Campaign("nc servo control", tags=("nc",), controller="nc", bench=f"{_HERE}:SERVO")
OF_TORQUE: Final = Campaign("nc torque interface", tags=("nc",), controller="nc", bench=f"{_HERE}:TORQUE")
OF_OBSERVER: Final = Campaign("nc torque observer", tags=("nc",), controller="nc", bench=f"{_HERE}:OBSERVER")
OF_INPUT: Final = Campaign("nc fast stop", tags=("nc",), controller="nc", bench=f"{_HERE}:INPUT")
OF_HOIST: Final = Campaign("nc contactors", tags=("nc",), controller="nc", bench=f"{_HERE}:HOIST")
OF_LIFT: Final = Campaign("nc inverter", tags=("nc",), controller="nc", bench=f"{_HERE}:LIFT")
OF_LOOP: Final = Campaign("nc looping", tags=("nc",), controller="nc", bench=f"{_HERE}:LOOP")
_SERVOS: Final = (
    (OF_POSITION, 8, 0.03, ("NC-481", "NC-790")),
    (OF_EXTERN, 8, 0.03, ("NC-375", "NC-404")),
    (OF_SERVO, None, 0.05, ("NC-481",)),
    (OF_TORQUE, 10, 0.15, ("NC-546",)),
    (OF_OBSERVER, 10, 0.15, ("NC-546",)),
)


def _travels(ctx: CaseContext, mode: int | None, within: float, *ids: str) -> None:
    """There and back: mode of the drive, velocity, end; the following error stays bounded and is gone."""
    one = axis(ctx)
    for target, velocity in ((90.0, 120.0), (-20.0, 70.0)):
        since = ctx.now_s
        until(ctx, one.move_absolute(target, Velocity=velocity).done)
        ctx.run_for(0.5)
        trace = ctx.trace()
        rows = trace["x.set_velocity"].time_s > since
        equal(ctx, f"position at {target}", one.position, target, *ids, within=within)
        speeds = trace["x.set_velocity"].values[rows]
        sign = 1.0 if target > 0.0 else -1.0
        equal(ctx, "greatest set velocity", float((sign * speeds).max()), velocity, *ids, within=1e-6)
        actual = trace["motor.velocity"].values[trace["motor.velocity"].time_s > since]
        fastest = float((sign * actual).max()) * 1000.0
        ctx.measure("fastest of the machine", fastest, "mm/s", low=0.97 * velocity, high=1.12 * velocity)
        error = float(abs(trace["x.following_error"].values[rows]).max())
        ctx.measure("greatest following error", error, "mm", high=8.0, requirements=ids)
        machine = float(trace["motor.position"].values[-1]) * 1000.0
        equal(ctx, "machine, mm", machine, target, within=within + 0.03)
    if mode is not None:
        equal(ctx, "6060h", one.object.device.words["6060h"], mode, *ids)
    one.power(False)
    ctx.run_for(0.3)
    equal(ctx, "operational without enable", one.operational, 0)
    ctx.wait_until(one.power().status, 2.0, "the axis is enabled again")


for _campaign, _mode, _within, _ids in _SERVOS:

    @_campaign.case("there-and-back", requirements=_ids)
    def there_and_back(
        ctx: CaseContext, mode: int | None = _mode, within: float = _within, ids: tuple[str, ...] = _ids
    ) -> None:
        """The axis goes where it is sent, with its velocity, whoever controls the position."""
        _travels(ctx, mode, within, *ids)


@OF_POSITION.case("correction", requirements=("NC-595", "NC-597"))
def correction(ctx: CaseContext) -> None:
    """A correction moves the machine by its negative and is no following error."""
    one = axis(ctx)
    until(ctx, one.move_absolute(10.0, Velocity=50.0).done)
    ctx.run_for(0.2)
    before = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    one.ref.PlcToNc.PositionCorrection = 0.2
    ctx.run_for(0.4)
    after = float(ctx.trace()["motor.position"].values[-1]) * 1000.0
    equal(ctx, "way of the machine, mm", after - before, -0.2, "NC-597", within=0.01)
    equal(ctx, "position", one.position, 10.0, "NC-597", within=0.01)
    equal(ctx, "following error", one.object.following_error, 0.0, "NC-595", within=0.01)


@OF_SERVO.case("words", requirements=("NC-416", "NC-417"))
def words(ctx: CaseContext) -> None:
    """Gain and speed setpoint reach the drive; at rest the speed setpoint is zero."""
    one = axis(ctx)
    one.move_velocity(80.0)
    ctx.run_for(0.5)
    sent = one.object.device.words
    equal(ctx, "KPC is sent", sent["KPC"] != 0, 1, "NC-416")
    ctx.measure("NSOLL_B", float(sent["NSOLL_B"]), low=1.0, requirements=("NC-417",))
    until(ctx, one.halt().done, "the axis has halted")
    ctx.run_for(0.2)
    equal(ctx, "NSOLL_B at rest", one.object.device.words["NSOLL_B"], 0, "NC-417", within=1000.0)


BOTH_EDGES: Final = BenchFile(
    "nc fast stop, both edges",
    INPUT.text.replace("Falling Edge", "Both Edges").replace(INPUT.name, "nc fast stop, both edges"),
)
OF_EDGES: Final = Campaign(
    "nc fast stop, both edges",
    tags=("nc",),
    controller="nc",
    bench=f"{_HERE}:BOTH_EDGES",
)


@OF_EDGES.case("first-level", requirements=("NC-121",))
def first_level(ctx: CaseContext) -> None:
    """The level that the input has at the start is no edge; the first edge stops the axis."""
    one = axis(ctx)
    ctx.run_for(0.1)
    stops = ctx.trace().select(kind="axis.fast_stop")
    equal(ctx, "fast stops before anything moves", len(list(stops)), 0, "NC-121")
    job = one.move_velocity(90.0, Acceleration=5000.0, Jerk=1e6)
    until(ctx, job.aborted, "the input has stopped the axis")
    equal(ctx, "fast stops", len(list(ctx.trace().select(kind="axis.fast_stop"))), 1)


@OF_INPUT.case("fast-stop", requirements=("NC-113", "NC-120"))
def fast_stop(ctx: CaseContext) -> None:
    """The input stops the axis with the fast deceleration, without an error, and locks it."""
    one = axis(ctx)
    job = one.move_velocity(90.0, Acceleration=5000.0, Jerk=1e6)
    until(ctx, job.aborted, "the input has stopped the axis")
    at = ctx.now_s
    ctx.run_for(0.3)
    trace = ctx.trace()
    braking = float(trace["x.set_acceleration"].values.min())
    equal(ctx, "deceleration", braking, -4000.0, "NC-113", within=40.0)
    equal(ctx, "set velocity", one.ref.NcToPlc.SetVelo, 0.0)
    equal(ctx, "error", one.error_id, 0, "NC-120")
    index = int((trace["x.set_position"].time_s <= at).sum()) - 1
    begun = float(trace["x.set_position"].values[index])
    ctx.measure("place of the stop", begun, "mm", low=29.0, high=34.0, requirements=("NC-120",))


@OF_INPUT.case("encoder-axis", requirements=("NC-244",))
def encoder_axis(ctx: CaseContext) -> None:
    """A simulated axis follows an encoder axis by its ratio; the encoder axis takes no commands."""
    v, e = ctx.bench.axis("v"), ctx.bench.axis("e")
    ctx.wait_until(v.power().status, 1.0, "the axis is enabled")
    gear = v.gear_in(e, 0.5)
    ctx.wait_until(gear.in_gear, 1.0, "it is in gear")
    ctx.run_for(0.2)
    first, leading = v.position, e.position
    ctx.run_for(0.6)
    way = e.position - leading
    ctx.measure("way of the encoder", abs(way), "mm", low=1.0)
    equal(ctx, "way of the slave", v.position - first, 0.5 * way, "NC-244", within=0.03 * abs(way))
    refused = e.move_absolute(5.0, Velocity=10.0)
    ctx.run_for(0.05)
    equal(ctx, "a command to an encoder axis is refused", refused.Error, 1)


def _rest(ctx: CaseContext, one: Any, target: float, ids: tuple[str, ...] = ("NC-609",)) -> None:
    """Go to a target; expect the sequence of speeds, times of brake and pause, and the place of rest."""
    states: list[tuple[float, int]] = []

    def look() -> None:
        state = int(one.ref.NcToPlc.AxisState)
        if not states or states[-1][1] != state:
            states.append((ctx.bench.now_s, state))

    end = ctx.bench.on_cycle(look)
    sign = 1.0 if target > one.position else -1.0
    begin = one.position
    until(ctx, one.move_absolute(target, Velocity=100.0).done)
    end()
    found = [state for _, state in states]
    wanted = [0, 21, 22, 23, 24, 0]
    equal(ctx, f"states of the axis {found}", found == wanted or found == wanted[1:], 1, *ids)
    ctx.run_for(0.5)
    speed = ctx.trace()["hoist.velocity"]
    since = states[1][0] if found[0] == 0 else states[0][0]
    rows = speed.time_s > since
    fast = float((sign * speed.values[rows]).max()) * 1000.0
    ctx.measure("fast travel", fast, "mm/s", low=95.0, high=102.0, requirements=ids)
    off = one.position - target
    ctx.measure(f"rest from {begin:.1f}, off the target", off, "mm", low=-6.0, high=6.0, requirements=ids)
    at = one.position
    ctx.run_for(0.5)
    equal(ctx, "it stands", one.position, at, within=1e-9)
    equal(ctx, "illegal terminals", ctx.bench.drive("hoist").illegal, 0, "NC-758")


for _campaign in (OF_HOIST, OF_LIFT):

    @_campaign.case("there-and-back", requirements=("NC-061", "NC-609", "NC-758"))
    def hoisted(ctx: CaseContext) -> None:
        """Fast, slow, brake: the axis rests near its target in both directions."""
        one = axis(ctx)
        _rest(ctx, one, 110.0)
        _rest(ctx, one, 5.0)

    @_campaign.case("stop", requirements=("NC-610",))
    def stopped(ctx: CaseContext) -> None:
        """A stop creeps for its distance and brakes; the axis is locked until Execute falls."""
        one = axis(ctx)
        move = one.move_absolute(500.0, Velocity=100.0)
        ctx.run_for(1.5)
        at = one.position
        stop = one.stop()
        until(ctx, stop.done, "the stop is done")
        equal(ctx, "the motion was aborted", move.CommandAborted, 1)
        ctx.measure("way of the stop", one.position - at, "mm", low=5.0, high=40.0, requirements=("NC-610",))
        refused = one.move_absolute(5.0, Velocity=100.0)
        ctx.run_for(0.01)
        equal(ctx, "ErrorID of a command before Execute falls", refused.ErrorID, 0x42EF)
        stop.set(Execute=False)
        ctx.run_for(0.02)
        jog = one.jog(JogMode.MC_JOGMODE_STANDARD_SLOW)
        ctx.run_for(1.0)
        before = one.position
        ctx.run_for(0.5)
        ctx.measure("jog in half a second", one.position - before, "mm", low=20.0, high=52.0)
        jog.set(JogForward=False)
        until(ctx, jog.done, "the jog is done")

    @_campaign.case("enable", requirements=("NC-733",))
    def enable(ctx: CaseContext) -> None:
        """A lost enable ends the motion with an error and the brake; a lost feed enable with a stop."""
        one = axis(ctx)
        motor = ctx.bench.drive("hoist")
        move = one.move_absolute(-500.0, Velocity=100.0)
        ctx.run_for(1.0)
        one.power(False)
        ctx.run_for(0.2)
        equal(ctx, "ErrorID of the motion", move.ErrorID, 0x4356, "NC-733")
        equal(ctx, "the brake is closed", motor.braked, 1)
        until(ctx, one.reset().done, "the reset is done")
        ctx.wait_until(one.power().status, 1.0, "the axis is enabled")
        move = one.move_velocity(-100.0)
        ctx.run_for(1.0)
        equal(ctx, "the brake is open", motor.braked, 0)
        one.power(negative=False)
        ctx.run_for(2.0)
        equal(ctx, "the motion was aborted", move.CommandAborted, 1)
        equal(ctx, "the brake is closed", motor.braked, 1)

    @_campaign.case("refused", requirements=("NC-607", "NC-608"))
    def refused(ctx: CaseContext) -> None:
        """No superposed motion, no external setpoints, no negative velocity; a short way is done at once."""
        one = axis(ctx)
        found = [one.move_superimposed(5.0, 10.0), one.external_enable(0.0)]
        ctx.run_for(0.01)
        for block in found:
            equal(ctx, "ErrorID", block.ErrorID, 0x4B05, "NC-608")
        short = one.move_absolute(1.9, Velocity=100.0)
        ctx.run_for(0.02)
        equal(ctx, "a way within the braking distance is done", short.Done, 1, "NC-607")
        equal(ctx, "without moving", one.position, 0.0, within=1e-3)
        wrong = one.move_absolute(200.0, Velocity=-5.0)
        ctx.run_for(0.02)
        equal(ctx, "ErrorID of a negative velocity", wrong.ErrorID, 0x4359)


@OF_LOOP.case("one-side", requirements=("NC-672",))
def one_side(ctx: CaseContext) -> None:
    """With a looping distance the machine rests at one place from either side, in spite of play."""
    one = axis(ctx)
    rest = []
    for target in (0.0, 60.0, 120.0, 60.0):
        ctx.wait_until(one.move_absolute(target, Velocity=40.0).done, 60.0, "the motion is done")
        ctx.run_for(0.5)
        if target == 60.0:
            rest.append(float(ctx.trace()["hoist.position"].values[-1]) * 1000.0)
    equal(ctx, "difference of both places of rest", rest[1], rest[0], "NC-672", within=0.05)


@OF_HOIST.case("play", requirements=("NC-672",))
def play(ctx: CaseContext) -> None:
    """Without looping the play shows between both directions."""
    one = axis(ctx)
    rest = []
    for target in (60.0, 120.0, 60.0):
        ctx.wait_until(one.move_absolute(target, Velocity=40.0).done, 60.0, "the motion is done")
        ctx.run_for(0.5)
        if target == 60.0:
            rest.append(float(ctx.trace()["hoist.position"].values[-1]) * 1000.0)
    far = max(abs(b - a) for a, b in pairwise(rest))
    ctx.measure("difference of both places of rest", far, "mm", low=0.8, high=14.0)

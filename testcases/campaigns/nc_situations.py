"""NC axes in situations that are rare: a two-speed axis without override, an analog drive with drift, probes
in a window, the dialog in every place, parameters of a project.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.nc.controller import OffsetMode
from motion.nc.probe_blocks import MC_AbortTrigger
from motion.nc.touch_probe import ProbeSource
from testcases.campaigns.nc_axes import axis, until
from testcases.campaigns.nc_machines import dialog
from testcases.campaigns.support import equal

_HERE: Final = "testcases.campaigns.nc_situations"
_CYCLE_S: Final = 0.002


def _analog() -> BenchFile:
    text = load_bench("analog").text
    head = text[: text.index("[axis.axis1]")].replace("cycle_ms = 4", "cycle_ms = 2")
    return BenchFile(
        "nc analog drive",
        head.replace("[drive.drive1]\n", "[drive.drive1]\n", 1)
        + '[axis.x]\ncontroller = "nc"\ndrive = "drive1"\n[axis.x.parameters]\n"ctrl.pos_kv" = 10.0\n'
        '"ctrl.offset_timer" = 0.25\n"ctrl.offset_limit" = 0.02\n',
    )


ANALOG: Final = _analog()
OF_HOIST: Final = Campaign(
    "nc two speeds", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_drives:HOIST"
)
OF_ANALOG: Final = Campaign("nc analog drive", tags=("nc",), controller="nc", bench=f"{_HERE}:ANALOG")
OF_MACHINES: Final = Campaign(
    "nc situations", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_machines:BENCH"
)
OF_TWO: Final = Campaign(
    "nc projects", tags=("nc",), controller="nc", bench="testcases.campaigns.nc_axes:BENCH"
)


# -- two speeds ----------------------------------------------------------------------------------------------


@OF_HOIST.product(
    "override/{phase}",
    parameters={"phase": ("fast", "creeping", "releasing")},
    title="no override while a two-speed axis is {phase}",
    requirements=("NC-613", "NC-615", "NC-653", "NC-654"),
)
def override(ctx: CaseContext, phase: str) -> None:
    """Without override the axis stands with its brake applied after the delay, and goes on with its command
    when the override comes back: brake first, and slowly with half of it.
    """
    one, motor = axis(ctx), ctx.bench.drive("hoist")
    move = one.move_absolute(140.0, Velocity=100.0)
    if phase == "fast":
        ctx.run_for(0.5)
    elif phase == "creeping":
        ctx.wait_until(lambda: one.ref.NcToPlc.AxisState == 23, 5.0, "it creeps")
    else:
        ctx.run_for(0.05)
    one.power(override=0.0)
    ctx.run_for(3 * _CYCLE_S)
    if phase == "creeping":
        # Only fast and slow travel look at the override; what creeps goes on to its end (NC-653).
        ctx.wait_until(move.done, 10.0, "it creeps to its end")
        return
    equal(ctx, "state without override", one.ref.NcToPlc.AxisState, 20.0, "NC-653")
    image = one.image.pack_drive_outputs()
    equal(ctx, "neither speed is on", image[8] & 0x0F, 0.0, "NC-653")
    delay = 0.2
    ctx.run_for(delay - 6 * _CYCLE_S)
    if phase == "fast":
        equal(ctx, "the brake before its delay", one.image.pack_drive_outputs()[8] >> 7, 0.0, "NC-654")
    ctx.run_for(10 * _CYCLE_S)
    equal(ctx, "the brake after its delay", one.image.pack_drive_outputs()[8] >> 7, 1.0, "NC-654")
    ctx.run_for(0.4)
    place = one.position
    equal(ctx, "the brake of the motor", motor.braked, 1.0)
    ctx.run_for(0.3)
    equal(ctx, "it stands", one.position, place, "NC-653", within=1e-6)
    equal(ctx, "Busy", move.Busy, 1.0, "NC-653")
    one.power(override=40.0)
    ctx.run_for(0.06)
    equal(ctx, "state while the brake opens", one.ref.NcToPlc.AxisState, 21.0, "NC-613")
    equal(ctx, "no speed while the brake opens", one.image.pack_drive_outputs()[8] & 0x0F, 0.0, "NC-613")
    ctx.run_for(0.4)
    speed = float(ctx.trace()["hoist.velocity"].values[-1]) * 1000.0
    equal(ctx, "slow with 40 %", speed, 10.0, "NC-613", within=1.0)
    one.power(override=100.0)
    ctx.run_for(0.3)
    speed = float(ctx.trace()["hoist.velocity"].values[-1]) * 1000.0
    ctx.measure("fast with 100 %", speed, "mm/s", low=60.0, requirements=("NC-613",))
    ctx.wait_until(move.done, 20.0, "the motion is done")
    ctx.measure("off the target", one.position - 140.0, "mm", low=-6.0, high=6.0)


@OF_HOIST.product(
    "stop/{phase}",
    parameters={"phase": ("standing", "releasing", "slow", "pausing", "braking")},
    title="a stop while a two-speed axis is {phase}",
    requirements=("NC-673", "NC-674", "NC-675", "NC-676"),
)
def stop(ctx: CaseContext, phase: str) -> None:
    """A stop brakes what stands or releases its brake, creeps for its distance what travels, waits for the
    pause, and adds nothing to what brakes.
    """
    one = axis(ctx)
    move = one.move_absolute(-140.0, Velocity=40.0 if phase == "slow" else 100.0)
    state = {"pausing": 22, "braking": 24}.get(phase)
    if state is not None:
        ctx.wait_until(lambda: one.ref.NcToPlc.AxisState == state, 10.0, phase)
    elif phase == "releasing":
        ctx.run_for(0.05)
    else:
        ctx.run_for(0.6)
    if phase == "standing":
        one.power(override=0.0)
        ctx.run_for(0.5)
    at, since = one.position, ctx.now_s
    stopped = one.stop()
    ctx.wait_until(stopped.done, 10.0, "the stop is done")
    took, way = ctx.now_s - since, abs(one.position - at)
    if phase in ("standing", "releasing"):
        equal(ctx, "way of the stop", way, 0.0, "NC-674", within=0.1)
        equal(ctx, "time of the brake", took, 0.25, "NC-674", within=0.05)
    elif phase == "slow":
        ctx.measure("way of the stop", way, "mm", low=5.0, high=9.0, requirements=("NC-675",))
    elif phase == "pausing":
        ctx.measure("way of the stop", way, "mm", low=5.0, high=20.0, requirements=("NC-676",))
    else:
        ctx.measure("time of the stop", took, "s", high=0.3, requirements=("NC-673",))
    equal(ctx, "the motion is aborted, or done", move.CommandAborted or move.Done, 1.0)
    ctx.run_for(0.5)
    place = one.position
    ctx.run_for(0.2)
    equal(ctx, "it stands", one.position, place, within=1e-6)


# -- an analog drive -----------------------------------------------------------------------------------------


@OF_ANALOG.case("offset", requirements=("NC-558", "NC-560", "NC-561", "NC-562", "NC-564"))
def offset(ctx: CaseContext) -> None:
    """The automatic offset integrates the output of the controller at rest with its time, within its limit,
    and rests while the axis travels; held, it stays, switched off, it fades out or is gone.
    """
    one = axis(ctx, "x")
    controller = one.object.controller
    full = float(one.read_parameter("axis.reference_velocity"))
    rows: list[tuple[float, float, float]] = []

    def look() -> None:
        rows.append((controller.offset, one.object.drive.control, one.object.motion.v))

    end = ctx.bench.on_cycle(look)
    # A drift of the output, which the controller has to make up for with a following error.
    one.write_parameter("drv.drift_compensation", 4.0)
    ctx.run_for(0.5)
    before = one.object.following_error
    one.write_parameter("ctrl.auto_offset", True)
    rows.clear()
    ctx.run_for(0.6)
    found = np.array(rows)
    wanted, last = [], 0.0
    for _, control, velocity in rows:
        if abs(velocity) <= 0.01 * full:
            last = min(max(last + control * _CYCLE_S / 0.25, -0.02 * full), 0.02 * full)
        wanted.append(last)
    off = float(np.abs(found[2:, 0] - np.array(wanted)[2:]).max())
    equal(ctx, "offset off its integral", off, 0.0, "NC-558", "NC-561", within=0.05)
    ctx.measure("following error before", abs(before), low=0.2)
    equal(ctx, "following error with it", one.object.following_error, 0.0, "NC-558", within=0.4 * abs(before))
    held = controller.offset
    move = one.move_velocity(0.3 * full if full < 1000.0 else 150.0)
    until(ctx, move.in_velocity, "constant")
    first = controller.offset
    ctx.run_for(0.2)
    equal(ctx, "offset while it travels", controller.offset, first, "NC-560", within=1e-9)
    until(ctx, one.halt().done)
    controller.offset_mode = OffsetMode.HOLD
    kept = controller.offset
    ctx.run_for(0.1)
    equal(ctx, "offset that is held", controller.offset, kept, "NC-562", within=1e-9)
    controller.offset_mode = OffsetMode.FADE_OUT
    one.write_parameter("ctrl.auto_offset", False)
    kept, number = controller.offset, len(rows)
    ctx.run_for(0.1)
    share = (0.25 / (0.25 + _CYCLE_S)) ** (len(rows) - number)
    equal(ctx, "offset that fades", controller.offset, kept * share, "NC-562", within=0.02 * abs(kept))
    controller.offset_mode = OffsetMode.OFF
    ctx.run_for(2 * _CYCLE_S)
    equal(ctx, "offset switched off", controller.offset, 0.0, "NC-562", within=1e-12)
    ctx.measure("what it was", abs(held), low=0.5)
    one.write_parameter("drv.drift_compensation", 60.0)
    one.write_parameter("axis.position_lag_monitoring", False)
    one.write_parameter("ctrl.auto_offset", True)
    ctx.run_for(2.0)
    equal(ctx, "offset at its limit", abs(controller.offset), 0.02 * full, "NC-561", within=1e-6)
    end()


# -- probes, dialog, projects --------------------------------------------------------------------------------


@OF_MACHINES.case("probe-window", requirements=("NC-409",))
def probe_window(ctx: CaseContext) -> None:
    """An edge outside of the window does not count, one inside does; a wait can be ended, and a source that
    there is not is refused.
    """
    one = axis(ctx)
    outside = one.touch_probe(
        ProbeSource.LATCH_POSITIVE, WindowOnly=True, FirstPosition=32.0, LastPosition=40.0
    )
    until(ctx, one.move_absolute(60.0, Velocity=150.0).done)
    equal(ctx, "an edge outside of the window", outside.Done, 0.0, "NC-409")
    equal(ctx, "it waits on", outside.Busy, 1.0, "NC-409")
    count = one.ref.NcToPlc.TouchProbeCounter
    end = one.run(MC_AbortTrigger(one.ref, Execute=True))
    ctx.run_for(0.01)
    equal(ctx, "Done of MC_AbortTrigger", end.Done, 1.0)
    equal(ctx, "CommandAborted of MC_TouchProbe", outside.CommandAborted, 1.0)
    equal(ctx, "Done of MC_TouchProbe", outside.Done, 0.0)
    until(ctx, one.move_absolute(0.0, Velocity=150.0).done)
    equal(ctx, "no latch meanwhile", one.ref.NcToPlc.TouchProbeCounter, count)
    inside = one.touch_probe(
        ProbeSource.LATCH_POSITIVE, WindowOnly=True, FirstPosition=30.0, LastPosition=31.5
    )
    until(ctx, one.move_absolute(60.0, Velocity=80.0).done)
    equal(ctx, "an edge inside of the window", inside.Done, 1.0, "NC-409")
    equal(ctx, "its place", inside.RecordedPosition, 31.0, "NC-409", within=0.05)
    equal(ctx, "latches", one.ref.NcToPlc.TouchProbeCounter, count + 1)
    wrong = one.touch_probe(77)  # type: ignore[arg-type]
    ctx.run_for(0.01)
    equal(ctx, "ErrorID of a source that there is not", wrong.ErrorID, 0x4B06)


@OF_MACHINES.case("dialog", requirements=("NC-238", "NC-239", "NC-240", "NC-241", "NC-298"))
def in_the_dialog(ctx: CaseContext) -> None:
    """The dialog stops with F6, resets with F8, homes with F9, and refuses what it cannot do, all of it while
    the program runs.
    """
    one = ctx.bench.axis("x", controller="nc")
    equal(ctx, "a key while the program runs", one.online.press("F4"), 0x4B05, "NC-238")
    equal(
        ctx, "a start while the program runs", one.online.start("absolute", velocity=10.0, target=5.0), 0x4B05
    )
    equal(ctx, "a stop while the program runs", one.online.stop(), 0x4B05)
    for wrong in (
        lambda: one.online.press("F7"),
        lambda: one.online.start("sideways", velocity=10.0),
        lambda: one.online.start("absolute", velocity=10.0),
        lambda: one.online.start("reversing", velocity=10.0, target=5.0),
    ):
        refused = 0
        try:
            wrong()
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            ctx.do(f"refused: {error}")
            refused = 1
        equal(ctx, "refused in words", refused, 1.0)
    one = dialog(ctx)
    equal(ctx, "F4", one.online.press("F4"), 0.0)
    ctx.run_for(0.5)
    ctx.measure("velocity with F4", float(one.ref.axis.motion.v), "mm/s", low=100.0)
    equal(ctx, "F6", one.online.press("F6"), 0.0, "NC-238")
    ctx.wait_until(lambda: one.object.motion.v == 0.0, 2.0, "F6 stops it")
    one.object.raise_error(0x4550)
    ctx.run_for(0.05)
    equal(ctx, "F8", one.online.press("F8"), 0.0, "NC-239")
    ctx.run_for(0.5)
    equal(ctx, "error after F8", one.error_id, 0.0, "NC-239")
    equal(
        ctx, "modulo target beyond the factor", one.online.start("modulo", velocity=50.0, target=-1.0), 0x4B06
    )
    before = one.object.motion.s
    equal(ctx, "modulo start", one.online.start("modulo", velocity=200.0, target=30.0), 0.0, "NC-240")
    ctx.run_for(0.05)
    ctx.wait_until(
        lambda: one.object.motion.active is None or one.object.motion.active.ended, 8.0, "it is there"
    )
    ctx.run_for(0.3)
    equal(ctx, "modulo position", one.object.motion.s % 90.0, 30.0, "NC-240", within=1e-6)
    ctx.measure("forwards", one.object.motion.s - before, low=0.0, high=90.0)


@OF_TWO.case(
    "parameters",
    requirements=("NC-045", "NC-058", "NC-065", "NC-078"),
    without=("NC-472",),  # the axes that an activation makes count anew
)
def project(ctx: CaseContext) -> None:
    """Offline parameters act with the next activation, online ones at once; each can be brought to the other,
    and an axis that is removed leaves its id for another one.
    """
    nc = ctx.bench.nc
    made = nc.project
    entry, one = made["x"], ctx.bench.axis("x", controller="nc")
    equal(ctx, "linked", entry.linked, 1.0)
    equal(ctx, "id", entry.number, 1.0, "NC-078")
    ids = entry.object_ids
    equal(ctx, f"object ids {ids}", len(set(ids.values())), len(ids), "NC-058")
    equal(ctx, "its number is in them", float(all(value >> 4 & 0xFF == 1 for value in ids.values())), 1.0)
    before = float(one.read_parameter("ctrl.pos_kv"))
    entry.write("ctrl.pos_kv", before + 3.0)
    equal(ctx, "offline", entry.read("ctrl.pos_kv"), before + 3.0, "NC-065")
    equal(ctx, "online before", one.read_parameter("ctrl.pos_kv"), before, "NC-065")
    made.download("x")
    equal(ctx, "online after a download", one.read_parameter("ctrl.pos_kv"), before + 3.0, "NC-065")
    one.write_parameter("ctrl.pos_kv", before - 1.0)
    equal(ctx, "offline before an upload", entry.read("ctrl.pos_kv"), before + 3.0)
    made.upload("x")
    equal(ctx, "offline after an upload", entry.read("ctrl.pos_kv"), before - 1.0, "NC-065")
    added = made.add("spare")
    equal(ctx, "id of an added axis", added.number, 3.0, "NC-045")
    equal(ctx, "default of an added axis", added.read("axis.maximum_velocity"), 2000.0)
    for wrong in (lambda: made.download("spare"), lambda: made.add("x"), lambda: made["nobody"]):
        refused = 0
        try:
            wrong()
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            ctx.do(f"refused: {error}")
            refused = 1
        equal(ctx, "refused in words", refused, 1.0)
    made.remove("spare")
    equal(ctx, "names left", list(made.entries) == ["x", "y"], 1.0)
    equal(ctx, "its id is free", made.add("another").number, 3.0, "NC-078")
    made.remove("another")
    entry.write("ctrl.pos_kv", 17.0)
    made.activate()
    ctx.run_for(0.05)
    again = ctx.bench.axis("x", controller="nc")
    equal(ctx, "online after the activation", again.read_parameter("ctrl.pos_kv"), 17.0, "NC-065")
    ctx.wait_until(again.power().status, 3.0, "the new axis is enabled")
    until(ctx, again.move_relative(5.0, Velocity=50.0).done)

"""What a controller does for its axes beside motion: ramps from times, limit switches in data blocks, the
memory card with the adjustment of encoders, diagnosis in words, and what an enable waits for.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from motion.s7.data_blocks import BitAddress
from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, can_segment, drive_name, enable, equal, restart

_HERE: Final = "testcases.campaigns.axis_services"
TIMES: Final = {
    "maximum_up_s": (0.31, "DynamicLimits.MaxVelocity", "DynamicLimits.MaxAcceleration"),
    "maximum_down_s": (0.27, "DynamicLimits.MaxVelocity", "DynamicLimits.MaxDeceleration"),
    "default_up_s": (0.19, "DynamicDefaults.Velocity", "DynamicDefaults.Acceleration"),
    "default_down_s": (0.23, "DynamicDefaults.Velocity", "DynamicDefaults.Deceleration"),
    "emergency_s": (0.11, "DynamicLimits.MaxVelocity", "DynamicDefaults.EmergencyDeceleration"),
}
"""Times in s, and which velocity gives which acceleration with them."""


def _with_times() -> BenchFile:
    given = {path for _, _, path in TIMES.values()}
    lines = [
        line
        for line in load_bench("reference").text.splitlines()
        if line.partition(" ")[0].strip('"') not in given
    ]
    times = "".join(f"{name} = {time_s}\n" for name, (time_s, *_) in TIMES.items())
    return BenchFile("ramps as times", "\n".join(lines) + f"\n[axis.axis1.ramp_times]\n{times}")


RAMPS: Final = _with_times()
ABSOLUTE: Final = load_bench("reference").configured(
    {
        "drive": {"drive1": {"encoder": "absolute"}},
        "axis": {"axis1": {"variables": {"Sensor[1].Type": 1}}},
    }
)
CAMPAIGN: Final = Campaign("axis services", tags=("axis",), bench="reference")
OF_TIMES: Final = Campaign("ramps as times", tags=("axis",), bench=f"{_HERE}:RAMPS")
OF_CARDS: Final = Campaign("memory card", tags=("axis", "encoder"), bench=f"{_HERE}:ABSOLUTE")
BLOCK: Final = 7
_SIGN: Final = {"negative": -1.0, "positive": 1.0}
_ENDS: Final = {"negative": "Min", "positive": "Max"}


@OF_TIMES.case("follow")
def ramp_times(ctx: CaseContext) -> None:
    """Every acceleration is its velocity by its time, also after the velocity has been changed in load memory
    and the axis restarted; a motion takes exactly that.
    """
    read = ctx.axis.variables.read

    def check(when: str) -> None:
        for name, (time_s, velocity, path) in TIMES.items():
            wanted = float(read(velocity)) / time_s
            equal(ctx, f"{path} of {name} {when}", read(path), wanted, within=1e-9 * wanted)

    check("at the start")
    restart(ctx, {"DynamicLimits.MaxVelocity": 430.0, "DynamicDefaults.Velocity": 77.0})
    check("after a change of the velocities")
    enable(ctx)
    ctx.axis.move_velocity(77.0, Jerk=0.0)
    ctx.run_for(0.5)
    trace = ctx.trace()
    greatest = float(trace[f"{axis_name(ctx)}.acceleration_setpoint"].values.max())
    wanted = 77.0 / TIMES["default_up_s"][0]
    equal(ctx, "acceleration of a motion with the defaults", greatest, wanted, within=1e-6 * wanted)


@CAMPAIGN.product(
    "limit-bit/{side}",
    parameters={"side": tuple(_SIGN)},
    title="bit of a data block as hardware limit switch, {side} side",
    requirements=("LIM-070", "LIM-071"),
)
def limit_bit(ctx: CaseContext, side: str) -> None:
    """The bit stops the axis with 531 at its level, that of the other side does not; the wired inputs count
    no more.
    """
    axis = ctx.axis
    blocks = ctx.bench.runtime.data_blocks
    block = blocks.add(BLOCK, 8)
    bits = {"negative": (4, 2), "positive": (5, 6)}
    level = {name: bool(axis.var(f"PositionLimits_HW.{end}SwitchLevel")) for name, end in _ENDS.items()}
    for name, place in bits.items():
        block.set_bit(*place, not level[name])
    axis.set_limit_variables(
        BitAddress.of_bit(BLOCK, *bits["negative"]), BitAddress.of_bit(BLOCK, *bits["positive"])
    )
    restart(ctx, {"PositionLimits_HW.Active": False})
    ctx.wait_until(axis.write_parameter(1000, True).done, 2.0, "the monitoring is on")
    enable(ctx)
    job = axis.move_velocity(_SIGN[side] * 120.0)
    ctx.wait_until(job.in_velocity, 3.0, "the velocity is reached")
    ctx.inject("switch.stuck", drive_name(ctx), input=f"{side}_limit", state=True, duration_s=0.05)
    ctx.run_for(0.1)
    equal(ctx, "ErrorWord while the wired switch is actuated", axis.var("ErrorWord"), 0.0, "LIM-071")
    block.set_bit(*bits[side], level[side])
    ctx.run_for(cycles(ctx, 2))
    number, other = (17, 18) if side == "negative" else (18, 17)
    equal(ctx, "alarm", axis.var("ErrorDetail.Number"), 531.0, "LIM-071")
    equal(ctx, f"X{number}", axis.var(f"StatusWord.X{number}"), 1.0, "LIM-071")
    equal(ctx, f"X{other}", axis.var(f"StatusWord.X{other}"), 0.0, "LIM-071")
    ctx.run_for(0.5)
    block.set_bit(*bits[side], not level[side])
    ctx.wait_until(axis.reset().done, 2.0, "the alarm is acknowledged")
    equal(ctx, f"X{number} in the end", axis.var(f"StatusWord.X{number}"), 0.0)


def _save(ctx: CaseContext, bench: Any, *, wanted: int = 0) -> None:
    """Save, call by call: Busy for a cycle, Done until `Execute` falls."""
    save = MC_SaveAbsoluteEncoderData(bench.runtime)
    bench.runtime.call(save)
    bench.run_for(0.012)
    equal(ctx, "outputs before Execute", save.Done + save.Busy + save.Error + save.ErrorID, 0.0)
    save.Execute = True
    seen: list[tuple[bool, bool, bool, int]] = []
    for _ in range(4):
        bench.run_for(0.004)
        seen.append((save.Busy, save.Done, save.Error, save.ErrorID))
    first = next((number for number, one in enumerate(seen) if any(one)), 0)
    busy, after = seen[first], seen[first + 1]
    if wanted:
        equal(ctx, "ErrorID", seen[-1][3], wanted, "HOM-158")
        equal(ctx, "Error", seen[-1][2], 1.0)
    else:
        equal(ctx, "Busy in the first call", busy == (True, False, False, 0), 1.0, "HOM-158")
        equal(ctx, "Done in the second call", after == (False, True, False, 0), 1.0, "HOM-158")
    save.Execute = False
    bench.run_for(0.012)
    equal(ctx, "outputs after Execute", save.Done + save.Busy + save.Error + save.ErrorID, 0.0)


@OF_CARDS.case("replaced", requirements=("HOM-158", "HOM-159", "HOM-160"))
def card_replaced(ctx: CaseContext) -> None:
    """The adjustment of an absolute encoder is saved; a new controller with the card knows the position at
    once, and uses the file up; one whose data are damaged, or whose encoder is another, refuses it.
    """
    with tempfile.TemporaryDirectory() as folder:
        with_card = ABSOLUTE.configured({"bench": {"memory_card": folder}})
        file = Path(folder) / "UserFiles" / "AbsEncoderData.dat"
        with with_card.build(seed=1) as bench:
            axis = bench.axis()
            bench.wait_until(axis.power().status, 3.0)
            bench.wait_until(axis.home(47.5, mode=7).done, 2.0)
            _save(ctx, bench)
            equal(ctx, "the file is there", file.exists(), 1.0, "HOM-158")
            place = float(axis.var("ActualPosition"))
            machine = float(bench.trace()[f"{bench.drive_of()}.position"].values[-1])
        text = file.read_text(encoding="utf-8")
        with with_card.build(seed=1) as bench:
            bench.run_for(0.1)
            axis = bench.axis()
            moved = float(bench.trace()[f"{bench.drive_of()}.position"].values[-1]) - machine
            wanted = place + moved * 1000.0
            equal(
                ctx,
                "position of the new controller",
                axis.var("ActualPosition"),
                wanted,
                "HOM-159",
                within=0.05,
            )
            equal(ctx, "Adjusted", axis.var("StatusSensor[1].Adjusted"), 1.0, "HOM-159")
            equal(ctx, "X5", axis.var("StatusWord.X5"), 1.0, "HOM-159")
            restored = list(bench.trace().select(kind="controller.encoder_data_restored"))
            equal(ctx, "entries of the diagnostics buffer", len(restored), 1.0, "HOM-160")
            equal(ctx, "the file is used up", file.exists(), 0.0, "HOM-160")
            equal(ctx, "and renamed", file.with_suffix(".bak").exists(), 1.0, "HOM-160")
        content = json.loads(text)
        content["objects"]["axis1"]["sensors"]["StatusSensor[1]"]["offset"] += 1.0
        for what, damaged in (
            ("another offset", json.dumps(content)),
            ("half a file", text[: len(text) // 2]),
        ):
            file.write_text(damaged, encoding="utf-8")
            _refused(ctx, with_card, what)
        file.write_text(text, encoding="utf-8")
        other = with_card.configured({"axis": {"axis1": {"variables": {"Sensor[1].InverseDirection": True}}}})
        _refused(ctx, other, "another encoder")


def _refused(ctx: CaseContext, with_card: BenchFile, what: str) -> None:
    with with_card.build(seed=1) as bench:
        bench.run_for(0.05)
        equal(ctx, f"{what}: Adjusted", bench.axis().var("StatusSensor[1].Adjusted"), 0.0, "HOM-159")
        entries = list(bench.trace().select(kind="controller.encoder_data_refused"))
        equal(ctx, f"{what}: entries of the diagnostics buffer", len(entries), 1.0)


@OF_CARDS.case("without", requirements=("HOM-158",))
def card_without(ctx: CaseContext) -> None:
    """Without a card, or with one that cannot be written, a save fails; of two at once the second one, and a
    third instance always.
    """
    _save(ctx, ctx.bench, wanted=0x80EC)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "UserFiles").write_text("a file in the way", encoding="utf-8")
        with ABSOLUTE.configured({"bench": {"memory_card": folder}}).build(seed=1) as bench:
            first, second = (MC_SaveAbsoluteEncoderData(bench.runtime, Execute=True) for _ in range(2))
            third = MC_SaveAbsoluteEncoderData(bench.runtime, Execute=True)
            for one in (first, second, third):
                bench.runtime.call(one)
            bench.run_for(0.02)
            equal(ctx, "a file in the way: ErrorID", first.ErrorID, 0x80EC)
            equal(ctx, "the second at once: ErrorID", second.ErrorID, 0x80EE)
            equal(ctx, "a third instance: ErrorID", third.ErrorID, 0x80ED)


@CAMPAIGN.case("diagnosis", requirements=("DIA-110",))
def diagnosis(ctx: CaseContext) -> None:
    """The pages say what words and variables say, alarms first, in every state: disabled, moving, with an
    alarm.
    """
    axis = ctx.axis

    def check(when: str, *pending: int) -> None:
        said = axis.diagnosis()
        text = said.text()
        for name, word in said.words.items():
            equal(ctx, f"{when}: {name}", word, axis.var(name), "DIA-110")
        equal(ctx, f"{when}: state", text.partition("\n")[0].count(axis.state.name), 1.0)
        equal(ctx, f"{when}: job", float(bool(said.job)), float(axis.object.motion.job is not None))
        shown = [name for rows in said.pages.values() for name, value in rows.items() if value is True]
        equal(ctx, f"{when}: indications that are set", text.count("  [x] "), len(shown))
        hidden = [name for name in shown if f"  [x] {name}\n" not in f"{text}\n"]
        equal(ctx, f"{when}: indications that are missing", len(hidden), 0.0)
        numbers = [alarm["number"] for alarm in said.alarms]
        equal(ctx, f"{when}: alarms", float(numbers != list(pending)), 0.0)
        for number in numbers:
            equal(ctx, f"{when}: {number} is named", text.count(f"  {number}  reaction "), 1.0)
        equal(ctx, f"{when}: no alarm", text.count("alarms\n  none"), float(not numbers))
        words = [line for line in text.partition("\ntelegram\n")[2].splitlines() if line.strip()]
        equal(ctx, f"{when}: words of the telegram", len(words), len(said.telegram))
        for path, name in (("ActualPosition", "actual position"), ("Velocity", "velocity setpoint")):
            values = said.pages["values"]
            found = [value for title, value in values.items() if title == name]
            for value in found:
                equal(ctx, f"{when}: {name}", value, axis.var(path), within=1e-9)
        equal(
            ctx,
            f"{when}: words as numbers",
            float(len(said.as_dict()["telegram"]) == len(said.telegram)),
            1.0,
        )

    check("disabled")
    enable(ctx)
    axis.move_velocity(90.0)
    ctx.run_for(0.2)
    check("moving")
    ctx.inject("axis.alarm", axis_name(ctx), number=307)
    ctx.run_for(0.02)
    check("with an alarm", 307)


@CAMPAIGN.case("waits", requirements=("STP-020",))
def waits(ctx: CaseContext) -> None:
    """An enable that waits says once for what, and goes on when it is there."""
    axis, name = ctx.axis, axis_name(ctx)
    ctx.run_for(0.05)
    silent = ctx.inject("can.unplug", can_segment(ctx), node=drive_name(ctx))
    ctx.run_for(0.5)
    ctx.wait_until(axis.reset().done, 3.0, "the loss is acknowledged")
    before = len(list(ctx.trace().select(source=name, kind="power.waits")))
    power = axis.power()
    ctx.run_for(0.2)
    waiting = list(ctx.trace().select(source=name, kind="power.waits"))[before:]
    equal(ctx, "entries while the drive is silent", len(waiting), 1.0, "STP-020")
    said = float("communication" in str(waiting[-1].data["reason"]) if waiting else False)
    equal(ctx, "it waits for the communication", said, 1.0, "STP-020")
    equal(ctx, "Busy", axis.power_instance.Busy, 1.0)
    equal(ctx, "Status", axis.power_instance.Status, 0.0)
    silent.remove()
    ctx.wait_until(power.status, 10.0, "the enable goes on when the drive is back")

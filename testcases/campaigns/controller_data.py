"""Data beside the axes: memory card, limit switches in a data block, telegrams through a data block, what the
diagnosis says, names of the calls.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import alarm
from motion.drives.data_block import DataBlock
from motion.s7.controller import OperatingState
from motion.s7.data_blocks import BitAddress
from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from motion.s7.memory_card import FILE, FOLDER, USED
from testcases.campaigns.support import equal

_HERE: Final = "testcases.campaigns.controller_data"
ABSOLUTE: Final[BenchFile] = load_bench("reference").configured(
    {
        "drive": {"drive1": {"encoder": "absolute"}},
        "axis": {
            "axis1": {"variables": {"Sensor[1].Type": 1, "Sensor[1].Parameter.DeterminableRevolutions": 4096}}
        },
    }
)
"""The reference bench with an absolute encoder."""
UNWATCHED: Final[BenchFile] = load_bench("reference").configured(
    {"axis": {"axis1": {"variables": {"PositionLimits_HW.Active": False}}}}
)
"""The reference bench without limit switches, until the program switches them on."""
BLOCK: Final[BenchFile] = load_bench("profidrive").configured(
    {"axis": {"axis1": {"connection": "data_block"}}}
)
"""A bench whose program stands between the telegram and the axis."""
CARD: Final = Campaign("memory card", tags=("controller",), bench=f"{_HERE}:ABSOLUTE")
BITS: Final = Campaign("limit switches in a data block", tags=("controller",), bench=f"{_HERE}:UNWATCHED")
WORDS: Final = Campaign("telegram in a data block", tags=("controller",), bench=f"{_HERE}:BLOCK")
DIAGNOSIS: Final = Campaign("diagnosis", tags=("controller",), bench="reference")


def _enabled(ctx: CaseContext) -> Any:
    ctx.wait_until(ctx.axis.power().status, 3.0, "the axis is enabled")
    return ctx.axis


# -- memory card -------------------------------------------------------------------------------------------


@contextmanager
def _card() -> Iterator[Path]:
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def _stop(ctx: CaseContext) -> Any:
    controller = ctx.bench.controller
    controller.stop()
    ctx.wait_until(
        lambda: ctx.axis.object.state.name in {"DISABLED", "ALARM_DISABLED"}, 3.0, "the axis is off"
    )
    ctx.run_for(0.05)
    return controller


def _run(ctx: CaseContext) -> None:
    ctx.bench.controller.run()
    ctx.wait_until(lambda: ctx.bench.controller.state is OperatingState.RUN, 5.0, "RUN")
    ctx.run_for(0.05)


def _save(ctx: CaseContext) -> MC_SaveAbsoluteEncoderData:
    save = MC_SaveAbsoluteEncoderData(ctx.bench.runtime)
    ctx.bench.runtime.call(save)
    ctx.run_for(0.004)
    equal(ctx, "no output before Execute", save.Busy + save.Done + save.Error, 0)
    save.Execute = True
    ctx.wait_until(lambda: save.Busy or save.Error, 0.02, "the save is busy, or refused")
    ctx.wait_until(save.ended, 0.1, "the save has ended")
    return save


def _said(ctx: CaseContext, kind: str) -> list[str]:
    """Return the reasons, or numbers of objects, of what the controller says of a card."""
    found = [one for one in ctx.trace().events if one.kind == f"controller.encoder_data_{kind}"]
    return [str(one.data.get("reason", one.data.get("objects"))) for one in found]


@CARD.case(
    "saved-and-restored",
    requirements=("MC-466", "MC-467", "MC-471", "MC-472", "HOM-158", "HOM-159", "HOM-160"),
)
def restored(ctx: CaseContext) -> None:
    """An adjustment on the card comes back after everything else was lost, once; outputs are held with
    Execute.
    """
    axis = _enabled(ctx)
    with _card() as folder:
        equal(ctx, "an empty card restores nothing", ctx.bench.runtime.insert_card(folder), 0)
        ctx.wait_until(axis.home(37.5, mode=7).done, 1.0, "the encoder is adjusted")
        save = _save(ctx)
        equal(ctx, "Done alone", save.Done - save.Busy - save.Error, 1, "MC-467")
        ctx.run_for(0.02)
        equal(ctx, "Done is held", save.Done, 1, "MC-471")
        save.Execute = False
        ctx.run_for(0.008)
        equal(ctx, "Done falls", save.Done, 0, "MC-471")
        equal(ctx, "told", _said(ctx, "saved") == ["1"], 1, "HOM-158")
        content = json.loads((folder / FOLDER / FILE).read_text())
        values = content["objects"]["axis1"]["sensors"]["StatusSensor[1]"]
        equal(ctx, "saved offset", values["offset"], axis.var("StatusSensor[1].AbsEncoderOffset"))
        equal(ctx, "saved as adjusted", values["adjusted"], 1)
        _stop(ctx).factory_reset()
        equal(ctx, "the adjustment is lost", axis.var("StatusSensor[1].Adjusted"), 0)
        equal(ctx, "restored", ctx.bench.runtime.insert_card(folder), 1, "MC-472")
        equal(ctx, "it is adjusted", axis.var("StatusSensor[1].Adjusted"), 1, "HOM-159")
        _run(ctx)
        equal(ctx, "position", axis.var("ActualPosition"), 37.5, "HOM-159", within=0.05)
        equal(ctx, "homed", axis.var("StatusWord.X5"), 1)
        equal(ctx, "told", _said(ctx, "restored") == ["1"], 1, "HOM-160")
        used = not (folder / FOLDER / FILE).exists() and (folder / FOLDER / USED).exists()
        equal(ctx, "the file is used up", used, 1, "HOM-160")
        equal(ctx, "restored once more", ctx.bench.runtime.insert_card(folder), 0, "HOM-160")


@CARD.case("refused", requirements=("MC-465", "MC-626", "HOM-162", "HOM-204"))
def not_restored(ctx: CaseContext) -> None:
    """Without a card, at the third instance, and while another save runs there is an ErrorID each; damaged
    data and those of other objects are not taken, with the reason.
    """
    axis = _enabled(ctx)
    runtime = ctx.bench.runtime
    first = _save(ctx)
    equal(ctx, "ErrorID without a card", first.ErrorID, 0x80EC, "MC-626")
    first.Execute = False
    ctx.run_for(0.008)
    equal(ctx, "outputs afterwards", first.Error + first.ErrorID, 0)
    second, third = MC_SaveAbsoluteEncoderData(runtime), MC_SaveAbsoluteEncoderData(runtime)
    with _card() as folder:
        runtime.insert_card(folder)
        for one in (first, second, third):
            one(Execute=True)
        equal(ctx, "ErrorID of a save meanwhile", second.ErrorID, 0x80EE, "MC-626")
        equal(ctx, "ErrorID of a third instance", third.ErrorID, 0x80ED, "MC-626")
        ctx.wait_until(first.done, 0.1, "the first save is done")
        file = folder / FOLDER / FILE
        good = file.read_text()
        saved = json.loads(good)
        name = saved["objects"]["axis1"]["configuration"]
        equal(ctx, "configuration is saved", name["Sensor[1].Type"], 1)
        for text, reason in (
            (good[: len(good) // 2], "damaged"),
            (good.replace('"adjusted": false', '"adjusted": true'), "checksum"),
            ("[]", "damaged"),
            ("", "damaged"),
        ):
            file.write_text(text)
            before = len(_said(ctx, "refused"))
            equal(ctx, f"{reason} data are not taken", runtime.insert_card(folder), 0, "HOM-162")
            told = _said(ctx, "refused")
            equal(
                ctx, f"the reason {told[-1:]}", len(told) - before == 1 and reason in told[-1], 1, "HOM-162"
            )
        file.write_text(good)
        axis.object.name = "other"
        equal(ctx, "another name", runtime.insert_card(folder), 0, "HOM-162")
        axis.object.name = "axis1"
        equal(ctx, "the reason names it", "'axis1' does not exist" in _said(ctx, "refused")[-1], 1)
        equal(ctx, "the file is there", file.exists(), 1)
        axis.variables.set_internal("Sensor[1].Parameter.StepsPerRevolution", 77)
        equal(ctx, "another encoder", runtime.insert_card(folder), 0, "HOM-162")
        equal(ctx, "the reason names it", "StepsPerRevolution was" in _said(ctx, "refused")[-1], 1)


# -- limit switches ----------------------------------------------------------------------------------------


@BITS.product(
    "side/{side}-{level}",
    parameters=[
        {"side": side, "byte": byte, "bit": bit, "level": level}
        for side, byte, bit in (("negative", 4, 0), ("positive", 11, 7))
        for level in (True, False)
    ],
    title="The {side} switch is DBX{byte}.{bit}, level {level}",
    requirements=("LIM-069", "LIM-070", "LIM-071"),
)
def side(ctx: CaseContext, side: str, byte: int, bit: int, level: bool) -> None:
    """That bit alone is the limit switch, from the moment on at which the program switches the monitoring on;
    its neighbours and the other inputs do not matter.
    """
    axis = ctx.axis
    block = ctx.bench.runtime.data_blocks.add(7, 12)
    block.set_bit(byte, bit, not level)
    axis.set_limit_variables(**{side: BitAddress.of_bit(7, byte, bit)})
    name = "Min" if side == "negative" else "Max"
    axis.variables.write_start(f"PositionLimits_HW.{name}SwitchLevel", level)
    ctx.wait_until(axis.reset(restart=True).done, 3.0, "the start values count")
    _enabled(ctx)
    job = axis.write_parameter(1000, True)
    ctx.wait_until(job.done, 0.2, "the switches are monitored")
    for number in range(12 * 8):
        if number != 8 * byte + bit:
            block.set_bit(number // 8, number % 8, level)
    axis.move_velocity(-40.0 if side == "negative" else 40.0)
    ctx.run_for(0.3)
    equal(ctx, "alarm by other bits", axis.var("ErrorDetail.Number"), 0, "LIM-069")
    since = ctx.now_s
    block.set_bit(byte, bit, level)
    ctx.run_for(0.5)
    ctx.expect(alarm(531, since=since, within_s=0.02).covers("LIM-069"))
    word = "StatusWord.X17" if side == "negative" else "StatusWord.X18"
    equal(ctx, word, axis.var(word), 1, "LIM-071")


@BITS.case("no-address", requirements=("LIM-070",))
def no_address(ctx: CaseContext) -> None:
    """An address that is no bit of a block with standard access is refused when the monitoring is switched
    on; the last bit of a block is one.
    """
    axis, blocks = ctx.axis, ctx.bench.runtime.data_blocks
    blocks.add(7, 12)
    blocks.add(8, 12, optimized=True)
    good = BitAddress.of_bit(7, 11, 7)
    for words, address, wanted in (
        ("its type", good._replace(rid=0x0200_0002), False),
        ("its area", good._replace(area=0x83), False),
        ("a block that is not there", good._replace(number=9), False),
        ("an optimized block", good._replace(number=8), False),
        ("a bit behind the end", good._replace(offset=96), False),
        ("the last bit", good, True),
    ):
        axis.set_limit_variables(negative=address)
        restart = axis.reset(restart=True)
        ctx.wait_until(restart.ended, 3.0, "the restart is over")
        job = axis.write_parameter(1000, True)
        ctx.run_for(0.02)
        shown = axis.var("ErrorDetail.Number")
        equal(ctx, f"{words}: taken", job.Done and not shown, wanted, "LIM-070")
        if axis.var("ErrorDetail.Number"):
            axis.variables.write_start("PositionLimits_HW.Active", False)
    for wrong in ((7, 12, 0), (7, 0, 8), (7, -1, 0)):
        code = 0
        try:
            blocks[wrong[0]].set_bit(wrong[1], wrong[2], True)
        except Exception:  # noqa: BLE001 - whatever refuses it
            code = 1
        equal(ctx, f"DBX{wrong[1]}.{wrong[2]} is refused", code, 1)


# -- telegram ----------------------------------------------------------------------------------------------


@WORDS.case("through", requirements=("CFG-253", "CFG-255", "CFG-256", "CFG-258", "CFG-260"))
def through(ctx: CaseContext) -> None:
    """Without the program nothing arrives; what it copies is what the axis and the drive get, with their own
    signs and names, with a sign of life that counts.
    """
    block = DataBlock("DB1", {"slides": "Array[3..4] of PD_TEL105", "spare": {"one": "PD_TEL3"}})
    equal(ctx, "its structures", list(block) == ["slides[3]", "slides[4]", "spare.one"], 1, "CFG-258")
    axis, telegram = ctx.axis, block["slides[4]"]
    axis.object.port.connect_block(telegram)
    ctx.run_for(0.1)
    equal(ctx, "communication without a program", axis.var("StatusDrive.CommunicationOK"), 0, "CFG-253")
    telegram.pass_through()
    ctx.run_for(0.3)
    if axis.var("ErrorDetail.Number"):
        ctx.wait_until(axis.reset().done, 2.0, "the alarm is acknowledged")
    _enabled(ctx)
    begun = axis.var("ActualPosition")
    ctx.wait_until(axis.move_relative(-21.0, Velocity=100.0).done, 4.0, "the axis has moved")
    equal(ctx, "way", axis.var("ActualPosition") - begun, -21.0, "CFG-255", within=0.1)
    job = axis.move_velocity(-60.0)
    ctx.wait_until(job.in_velocity, 2.0, "the velocity is there")
    ctx.measure("speed setpoint", telegram.Output["NSOLL_B"], high=-1.0, requirements=("CFG-256",))
    ctx.measure("actual speed", telegram.Input["NIST_B"], high=-1.0, requirements=("CFG-256",))
    equal(ctx, "what is sent", telegram.sent["NSOLL_B"] == telegram.Output["NSOLL_B"], 1, "CFG-260")
    equal(ctx, "words of another one", sum(block["slides[3]"].Input.values()), 0, "CFG-258")
    signs = set()
    for _ in range(4):
        ctx.run_for(0.004)
        signs.add(telegram.sent["STW2"] >> 12)
    equal(ctx, "signs of life in four cycles", len(signs), 4, "CFG-260")


@WORDS.case("declared", requirements=("CFG-257", "CFG-259"))
def declared(ctx: CaseContext) -> None:
    """Only structures with input and output, arrays and structures of them can be declared; a block in load
    memory alone, or write-protected, cannot be used.
    """

    def refused(declarations: Any, **attributes: Any) -> int:
        try:
            DataBlock("DB1", declarations, **attributes)
        except Exception as error:  # noqa: BLE001 - whatever refuses it, the story says what it was
            ctx.do(f"refused: {error}")
            return 1
        return 0

    for kind in ("PD_TEL3_IN", "INT", "PD_TEL77", "Array[2..1] of PD_TEL3", "Array[0..1000] of PD_TEL3"):
        equal(ctx, f"{kind} is refused", refused({"a": kind}), 1, "CFG-257")
        equal(ctx, f"{kind} in a structure is refused", refused({"a": {"b": kind}}), 1, "CFG-257")
    for kind in ("PD_TEL105", "Array[0..0] of PD_TEL83", "Array[0..999] of PD_TEL83"):
        equal(ctx, f"{kind} is taken", refused({"a": kind}), 0, "CFG-257")
    for attributes, wanted in (
        ({"only_in_load_memory": True}, 1),
        ({"write_protected": True}, 1),
        ({"optimized": True}, 0),
        ({"optimized": True, "technology_version": 3.9}, 1),
        ({"optimized": True, "technology_version": 4.0}, 0),
    ):
        equal(ctx, f"{attributes} is refused", refused({"a": "PD_TEL3"}, **attributes), wanted, "CFG-259")
    ctx.run_for(0.1)


# -- diagnosis ---------------------------------------------------------------------------------------------


@DIAGNOSIS.case("pages", requirements=("DIA-110", "DIA-001"))
def pages(ctx: CaseContext) -> None:
    """Every indication is its bit or variable of one instant, at rest, in motion, with an alarm; words, job,
    telegram, alarms and units are those of the axis.
    """
    axis = ctx.axis

    def look(state: str, shown: tuple[str, ...], *, job: str = "", number: int = 0) -> None:
        found = axis.diagnosis()
        text, data = found.text(), found.as_dict()
        words = {name: int(axis.var(name)) for name in ("StatusWord", "ErrorWord", "WarningWord")}
        for name, value in words.items():
            equal(ctx, f"{name} in {state}", found.words[name], value, "DIA-110")
        equal(ctx, f"state {found.state}", found.state == state and state in text, 1)
        for name in shown:
            equal(ctx, f"{name} is shown in {state}", f"[x] {name}" in text, 1, "DIA-001")
        equal(ctx, f"job {found.job}", (found.job or "").startswith(job) and bool(found.job) == bool(job), 1)
        equal(ctx, "number of the alarm", found.alarms[0]["number"] if found.alarms else 0, number)
        equal(ctx, "values with their units", " mm/s" in text and data["axis"] == axis.name, 1)
        equal(ctx, "STW1", found.telegram["STW1"], axis.object.stw1_sent)
        bits = {name: value for rows in found.pages.values() for name, value in rows.items()}
        unset = [name for name, value in bits.items() if value is False]
        listed = text.split("not set:")
        ctx.measure("indications that are not set", len(unset), low=5.0)
        equal(
            ctx, "they are listed", all(name in " ".join(" ".join(listed[1:]).split()) for name in unset), 1
        )

    look("DISABLED", ())
    _enabled(ctx)
    ctx.wait_until(axis.home(3.0).done, 1.0, "the axis is homed")
    ctx.run_for(0.02)
    look("STANDSTILL", ("enabled", "homed"))
    axis.move_velocity(50.0)
    ctx.run_for(0.3)
    look("MOTION", ("enabled", "constant velocity"), job="MC_MoveVelocity")
    ctx.inject("drive.fault", "drive1", code=0x2310)
    ctx.run_for(0.5)
    look("ALARM_DISABLED", ("error",), number=421)

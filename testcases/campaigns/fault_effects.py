"""What a fault of a node on CANopen does, to the letter: its heartbeat, SDO answers, EMCYs and starts, at
every kind of device; at drives their status word, torque and ramps.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from fieldbus.canopen import NmtCommand
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import DRIVE, Node
from testcases.campaigns.cia402_modes import DOWN, SPEED, drive, turning
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "fault effects",
    controller="",
    tags=("fault", "canopen"),
    bench="testcases.campaigns.device_objects:BENCH",
)
OF_SERVO: Final = Campaign(
    "fault effects at a servo",
    controller="",
    tags=("fault", "drive"),
    bench="testcases.campaigns._led_servo:BENCH",
)
BEAT_MS: Final = 10


def nodes(ctx: CaseContext) -> Iterator[tuple[str, Any, Node]]:
    """Yield name, device and node of every device of the bench that has faults of a node."""
    for name in (*ctx.bench.drive_names, *ctx.bench.encoder_names):
        own = name in ctx.bench.drive_names
        section: Any = ctx.bench.config.drive[name] if own else ctx.bench.config.encoder[name]
        device: Any = ctx.bench.drive(name) if own else ctx.bench.encoder(name)
        yield name, device, Node(ctx, section.node_id)


def beats(ctx: CaseContext, node: Node, seconds: float) -> list[float]:
    """Return when heartbeats come in a time, s."""
    node.frames.clear()
    ctx.run_for(seconds)
    return node.times(0x700 + node.node)


@CAMPAIGN.case("heartbeat", requirements=("C301-023",), without=("C301-023",))
def heartbeat(ctx: CaseContext) -> None:
    """It stops, comes late by so much, and is on time again."""
    ctx.run_for(0.08)
    for name, device, node in nodes(ctx):
        node.listen(0x700 + node.node)
        node.write(0x1017, BEAT_MS)
        node.write(0x1017, BEAT_MS)
        found = beats(ctx, node, 0.105)
        equal(ctx, f"{name}: heartbeats", len(found), 10, "C301-023", within=1)
        apart = np.diff(found)
        equal(ctx, f"{name}: period, s", float(np.mean(apart)), BEAT_MS / 1000, "C301-023", within=5e-4)
        device.stop_heartbeat(True)
        equal(ctx, f"{name}: stopped", len(beats(ctx, node, 0.05)), 0)
        device.stop_heartbeat(False)
        equal(ctx, f"{name}: on again", len(beats(ctx, node, 0.055)), 5, within=1)
        if not hasattr(device, "delay_heartbeat"):
            continue
        for delay_s in (0.013, 0.0):
            device.delay_heartbeat(delay_s)
            beats(ctx, node, 0.03)
            apart = np.diff(beats(ctx, node, 0.12))
            period = BEAT_MS / 1000 + delay_s
            equal(ctx, f"{name}: late, s", float(np.mean(apart)), period, "C301-023", within=5e-4)
        node.write(0x1017, 0)


@CAMPAIGN.case("sdo", requirements=("C301-057",))
def sdo(ctx: CaseContext) -> None:
    """Every access, or that to one object, is aborted with a code; no answer at all; then as before."""
    ctx.run_for(0.08)
    for name, device, node in nodes(ctx):
        if not hasattr(device, "abort_sdo"):
            continue
        kind, identity = node.upload(0x1000), node.upload(0x1018, 1)
        for code in (0x06010000, 0x08000022):
            device.abort_sdo(code)
            found = (node.upload(0x1000), node.upload(0x1018, 1), node.download(0x1017, 0, b"\0\0"))
            equal(ctx, f"{name}: {code:08X}h for all", found == (code,) * 3, 1, "C301-057")
            device.abort_sdo(code, 0x1018)
            equal(ctx, f"{name}: of one object", node.upload(0x1018, 1) == code, 1, "C301-057")
            equal(ctx, f"{name}: no other one", node.upload(0x1000) == kind, 1, "C301-057")
        device.abort_sdo(None)
        equal(ctx, f"{name}: served again", node.upload(0x1018, 1) == identity, 1)
        device.suppress_sdo_responses(True)
        node.listen(0x580 + node.node)
        node.frames.clear()
        node.send(0x600 + node.node, bytes.fromhex("4000100000000000"))
        ctx.run_for(0.05)
        equal(ctx, f"{name}: no answer", len(node.taken(0x580 + node.node)), 0)
        device.suppress_sdo_responses(False)
        node.send(0x600 + node.node, bytes.fromhex("4000100000000000"))
        ctx.run_for(0.05)
        equal(ctx, f"{name}: one answer", len(node.taken(0x580 + node.node)), 1)


@CAMPAIGN.case("emcy-and-start", requirements=("C301-022", "C301-108"))
def emcy_and_start(ctx: CaseContext) -> None:
    """EMCYs come in their period, and one that takes it back at the end; a node is silent as long as it
    boots.
    """
    ctx.run_for(0.08)
    for name, device, node in nodes(ctx):
        if hasattr(device, "repeat_emcy"):
            node.listen(0x80 + node.node)
            node.frames.clear()
            device.repeat_emcy(0x9000, 0.005)
            ctx.run_for(0.0505)
            times = node.times(0x80 + node.node)
            frames = node.taken(0x80 + node.node)
            equal(ctx, f"{name}: EMCYs in 50 ms", len(frames), 10, "C301-108", within=1)
            equal(ctx, f"{name}: apart, s", float(np.mean(np.diff(times))), 0.005, within=3e-4)
            equal(ctx, f"{name}: code", all(one[:2] == b"\x00\x90" for one in frames), 1, "C301-108")
            device.repeat_emcy(None)
            ctx.run_for(0.03)
            frames = node.taken(0x80 + node.node)
            equal(ctx, f"{name}: taken back, once", [one[:2] for one in frames] == [b"\0\0"], 1, "C301-108")
        if hasattr(device, "reset_node"):
            node.listen(0x700 + node.node)
            node.write(0x1017, 0)
            node.frames.clear()
            begun = ctx.now_s
            device.reset_node(0.15)
            ctx.run_for(0.14)
            equal(ctx, f"{name}: silent", len(node.frames), 0, "C301-022")
            ctx.run_for(0.05)
            times, frames = node.times(0x700 + node.node), node.taken(0x700 + node.node)
            equal(ctx, f"{name}: boot-up", bool(frames) and frames[0] == b"\0", 1, "C301-022")
            equal(ctx, f"{name}: after, s", (times or [0.0])[0] - begun, 0.15, "C301-022", within=0.02)
            ctx.run_for(0.05)


# -- a drive ----------------------------------------------------------------------------------------------


@OF_SERVO.case(
    "status-word",
    requirements=("C402-039",),
    without=("C402-026", "C402-039", "C402-042"),
)
def status_word(ctx: CaseContext) -> None:
    """Bits are set and cleared whatever the state says, or the word stands still; then it is as it was."""
    node = drive(ctx)
    device: Any = ctx.bench.drive(DRIVE)
    node.enable(3)
    before = node.read(0x6041, signed=False)
    device.override_statusword_bits(0x0088, 0x0004)
    ctx.run_for(0.002)
    node.equal("set and cleared", node.read(0x6041, signed=False), (before | 0x88) & ~0x04)
    device.override_statusword_bits(0, 0)
    ctx.run_for(0.002)
    node.equal("as it was", node.read(0x6041, signed=False), before)
    device.freeze_statusword(True)
    node.control(0x06)
    node.equal("frozen", node.read(0x6041, signed=False), before)
    device.freeze_statusword(False)
    ctx.run_for(0.002)
    node.bits(0x6F, 0x21, "C402-039")


@OF_SERVO.case("ramps-and-torque", requirements=("C402-011", "C402-072"))
def ramps_and_torque(ctx: CaseContext) -> None:
    """Ramps with a share of their slope, torque with a share of its limit; both are whole again."""
    device: Any = ctx.bench.drive(DRIVE)
    for share in (0.5, 0.25, 1.0):
        node = turning(ctx, 3)
        device.scale_ramps(share)
        node.write(0x60FF, 0)
        begun = ctx.now_s
        ctx.run_for(0.05)
        speeds = ctx.trace()[f"{DRIVE}.motor_speed"].between(begun + 0.006, ctx.now_s)
        found = -float(np.polyfit(speeds.time_s - begun, speeds.values, 1)[0])
        node.equal(f"share {share}: slope", found, share * DOWN, "C402-072", within=0.03 * share * DOWN)
        ctx.run_for(SPEED / DOWN / share)
        device.scale_ramps(1.0)
        node.control(0x06)
    for share in (0.1, 0.4, None):
        node = drive(ctx)
        node.enable(4)
        node.write(0x6087, 10_000_000)
        device.limit_torque(share)
        node.write(0x6071, 900)
        ctx.run_for(0.006)
        limit = 900 if share is None else min(900, share * 1000)
        node.equal(f"share {share}: torque", node.read(0x6077), limit, within=3)
        node.control(0x00)
        ctx.inject("mechanics.jam", DRIVE, duration_s=0.05)
        ctx.run_for(0.1)


@OF_SERVO.case("transitions", requirements=("C402-026", "C402-027"), without=("C402-043",))
def transitions(ctx: CaseContext) -> None:
    """Commands of some transitions are ignored until they count again; a drive that withdraws by itself."""
    node = drive(ctx)
    device: Any = ctx.bench.drive(DRIVE)
    for number, words, stays in ((2, (0x06,), 0x40), (3, (0x06, 0x07), 0x21), (4, (0x06, 0x07, 0x0F), 0x23)):
        device.refuse_transitions(number)
        for word in words:
            node.control(word)
        mask = 0x4F if stays == 0x40 else 0x6F
        node.bits(mask, stays, "C402-026")
        device.refuse_transitions()
        ctx.run_for(0.004)
        node.control(words[-1])
        node.bits(0x6F, {2: 0x21, 3: 0x23, 4: 0x27}[number], "C402-026")
        device.force_switch_on_disabled()
        ctx.run_for(0.004)
        node.bits(0x4F, 0x40, "C402-027")
        node.equal("no fault", node.read(0x603F, signed=False), 0)
        node.control(0x00)
    device.set_local_control(True)
    ctx.run_for(0.002)
    node.bits(0x200, 0)
    node.control(0x06)
    node.bits(0x4F, 0x40)
    device.set_local_control(False)
    ctx.run_for(0.002)
    node.bits(0x26F, 0x221)
    node.nmt(NmtCommand.START)

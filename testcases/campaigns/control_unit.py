"""The control unit of a PROFIdrive device: inputs, outputs and probes of telegrams 390 to 394, its status
word, its sign of life.
"""

from __future__ import annotations

from typing import Final

from emulators.drive.profidrive.control_unit import TELEGRAMS
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._control_unit_rig import ACKNOWLEDGE, CONTROL, PING, US, Rig
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "control unit", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)
PROBES: Final = {390: 0, 391: 2, 392: 6, 393: 8, 394: 0}


@CAMPAIGN.case("inputs", requirements=("PD-021", "PD-022", "PD-023", "PD-024", "PD-025"))
def inputs(ctx: CaseContext) -> None:
    """Each input and output has its bit in either word; without control by PLC outputs stay; a telegram of
    another length is none.
    """
    for number in TELEGRAMS:
        rig = Rig(number)
        second = "A_DIGITAL_1" in rig.layout.setpoint.names
        equal(ctx, f"probes of telegram {number}", rig.unit.probes, PROBES[number], "PD-094")
        for bit in (0, 3, 15, 16, 21):
            rig.unit.set_input(bit, True)
            answer = rig.cycle()
            equal(ctx, f"first word with input {bit}", answer["E_DIGITAL"], (1 << bit) & 0xFFFF, "PD-021")
            if "E_DIGITAL_1" in answer:
                equal(ctx, f"second word with input {bit}", answer["E_DIGITAL_1"], 1 << bit >> 16, "PD-024")
            rig.unit.set_input(bit, False)
        for word, other in ((0x8001, 0x0007), (0x0002, 0x0000)):
            rig.cycle(A_DIGITAL=word, **({"A_DIGITAL_1": other} if second else {}))
            equal(ctx, "outputs", rig.unit.outputs, word | (other << 16 if second else 0), "PD-021")
        rig.cycle(0, A_DIGITAL=0x0F0F)
        equal(ctx, "outputs without control by PLC", rig.unit.outputs, 0x0002, "PD-093")
        equal(ctx, "a telegram of three bytes is taken", rig.unit.receive(b"123"), 0)
        equal(ctx, "telegrams refused", rig.unit.refused, 1)
        rig.unit.analog_input = -1234
        answer = rig.cycle()
        equal(ctx, "analog input", answer.get("E_ANALOG", -1234), -1234, "PD-025")


@CAMPAIGN.case("probes", requirements=("PD-094", "PD-095"))
def probes(ctx: CaseContext) -> None:
    """An edge that is waited for has its time within the cycle in quarters of a microsecond, in one answer;
    the first of a cycle counts, and each edge has its bit.
    """
    for number, count in PROBES.items():
        for probe in range(1, count + 1):
            rig = Rig(number)
            falling, rising = 1 << (probe - 1), 1 << (probe + 7)
            rig.cycle(MT_STW=falling | rising)
            unit = rig.unit
            unit.cycle()
            for wait_us, level in ((1500, True), (500, False), (0, True)):
                rig.scheduler.run_for(wait_us * US)
                unit.probe_edge(probe, level)
            rig.scheduler.run_for(2000 * US)
            answer = rig.cycle(MT_STW=falling)
            equal(ctx, f"rising edge of probe {probe}", answer[f"MT{probe}_ZS_S"], 6000, "PD-094")
            equal(ctx, f"falling edge of probe {probe}", answer[f"MT{probe}_ZS_F"], 8000, "PD-094")
            equal(ctx, "bits of the edges", answer["MT_ZSW"] & 0xFF, falling, "PD-095")
            others = [
                answer[f"MT{one}_ZS_{edge}"] for one in range(1, count + 1) if one != probe for edge in "SF"
            ]
            equal(ctx, "times of the other probes", sum(others), 0, "PD-094")
            unit.probe_edge(probe, False)
            unit.probe_edge(probe, True)
            answer = rig.cycle(MT_STW=falling)
            equal(ctx, "an edge nobody waits for", answer[f"MT{probe}_ZS_S"], 0, "PD-095")
            equal(ctx, "one that is waited for", answer[f"MT{probe}_ZS_F"] > 0, 1, "PD-095")
            equal(ctx, "in the next answer", rig.cycle(MT_STW=falling)[f"MT{probe}_ZS_F"], 0, "PD-095")


@CAMPAIGN.case("status", requirements=("PD-093",))
def status(ctx: CaseContext) -> None:
    """Fault, warning and synchronised time have bits 3, 7 and 8; acknowledged by the edge of bit 7 alone; the
    sign of life counts from 1 to 15, and a controller that stops counting is a fault.
    """
    rig = Rig()
    equal(ctx, "CU_ZSW1", rig.cycle()["CU_ZSW1"] & 0x0FFF, 0)
    rig.unit.raise_fault(1000)
    rig.unit.warnings.add(2000)
    for word, wanted in (
        (CONTROL, 0x0088),
        (CONTROL | ACKNOWLEDGE, 0x0080),
        (CONTROL | ACKNOWLEDGE, 0x0080),
    ):
        equal(ctx, f"CU_ZSW1 with {word:04X}h", rig.cycle(word)["CU_ZSW1"] & 0x0FFF, wanted, "PD-093")
    rig.unit.raise_fault(1000)
    equal(ctx, "bit 7 that stands", rig.cycle(CONTROL | ACKNOWLEDGE)["CU_ZSW1"] & 0x0088, 0x0088, "PD-093")
    rig.unit.warnings.clear()
    rig.cycle()
    rig.cycle(CONTROL | ACKNOWLEDGE)
    equal(ctx, "without both", rig.cycle()["CU_ZSW1"] & 0x0088, 0, "PD-093")
    equal(ctx, "after a ping", rig.cycle(CONTROL | PING)["CU_ZSW1"] & 0x0FFF, 0x0100, "PD-093")
    rig = Rig()
    sign = rig.cycle(count=40)["CU_ZSW1"] >> 12
    for _ in range(32):
        following = rig.cycle()["CU_ZSW1"] >> 12
        equal(ctx, "sign of life", following, sign % 15 + 1, "PD-093")
        sign = following
    rig.counts = False
    equal(ctx, "one sign that stands", rig.cycle()["CU_ZSW1"] & 8, 0, "PD-093")
    equal(ctx, "fault when it stands", rig.cycle(count=2)["CU_ZSW1"] & 8, 8, "PD-093")
    equal(ctx, "number of the fault", rig.unit.faults.present[0].number, 1912, "PD-093")
    equal(ctx, "sign of life without a clock", Rig(isochronous=False).cycle(count=40)["CU_ZSW1"], 0)

"""Homing, limit switches and counts."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError, Source
from testcases.museum._seeds import known, made

_AREA: Final = "homing and limits"
_EXTERNAL: Final = "testcases.campaigns.external_encoder:REFERENCE"

ENTRIES: Final[tuple[FieldError, ...]] = (
    FieldError(
        name="homing-runs-through-the-switch",
        title="Homing meets the limit switch and goes on in the same direction",
        area=_AREA,
        sources=(
            Source("grbl/grbl, issue 530", "https://github.com/grbl/grbl/issues/530"),
            Source("grbl/grbl, issue 612", "https://github.com/grbl/grbl/issues/612"),
        ),
        happened=(
            "A milling machine stopped at its switch for the time of debouncing and then moved on, into the "
            "switch. Another one that stood on its switch at power-on could not be homed at all."
        ),
        on_the_bus="The direction of the setpoint does not change behind the edge of the switch.",
        found_by=(
            "Home from every side: from the middle, from behind the mark, and standing on the switch, at "
            "the speed of production."
        ),
        campaign="homing",
        case="homing/reversal/cam/positive/below",
        bench="reference",
        defect=known("no-reversal-at-limit"),
    ),
    FieldError(
        name="limit-switch-ends-homing",
        title="A limit switch on the way counts as the end of homing",
        area=_AREA,
        sources=(
            Source("epics-modules/motor, pull request 19", "https://github.com/epics-modules/motor/pull/19"),
        ),
        happened=(
            "A homing sequence may reverse at a limit switch. The motor record took the switch for the end "
            "of the motion and reported it as done before the home switch had been found."
        ),
        on_the_bus=(
            "*Done* and *homed* come at the edge of the limit switch; the position there becomes the home "
            "position."
        ),
        found_by=(
            "Start the homing between mark and limit switch, on the side where it has to reverse, and "
            "measure the place of the machine afterwards, not the position in the controller."
        ),
        campaign="homing",
        case="homing/reversal/cam/positive/below",
        bench="reference",
        defect=made(
            "limit-switch-ends-homing",
            "axis",
            "Active homing takes the limit switch at which it should reverse for its mark",
            (
                "motion.s7.axis.homing.active:ActiveHoming.step",
                "            self._turn()\n",
                "            self._arrive(self._axis.feedback.position)\n",
            ),
        ),
    ),
    FieldError(
        name="homed-without-homing",
        title="The axis reports that it is homed although it is not",
        area=_AREA,
        sources=(Source("terjeio/grblHAL, issue 41", "https://github.com/terjeio/grblHAL/issues/41"),),
        happened=(
            "The status report compared the axes that are to be homed with themselves in place of those "
            "that have been, and said *homed* from the start. Software limits and absolute moves rely on "
            "it."
        ),
        on_the_bus=(
            "The bit *homed* is set before the first mark has been passed, or stays set when homing is "
            "aborted."
        ),
        found_by="Abort a homing in each of its phases and read the status. It has to say *not homed*.",
        campaign="homing",
        case="homing/aborted/halt/approach",
        bench="reference",
        defect=known("homed-too-early"),
    ),
    FieldError(
        name="edge-of-the-wrong-side",
        title="The mark is taken at its other edge when it is passed the other way round",
        area=_AREA,
        sources=(
            Source(
                "Peter-van-Tol/LiteX-CNC, issue 75",
                "https://github.com/Peter-van-Tol/LiteX-CNC/issues/75",
            ),
        ),
        happened=(
            "The index of an encoder was taken at its rising edge whatever the direction. Home positions "
            "that were found in opposite directions differ by the width of the mark."
        ),
        on_the_bus="Nothing: positions look right. Only the machine stands elsewhere.",
        found_by=(
            "Home in both directions and compare the place of the load by an independent measurement, such "
            "as a dial gauge."
        ),
        campaign="homing",
        case="homing/input/positive/positive/below",
        bench="reference",
        defect=known("input-edge-swapped"),
    ),
    FieldError(
        name="limit-bars-the-way-back",
        title="Moving off a limit switch raises the limit alarm again",
        area=_AREA,
        sources=(
            Source("bdring/FluidNC, issue 514", "https://github.com/bdring/FluidNC/issues/514"),
            Source("gnea/grbl, issue 1222", "https://github.com/gnea/grbl/issues/1222"),
        ),
        happened=(
            "An acknowledged axis on its limit switch was to be moved back. The alarm came again, at once "
            "or when the switch was released, so that operators switch the limit off, and then it protects "
            "nothing."
        ),
        on_the_bus="The alarm of the switch returns while the velocity leads away from it.",
        found_by=(
            "Run into each switch, acknowledge, and move back. Then try to move on outwards: that must not "
            "work."
        ),
        campaign="fault_reactions",
        case="fault-reactions/limit-switch/constant",
        bench="reference",
        defect=known("limit-bars-the-way-back"),
    ),
    FieldError(
        name="counter-wraps-into-a-jump",
        title="The wrap-around of an encoder count is taken for a motion",
        area=_AREA,
        sources=(
            Source(
                "PR2/pr2_ethercat_drivers, issue 54",
                "https://github.com/PR2/pr2_ethercat_drivers/issues/54",
            ),
            Source(
                "Opentrons/ot3-firmware, pull request 700",
                "https://github.com/Opentrons/ot3-firmware/pull/700",
            ),
        ),
        happened=(
            "Counters of 16 or 32 bits run over in long operation, or when an axis goes far. Without, or "
            "with a late correction the position is off by the whole range of the counter for one sample or "
            "for good."
        ),
        on_the_bus="The position jumps by 2^16, 2^32 or the range of the encoder between two samples.",
        found_by=(
            "Place the counter just before the end of its range (a preset does it) and move over the end in "
            "both directions. Waiting for it takes months."
        ),
        campaign="external_encoder",
        case="external-encoder/overflow/drum",
        bench=_EXTERNAL,
        defect=known("encoder-overflow-jumps"),
    ),
    FieldError(
        name="wrong-place-after-power-on",
        title="After power-on an adjusted absolute encoder shows another place",
        area=_AREA,
        sources=(
            Source(
                "Lenze application knowledge base, 201010983 (ECS before V8.3)",
                "https://www.lenze.com/en-de/go/akb/201010983/1",
            ),
        ),
        happened=(
            "When the home position of an axis had been set twice in one session, the drive took a wrong "
            "position over at the next power-on. Every absolute target was displaced by that, up to the "
            "limit switches."
        ),
        on_the_bus="Position before power-off and after power-on differ, with the axis at the same place.",
        found_by=(
            "Set the home position several times, note the position, switch off and on, and compare. "
            "Commissioning is where it happens, production is where it hurts."
        ),
        campaign="external_encoder",
        case="external-encoder/restart/drum",
        bench=_EXTERNAL,
        defect=known("encoder-offset-not-kept"),
    ),
)

"""PROFIdrive on the wire by itself: telegrams, normalised values, both signs of life, requests for parameters
and their answers, byte by byte.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from functools import partial
from typing import Final

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import free_telegram, telegram
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.formats import from_n2, from_n4, to_int32, to_kpc, to_n2, to_n4, torque_factor
from fieldbus.profidrive.requests import (
    Address,
    Answer,
    Refusal,
    Request,
    Values,
    decode_answer,
    decode_request,
    pack_values,
    size_of,
    unpack_values,
)
from fieldbus.profidrive.sign_of_life import SignOfLife, SignState, SignWatch, next_sign
from fieldbus.profidrive.telegrams import Layout, TelegramError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal, raises, same

CAMPAIGN: Final = Campaign(
    "profidrive facts", controller="", tags=("telegram",), bench="testcases.campaigns.can_bus:BENCH"
)


# -- values and telegrams ----------------------------------------------------------------------------------


@CAMPAIGN.case("values", requirements=("PD-034", "PD-037", "PD-042"))
def values(ctx: CaseContext) -> None:
    """N2 and N4 round to the nearest, to either side, and are held at their ends; MOMRED and KPC."""
    for share, n2, n4 in (
        (0.0, 0, 0),
        (1.0, 0x4000, 0x4000_0000),
        (-1.0, -0x4000, -0x4000_0000),
        (0.25, 0x1000, 0x1000_0000),
        (1.999, 32_752, 2_146_409_906),
        (2.0, 0x7FFF, 0x7FFF_FFFF),
        (7.0, 0x7FFF, 0x7FFF_FFFF),
        (-2.0, -0x8000, -0x8000_0000),
        (-9.0, -0x8000, -0x8000_0000),
        (math.inf, 0x7FFF, 0x7FFF_FFFF),
        (-math.inf, -0x8000, -0x8000_0000),
        (math.nan, 0, 0),
        (2.5 / 0x4000, 3, 163_840),
        (-2.5 / 0x4000, -3, -163_840),
        (2.49 / 0x4000, 2, 163_185),
    ):
        same(ctx, f"N2 of {share}", to_n2(share), n2, "PD-034")
        same(ctx, f"N4 of {share}", to_n4(share), n4, "PD-034")
    for raw, share in ((0x4000, 1.0), (-0x8000, -2.0), (0x2000, 0.5)):
        same(ctx, f"{raw} as N2", from_n2(raw), share, "PD-034")
        same(ctx, f"{raw} as N4", from_n4(raw << 16), share, "PD-034")
    for value, wanted in (
        (1.5, 2),
        (-1.5, -2),
        (1e12, 2**31 - 1),
        (-1e12, -(2**31)),
        (math.nan, 0),
        (0.4, 0),
    ):
        same(ctx, f"{value} in 32 bits", to_int32(value), wanted)
    for word, percent, left in (
        (0, 100.0, 1.0),
        (0x4000, 100.0, 0.0),
        (0x2000, 100.0, 0.5),
        (0x4000, 40.0, 0.6),
        (0x7FFF, 100.0, 0.0),
        (-0x4000, 100.0, 1.0),
    ):
        equal(
            ctx, f"MOMRED {word} of {percent} %", torque_factor(word, percent), left, "PD-037", within=1e-12
        )
    for gain, raw in (
        (10.0, 10_000),
        (0.0004, 0),
        (0.0006, 1),
        (-5.0, 0),
        (4000.0, 4_000_000),
        (9e9, 4_000_000),
    ):
        same(ctx, f"KPC of {gain}", to_kpc(gain), raw, "PD-042")
    same(ctx, "KPC of no number", to_kpc(math.nan), 0)


@CAMPAIGN.case("layouts", requirements=("PD-029", "PD-030"))
def layouts(ctx: CaseContext) -> None:
    """Signals stand in their order, high byte first; names, ranges and lengths have to fit."""
    layout = Layout(("STW1", "NSOLL_B", "STW2", "FREE", "XERR"))
    frame = layout.encode({"STW1": 0x047F, "NSOLL_B": -2, "STW2": -1, "XERR": 0x0102_0304})
    same(ctx, "frame", frame.hex(), "047f" + "fffffffe" + "ffff" + "0000" + "01020304", "PD-029")
    same(ctx, "length", (layout.length, layout.words), (14, 7))
    wanted = {"STW1": 0x047F, "NSOLL_B": -2, "STW2": 0xFFFF, "XERR": 0x0102_0304}
    same(ctx, "decoded", layout.decode(frame), wanted, "PD-029")
    same(ctx, "unpacked", layout.unpack(layout.pack(1, 2, 3, 4, 5)), (1, 2, 3, 4, 5))
    same(ctx, "offsets", [layout.offset(name) for name in layout.names], [0, 2, 6, 8, 10])
    same(ctx, "places", layout.places(low_word_first=False), (0, 1, 2, 3, 4, 5, 6))
    same(ctx, "low word first", layout.places(low_word_first=True), (0, 2, 1, 3, 4, 6, 5))
    same(ctx, "what is not given is 0", layout.encode({}), bytes(14))
    both = layout + Layout(("M_ADD1",))
    same(ctx, "behind each other", both.names, (*layout.names, "M_ADD1"))
    for wrong in (
        {"STW1": 0x1_0000},
        {"STW1": -0x8001},
        {"NSOLL_B": 1 << 31},
        {"NSOLL_B": -(1 << 31) - 1},
        {"NSOLL_A": 0},
        {"FREE": 1},
    ):
        equal(ctx, f"{wrong} is refused", bool(raises(partial(layout.encode, wrong), TelegramError)), 1)
    for fits in ({"STW1": 0xFFFF}, {"STW1": -0x8000}, {"NSOLL_B": -(1 << 31)}, {"NSOLL_B": (1 << 31) - 1}):
        equal(ctx, f"{fits} fits", not raises(partial(layout.encode, fits), TelegramError), 1)
    for data in (frame[:-1], frame + b"\0"):
        equal(ctx, "another length", bool(raises(partial(layout.decode, data), TelegramError)), 1, "PD-030")
        equal(ctx, "in words", f"{len(data)} bytes in place of 14" in layout.describe(data), 1)
    equal(ctx, "no such signal", bool(raises(partial(layout.offset, "NSOLL_A"), TelegramError)), 1)
    for names in (("STW1", "STW1"), ("NOTHING",)):
        equal(ctx, f"{names} is refused", bool(raises(partial(Layout, names), TelegramError)), 1)
    text = layout.describe(layout.encode({"STW1": 1, "NSOLL_B": 0x2000_0000, "XERR": 7}))
    equal(ctx, f"in words: {text}", "NSOLL_B 50.0000 %" in text and "XERR 7" in text, 1)
    text = Layout(("NSOLL_A",)).describe(b"\x10\x00")
    same(ctx, "N2 in words", text, "NSOLL_A 25.00 %")


@CAMPAIGN.case("telegrams", requirements=("PD-029", "CFG-214", "CFG-243"))
def telegrams(ctx: CaseContext) -> None:
    """Words, encoders, sign of life and supplements of each telegram."""
    for number, words, encoders, dsc, sign in (
        (1, (2, 2), 0, False, False),
        (2, (4, 4), 0, False, True),
        (3, (5, 9), 1, False, True),
        (4, (6, 14), 2, False, True),
        (5, (9, 9), 1, True, True),
        (6, (10, 14), 2, True, True),
        (20, (2, 6), 0, False, False),
        (102, (6, 10), 1, False, True),
        (103, (7, 15), 2, False, True),
        (105, (10, 10), 1, True, True),
        (106, (11, 15), 2, True, True),
    ):
        one = telegram(number)
        same(ctx, f"{number}: words", (one.setpoint.words, one.actual.words), words, "PD-029")
        same(ctx, f"{number}: encoders", one.encoders, encoders)
        same(ctx, f"{number}: DSC and sign of life", (one.dsc, one.isochronous), (dsc, sign), "CFG-243")
    with_torque = telegram(105).with_supplement()
    same(ctx, "with 750", (with_torque.setpoint.words, with_torque.actual.words), (13, 11), "CFG-214")
    for number, supplement in ((111, 750), (7, 750), (105, 3)):
        said = raises(partial(telegram(number).with_supplement, supplement), TelegramError)
        equal(ctx, f"{number} with {supplement}: {said}", "does not supplement" in said, 1, "CFG-214")
    free = free_telegram(("STW1", "NSOLL_A"), ("ZSW1", "NIST_A"))
    same(ctx, "free", (free.setpoint.names, free.actual.names), (("STW1", "NSOLL_A"), ("ZSW1", "NIST_A")))
    for setpoint, actual in ((("NSOLL_A",), ("ZSW1",)), (("STW1",), ("NIST_A",)), ((), ("ZSW1",))):
        said = raises(partial(free_telegram, setpoint, actual), TelegramError)
        equal(ctx, f"{setpoint}, {actual} is refused", bool(said), 1, "PD-029")


# -- signs of life -----------------------------------------------------------------------------------------


class _Model:
    """The drive's side as PD-125 to PD-129 tell it."""

    def __init__(self, tolerance: int, factor: int) -> None:
        self.tolerance, self.factor = tolerance, factor
        self.idle()

    def idle(self) -> None:
        self.phase, self.own, self.counter, self.good, self.left = "idle", 0, 0, 0, 0
        self.last = 0

    def step(self, sign: int) -> bool:
        if self.phase == "idle":
            if sign and self.last and sign == self.last % 15 + 1:
                self.phase, self.left, self.good = "counting", self.factor, 0
            self.last = sign
            return False
        self.left -= 1
        changed = self.left == 0
        if changed:
            self.left = self.factor
            self.last = self.last % 15 + 1
        right = sign == self.last
        if self.phase == "running":
            self.own = self.own % 15 + 1
            if right:
                self.counter = max(0, self.counter - 1)
                return False
            if self.tolerance == 65_535:
                return False
            self.counter += 10
            if self.counter > 10 * self.tolerance:
                self.idle()
                return True
            return False
        if not right:
            self.idle()
            self.last = sign
            return False
        self.good += changed
        if self.phase == "answering":
            self.own = self.own % 15 + 1
        if self.good == 16:
            self.good = 0
            self.phase = "answering" if self.phase == "counting" else "running"
        return False


@CAMPAIGN.product(
    "sign-of-life/{tolerance}-{factor}",
    parameters=[
        {"tolerance": tolerance, "factor": factor}
        for tolerance, factor in ((0, 1), (1, 1), (1, 3), (5, 1), (65_535, 2))
    ],
    title="sign of life of a drive, PNU 925 = {tolerance}, {factor} bus cycles",
    requirements=("PD-123", "PD-124", "PD-125", "PD-126", "PD-127", "PD-128"),
)
def sign_of_life(ctx: CaseContext, tolerance: int, factor: int) -> None:
    """Sixteen right values, sixteen answers, failures that add up and are forgiven, and everything anew."""
    draw = random.Random(tolerance * 7 + factor)
    sign, drive, model = 0, SignOfLife(tolerance=tolerance, factor=factor), _Model(tolerance, factor)
    wrong: list[str] = []
    failed = synchronised = 0
    for cycle in range(6000):
        if cycle % factor == 0:
            sign = sign % 15 + 1
        # Long stretches without a mistake, some with many, and stretches of silence.
        rate = (0.0, 0.0, 0.05, 0.12)[cycle // 150 % 4]
        given = draw.choice((0, 3, sign % 15 + 1)) if draw.random() < rate else sign
        due = model.step(given)
        found = drive.step(given)
        failed += found
        synchronised += model.phase == "running"
        running = drive.state is SignState.SYNCHRONISED
        if (found, drive.value, drive.counter, running) != (
            due,
            model.own,
            model.counter,
            model.phase == "running",
        ):
            wrong.append(f"cycle {cycle}: {found}, {drive.value}, {drive.counter}, {drive.state}")
    equal(ctx, f"cycles that differ: {wrong[:2]}", len(wrong), 0, "PD-125", "PD-127")
    equal(ctx, "it was synchronised", synchronised > 500, 1, "PD-125")
    equal(ctx, "it has failed", failed > 0, tolerance < 5 or failed > 0, "PD-128")
    equal(ctx, "not monitored", drive.synchronised if tolerance == 65_535 else 1, 1, "PD-128")
    drive.reset()
    same(ctx, "reset", (drive.value, drive.counter, drive.state), (0, 0, SignState.IDLE))


@CAMPAIGN.case("sign-watch", requirements=("PD-123", "PD-132"))
def sign_watch(ctx: CaseContext) -> None:
    """The controller tolerates so many wrong values in a row, and no more; 0 at first is none."""
    same(ctx, "next", [next_sign(one) for one in (0, 1, 14, 15)], [1, 2, 15, 1], "PD-123")
    for tolerance in (0, 3):
        watch = SignWatch(tolerance=tolerance)
        found = [watch.step(one) for one in (0, 0, 7, 8, 9)]
        same(ctx, "begins anywhere", found, [True] * 5, "PD-132")
        found = [watch.step(9) for _ in range(5)]
        same(ctx, f"stands still, {tolerance}", found, [one < tolerance for one in range(5)], "PD-132")
        same(ctx, "goes on", watch.step(10), True, "PD-132")
        same(ctx, "falls to 0", watch.step(0), tolerance > 0, "PD-132")
        watch.reset()
        same(ctx, "reset", watch.step(3), True)
    for name, kind in (
        ("tolerance", {"tolerance": -1}),
        ("tolerance", {"tolerance": 65_536}),
        ("application", {"factor": 0}),
    ):
        said = raises(lambda k=kind: SignOfLife(**k), ConfigurationError)
        equal(ctx, f"{kind} is refused", name in said, 1)


# -- parameters ----------------------------------------------------------------------------------------------

REQUESTS: Final = (
    (Request(1, 1, 2, (Address(1120),)), "01 01 02 01 1000 0460 0000"),
    (Request(255, 1, 1, (Address(944), Address(947, 8, 2))), "FF 01 01 02 1000 03B0 0000 1002 03B3 0008"),
    (Request(7, 2, 1, (Address(1121),), (Values(0x08, (2.5,)),)), "07 02 01 01 1000 0461 0000 0801 40200000"),
    (
        Request(7, 2, 1, (Address(5, 1, 3),), (Values(0x41, (1, 2, 3)),)),
        "07 02 01 01 1003 0005 0001 4103 01020300",
    ),
    (Request(9, 1, 1, (Address(5, 0, 0, 0x20),)), "09 01 01 01 2000 0005 0000"),
)
ANSWERS: Final = (
    (Answer(1, 1, 2, (Values(0x43, (0x01020304,)),)), "01 01 02 01 4301 01020304"),
    (Answer(1, 1, 2, (Values(0x02, (-1,)),)), "01 01 02 01 0201 FF00"),
    (Answer(7, 2, 1, (None, None)), "07 02 01 02"),
    (Answer(7, 2, 1, (None, Refusal(2, 5))), "07 82 01 02 4000 4402 0002 0005"),
    (Answer(7, 1, 1, (Refusal(0),)), "07 81 01 01 4401 0000"),
    (Answer(7, 1, 1, (Values(0x42, (1, 2)), Refusal(4))), "07 81 01 02 4202 0001 0002 4401 0004"),
)
"""Requests and answers with their bytes."""


def _refused(decode: Callable[[bytes], object], data: bytes) -> str:
    """Return why bytes are refused; empty: they are not."""
    return raises(partial(decode, data), ParameterAccessError)


def _bytes(text: str) -> bytes:
    return bytes.fromhex(text.replace(" ", ""))


@CAMPAIGN.case("requests", requirements=("PD-199", "PD-200", "PD-201", "PD-202", "PD-203", "PD-205"))
def requests(ctx: CaseContext) -> None:
    """Requests and answers byte by byte there and back; what is cut off, too long, or of no format is
    refused.
    """
    for request, text in REQUESTS:
        data = _bytes(text)
        same(ctx, f"request {text}", request.encode().hex(), data.hex(), "PD-199")
        same(ctx, f"{text} read", decode_request(data), request, "PD-200")
        for size in range(len(data)):
            if size >= 4 and data[3] and size < len(data):
                said = _refused(decode_request, data[:size])
                equal(ctx, f"{size} bytes of {text} are refused", bool(said), 1, "PD-207")
        equal(
            ctx, "more bytes", bool(raises(partial(decode_request, data + b"\0\0"), ParameterAccessError)), 1
        )
    for answer, text in ANSWERS:
        data = _bytes(text)
        same(ctx, f"answer {text}", answer.encode().hex(), data.hex(), "PD-202")
        same(ctx, f"{text} read", decode_answer(data), answer, "PD-203")
        equal(
            ctx, "more bytes", bool(raises(partial(decode_answer, data + b"\0\0"), ParameterAccessError)), 1
        )
        for size in (*range(4), *range(5, len(data))):
            said = _refused(decode_answer, data[:size])
            equal(ctx, f"{size} bytes of {text} are refused", bool(said), 1, "PD-203")
    for wrong in (
        Request(256, 1, 1, (Address(1),)),
        Request(1, 1, 1, (Address(65_536),)),
        Request(1, 1, 1, (Address(1, elements=256),)),
        Request(1, 2, 1, (Address(1),), (Values(0x42, (70_000,)),)),
        Request(1, 2, 1, (Address(1),), (Values(0x99, (1,)),)),
        Request(1, 2, 1, (Address(1),), (Values(0x41, (1,) * 235),)),
        Request(1, 1, 1, (Address(1),) * 40),
    ):
        equal(ctx, f"{wrong} cannot be sent", bool(raises(wrong.encode, ParameterAccessError)), 1, "PD-199")
    equal(ctx, "39 addresses can", not raises(Request(1, 1, 1, (Address(1),) * 39).encode), 1, "PD-199")
    equal(
        ctx,
        "234 values can",
        not raises(Request(1, 2, 1, (Address(1),), (Values(0x41, (1,) * 200),)).encode),
        1,
    )
    for data in ("07 81 01 01 4400", "07 01 01 01 9901 0000", "07 01 01 01 43"):
        equal(
            ctx,
            f"{data} is refused",
            bool(raises(partial(decode_answer, _bytes(data)), ParameterAccessError)),
            1,
        )
    same(ctx, "text", Refusal(3, 7).text, "03h wrong sub-index at sub-index 7")
    same(ctx, "text of an unknown one", Refusal(0x99).text, "99h unknown error")
    for code, size in (
        (1, 1),
        (3, 2),
        (4, 4),
        (8, 4),
        (15, 8),
        (55, 8),
        (113, 2),
        (122, 4),
        (0x41, 1),
        (0x43, 4),
    ):
        same(ctx, f"size of format {code:02X}h", size_of(code), size, "PD-204")
    for code in (0, 0x40, 0x44, 0x99):
        same(ctx, f"format {code:02X}h has no size", size_of(code), None, "PD-204")
    same(ctx, "high byte first", pack_values(0x03, (-2, 1)).hex(), "fffe0001", "PD-204")
    same(ctx, "back", unpack_values(0x03, b"\xff\xfe\x00\x01"), (-2, 1), "PD-204")
    equal(ctx, "half a value", bool(raises(partial(unpack_values, 0x03, b"\1"), ParameterAccessError)), 1)

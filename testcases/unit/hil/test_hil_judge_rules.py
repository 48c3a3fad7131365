"""Rules for bus logs: acknowledging, switching off without ramp and sign of life, of logs of sound drives and
of logs with one word changed.
"""

from __future__ import annotations

import pytest

from fieldbus.can.export import write_log
from fieldbus.can.frame import CanFrame
from fieldbus.cia402 import DriveState
from hil.bench import load_bench
from hil.expect.checkers import run_checkers
from hil.logs import read_bus_log, trace_of_log
from hil.logs._facts import facts_of
from reports.model import Verdict

pytestmark = pytest.mark.exhaustive

CONTROLWORD, STATUSWORD = 0x604000, 0x604100
STW1, STW2, ZSW2 = 0x580000, 0x580300, 0x581300
ACKNOWLEDGE = 0x0080
MOVING_S = (0.2, 0.3)
"""Both drives are in motion then."""


class Recorded:
    """The log of a bench in which the drive moves, trips, is acknowledged and is switched on again."""

    def __init__(self, name, code, folder):
        self.name, self.folder = name, folder
        with load_bench(name).build(seed=0) as bench:
            axis = bench.axis()
            power = axis.power()
            bench.run_until(power.status, 2.0)
            axis.move_velocity(50.0)
            bench.run_for(0.3)
            bench.drive().raise_fault(code)
            bench.run_for(0.3)
            axis.reset()
            bench.run_for(0.5)
            self.frames = list(bench.trace().raw_frames("can0"))

    def judged(self, frames):
        """Verdicts of the rules by name."""
        path = write_log(frames, self.folder / "bus.log")
        trace = trace_of_log(read_bus_log(path), load_bench(self.name)).trace
        return {check.name: check.verdict for check in run_checkers(trace)}

    def changed(self, key, change):
        """The frames, with the word of an object changed; `change` gets time (s) and word."""
        decoder = facts_of(load_bench(self.name)).decoder("can0")
        result = []
        for time_ns, sender, frame, error in self.frames:
            found, new = decoder.mapped(frame), frame
            if found is None:
                decoder.observe(frame)
            elif key in [one for one, _ in found[1]]:
                word, offset = int.from_bytes(frame.data, "little"), 0
                for one, _ in found[1]:
                    if one == key:
                        break
                    offset += {0x606000: 8, 0x606100: 8}.get(one, 16 if one < 0x600000 else 32)
                    offset -= 16 if one in (CONTROLWORD, STATUSWORD) else 0
                old = word >> offset & 0xFFFF
                word ^= (old ^ change(time_ns * 1e-9, old)) << offset
                new = CanFrame(frame.can_id, word.to_bytes(len(frame.data), "little"))
            result.append((time_ns, sender, new, error))
        return result


@pytest.fixture(scope="module")
def profidrive(tmp_path_factory):
    return Recorded("profidrive", 30001, tmp_path_factory.mktemp("profidrive"))


@pytest.fixture(scope="module")
def cia402(tmp_path_factory):
    return Recorded("reference", 0x2310, tmp_path_factory.mktemp("cia402"))


def between(time_s):
    return MOVING_S[0] < time_s < MOVING_S[1]


RULES = {
    "profidrive": {
        "acknowledging of drive1": (STW1, lambda _time_s, word: word & ~ACKNOWLEDGE),
        "OFF2 of drive1": (STW1, lambda time_s, word: word & ~0x0002 if between(time_s) else word),
        "sign of life of drive1": (
            ZSW2,
            lambda time_s, word: word & 0xFFF | (word >> 12) % 13 + 3 << 12 if between(time_s) else word,
        ),
        "sign of life of drive1 in the telegram to it": (
            STW2,
            lambda time_s, word: word & 0xFFF | (word >> 12) % 13 + 3 << 12 if between(time_s) else word,
        ),
    },
    "cia402": {
        "acknowledging of drive1": (CONTROLWORD, lambda _time_s, word: word & ~ACKNOWLEDGE),
        "disable voltage of drive1": (
            CONTROLWORD,
            lambda time_s, word: word & ~0x0002 if between(time_s) else word,
        ),
    },
}


@pytest.mark.parametrize("profile", RULES)
def test_a_sound_log_passes_and_one_changed_word_does_not(profile, request):
    """Every rule passes on the log of a sound drive, also where frames are missing once the mapping is
    known, and fails when its word says otherwise.
    """
    recorded = request.getfixturevalue(profile)
    rules = RULES[profile]
    with_gaps = [one for n, one in enumerate(recorded.frames) if n % 7 or one[0] < 200_000_000]
    for frames in (recorded.frames, with_gaps):
        found = recorded.judged(frames)
        assert {name: found.get(name) for name in rules} == dict.fromkeys(rules, Verdict.PASSED)
    for name, (key, change) in rules.items():
        found = recorded.judged(recorded.changed(key, change))
        assert found[name] is Verdict.FAILED, name
        others = {other: found[other] for other in rules if other != name}
        assert others == dict.fromkeys(others, Verdict.PASSED), name


def test_a_fault_that_ends_with_a_restart_needs_no_edge(cia402):
    """A boot-up of the node between is a reason of its own, and so is a control word that came by SDO."""
    without = cia402.changed(CONTROLWORD, lambda _time_s, word: word & ~ACKNOWLEDGE)
    status = cia402.changed(STATUSWORD, lambda _time_s, word: word)
    assert [one[2] for one in status] == [one[2] for one in cia402.frames]
    fault_ns = next(
        time_ns for time_ns, _, frame, _ in without if frame.can_id == 0x085 and frame.data[:2] != b"\0\0"
    )
    assert DriveState.FAULT.text == "Fault"
    for extra in (
        CanFrame(0x705, b"\0"),
        CanFrame(0x605, bytes.fromhex("2b40600080000000")),
    ):
        at = next(n for n, one in enumerate(without) if one[0] > fault_ns + 100_000_000)
        frames = [*without[:at], (without[at][0], "", extra, ""), *without[at:]]
        assert cia402.judged(frames)["acknowledging of drive1"] is Verdict.PASSED

"""Option codes, from the table of the profile: values, and what every mode makes of every stop, by true
motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import pytest

from fieldbus.canopen import NmtCommand, SdoAbort
from fieldbus.cia402 import DriveState as S
from testcases.catalogue import each, requirements_in
from testcases.unit.emulators.conftest import DriveBench
from testcases.unit.emulators.moving import MODES, QUICK, RPM, SLOW, TORQUE_NM, MovingDrive

# Identifier, object, value, what is done.
TABLE = """
C402-049 | 6007 | 0 | nothing
C402-050 | 6007 | 1 | fault
C402-051 | 6007 | 2 | disable voltage
C402-052 | 6007 | 3 | quick stop
C402-053 | 605A | 0 | coast
C402-054 | 605A | 1 | slow down
C402-055 | 605A | 2 | quick stop ramp
C402-056 | 605A | 3 | limit
C402-057 | 605A | 4 | limit
C402-058 | 605A | 5 | slow down, stay
C402-058 | 605A | 6 | quick stop ramp, stay
C402-058 | 605A | 7 | limit, stay
C402-058 | 605A | 8 | limit, stay
C402-059 | 605B | 0 | coast
C402-060 | 605B | 1 | slow down
C402-061 | 605C | 0 | coast
C402-062 | 605C | 1 | slow down
C402-063 | 605D | 1 | slow down, stay
C402-064 | 605D | 2 | quick stop ramp, stay
C402-065 | 605D | 3 | limit, stay
C402-066 | 605D | 4 | limit, stay
C402-067 | 605E | 0 | coast
C402-068 | 605E | 1 | slow down
C402-069 | 605E | 2 | quick stop ramp
C402-070 | 605E | 3 | limit
C402-071 | 605E | 4 | limit
"""
STOPS = {
    0x605A: "quick stop",
    0x605B: "shutdown",
    0x605C: "disable operation",
    0x605D: "halt",
    0x605E: "fault",
}
ENDS = {
    0x605A: S.SWITCH_ON_DISABLED,
    0x605B: S.READY_TO_SWITCH_ON,
    0x605C: S.SWITCHED_ON,
    0x605D: S.OPERATION_ENABLED,
    0x605E: S.FAULT,
}


@dataclass(frozen=True)
class Row:
    requirement: str
    index: int
    value: int
    action: str

    @property
    def stays(self) -> bool:
        return self.action.endswith("stay")


def rows() -> list[Row]:
    parsed = []
    for line in TABLE.strip().splitlines():
        requirement, index, value, action = (part.strip() for part in line.split("|"))
        parsed.append(Row(requirement, int(index, 16), int(value), action))
    return parsed


def cases():
    """Return every stop of the table in every mode that can move by itself."""
    return [
        pytest.param(
            row,
            mode,
            id=f"{row.index:04X}h={row.value}-{MODES[mode]}",
            marks=pytest.mark.requirement(row.requirement, "C402-074"),
        )
        for row, mode in product(rows(), (1, 2, 3, 4, 7, 8, 9, 10))
        if row.index in STOPS
    ]


@pytest.mark.requirement("C402-072", "C402-073", *(f"C402-{n:03}" for n in range(49, 72)))
def test_values():
    """The values of the table are accepted; reserved ones, negative ones and 605Dh = 0 are 06090030h."""
    bench = DriveBench(MovingDrive().drive.config)
    allowed = {}
    for row in rows():
        allowed.setdefault(row.index, set()).add(row.value)
    assert set(allowed) == {0x6007, *STOPS}
    for index, values in allowed.items():
        for value in (*range(-3, 12), -0x8000, 0x7FFF):
            before = bench.read(index)
            if value in values:
                bench.write(index, value)
                assert bench.read(index) == value
                continue
            with pytest.raises(SdoAbort) as refusal:
                bench.write(index, value)
            assert refusal.value.code == 0x06090030, (index, value)
            assert bench.read(index) == before


def slope(bench: MovingDrive, mode: int, action: str) -> float:
    """Return the deceleration that belongs to an action, rpm/s."""
    if action == "coast":
        return 0.0
    if action.startswith("limit"):
        return TORQUE_NM / bench.inertia / math.tau * 60.0
    if mode == 4:
        return 0.0  # no torque at constant speed: 6087h has nothing to take away
    return SLOW if action.startswith("slow") else QUICK


STOPS_CASES = list(cases())


def check_stops(row, mode):
    bench = MovingDrive(**{f"_{row.index:04X}": row.value})
    bench.set_moving(mode)
    speed = bench.rpm
    word = bench.following_word(mode) | (0x10 if mode == 1 else 0)
    stop = STOPS[row.index]
    if stop == "fault":
        bench.drive.raise_fault(0x8600)
    else:
        bench.control(
            {"quick stop": 2, "shutdown": 6, "disable operation": 7, "halt": word | 0x100}[stop], 0.0
        )
    expected = slope(bench, mode, row.action)
    bench.run(0.005)
    if expected and stop != "quick stop":
        assert not bench.status & 0x400 or mode in (2, 8, 9, 10)
    early = bench.rpm
    bench.run(0.02)
    assert (early - bench.rpm) / 0.02 == pytest.approx(expected, rel=0.03, abs=60)
    assert speed - early == pytest.approx(expected * 0.005, abs=25)
    bench.run(RPM / expected + 0.05 if expected else 0.01)
    if expected:
        assert bench.rpm == pytest.approx(0.0, abs=5)  # below the standstill speed the torque goes
    else:
        assert bench.rpm == pytest.approx(RPM, abs=15)
        assert bench.drive.core.torque == 0.0
    assert bench.state is (S.QUICK_STOP_ACTIVE if row.stays and stop == "quick stop" else ENDS[row.index])
    assert bench.drive.core.enabled == row.stays
    if row.stays:
        # Bit 10 shows the standstill in the modes that have it (C402-044, C402-076).
        assert bool(bench.status & 0x400) == (mode not in (2, 8, 9, 10) and bool(expected))


@pytest.mark.exhaustive
@requirements_in(STOPS_CASES)
def test_stops(subtests):
    """The axis brakes as the option says, with the ramps of its mode, and the state at the end is that of the
    command.
    """
    for label, values in each(STOPS_CASES):
        with subtests.test(label):
            check_stops(*values)


def check_release_of_a_halt(option, mode):
    bench = MovingDrive(_605D=option)
    bench.set_moving(mode)
    word = bench.following_word(mode) | (0x10 if mode == 1 else 0)
    bench.control(word | 0x100, 0.4)
    if mode == 4 and option <= 2:
        return  # the axis coasts: there is nothing to go on from
    assert bench.rpm == pytest.approx(0.0, abs=1)
    if mode in (7, 8):
        bench.streaming = False
        bench.stream_position = bench.read(0x6062)
        bench.write(0x607A, bench.read(0x6062))
    if mode in (4, 10):
        bench.write(0x6071, 50)
    bench.control(word, 0.05)
    if mode in (7, 8):
        assert bench.rpm == pytest.approx(0.0, abs=1)
        bench.stream_step = 200.0
        bench.streaming = True
        bench.run(0.1)
        assert bench.rpm == pytest.approx(200 / 131072 * 60_000, rel=0.02)
        return
    bench.run(0.3)
    if mode in (4, 10):
        assert bench.rpm > 100
        assert bench.read(0x6077) == 50
    else:
        assert bench.rpm == pytest.approx(RPM, abs=2)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-076")
def test_release_of_a_halt(subtests):
    """Pp goes on to its setpoint, velocity modes to their target, tq and cst to their torque, ip and csp to
    what comes.
    """
    for label, values in each([1, 2, 3, 4], [1, 2, 3, 4, 7, 8, 9, 10]):
        with subtests.test(label):
            check_release_of_a_halt(*values)


LOST_CONNECTION_STATE = [
    S.SWITCH_ON_DISABLED,
    S.READY_TO_SWITCH_ON,
    S.SWITCHED_ON,
    S.OPERATION_ENABLED,
    S.QUICK_STOP_ACTIVE,
]


def check_lost_connection(option, state, cause):
    bench = MovingDrive(_6007=option, _605A=6)
    if cause == "heartbeat":
        bench.write(0x1016, 5 << 16 | 20, 1)
        bench.master.send(0x705, b"\x05")
    bench.master.nmt(NmtCommand.START, 1)
    bench.run(0.005)
    if state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE):
        beat = bench.scheduler.every(10_000_000, lambda: bench.master.send(0x705, b"\x05"))
        bench.set_moving(3)
        if state is S.QUICK_STOP_ACTIVE:
            bench.control(2, 0.1)
        beat.cancel()
    else:
        bench.to_state(state)
    assert bench.state is state
    if cause == "heartbeat":
        bench.run(0.05)
    else:
        bench.master.nmt(NmtCommand.STOP if cause == "stop" else NmtCommand.ENTER_PRE_OPERATIONAL, 1)
        bench.run(0.01)
    bench.run(0.3)
    expected = {
        0: state,
        1: S.FAULT,
        2: S.SWITCH_ON_DISABLED,
        3: S.QUICK_STOP_ACTIVE
        if state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE)
        else S.SWITCH_ON_DISABLED,
    }[option]
    assert bench.state is expected
    assert bench.read(0x603F) == ((0x8130 if cause == "heartbeat" else 0x8100) if option == 1 else 0)
    if state is S.OPERATION_ENABLED:
        assert bench.rpm == pytest.approx({0: RPM, 1: 0, 2: RPM, 3: 0}[option], abs=15)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-077", "C402-049", "C402-050", "C402-051", "C402-052")
def test_lost_connection(subtests):
    """6007h in every state: 0 nothing, 1 fault, 2 disable voltage, 3 quick stop; without torque only the
    state changes.
    """
    for label, values in each([0, 1, 2, 3], LOST_CONNECTION_STATE, ["stop", "pre-operational", "heartbeat"]):
        with subtests.test(label):
            check_lost_connection(*values)

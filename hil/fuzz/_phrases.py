"""Hypothesis strategies for phrases: several steps that make sense one after the other.

Steps that are drawn one by one seldom meet: a motion needs an enabled axis and time, a buffered job one to
wait for, a new set-point of a drive its mode, its target and the edge of a control word.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hil.fuzz._choices import whole
from hil.fuzz._device_strategies import CONTROL_WORD, MODE, written
from hil.fuzz._nc_jobs import RELEASE, WRITE
from hil.fuzz._nc_strategies import block_inputs
from hil.fuzz._program import JOBS, REMOVE_FAULTS, Do, Participant, Step, Wait, for_axis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fieldbus.history import Scalar
    from hil.fuzz._devices import Devices, Led, Node

Phrase = tuple[Step, ...]
Phrases = SearchStrategy[Phrase]

_VELOCITIES: Final = (25.0, 60.0, 110.0, 240.0, 390.0)
_DISTANCES: Final = (-180.0, -75.0, -8.0, 3.0, 12.0, 45.0, 130.0)
_PLACES: Final = (-220.0, -90.0, -35.0, 10.0, 55.0, 160.0, 280.0)
_DYNAMICS: Final[dict[str, tuple[float, ...]]] = {
    "Acceleration": (-1.0, 350.0, 800.0, 1900.0),
    "Deceleration": (-1.0, 270.0, 950.0, 2300.0),
    "Jerk": (-1.0, -1.0, 0.0, 4000.0, 17_000.0),
}
"""Dynamic values that differ from each other; a negative one is the default of the object."""
_PAUSES: Final = (0.02, 0.06, 0.14, 0.3)
_LONG: Final = (0.4, 0.7, 1.1, 1.6)


def _waits(times: Sequence[float]) -> SearchStrategy[Step]:
    return st.sampled_from(list(times)).map(Wait)


def _one(values: Sequence[Scalar]) -> SearchStrategy[Scalar]:
    return st.sampled_from(list(values))


def _given(job: str, **values: SearchStrategy[Scalar]) -> SearchStrategy[Step]:
    """Return an instruction with values for those of its parameters that it has."""
    known = {parameter.name for parameter in JOBS[job]}
    values = {name: one for name, one in values.items() if name in known}
    return st.fixed_dictionaries(values).map(lambda drawn: Do(job, drawn))


def _fixed(job: str, **values: Scalar) -> SearchStrategy[Step]:
    return st.just(Do(job, values))


def _row(*parts: SearchStrategy[Step]) -> Phrases:
    return st.tuples(*parts)


_RECOVER: Final[Phrase] = (
    Do(REMOVE_FAULTS),
    Do("reset"),
    Do("power_on"),
    Wait(0.2),
    Do("home"),
)
"""Brings an axis that an alarm has stopped back into operation."""


def _moves(jobs: Sequence[str], **more: SearchStrategy[Scalar]) -> SearchStrategy[Step]:
    """Return motion jobs with dynamic values of their own."""
    how = {key: _one(values) for key, values in _DYNAMICS.items()} | more
    velocity = _one(_VELOCITIES)
    both = _one([sign * one for one in _VELOCITIES for sign in (1.0, -1.0)])
    known = {
        "move_absolute": _given("move_absolute", position=_one(_PLACES), velocity=velocity, **how),
        "move_relative": _given("move_relative", distance=_one(_DISTANCES), velocity=velocity, **how),
        "move_velocity": _given("move_velocity", velocity=both, **how),
    }
    return st.one_of([one for name, one in known.items() if name in jobs])


def _of_technology_object(jobs: Sequence[str]) -> list[Phrases]:
    """Return what is done with an axis by itself."""
    pause, long = _waits(_PAUSES), _waits(_LONG)
    move = _moves(jobs)
    next_move = _moves(jobs, BufferMode=st.just(1))
    leave = {key: _one(values) for key, values in _DYNAMICS.items()}
    halt = _given("halt", **leave)
    stop = _given("stop", mode=_one((0, 2, 3)), **leave)
    found = [
        _row(move, long),
        _row(move, pause, move, long),
        _row(move, next_move, next_move, long, long),
        _row(move, pause, halt, long),
        _row(move, pause, stop, long, _fixed("stop_release"), pause),
        _row(_fixed("power_off", stop_mode=0), long, _fixed("power_on"), pause),
        _row(move, pause, _given("power_off", stop_mode=_one((0, 1, 2, 3))), long, _fixed("power_on"), pause),
        _row(_given("home", position=_one(_PLACES), mode=_one((0, 1, 6, 7))), pause, move, long),
    ]

    def with_job(name: str, *rows: Phrases) -> None:
        if name in jobs:
            found.extend(rows)

    jog = _given("jog", velocity=_one(_VELOCITIES), backward=st.booleans(), **leave)
    with_job("jog", _row(jog, long, _fixed("jog_release"), long))
    factors = _given("override", factor=_one((0.0, 35.0, 70.0, 150.0)))
    with_job("override", _row(move, pause, factors, long, _fixed("override", factor=100.0), long))
    added = _given("move_superimposed", distance=_one(_DISTANCES), velocity=_one(_VELOCITIES), **leave)
    with_job("move_superimposed", _row(move, pause, added, long), _row(added, long, move, long))
    leads = _given("motion_in_velocity", velocity=_one((-60.0, 25.0, 110.0)))
    with_job("motion_in_velocity", _row(leads, long, _fixed("motion_in_release"), long))
    limit = _given("torque_limiting", limit=_one((0.05, 0.5, 2.0)))
    with_job("torque_limiting", _row(limit, move, long, _fixed("torque_release"), pause))
    homing = _given("home", position=_one(_PLACES), mode=_one((2, 3, 5, 8)))
    found.append(_row(homing, st.just(Wait(2.5)), move, long))
    return found


def _following(one: Participant, axes: Sequence[Participant]) -> list[Phrases]:
    """Return what an axis does that follows another one of the program."""
    leaders = [name for name in one.leaders if any(other.axis == name for other in axes)]
    if not leaders:
        return []
    pause, long = _waits(_PAUSES), _waits(_LONG)
    ratio = {"numerator": _one((1, 2, 3, -1)), "denominator": _one((1, 2, 3))}

    def of(leader: str) -> list[Phrases]:
        jobs = next(other.jobs for other in axes if other.axis == leader)
        lead = _moves(jobs).map(lambda step: for_axis(step, leader))
        own = {"leader": st.just(leader), **ratio}
        at_place = {"master": _one(_PLACES), "slave": _one(_PLACES), "distance": _one((10.0, 40.0))}
        couple = st.one_of(
            _given("gear_in", **own),
            _given("gear_in_velocity", **own),
            _given("gear_in_pos", **own, **at_place, profile=_one((0, 1, 3, 4))),
        )
        shift = st.one_of(
            _given("phasing", shift=_one(_DISTANCES)),
            _given("offset", offset=_one(_DISTANCES), distance=_one((10.0, 40.0))),
            _given("leading_value_additive", position=_one(_DISTANCES)),
            _given("halt"),
        )
        leave = st.one_of(
            _given("gear_out", position=_one(_PLACES), profile=_one((0, 1)), distance=_one((10.0, 40.0))),
            _given("cam_out", position=_one(_PLACES), profile=_one((0, 1)), distance=_one((10.0, 40.0))),
            _moves(one.jobs),
        )
        follow, shifted, left = (
            steps.map(lambda step: for_axis(step, one.axis)) for steps in (couple, shift, leave)
        )
        found = [
            _row(follow, lead, long, long),
            _row(lead, pause, follow, long, shifted, long),
            _row(follow, lead, long, left, lead, long),
        ]
        if one.cams:
            cam = _given(
                "cam_in",
                leader=st.just(leader),
                cam=_one(one.cams),
                mode=_one((0, 1, 2)),
                profile=_one((0, 1, 3, 4, 5)),
                distance=_one((10.0, 40.0)),
            ).map(lambda step: for_axis(step, one.axis))
            found += [_row(cam, lead, long, long), _row(lead, pause, cam, long, shifted, left, long)]
        return found

    return [phrase for leader in leaders for phrase in of(leader)]


def _named(phrases: Phrases, axis: str) -> Phrases:
    """Return phrases whose instructions are for an axis."""
    return phrases.map(lambda steps: tuple(for_axis(step, axis) for step in steps))


def _of_nc_axis() -> list[Phrases]:
    """Return what is done with an axis of an NC."""
    pause, long = _waits(_PAUSES), _waits(_LONG)
    how: dict[str, SearchStrategy[Scalar]] = {
        "Velocity": _one((40.0, 150.0, 300.0)),
        "Acceleration": _one((0.0, 700.0, 1600.0)),
        "Deceleration": _one((0.0, 600.0, 2100.0)),
        "Jerk": _one((0.0, 0.0, 20_000.0)),
    }
    known = block_inputs()

    def moves(**more: SearchStrategy[Scalar]) -> SearchStrategy[Step]:
        return st.one_of(
            _given("MC_MoveAbsolute", Position=_one(_PLACES), **how, **more),
            _given("MC_MoveRelative", Distance=_one(_DISTANCES), **how, **more),
            _given("MC_MoveAdditive", Distance=_one(_DISTANCES), **how, **more),
            _given(
                "MC_MoveContinuousAbsolute",
                Position=_one(_PLACES),
                EndVelocity=_one((0.0, 30.0, 120.0)),
                **how,
                **more,
            ),
            _given("MC_MoveVelocity", Direction=_one(("POSITIVE", "NEGATIVE")), **how, **more),
        )

    buffered = known["MC_MoveAbsolute"]["BufferMode"].filter(lambda mode: mode is not None)
    leave = {key: how[key] for key in ("Deceleration", "Jerk")}
    recover: Phrase = (Do(REMOVE_FAULTS), Do("MC_Reset"), Wait(0.2))
    return [
        _row(moves(), long),
        _row(moves(), long, moves(), long),
        _row(moves(), pause, moves(BufferMode=buffered), moves(BufferMode=buffered), long, long),
        _row(moves(), pause, _given("MC_Halt", **leave), long),
        _row(
            moves(),
            pause,
            _given("MC_Stop", **leave),
            long,
            st.just(Do(RELEASE, {"block": "MC_Stop"})),
            pause,
        ),
        _row(moves(), pause, _given("MC_MoveSuperImposed", Distance=_one(_DISTANCES)), long),
        st.just(recover),
    ]


def _of_drive(node: Node) -> list[Phrases]:
    """Return what a CiA 402 drive is told that the program leads itself: mode, target, control word."""
    own = {one.index for one in node.entries if one.writable}

    def write(index: int, values: Sequence[int], size: int) -> SearchStrategy[Step]:
        return st.sampled_from(list(values)).map(lambda one: written(node, index, one, size))

    def control(*words: int) -> list[SearchStrategy[Step]]:
        return [write(CONTROL_WORD, (one,), 2) for one in words]

    def mode(number: int) -> SearchStrategy[Step]:
        return write(MODE, (number,), 1)

    long = _waits(_LONG)
    speeds = write(0x6081, (20_000, 80_000, 200_000, 500_000), 4)
    ramps = [write(index, values, 4) for index, values in _RAMP_OBJECTS.items() if index in own]
    begin = control(0x06, 0x07, 0x0F)
    found = [
        _row(write(0x605A, (1, 2, 5, 6), 2), *control(0x0B), long, *control(0x00, 0x06, 0x07, 0x0F), long),
        _row(*control(0x80, 0x06, 0x07, 0x0F), _waits(_PAUSES)),
    ]
    if {0x607A, 0x6081} <= own:
        targets = write(0x607A, (-60_000, -5000, 2000, 40_000, 150_000), 4)
        found += [
            _row(mode(1), *begin, *ramps, targets, speeds, *control(0x1F), long, *control(0x0F), long),
            _row(mode(1), targets, speeds, *control(0x5F), long, *control(0x0F, 0x10F), long, *control(0x0F)),
            _row(mode(1), targets, *control(0x1F, 0x0F), targets, *control(0x3F), long, *control(0x0F), long),
        ]
    if 0x60FF in own:
        wanted = write(0x60FF, (-200_000, -40_000, 30_000, 300_000), 4)
        found.append(_row(mode(3), *begin, *ramps, wanted, long, wanted, long, *control(0x10F), long))
    if 0x6098 in own:
        methods = write(0x6098, (1, 2, 17, 18, 19, 21, 33, 34, 35, 37), 1)
        found.append(_row(mode(6), methods, *begin, *control(0x1F), st.just(Wait(2.0)), *control(0x0F)))
    if 0x6071 in own:
        found.append(_row(mode(4), *begin, write(0x6071, (-60, 40, 150), 2), long, *control(0x10F), long))
    return found


_RAMP_OBJECTS: Final = {
    0x6083: (200_000, 900_000),
    0x6084: (300_000, 1_200_000),
}


def _of_led(led: Led) -> list[Phrases]:
    """Return what a PROFIdrive drive is told that the program leads by its telegram."""
    known = dict(led.signals)
    if "STW1" not in known:
        return []

    def signal(name: str, *values: int) -> SearchStrategy[Step]:
        return st.sampled_from(values or list(known[name])).map(
            lambda one: Do("signal", {"device": led.name, "name": name, "value": one})
        )

    long = _waits(_LONG)
    found = []
    setpoint = next((one for one in ("NSOLL_B", "NSOLL_A") if one in known), None)
    if setpoint is not None:
        unit = 0x0400_0000 if setpoint == "NSOLL_B" else 0x0400
        speeds = signal(setpoint, unit, -unit, 2 * unit, -3 * unit, unit // 2, 0)
        end = signal("STW1", 0x047E, 0x047D, 0x047B, 0x0477, 0x046F, 0x045F, 0x043F)
        again = _row(signal("STW1", 0x04FE), signal("STW1", 0x047E), long, signal("STW1", 0x047F), long)
        found += [
            _row(speeds, long, speeds, long),
            _row(speeds, long, end, long, signal("STW1", 0x047E), long, signal("STW1", 0x047F), long),
            again,
        ]
    return found


def phrases(
    jobs: Sequence[str], axes: Sequence[Participant], devices: Devices, *, calm: bool
) -> Phrases | None:
    """Return a strategy of phrases; None: nothing can be said on this bench.

    Args:
        jobs: Instructions of the only axis, as of `job_names`; none: the bench has no axis.
        axes: Axes that get instructions, where there are several.
        devices: What can be asked of devices.
        calm: Whether no fault is to come in between: then an axis seldom has to recover.

    """
    every: list[Phrases] = []
    for one in axes or ([Participant("", "", tuple(jobs))] if jobs else []):
        if WRITE in one.jobs:
            own = _of_nc_axis()
        else:
            own = _of_technology_object(one.jobs)
            own += [st.just(_RECOVER)] * (1 if calm else 4)
        every.append(whole(_named(st.one_of(own), one.axis)))
        following = _following(one, axes)
        if following:
            every += [whole(st.one_of(following))]
    for node in devices.nodes:
        if node.servo and not node.led:
            every.append(whole(st.one_of(_of_drive(node))))
    for led in devices.led:
        found = _of_led(led)
        if found:
            every.append(whole(st.one_of(found)))
    return st.one_of(every) if every else None

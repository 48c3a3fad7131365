"""Hypothesis strategies for fuzz programs. Numbers are drawn in coarse steps, so
that a shrunk program reads well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hil.faults import CATALOGUE, Fault, Parameter
from hil.faults._kind import environment
from hil.faults.seams import missing
from hil.fuzz._choices import whole
from hil.fuzz._configuration import Configuration
from hil.fuzz._device_jobs import DEVICE_JOBS
from hil.fuzz._nc_jobs import NC_JOBS, WRITE
from hil.fuzz._nc_strategies import block_inputs, parameter_values
from hil.fuzz._program import (
    ASSIGN,
    DERIVED,
    JOBS,
    LET_GO,
    REMOVE_FAULTS,
    SYNCHRONOUS,
    Break,
    Do,
    ObjectWithoutMotion,
    Participant,
    Program,
    Step,
    Variable,
    Wait,
    for_axis,
    instruction_of,
)
from hil.fuzz._s7_jobs import inputs_of
from hil.fuzz._telegram_strategies import TELEGRAM_KINDS, telegram_fault

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from hil.bench.bench import Bench

_EMCY: Final = (0x2310, 0x3210, 0x3220, 0x4310, 0x5400, 0x7121, 0x7305, 0x8611, 0xFF00)
_ALARMS: Final = ((421, 4), (431, 4), (521, 4), (411, 4), (534, 3), (533, 2), (304, 3), (307, 2), (550, 5))
_FOREIGN_CONTROL: Final = ("rpdo", "sdo_rx", "nmt", "controller")
"""Messages by which a forged frame would take control of the drive: no fault of a bus, but an attack."""

UNCHANGED: Final = st.just(Configuration())
"""The bench as its file describes it."""
PREAMBLE: Final[tuple[Step, ...]] = (Do("power_on"), Wait(0.3))
"""What programs for one technology object begin with."""
_NC_POWER: Final = Do("MC_Power", dict.fromkeys(("Enable", "Enable_Positive", "Enable_Negative"), True))
OWN_JOBS: Final = tuple(
    job for job in JOBS if job not in {*SYNCHRONOUS, *NC_JOBS, *DEVICE_JOBS, *DERIVED} or job == LET_GO
)
"""Instructions of a technology object by itself."""
OF_DRIVE: Final = frozenset({"drive", "switch", "mechanics", "encoder"})
"""Targets of faults that belong to a drive."""


def _grid(low: int, high: int, step: float) -> SearchStrategy[float]:
    return st.integers(low, high).map(lambda number: round(number * step, 6))


def _job(name: str, **parameters: SearchStrategy[Scalar]) -> SearchStrategy[Step]:
    """Return a strategy of steps with an instruction; a parameter that is None is left out."""

    def build(**values: Scalar) -> Step:
        return Do(name, {key: value for key, value in values.items() if value is not None})

    return st.builds(build, **parameters)


def _nc_jobs(masters: Sequence[str] = ()) -> SearchStrategy[Step]:
    """Return instructions of an NC axis; with `masters` those of a coupled one besides."""
    blocks = [_job(name, **inputs) for name, inputs in block_inputs(masters).items()]
    write = parameter_values().map(lambda values: Do(WRITE, values))
    return st.one_of([*blocks, _job(REMOVE_FAULTS), whole(write), whole(write)])


def _jobs(names: Sequence[str]) -> SearchStrategy[Step]:
    if WRITE in names:
        return _nc_jobs()
    velocity = _grid(1, 40, 10.0)
    signed = _grid(-40, 40, 10.0)
    distance = _grid(-20, 20, 10.0)
    jerk = st.sampled_from([None, None, 0.0, 2000.0])
    how = {"jerk": jerk, "buffer": st.sampled_from([None, None, 1])}
    known: dict[str, dict[str, SearchStrategy[Scalar]]] = {
        "power_off": {"stop_mode": st.integers(0, 3)},
        "home": {
            "position": _grid(-10, 10, 10.0),
            "mode": st.sampled_from([None, None, 1, 2, 3, 5, 6, 7, 8, 9, 11, 12]),
        },
        "move_absolute": {"position": _grid(-30, 30, 10.0), "velocity": velocity, **how},
        "move_relative": {"distance": distance, "velocity": velocity, **how},
        "move_velocity": {"velocity": signed, "jerk": jerk},
        "move_superimposed": {"distance": distance, "velocity": velocity},
        "motion_in_velocity": {"velocity": signed},
        "torque_limiting": {"limit": st.sampled_from([-1.0, 0.05, 0.5, 2.0])},
        "override": {"factor": st.sampled_from([0.0, 10.0, 50.0, 100.0, 200.0])},
        "jog": {"velocity": velocity, "backward": st.booleans()},
        "stop": {"mode": st.sampled_from([0, 2, 3])},
    }
    own = [
        _derived(name) if name in DERIVED else _with_inputs(name, _job(name, **known.get(name, {})))
        for name in names
        if name != LET_GO
    ]
    held = [name for name in names if instruction_of(name)]
    return st.one_of([*own, *([_held(held)] if LET_GO in names else [])])


def _held(names: Sequence[str]) -> SearchStrategy[Step]:
    return st.sampled_from(list(names)).map(lambda name: Do(LET_GO, {"job": name}))


_INPUTS: Final[dict[str, tuple[Scalar, ...]]] = {
    **dict.fromkeys(("Position", "StartPosition", "EndPosition"), (-45.0, -10.0, 0.0, 25.0, 130.0)),
    **dict.fromkeys(("Distance", "Offset", "PhaseShift"), (-30.0, 0.0, 7.5, 60.0)),
    **dict.fromkeys(("Velocity", "VelocityDiff"), (-20.0, 0.0, 15.0, 80.0, 220.0)),
    "Acceleration": (-1.0, 0.0, 300.0, 700.0, 1500.0, 40_000.0),
    "Deceleration": (-1.0, 0.0, 250.0, 900.0, 1800.0, 40_000.0),
    "AccelerationDiff": (-300.0, 0.0, 500.0),
    "Jerk": (-1.0, 0.0, 3000.0, 12_000.0),
    "Direction": (0, 1, 2, 3, 4),
    "SyncDirection": (1, 2, 3),
    "SyncOutDirection": (1, 2, 3),
    "ApproachDirection": (1, 2, 3),
    "BufferMode": (0, 1, 2),
    "Mode": (0, 1, 2, 3, 4, 5, 6, 7),
    "StartMode": (0, 1),
    "StopMode": (0, 1, 2, 3),
    "Sensor": (0, 1, 2),
    "ReferenceSensor": (1, 2),
    "Limit": (-1.0, 0.05, 0.5, 2.0),
    "UpperLimit": (0.2, 1.0, 1e6),
    "LowerLimit": (-1e6, -1.0, -0.1),
    "ParameterNumber": (1000, 1003, 1005, 1010, 1020, 1022, 1050, 1100, 9999),
    "Value": (0.0, 1.0, 5.0, 200.0),
    **dict.fromkeys(("STW1", "STW1BitMask", "STW2", "STW2BitMask"), (0, 0x0800, 0x1000)),
    **dict.fromkeys(("MasterScaling", "SlaveScaling"), (0.5, 1.0, 2.0)),
    **dict.fromkeys(("LeadingValue", "FollowingValue", "ApproachLeadingValue"), (-10.0, 0.0, 20.0, 90.0)),
    **dict.fromkeys(("MasterOffset", "SlaveOffset"), (-5.0, 0.0, 12.5)),
    "ProfileReference": (0, 1, 2),
    "SyncProfileReference": (0, 1, 2, 3, 4),
    **dict.fromkeys(("PhasingDistance", "OffsetDistance"), (0.0, 15.0, 40.0)),
    **dict.fromkeys(("MasterStartDistance", "MasterStopDistance"), (0.0, 15.0, 40.0)),
}
"""Values for inputs by their names: unlike each other, with borders and some that have to be refused."""


def _input(parameter: Parameter) -> SearchStrategy[Scalar]:
    if parameter.type == "bool":
        return st.booleans()
    known = _INPUTS.get(parameter.name)
    if known is None:
        return st.sampled_from([0, 1] if parameter.type == "int" else [0.0, 1.0, 10.0])
    return st.sampled_from(list(known))


def _derived(name: str) -> SearchStrategy[Step]:
    """Return an instruction with the inputs of its definition, some of them given."""
    return _with_inputs(name, st.just(Do(name)), most=4)


def _with_inputs(name: str, step: SearchStrategy[Step], most: int = 2) -> SearchStrategy[Step]:
    """Return an instruction with some of the inputs that have no short parameter."""
    instruction = instruction_of(name)
    inputs = inputs_of(instruction) if instruction else ()
    if not inputs:
        return step

    def added(one: Step, chosen: list[tuple[str, Scalar]]) -> Step:
        if not isinstance(one, Do) or not chosen:
            return one
        more = {key: value for key, value in chosen if key.lower() not in one.parameters}
        return replace(one, parameters={**one.parameters, **more})

    pairs = st.one_of([st.tuples(st.just(one.name), _input(one)) for one in inputs])
    return st.builds(added, step, st.lists(pairs, max_size=min(most, len(inputs))))


def object_steps(objects: Sequence[ObjectWithoutMotion]) -> SearchStrategy[Step]:
    """Return instructions of technology objects that are no axes."""
    return whole(st.one_of([whole(_of_object(one)) for one in objects if one.jobs]))


def _of_object(one: ObjectWithoutMotion) -> SearchStrategy[Step]:
    jobs = st.one_of([*(_derived(job) for job in one.jobs), _held(one.jobs)])
    return whole(jobs).map(lambda step: for_axis(step, one.name))


def assignments(variables: Sequence[Variable]) -> SearchStrategy[Step]:
    """Return assignments of the user program to variables of axes."""
    return whole(
        st.sampled_from(list(variables)).flatmap(
            lambda one: st.sampled_from(one.values).map(
                lambda value: Do(ASSIGN, {"path": one.path, "value": value}, one.axis)
            )
        )
    )


def _synchronous(leaders: Sequence[str], cams: Sequence[str]) -> SearchStrategy[Step]:
    """Return instructions of an axis that may follow others."""
    leader = {"leader": st.sampled_from(list(leaders))}
    ratio = {"numerator": st.sampled_from([1, 1, 2, 3, -1, -3]), "denominator": st.sampled_from([1, 2, 4])}
    position, distance = _grid(-20, 20, 10.0), _grid(1, 20, 5.0)
    known: dict[str, dict[str, SearchStrategy[Scalar]]] = {
        "gear_in": {**leader, **ratio},
        "gear_in_velocity": {**leader, **ratio},
        "gear_in_pos": {
            **leader,
            **ratio,
            "master": position,
            "slave": position,
            "profile": st.sampled_from([0, 1, 3, 4]),
            "distance": distance,
        },
        "gear_out": {"position": position, "profile": st.integers(0, 1), "distance": distance},
        "cam_out": {"position": position, "profile": st.integers(0, 1), "distance": distance},
        "phasing": {"shift": position},
        "offset": {"offset": position, "distance": distance},
        "leading_value_additive": {"position": position},
        "additive_release": {},
    }
    if cams:
        cam: dict[str, SearchStrategy[Scalar]] = {"cam": st.sampled_from(list(cams))}
        known["interpolate"] = cam
        known["cam_in"] = {
            **leader,
            **cam,
            "mode": st.integers(0, 2),
            "profile": st.integers(0, 6),
            "distance": distance,
        }
    return st.one_of([_with_inputs(name, _job(name, **known[name])) for name in SYNCHRONOUS if name in known])


def _of_axis(one: Participant) -> SearchStrategy[Step]:
    """Return instructions of one of several axes; of one that may follow others half of them belong to
    that.
    """
    if WRITE in one.jobs:
        jobs = whole(_nc_jobs(one.leaders))
        return jobs.map(lambda step: for_axis(step, one.axis))
    own = whole(_jobs(one.jobs))
    jobs = st.one_of(own, whole(_synchronous(one.leaders, one.cams))) if one.leaders else own
    return whole(jobs).map(lambda step: for_axis(step, one.axis))


def _aimed(step: Step, one: Participant) -> Step:
    """Return a fault of an axis or its drive as one of this axis."""
    if not isinstance(step, Break) or step.fault.target:
        return step
    target = {"axis": one.axis, **dict.fromkeys(OF_DRIVE, one.drive)}.get(step.fault.entry.target, "")
    return Break(replace(step.fault, target=target)) if target else step


def preamble_of(axes: Sequence[Participant], jobs: Sequence[str]) -> tuple[Step, ...]:
    """Return the steps that programs begin with: all axes are enabled; several technology objects are homed
    besides, and cams interpolated.

    Args:
        axes: Axes that get instructions; none: the first one.
        jobs: Instructions of the first one, as of `job_names`.

    """
    if _NC_POWER.job in jobs:
        return (
            *(replace(_NC_POWER, axis=one.axis) for one in axes),
            *(() if axes else (_NC_POWER,)),
            Wait(0.3),
        )
    if not axes:
        return PREAMBLE
    cams = dict.fromkeys(cam for one in axes for cam in one.cams)
    powers = [Do("power_on", axis=one.axis) for one in axes]
    homes = [Do("home", axis=one.axis) for one in axes if "home" in one.jobs]
    return (*powers, *(Do("interpolate", {"cam": cam}) for cam in cams), Wait(0.3), *homes)


def _selection(messages: Sequence[str]) -> SearchStrategy[dict[str, Scalar]]:
    return st.fixed_dictionaries(
        {"message": st.sampled_from(list(messages))},
        optional={"every": st.integers(1, 5), "probability": st.sampled_from([0.1, 0.5, 0.9])},
    )


_OF_A_LINE: Final = ("modbus.crc", "modbus.broadcast", "modbus.noise")
_OF_A_NETWORK: Final = ("modbus.transaction", "modbus.reset", "modbus.cut")


def _extras(kind: str) -> SearchStrategy[dict[str, Scalar]]:
    """Return the parameters of a kind besides the choice of frames."""
    inputs = st.sampled_from(["negative_limit", "positive_limit", "home"])
    known: dict[str, SearchStrategy[dict[str, Scalar]]] = {
        "frame.delay": st.fixed_dictionaries({"delay_s": _grid(1, 20, 0.001)}),
        "frame.drift": st.fixed_dictionaries({"drift_ppm": _grid(1, 20, 100.0)}),
        "frame.jitter": st.fixed_dictionaries({"jitter_s": _grid(1, 20, 0.0002)}),
        "frame.corrupt": st.fixed_dictionaries({"attempts": st.integers(1, 4)}),
        "frame.duplicate": st.fixed_dictionaries({"copies": st.integers(1, 3)}),
        "frame.replace": st.fixed_dictionaries({"data": st.binary(max_size=8).map(bytes.hex)}),
        "frame.length": st.fixed_dictionaries({"length": st.integers(0, 8)}),
        "drive.reset": st.fixed_dictionaries({"boot_s": _grid(1, 10, 0.02)}),
        "drive.dc_link": st.fixed_dictionaries({"voltage_V": st.sampled_from([0.0, 350.0, 560.0, 800.0])}),
        "drive.overtemperature": st.fixed_dictionaries(
            {
                "part": st.sampled_from(["motor", "power_stage"]),
                "temperature_C": st.sampled_from([90.0, 125.0, 150.0]),
            }
        ),
        "drive.refuse_transition": st.fixed_dictionaries({"transition": st.sampled_from([2, 3, 4, 15, 16])}),
        "frame.lose_arbitration": st.fixed_dictionaries({"rivals": st.integers(1, 40)}),
        "can.noise": st.fixed_dictionaries({"bit_error_rate": _grid(1, 10, 0.0001)}),
        "can.load": st.fixed_dictionaries({"load_percent": _grid(1, 9, 10.0)}),
        "drive.fault": st.fixed_dictionaries({"code": st.sampled_from(_EMCY), "persistent": st.booleans()}),
        "modbus.truncate": st.fixed_dictionaries({"length": st.integers(1, 30)}),
        "modbus.unit": st.fixed_dictionaries({"unit": st.integers(0, 255)}),
        "modbus.exception": st.fixed_dictionaries({"code": st.sampled_from([1, 2, 3, 4, 5, 6, 8, 10, 11])}),
        "modbus.delay": st.fixed_dictionaries({"delay_s": _grid(1, 20, 0.0007)}),
        "safety.sdi": st.fixed_dictionaries({"direction": st.sampled_from(["positive", "negative"])}),
        "switch.press": st.fixed_dictionaries({"input": inputs}),
        "switch.stuck": st.fixed_dictionaries({"input": inputs, "state": st.booleans()}),
        "switch.inverted": st.fixed_dictionaries({"input": inputs}),
        "switch.bounce": st.fixed_dictionaries({"input": inputs, "pulses": st.integers(1, 8)}),
        "probe.pulse": st.fixed_dictionaries(
            {"input": st.sampled_from(["probe1", "probe2"]), "width_s": _grid(1, 20, 0.0007)}
        ),
        "mechanics.friction": st.fixed_dictionaries({"force_N": _grid(0, 10, 30.0)}),
        "mechanics.load_step": st.fixed_dictionaries({"force_N": _grid(-10, 10, 50.0)}),
        "encoder.jump": st.fixed_dictionaries(
            {"increments": st.integers(-20, 20).map(lambda number: number * 1000)}
        ),
        "cam.overwrite": st.fixed_dictionaries({"shift": _grid(-10, 10, 0.5), "interpolate": st.booleans()}),
        "controller.overrun": st.fixed_dictionaries(
            {"level": st.sampled_from(["servo", "interpolator"]), "time_ms": _grid(1, 20, 0.5)}
        ),
        "axis.alarm": st.sampled_from(_ALARMS).map(lambda pair: {"number": pair[0], "reaction": pair[1]}),
    }
    return known.get(kind, st.just({}))


def _fault(kind: str, ids: dict[str, int]) -> SearchStrategy[Step]:
    if kind in TELEGRAM_KINDS:
        return telegram_fault(kind)
    messages = sorted(ids)
    if kind == "frame.inject":
        harmless = [ids[name] for name in messages if not name.startswith(_FOREIGN_CONTROL)]
        parameters = st.fixed_dictionaries(
            {"can_id": st.sampled_from([*harmless, 0x7FF]), "data": st.binary(max_size=8).map(bytes.hex)}
        )
        return st.builds(
            lambda values, count: Break(Fault(kind, count=count, parameters=values)),
            parameters,
            st.integers(1, 20),
        )
    if kind.startswith("frame."):
        if kind in {"frame.replace", "frame.length"}:
            messages = [name for name in messages if not name.startswith(_FOREIGN_CONTROL)]
        return st.builds(
            lambda chosen, extras, count, duration: Break(
                Fault(kind, count=count, duration_s=duration, parameters={**chosen, **extras})
            ),
            _selection(messages),
            _extras(kind),
            st.integers(1, 20),
            _grid(1, 25, 0.02),
        )
    entry = next(one for one in CATALOGUE if one.name == kind)
    duration = _grid(1, 25, 0.02) if entry.lasting and kind != "axis.alarm" else st.none()
    return st.builds(
        lambda extras, seconds: Break(Fault(kind, duration_s=seconds, parameters=extras)),
        _extras(kind),
        duration,
    )


def fault_steps(kind: str, ids: dict[str, int]) -> SearchStrategy[Step]:
    """Return a strategy of steps that inject a fault of a kind.

    Args:
        kind: As of `fault_kinds`.
        ids: Identifiers of the drive by message name, as of `identifiers_of`.

    """
    return _fault(kind, ids)


def fault_kinds(bench: Bench) -> list[str]:
    """Return the kinds of the catalogue that a bench can inject and that leave the drive to its controller.

    Their definitions say which are drawn (`FaultType.fuzzed`).
    """
    drive = bench.drive()
    where = environment(bench, drive)
    has_alarms = hasattr(bench.axis(), "alarms")
    from hil.bench.bench import Bench
    from hil.bench.modbus_links import ModbusSegment

    segment = bench.segment()
    on_modbus = isinstance(segment, ModbusSegment)
    line = isinstance(segment, ModbusSegment) and segment.kind == "modbus_rtu"
    # Axes of an NC may have drives by analog outputs alone: then there is no port.
    ports = bench.ports.by_name if isinstance(bench, Bench) else {}
    led_by_telegram = hasattr(next(iter(ports.values()), None), "actual_seam")
    return [
        entry.name
        for entry in CATALOGUE
        if not entry.injectable(where)
        and (entry.target != "axis" or has_alarms)
        and (entry.target != "cam" or bool(getattr(bench, "cam_names", False)))
        and entry.fuzzed
        and (entry.effect.needs is None or not missing(drive, entry.effect.needs))
        and (entry.target != "segment" or entry.name.startswith("modbus.") == on_modbus)
        and entry.name not in (_OF_A_NETWORK if line else _OF_A_LINE)
        and (not entry.name.startswith("telegram.") or (entry.name in TELEGRAM_KINDS and led_by_telegram))
    ]


def identifiers_of(bench: Bench) -> dict[str, int]:
    """Return the identifiers of the drive's frames; none where it is not on CAN."""
    name = bench.drive().name
    from hil.bench.modbus_links import ModbusSegment

    return {} if isinstance(bench.segment(), ModbusSegment) else bench.cob_ids(name)


def steps(
    kinds: Sequence[str],
    ids: dict[str, int],
    jobs: Sequence[str] = OWN_JOBS,
    axes: Sequence[Participant] = (),
    others: Sequence[SearchStrategy[Step]] = (),
) -> SearchStrategy[Step]:
    """Return a strategy of single steps.

    Args:
        kinds: Fault kinds, as of `fault_kinds`.
        ids: Identifiers of the drive by message name (`bench.cob_ids`).
        jobs: Instructions, as of `job_names`; none: the bench has no axis.
        axes: Axes that get the instructions, each those that it can; none: the first one gets `jobs`.
        others: Steps of further kinds; all of them together are as likely as the instructions.

    """
    waits: SearchStrategy[Step] = _grid(1, 30, 0.02).map(Wait)
    # Each counts once, however many kinds it has: nested choices would be flattened, and nearly every step a
    # fault. Instructions count several times: a fault needs a motion that it disturbs, and several axes have
    # to come together.
    found = [waits]
    if axes:
        given = whole(st.one_of([_of_axis(one) for one in axes]))
        found += [given, whole(given)]
    elif jobs:
        found += [whole(_jobs(jobs)), whole(_jobs(jobs))]
    if kinds:
        faults = whole(st.one_of([_fault(kind, ids) for kind in kinds]))
        found.append(st.builds(_aimed, faults, st.sampled_from(list(axes))) if axes else faults)
    if others:
        more = whole(st.one_of([whole(one) for one in others]))
        found += [more] if jobs else [more, whole(more), whole(more)]
    return st.one_of(found)


def programs(
    kinds: Sequence[str],
    ids: dict[str, int],
    *,
    jobs: Sequence[str] = OWN_JOBS,
    axes: Sequence[Participant] = (),
    longest: int = 12,
    preamble: Sequence[Step] | None = None,
    configurations: SearchStrategy[Configuration] = UNCHANGED,
    others: Sequence[SearchStrategy[Step]] = (),
    phrases: SearchStrategy[tuple[Step, ...]] | None = None,
    calm_phrases: SearchStrategy[tuple[Step, ...]] | None = None,
) -> SearchStrategy[Program]:
    """Return a strategy of programs: of single steps and phrases, or of phrases alone, without a fault.

    Args:
        kinds: Fault kinds, as of `fault_kinds`.
        ids: Identifiers of the drive by message name (`bench.cob_ids`).
        jobs: Instructions, as of `job_names`.
        axes: As of `steps`.
        longest: Greatest number of steps after the preamble.
        preamble: Steps that every program begins with; None: as of `preamble_of`.
        configurations: What is laid over the bench file, as of `configurations`; none by default.
        others: As of `steps`.
        phrases: Several steps that make sense together, as of `hil.fuzz._phrases.phrases`; they are put in
            among the single ones.
        calm_phrases: Those of programs that have no fault; None: there are no such programs.

    """
    if preamble is None:
        preamble = preamble_of(axes, jobs)
    one = steps(kinds, ids, jobs, axes, others).map(lambda step: (step,))
    begin = tuple(preamble)

    # Without a fault nothing but a missing home position ends a program early.
    homed = (*begin, *((Do("home"),) if "home" in jobs and not axes else ()))

    def build(
        first: tuple[Step, ...], configuration: Configuration, *parts: list[tuple[Step, ...]]
    ) -> Program:
        drawn = [step for part in parts for phrase in part for step in phrase]
        return Program((*first, *drawn[:longest]), configuration)

    # Three lists in a row: one long list would nearly always be drawn short.
    mixed = one if phrases is None else st.one_of(whole(one), whole(one), whole(phrases))
    thirds = [st.lists(mixed, max_size=(longest + part) // 3) for part in range(3)]
    found = st.builds(partial(build, begin), configurations, *thirds)
    if calm_phrases is None or longest < 1:
        return found
    some = st.lists(calm_phrases, min_size=1, max_size=(longest + 1) // 2)
    calm = st.builds(partial(build, homed), configurations, some)
    return st.one_of(whole(found), whole(calm))


def descendants(
    parents: Sequence[Program],
    step: SearchStrategy[Step],
    *,
    longest: int,
    configurations: SearchStrategy[Configuration] | None = None,
) -> SearchStrategy[Program]:
    """Return a strategy of programs that continue from others: cut, joined, with
    steps left out, put in or repeated.

    Args:
        parents: The others, at least one.
        step: Strategy of steps that are put in.
        longest: Greatest number of steps.
        configurations: Of these some take the place of that of the parent; None: it stays.

    """
    place = st.integers(0, longest)

    def leave_out(steps: list[Step], where: int) -> None:
        if len(steps) > 1:
            del steps[where % len(steps)]

    def repeat(steps: list[Step], where: int) -> None:
        if steps:
            steps.insert(where % len(steps), steps[where % len(steps)])

    def swap(steps: list[Step], where: int) -> None:
        if steps:
            here = where % len(steps)
            steps[here - 1], steps[here] = steps[here], steps[here - 1]

    change = st.one_of(
        st.tuples(st.just("put in"), place, step),
        st.tuples(st.sampled_from(["leave out", "repeat", "swap"]), place, st.none()),
        st.tuples(st.just("join"), place, st.sampled_from(list(parents))),
    )
    changes = {"leave out": leave_out, "repeat": repeat, "swap": swap}

    def build(
        parent: Program, wanted: list[tuple[str, int, Any]], configuration: Configuration | None
    ) -> Program:
        steps = list(parent.steps)
        for kind, where, what in wanted:
            if kind == "put in":
                steps.insert(where % (len(steps) + 1), what)
            elif kind == "join":
                other = list(what.steps)
                steps = [*steps[: where % (len(steps) + 1)], *other[where % (len(other) + 1) :]]
            else:
                changes[kind](steps, where)
        return Program(
            tuple((steps or list(parent.steps))[:longest]),
            parent.configuration if configuration is None else configuration,
        )

    other = st.none() if configurations is None else st.one_of(st.none(), configurations)
    return st.builds(build, st.sampled_from(list(parents)), st.lists(change, min_size=1, max_size=4), other)

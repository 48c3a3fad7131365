"""A session saved as a test of pytest, every line of which was tried on fresh benches."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import HilError
from hil.campaign import load_bench_file
from hil.cockpit.code_text import WIDTH, Call, Code, import_lines, literal, trigger_call
from hil.cockpit.observations import Begun, Chooser, JobEnd, Judgement, Stopped
from hil.cockpit.rehearsal import Action, Do, Look, Moment, Pause, Script, Until
from hil.cockpit.steps import (
    COMMANDS,
    Command,
    Inject,
    InterpolateCam,
    Remark,
    SetInputs,
    Step,
    TakeBack,
    TimedStep,
    WriteObject,
    WriteParameter,
    WriteVariable,
)
from hil.errors import CannotRunError
from hil.expect import describe, run_checkers
from hil.faults import Immediately, fault_type
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench import BenchFile
    from hil.record import Trace

SEEDS: Final = (0, 1)
"""Seeds of the rehearsals: what hangs on chance is not expected."""
_NOUNS: Final = {
    "home": "homing",
    "jog": "jogging",
    "halt": "halting",
    "stop": "stopping",
    "reset": "acknowledgement",
    "set_position": "setting",
    "move_absolute": "move",
    "move_relative": "move",
    "move_velocity": "travel",
}
_BEGIN: Final = "begin"
"""Variable of what expectations count from."""
_TAKEN: Final = {"bench", "trace", "faults", "axis", "drive", "pytest", "hit", "begin", "stopped"}


@dataclass(frozen=True)
class Recorded:
    """A session to be saved."""

    steps: tuple[TimedStep, ...]
    made: tuple[Any, ...]
    """What each step has made."""
    trace: Trace
    end_ns: int
    """Time at which it is saved, ns."""
    axes: tuple[str, ...]
    bench_file: BenchFile
    reached: Mapping[int, int]
    """Step on an NC axis -> when what a test waits for behind it came, ns."""
    nc: tuple[str, ...]
    """Those of the axes that an NC has."""


@dataclass(frozen=True)
class WrittenTest:
    """A test that was written."""

    text: str
    notes: tuple[str, ...]
    """What the writer has to say about it."""


def function_name(text: str) -> str:
    """Return the name of a test function: `test_limit_switch` of `Limit switch!`."""
    words = re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
    return words if words.startswith("test_") else f"test_{words or 'session'}"


def write_test(session: Recorded, *, name: str = "session", bench: str = "", title: str = "") -> WrittenTest:
    """Write the test of a session.

    On a bench in virtual time the steps are done again on fresh benches, and what holds there is expected;
    on a live one the recording of the session is judged.

    Args:
        session: What was done.
        name: Of the test.
        bench: Bench file, embedded name or path as the test shall have it; empty: the name of the bench.
        title: Rule that the test states; empty: made from the faults and alarms.

    Raises:
        CannotRunError: Nothing was done, or the steps cannot be done again.

    """
    if not session.steps:
        raise CannotRunError("nothing was done in this session yet: there is no test to write")
    notes = list[str]()
    end_ns, recorded = session.end_ns, session.trace
    script = Script(session.steps, recorded, session.made, end_ns, reached=session.reached)
    seen = script.recorded(session.steps, session.made, end_ns)
    if session.bench_file.kind != "virtual":
        runs = [seen]
        notes.append("the bench is live: the test expects what was recorded once, and was not tried again")
    else:
        try:
            runs = [_rehearse(script, session.bench_file, seed) for seed in SEEDS]
            different = _differences(seen, runs[0])
        except CannotRunError as error:
            different = str(error)
        if different:
            notes.append(f"all pauses stay as they were: {different}")
            script = Script(
                session.steps, recorded, session.made, end_ns, reached=session.reached, exact=True
            )
            runs = [_rehearse(script, session.bench_file, seed) for seed in SEEDS]
            still = _differences(seen, runs[0])
            notes += [still] if still else []
    looks = [one for one in script.actions if isinstance(one, Look)]
    steps = [one.step for one in session.steps]
    axes, cycle_ms = session.axes, session.bench_file.config.bench.cycle_ms
    chooser = Chooser(steps, axes, session.nc, cycle_ms / 1000)
    judged = {
        look.steps: chooser.judge(look, [moments[number] for moments in runs])
        for number, look in enumerate(looks)
    }
    broken = list(dict.fromkeys(one for moments in runs if moments for one in _broken(moments[-1].trace)))
    rules = bool(runs[0]) and not broken
    if broken:
        notes.append(f"the test does not check the rules of every run, because one is broken: {broken[0]}")
    writer = _Writer(session, script.actions, judged, axes)
    text = writer.module(
        function_name(name),
        bench or session.bench_file.name,
        title or _title(steps, runs[0]),
        rules=rules,
    )
    return WrittenTest(text, tuple(notes))


def _rehearse(script: Script, bench_file: BenchFile, seed: int) -> list[Moment]:
    from hil.errors import ExpectationFailedError

    with bench_file.build(seed=seed) as bench:
        try:
            return script.play(bench)
        except ExpectationFailedError as error:
            raise CannotRunError(f"the session cannot be repeated on a fresh bench: {error}") from error


def _broken(trace: Trace) -> list[str]:
    """Return the rules of every run that a recording breaks, in words."""
    return [describe(check) for check in run_checkers(trace) if check.verdict is not Verdict.PASSED]


def _differences(before: Sequence[Moment], again: Sequence[Moment]) -> str:
    """Return in what a rehearsal differs from the session; empty: in nothing that matters."""

    def alarms(moments: Sequence[Moment]) -> list[tuple[str, object]]:
        found = moments[-1].trace.select(kind="alarm.raised") if moments else ()
        return [(entry.source, entry.data.get("number")) for entry in found]

    was, now = alarms(before), alarms(again)
    if was == now:
        return ""
    texts = [", ".join(f"{number} of {axis}" for axis, number in one) or "none" for one in (was, now)]
    return f"alarms of the session: {texts[0]}; when it was done again: {texts[1]}"


def _title(steps: Sequence[Step], moments: Sequence[Moment]) -> str:
    summaries = [fault_type(one.fault.kind).summary for one in steps if isinstance(one, Inject)]
    alarms = moments[-1].trace.select(kind="alarm.raised") if moments else ()
    numbers = list(dict.fromkeys(str(entry.data.get("number")) for entry in alarms))
    subject = summaries[0] if summaries else "The axes do what the session did"
    shown = " and ".join(numbers[:3])
    text = f"{subject}: alarm {shown}." if numbers else f"{subject}."
    return text if len(text) <= WIDTH - 12 else text[: WIDTH - 16].rsplit(" ", 1)[0] + " ..."


class _Writer:
    """Writes a module.

    Args:
        session: What was done.
        actions: Steps, waits and looks.
        judged: What is expected at each look, by its steps.
        axes: Names of the axes.

    """

    def __init__(
        self,
        session: Recorded,
        actions: Sequence[Action],
        judged: Mapping[tuple[int, ...], Judgement],
        axes: Sequence[str],
    ) -> None:
        self._steps = [one.step for one in session.steps]
        self._actions = actions
        self._judged = judged
        self._axes = tuple(axes)
        self._fixture = {axes[0]: "axis"} if len(axes) == 1 else {}
        self._imports: dict[str, set[str]] = {}
        self._used: set[str] = set()
        self._names = self._name_steps()
        self._begun = {
            one.reference.number
            for one in judged.values()
            if isinstance(one.reference, Begun) and _counts(one)
        }
        """Steps whose time expectations count from."""
        self._lines: list[str] = []
        self._pytest = False

    # -- names ----------------------------------------------------------------------------------------------

    def _name_steps(self) -> dict[int, str]:
        """Return the names of variables for what steps make, where later lines need it."""
        needed = {one.number for one in self._actions if isinstance(one, Until)}
        needed |= {one.step for one in self._steps if isinstance(one, SetInputs | TakeBack)}
        needed |= {end.number for one in self._judged.values() for end in one.ends}
        names: dict[int, str] = {}
        taken = set(_TAKEN)
        for number in sorted(needed):
            step = self._steps[number]
            noun = "fault" if isinstance(step, Inject) else "job"
            if isinstance(step, Command):
                noun = _NOUNS.get(step.name, step.name)
            name, count = noun, 1
            while name in taken:
                count += 1
                name = f"{noun}{count}"
            taken.add(name)
            names[number] = name
        return names

    def _axis(self, name: str) -> str:
        """Return the variable of an axis."""
        if name in self._fixture:
            self._used.add("axis")
            return "axis"
        variable = re.sub(r"\W", "_", name)
        if keyword.iskeyword(variable) or variable in _TAKEN or not variable.isidentifier():
            variable = f"axis_{variable}"
        self._used.add("bench")
        self._used.add(f"axis:{name}:{variable}")
        return variable

    def _note(self, call: Call) -> Call:
        for module, name in call.imports():
            self._imports.setdefault(module, set()).add(name)
        return call

    # -- the module -----------------------------------------------------------------------------------------

    def module(self, name: str, bench: str, title: str, *, rules: bool) -> str:
        """Return the text of the module."""
        for action in self._actions:
            match action:
                case Do():
                    if action.number in self._begun:
                        self._used.add("bench")
                        self._lines.append(f"    {_BEGIN} = bench.now_s")
                    self._do(action.number, action.step)
                case Until():
                    self._used.add("bench")
                    condition = f"{self._names[action.number]}.{action.output}"
                    self._lines.append(f"    bench.wait_until({condition}, timeout={action.timeout_s!r})")
                case Pause():
                    self._used.add("bench")
                    self._lines.append(f"    bench.run_for({literal(action.seconds)})")
                case Look():
                    self._look(self._judged[action.steps])
        if rules:
            self._used.add("trace")
            self._lines.append("    trace.check_rules()")
        made = sorted(one for one in self._used if one.startswith("axis:"))
        handles = [f"    {one.split(':')[2]} = bench.axis({literal(one.split(':')[1])})" for one in made]
        fixtures = [one for one in ("bench", "axis", "faults", "trace") if one in self._used]
        self._pytest = True
        imports = import_lines(self._imports)
        while self._lines and not self._lines[-1]:
            self._lines.pop()
        return "\n".join(
            [
                f'"""A session on the bench {bench}, written by the cockpit."""',
                "",
                *(["import pytest", ""] if self._pytest else []),
                *imports,
                *([""] if imports else []),
                "",
                f"@pytest.mark.hil_bench({literal(bench)})",
                f"def {name}({', '.join(fixtures)}):",
                f'    """{_sentence(title)}"""',
                *handles,
                *self._lines,
                "",
            ]
        )

    def _do(self, number: int, step: Step) -> None:
        match step:
            case Command():
                self._statement(number, self._command(step))
            case SetInputs():
                given = ", ".join(f"{name}={literal(one)}" for name, one in step.inputs.items())
                self._lines.append(f"    {self._names[step.step]}.set({given})")
            case WriteVariable():
                call = Call(f"{self._axis(step.axis)}.write", (step.path, step.value))
                self._statement(number, call)
            case WriteObject():
                self._used.add("bench")
                sub = Code(f"0x{step.sub:02X}", step.sub) if step.sub > 9 else step.sub
                data = Code(f'bytes.fromhex("{step.data.hex(" ")}")', step.data)
                call = Call(
                    f"bench.node({literal(step.node)}).sdo.download",
                    (Code(f"0x{step.index:04X}", step.index), sub, data),
                )
                self._statement(number, call)
            case InterpolateCam():
                self._used.add("bench")
                self._statement(number, Call(f"bench.cam({literal(step.cam)}).interpolate"))
            case WriteParameter():
                self._used.add("bench")
                self._statement(
                    number,
                    Call(
                        f"bench.port({literal(step.node)}).write_parameter",
                        (step.number, step.index, step.code, step.value),
                    ),
                )
            case Inject():
                self._statement(number, self._inject(step))
            case TakeBack():
                self._lines.append(f"    {self._names[step.step]}.remove()")
            case Remark():
                self._lines.append(f"    # {step.text}")

    def _statement(self, number: int, call: Call) -> None:
        name = self._names.get(number)
        head = f"{name} = " if name else ""
        self._lines.append(f"    {head}{self._note(call).text(4, len(head))}")

    def _command(self, step: Command) -> Call:
        inputs: dict[str, Any] = dict(step.inputs)
        if "leader" in inputs:
            inputs["leader"] = Code(self._axis(str(inputs["leader"])), None)
        if "cam" in inputs:
            inputs["cam"] = Code(f"bench.cam({literal(inputs['cam'])})", None)
            self._used.add("bench")
        positional = tuple(inputs.pop(name) for name in COMMANDS[step.name] if name in inputs)
        return Call(f"{self._axis(step.axis)}.{step.name}", positional, inputs)

    def _inject(self, step: Inject) -> Call:
        self._used.add("faults")
        fault = step.fault
        options: dict[str, Any] = dict(fault.parameters)
        if not isinstance(fault.trigger, Immediately):
            options["trigger"] = trigger_call(fault.trigger)  # type: ignore[arg-type]  # made one by the fault
        if fault.until is not None:
            options["until"] = trigger_call(fault.until)  # type: ignore[arg-type]  # made one by the fault
        if fault.duration_s is not None:
            options["duration_s"] = fault.duration_s
        if fault.count is not None:
            options["count"] = fault.count
        return Call("faults.inject", (fault.kind, *([fault.target] if fault.target else [])), options)

    # -- what is expected -----------------------------------------------------------------------------------

    def _look(self, judged: Judgement) -> None:
        reference, calls, stops = judged.reference, judged.expectations, judged.stops
        if not calls and not stops and not judged.ends:
            return
        self._lines.append("")
        name = _BEGIN if isinstance(reference, Begun) else ""
        if isinstance(reference, Call) and _counts(judged):
            name = "hit" if str(reference.positional[0]).startswith("fault.") else _BEGIN
            self._lines.append(f"    {name} = {self._note(reference).text(4, 3 + len(name))}")
        if calls:
            self._used.add("trace")
            shown = tuple(_with_name(one, name) for one in calls)
            for one in shown:
                self._note(one)
            self._check(shown)
        for stopped in stops:
            self._stop(stopped, name)
        self._lines += [self._end(one) for one in judged.ends]
        self._lines.append("")

    def _check(self, calls: Sequence[Call]) -> None:
        whole = Call("trace.check", tuple(calls)).text(4)
        if "\n" in whole and len(calls) > 1:
            rows = "".join(f"        {one.text(8, 1)},\n" for one in calls)
            whole = f"trace.check(\n{rows}    )"
        elif len(calls) > 1:
            rows = ", ".join(one.text(-10_000) for one in calls)
            whole = f"trace.check({rows})"
        if any(one.function in {"state_at", "value_at"} for one in calls):
            self._used.add("bench")
        self._lines.append(f"    {whole}")

    def _stop(self, one: Stopped, since: str) -> None:
        when = since if isinstance(one.since, Begun) else f"trace.instant({since})"
        self._used.add("trace")
        self._imports.setdefault("hil.expect", set()).add("measure_stop")
        velocity, position = (literal(f"{one.axis}.actual_{name}") for name in ("velocity", "position"))
        call = Call(
            "measure_stop",
            (Code("trace()", None), Code(when, None)),
            {"velocity": Code(velocity, None), "position": Code(position, None)},
        )
        self._lines.append(f"    stopped = {call.text(4, 10)}")
        approx = f"pytest.approx({one.distance!r}, abs={one.tolerance!r})"
        self._lines.append(f"    assert stopped.distance == {approx}  # {one.unit}")

    def _end(self, end: JobEnd) -> str:
        name = self._names[end.number]
        if end.output == "Error":
            return f"    assert {name}.ErrorID == 0x{end.error_id:04X}"
        return f"    assert {name}.{end.output}"


def _counts(judged: Judgement) -> bool:
    """Whether something of a judgement counts from its reference."""
    return bool(judged.stops) or any(_refers(one) for one in judged.expectations)


def _refers(call: Call) -> bool:
    values = [*call.positional, *(call.options or {}).values()]
    return any(
        isinstance(one, Begun) or (isinstance(one, Call) and one.function == "event") for one in values
    )


def _with_name(call: Call, name: str) -> Call:
    """Return a call that has the variable of an event in place of the event."""
    if not name:
        return call

    def named(value: Any) -> Any:
        if isinstance(value, Begun):
            return Code(f"{name} + {value.offset_s!r}" if value.offset_s else name, None)
        if not isinstance(value, Call) or value.function != "event":
            return value
        return Code(f"{name}{value.suffix}", value.made)

    options = {key: named(one) for key, one in (call.options or {}).items()}
    return Call(call.function, tuple(map(named, call.positional)), options, call.module)


def _sentence(text: str) -> str:
    clean = text.replace("\\", "/").replace('"', "'").strip()
    return clean if clean.endswith((".", "!", "?")) else f"{clean}."


def bench_for_test(bench_file: BenchFile, name: str) -> tuple[str, str]:
    """Return how a test names its bench, and the text of a bench file that has to stand next to it.

    Args:
        bench_file: What the bench of the session was built of.
        name: Of the test.

    Returns:
        The source and no text; of a bench that was changed in the cockpit the name of a file, and its text.

    """
    try:
        unchanged = load_bench_file(bench_file.source).digest == bench_file.digest
    except HilError:
        unchanged = False
    if unchanged:
        return bench_file.source, ""
    return f"{function_name(name).removeprefix('test_')}.toml", bench_file.text


def save_bench(text: str, path: Path) -> None:
    """Write the bench file of a test.

    Raises:
        CannotRunError: Another file of this name is there, or nothing can be written.

    """
    try:
        if path.exists() and path.read_text(encoding="utf-8") != text:
            raise CannotRunError(f"{path} is another bench file: give the test another name")
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CannotRunError(f"{path} cannot be written: {error}") from error


def save_text(text: str, folder: Path, name: str, *, ending: str = "py") -> Path:
    """Write a test, or a matrix, into a folder, and return its file; an earlier one of the same name stays.

    Raises:
        CannotRunError: Nothing can be written there.

    """
    stem = function_name(name)
    if ending != "py":
        stem = stem.removeprefix("test_")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path, count = folder / f"{stem}.{ending}", 1
        while path.exists():
            count += 1
            path = folder / f"{stem}_{count}.{ending}"
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CannotRunError(f"{stem}.{ending} cannot be written to {folder}: {error}") from error
    return path

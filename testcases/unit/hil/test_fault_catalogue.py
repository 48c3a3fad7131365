"""The catalogue of faults keeps what it says, kind by kind: examples, effects, ends, parameters, targets,
benches.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench.encoders import ENCODER_METHODS
from hil.bench.remote import RemoteDrive
from hil.faults import CATALOGUE, DRIVE_METHODS, Fault, handbook
from testcases.unit.hil.fault_benches import Stage, situation_of, undisturbed

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "faults.md").read_text(encoding="utf-8")
FOR_GOOD = ("mechanics.coupling_break",)
"""Kinds that nothing repairs in the same case."""

every_kind = pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.name)


class _Reader:
    """Takes a call of the injector for the fault that it means."""

    def inject(self, kind, target="", *, duration_s=None, count=None, **parameters):
        return Fault(kind, target, duration_s=duration_s, count=count, parameters=parameters)


def documented(entry):
    """Return the fault of the example in the handbook."""
    section = PAGE.split(f"### `{entry.name}`\n")[1].split("\n### ")[0]
    (example,) = re.findall(r"```python\n(.*?)\n```", section, re.DOTALL)[:1]
    return eval(example, {"faults": _Reader()})


@pytest.mark.exhaustive
@every_kind
def test_the_example_acts_and_ends(entry):
    """The example, as `hil faults` prints it, changes what is recorded, is over when it says so, and the axis
    works as before.
    """
    situation = situation_of(entry)
    expected = undisturbed(situation)
    stage = Stage(situation)
    try:
        begin = stage.bench.now_s
        armed = eval(entry.example_call, {"faults": stage.faults})
        assert armed.fault == Fault.from_dict(entry.example)
        stage.act()
        assert armed.applied_ns == round(begin * 1e9)
        assert stage.print() != expected
        if armed.fault.duration_s is not None and not armed.over:
            stage.bench.run_until(lambda: armed.over, armed.fault.duration_s)
            assert armed.removed_ns == armed.applied_ns + round(armed.fault.duration_s * 1e9)
        stage.faults.remove_all()
        assert armed.over
        assert not armed.active
        kinds = [event.kind for event in stage.bench.history.events if event.data.get("injection") == 1]
        logged = [kind for kind in kinds if kind != "fault.hit"]
        lasting = entry.lasting and armed.fault.lasting
        assert logged == ["fault.armed", "fault.applied", *["fault.removed"] * lasting]
        problem = stage.recover()
        assert bool(problem) is (entry.name in FOR_GOOD), problem
    finally:
        stage.close()


def test_the_page_of_the_handbook_is_current():
    """The page is what `python -m hil.faults.handbook docs/reference/faults.md` writes."""
    assert handbook.page(handbook.head_of(PAGE)) == PAGE


def test_handbook_and_catalogue_show_the_same_example(subtests):
    """The handbook has the example that `hil faults` prints."""
    for entry in CATALOGUE:
        with subtests.test(entry.name):
            assert documented(entry) == Fault.from_dict(entry.example)


# -- parameters
# --------------------------------------------------------------------------------------------------------

TYPES = {
    "float": (True, "1", None, [1.0]),
    "int": (True, "1", None, 1.5),
    "bool": (1, "true", None),
    "text": (1, None, b"x"),
}


def wrong_values(parameter):
    """Return values that a parameter must not take."""
    values = list(TYPES[parameter.type])
    if parameter.type == "float":
        values += [math.nan, math.inf, -math.inf, 10**400]
    if parameter.type in ("float", "int"):
        step = 1 if parameter.type == "int" else max(abs(parameter.maximum), 1.0) * 1e-6
        values += [parameter.minimum - step, parameter.maximum + step]
    return [*values, "no such choice"] if parameter.choices else values


@pytest.mark.exhaustive
def test_a_parameter_takes_what_is_allowed_and_nothing_else(subtests):
    """Ends of the range are taken; other types, no numbers and what lies outside are refused with place,
    value and what is allowed.
    """
    for entry in CATALOGUE:
        for parameter in entry.parameters:
            with subtests.test(f"{entry.name}.{parameter.name}"):
                takes_what_is_allowed(entry, parameter)


def takes_what_is_allowed(entry, parameter):
    bounded = parameter.type in ("float", "int")
    assert not bounded or (parameter.minimum is not None and parameter.maximum is not None)
    others = {
        key: value for key, value in entry.example.get("parameters", {}).items() if key != parameter.name
    }
    for value in wrong_values(parameter):
        with pytest.raises(ConfigurationError) as caught:
            Fault(entry.name, parameters={**others, parameter.name: value})
        message = str(caught.value)
        assert f"{entry.name}.parameters.{parameter.name}: " in message
        assert parameter.allowed in message
    for value in [*parameter.choices, *((parameter.minimum, parameter.maximum) if bounded else ())]:
        parameter.check(entry.name, value)


def test_an_unknown_parameter_is_refused(subtests):
    """The message names kind and name, and what there is."""
    for entry in CATALOGUE:
        allowed = ", ".join(parameter.name for parameter in entry.parameters) or "no parameters"
        message = f"{entry.name}.parameters: 'colour' is not allowed; allowed: {allowed}"
        with subtests.test(entry.name), pytest.raises(ConfigurationError, match=re.escape(message)):
            Fault(entry.name, parameters={**entry.example.get("parameters", {}), "colour": 1})


# -- targets
# ------------------------------------------------------------------------------------------------------------

OTHERS = {
    "segment": "drive1",
    "drive": "can0",
    "axis": "drive1",
    "switch": "axis1",
    "mechanics": "can0",
    "encoder": "axis1",
    "station": "drive1",
    "controller": "drive1",
    "cam": "drive1",
    "proxy": "drive1",
}


@pytest.fixture(scope="module")
def stages():
    """Return benches that only refuse."""
    built = {}

    def stage(name):
        if name not in built:
            built[name] = Stage(
                situation_of(next(one for one in CATALOGUE if situation_of(one).bench == name))
            )
        return built[name]

    yield stage
    for one in built.values():
        one.close()


@pytest.mark.exhaustive
@pytest.mark.parametrize("wrong", ["nobody", "other"])
def test_a_target_that_is_none_is_refused(stages, subtests, wrong):
    """A part that there is not, or one of another kind: the message says which there are, and nothing is
    armed.
    """
    for entry in CATALOGUE:
        with subtests.test(entry.name):
            stage = stages(situation_of(entry).bench)
            target = "nobody" if wrong == "nobody" else OTHERS[entry.target]
            with pytest.raises((ConfigurationError, UnsupportedFaultError)) as caught:
                stage.faults.arm(Fault.from_dict({**entry.example, "target": target}))
            assert target in str(caught.value)
            assert stage.faults.armed == []


# -- benches
# ------------------------------------------------------------------------------------------------------------


class _Pipe:
    """The process of the drives: commands pass as JSON, and only those that the process
    accepts.
    """

    def __init__(self, device):
        self.device = device

    def call(self, method, name, args, kwargs):
        assert name == self.device.name
        command = json.loads(json.dumps({"args": list(args), "kwargs": kwargs}))
        return getattr(self.device, method)(*command["args"], **command["kwargs"])


@every_kind
def test_through_the_process_of_a_live_bench(entry, monkeypatch):
    """What the catalogue says of live benches: applied and taken back by commands that the process of the
    drives takes, or refused.
    """
    stage = Stage(situation_of(entry))
    bench = stage.bench
    drive, encoder = bench.drive, bench.encoder
    monkeypatch.setattr(
        bench, "drive", lambda name=None: RemoteDrive(_Pipe(drive(name)), drive(name).name, DRIVE_METHODS)
    )
    monkeypatch.setattr(
        bench,
        "encoder",
        lambda name=None: RemoteDrive(_Pipe(encoder(name)), encoder(name).name, ENCODER_METHODS),
    )
    monkeypatch.setattr(bench, "kind", "live")
    fault = Fault.from_dict(entry.example)
    try:
        if reason := entry.injectable("live"):
            with pytest.raises(
                UnsupportedFaultError,
                match=re.escape(f"{entry.name} cannot be injected on a live bench: {reason}"),
            ):
                stage.faults.arm(fault)
            return
        armed = stage.faults.arm(fault)
        bench.run_for(0.02)
        assert armed.applications == 1
        armed.remove()
        assert armed.over
    finally:
        monkeypatch.undo()
        stage.close()

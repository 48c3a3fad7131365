"""Overlapping faults on one target stack: the newest is active; when it ends, the previous one resumes."""

from __future__ import annotations

import pytest

from hil.faults import CATALOGUE, Fault
from testcases.unit.hil.fault_benches import Situation, Stage, situation_of

KINDS = [
    entry
    for entry in CATALOGUE
    if entry.lasting
    and entry.target in {"drive", "switch", "mechanics", "encoder"}
    and not entry.name.startswith(("telegram.", "switch.bounce"))
]


class Watched:
    """A device that records what faults do to it."""

    def __init__(self, device, calls):
        self._device = device
        self._calls = calls

    def __getattr__(self, name):
        value = getattr(self._device, name)
        if not callable(value):
            return value

        def call(*args, **kwargs):
            self._calls.append((name, args, kwargs))
            return value(*args, **kwargs)

        return call


def others(entry):
    """Return the example without its end, made to last, and the same with another value of its first
    number.
    """
    values = dict(entry.example.get("parameters", {}))
    if any(one.name == "persistent" for one in entry.parameters):
        values["persistent"] = True
    varied = dict(values)
    for one in entry.parameters:
        if one.type == "float":
            varied[one.name] = (values.get(one.name, one.default) + one.minimum) / 2
            break
        if one.type == "int" and one.name not in {"channel", "code", "mode", "transition", "level", "range"}:
            varied[one.name] = values.get(one.name, one.default) + 1
            break
    return [
        Fault(entry.name, entry.example.get("target", ""), parameters=parameters)
        for parameters in (values, varied)
    ]


@pytest.fixture(scope="module")
def stages():
    """Return benches in which the axis stands."""
    built = {}

    def stage(name):
        if name not in built:
            built[name] = Stage(Situation(name, "standing"))
        return built[name]

    yield stage
    for one in built.values():
        one.close()


@pytest.mark.parametrize("entry", KINDS, ids=lambda entry: entry.name)
def test_the_one_that_is_left_acts_on(entry, stages, monkeypatch):
    """The first may end while the second acts, or the other way round: what is left acts as if it were alone,
    and the last one restores the part.
    """
    stage = stages(situation_of(entry).bench)
    bench = stage.bench
    calls = []
    for name in ("drive", "encoder"):
        find = getattr(bench, name)
        monkeypatch.setattr(bench, name, lambda target=None, find=find: Watched(find(target), calls))
    first, second = others(entry)

    def alone(fault):
        armed = stage.faults.arm(fault)
        broken = calls[-1]
        armed.remove()
        return broken, calls[-1]

    (broken_a, restored_a), (broken_b, restored_b) = alone(first), alone(second)
    assert broken_a != restored_a
    for ending in (0, 1):
        pair = [stage.faults.arm(first), stage.faults.arm(second)]
        pair[ending].remove()
        assert calls[-1] == (broken_b, broken_a)[ending]
        pair[1 - ending].remove()
        assert calls[-1] == (restored_a, restored_b)[1 - ending]
    same = [stage.faults.arm(first), stage.faults.arm(first)]
    same[0].remove()
    assert calls[-1] == broken_a
    same[1].remove()
    assert calls[-1] == restored_a
    assert not any(armed.active for armed in stage.faults.armed)

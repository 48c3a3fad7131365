"""Faults as values: catalogue, validation, serialisation."""

import json
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError, UnsupportedFaultError
from hil.bench import load_bench
from hil.faults import (
    CATALOGUE,
    ENVIRONMENTS,
    Fault,
    Injector,
    after,
    at,
    fault_type,
    frame,
    immediately,
    on_event,
    position,
    signal,
    state,
    trigger_from_dict,
    velocity,
)
from hil.record import event

TRIGGERS = [
    immediately(),
    at(1.5),
    after(0.25),
    position(120.0, axis="axis1", direction="rising"),
    velocity(-3.0),
    signal("drive1.torque", 2.0, direction="falling"),
    state("axis1", "MOTION"),
    state("drive1", "OPERATIONAL", kind="nmt.state"),
    on_event("job.active", "axis1", nth=3, job="move1"),
    frame(0x181, number=10),
    frame(message="tpdo1", drive="drive1", segment="can0"),
]


def test_every_example_of_the_catalogue_is_good(subtests):
    """The example of each kind is accepted, is of that kind, and comes back from JSON equal."""
    for entry in CATALOGUE:
        with subtests.test(entry.name):
            fault = Fault.from_dict(entry.example)
            assert fault.kind == entry.name
            assert Fault.from_dict(json.loads(json.dumps(fault.to_dict()))) == fault


def test_the_catalogue_describes_each_kind_completely(subtests):
    """Summary, seam, parameters with type and range, and for every place whether and why not."""
    for entry in CATALOGUE:
        with subtests.test(entry.name):
            is_complete(entry)


def is_complete(entry):
    described = json.loads(json.dumps(entry.to_dict()))
    assert described["summary"]
    assert described["seam"]
    assert set(described["benches"]) == set(ENVIRONMENTS)
    assert described["benches"]["virtual"] == {"injectable": True, "reason": ""}
    for place in described["benches"].values():
        assert place["injectable"] is (place["reason"] == "")
    for parameter in described["parameters"]:
        assert parameter["summary"]
        assert parameter["type"] in {"float", "int", "bool", "text"}
        if parameter["default"] is not None:
            entry.parameter(parameter["name"]).check("x", parameter["default"])


@pytest.mark.parametrize("trigger", TRIGGERS, ids=str)
def test_triggers_come_back_from_their_file_form(trigger):
    """Every trigger survives the way through JSON and the way to another process."""
    assert trigger_from_dict(json.loads(json.dumps(trigger.to_dict()))) == trigger
    assert pickle.loads(pickle.dumps(trigger)) == trigger
    fault = Fault("drive.sto", trigger=trigger, until=trigger)
    assert Fault.from_dict(json.loads(json.dumps(fault.to_dict()))) == fault
    assert pickle.loads(pickle.dumps(fault)) == fault


def test_an_event_selector_is_a_trigger_too():
    """`event(...)` may stand where a trigger is wanted."""
    fault = Fault("drive.sto", trigger=event("alarm.raised", nth=2))
    assert fault == Fault("drive.sto", trigger=on_event("alarm.raised", nth=2))


@pytest.mark.exhaustive
@given(
    kind=st.sampled_from(["frame.drop", "frame.duplicate"]),
    count=st.none() | st.integers(1, 1000),
    duration=st.none() | st.floats(1e-6, 1e6),
    can_id=st.integers(0, 0x1FFFFFFF),
    probability=st.floats(0, 1),
)
def test_frame_faults_come_back_from_json(kind, count, duration, can_id, probability):
    """Whatever numbers a frame fault holds, JSON gives them back exactly."""
    fault = Fault(
        kind,
        "can0",
        count=count,
        duration_s=duration,
        parameters={"can_id": can_id, "probability": probability},
    )
    assert Fault.from_dict(json.loads(json.dumps(fault.to_dict()))) == fault


def test_a_wrong_kind_gets_a_proposal():
    """A misspelt kind names itself and the near ones."""
    with pytest.raises(
        ConfigurationError, match=r"'drive.fualt' is not a kind of fault; similar: drive\.fault"
    ):
        Fault("drive.fualt")
    with pytest.raises(ConfigurationError, match=r"`hil faults` lists them"):
        fault_type("nonsense")


@pytest.mark.parametrize(
    ("kind", "parameters", "words"),
    [
        ("drive.fault", {}, "code is missing; allowed: a whole number 1..65535"),
        ("drive.fault", {"code": 0}, "code: 0 is not allowed"),
        ("drive.fault", {"code": 1.5}, "code: 1.5 is not allowed"),
        ("drive.fault", {"code": True}, "code: True is not allowed"),
        ("drive.fault", {"code": 1, "kode": 2}, "kode.*allowed: code, persistent"),
        ("frame.delay", {"delay_s": float("nan")}, "delay_s: nan is not allowed"),
        ("frame.drop", {"probability": 1.01}, "allowed: a number 0..1"),
        ("switch.press", {"input": "door"}, "allowed: negative_limit, positive_limit, home"),
        ("frame.replace", {"data": "xyz"}, "hexadecimal"),
        ("frame.replace", {"data": "00" * 9}, "0 to 8 bytes"),
        ("frame.drop", {"message": "tpdo1", "can_id": 1}, "because message is given"),
        ("frame.inject", {"can_id": 0x800}, "extended = true"),
        ("switch.bounce", {"input": "home", "shortest_s": 0.5}, "shortest_s"),
        ("mechanics.jam", {"force_N": 1.0}, "no parameters"),
    ],
)
def test_wrong_parameters_are_refused_with_key_value_and_what_is_allowed(kind, parameters, words):
    """Each mistake in a parameter names the key, the value and the allowed ones."""
    with pytest.raises(ConfigurationError, match=words):
        Fault(kind, parameters=parameters)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"duration_s": 0.0}, "> 0 s"),
        ({"duration_s": float("inf")}, "> 0 s"),
        ({"duration_s": 1.0, "until": at(2.0)}, "because until is given"),
        ({"count": 0}, "whole number >= 1"),
        ({"count": 2}, "trigger is 'immediately'"),
        ({"count": 2, "trigger": position(1.0)}, "give duration_s or until"),
        ({"target": 7}, "name of a part"),
    ],
)
def test_contradicting_options_are_refused(options, words):
    """Options that cannot be meant together are a mistake."""
    with pytest.raises(ConfigurationError, match=words):
        Fault("drive.sto", **options)


def test_a_fault_that_is_over_at_once_has_no_end():
    """A jump of the encoder cannot last."""
    with pytest.raises(ConfigurationError, match="is over once applied"):
        Fault("encoder.jump", duration_s=1.0, parameters={"increments": 5})


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "a table with kind"),
        ({}, "fault.kind"),
        ({"kind": "drive.sto", "when": 3}, "fault.when.*kind, target, trigger"),
        ({"kind": "drive.sto", "parameters": 3}, "fault.parameters"),
        ({"kind": "drive.sto", "trigger": {"when": "noon"}}, "fault.trigger.when.*immediately, at"),
        ({"kind": "drive.sto", "trigger": {"when": "at"}}, "time_s: None"),
        ({"kind": "drive.sto", "trigger": {"when": "at", "time_s": "1"}}, "a number"),
        (
            {"kind": "drive.sto", "trigger": {"when": "at", "time_s": 1, "axis": "x"}},
            "trigger.axis.*when, time_s",
        ),
        ({"kind": "drive.sto", "trigger": {"when": "at", "time_s": -1.0}}, ">= 0 s"),
        (
            {"kind": "drive.sto", "trigger": {"when": "event", "kind": "x", "nth": -1}},
            "last event is not known",
        ),
        ({"kind": "drive.sto", "trigger": {"when": "frame"}}, "either an identifier or a message"),
        (
            {
                "kind": "drive.sto",
                "trigger": {"when": "signal", "signal": "a.b", "value": 1, "direction": "up"},
            },
            "rising",
        ),
    ],
)
def test_wrong_files_are_refused(content, words):
    """A fault of a file that is wrong in any way names the place."""
    with pytest.raises(ConfigurationError, match=words):
        Fault.from_dict(content)


def test_axis_words_of_a_file_mean_the_signals_of_that_axis():
    """`when = position` with an axis is the actual position of that axis."""
    trigger = trigger_from_dict({"when": "position", "axis": "axis2", "value": 5})
    assert trigger == signal("axis2.actual_position", 5.0)
    assert trigger_from_dict({"when": "velocity", "value": 5}) == signal("actual_velocity", 5.0)


@pytest.mark.parametrize(
    ("name", "number", "reaction", "words"),
    [("speed", 521, 4, "SpeedAxis"), ("reference", 521, 2, "no reaction 2")],
)
def test_an_alarm_that_the_object_cannot_have_is_refused_when_armed(name, number, reaction, words):
    """Not only in the middle of the run, when the trigger comes."""
    with load_bench(name).build(seed=1) as bench, pytest.raises(UnsupportedFaultError, match=words):
        Injector(bench).inject("axis.alarm", trigger=at(1.0), number=number, reaction=reaction)

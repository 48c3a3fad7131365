"""How instances are started, what they show and how they end, by interface class (section 1.1 of the
specification).
"""

from __future__ import annotations

import pytest

import motion.s7.instructions as instructions
from motion.s7.instructions import MC_SaveAbsoluteEncoderData
from testcases.unit.motion_axis.conftest import Rig, TorquePort

TERMINAL = ("Done", "CommandAborted", "Error")

# instruction, identifier, success output, whether it has Active and CommandAborted, inputs other than the
# start, whether it ends by itself
EXECUTE = [
    ("MC_Reset", "MC-020", "Done", False, True, {}, True),
    ("MC_Home", "MC-021", "Done", False, True, {"Mode": 0}, True),
    ("MC_Halt", "MC-022", "Done", False, True, {}, True),
    ("MC_MoveAbsolute", "MC-023", "Done", True, True, {"Position": 5.0}, True),
    ("MC_MoveRelative", "MC-024", "Done", True, True, {"Distance": 5.0}, True),
    ("MC_MoveVelocity", "MC-025", "InVelocity", False, True, {"Velocity": 20.0}, False),
    ("MC_MoveSuperimposed", "MC-027", "Done", False, True, {"Distance": 5.0}, True),
    ("MC_HaltSuperimposed", "MC-028", "Done", False, True, {}, True),
    ("MC_SetSensor", "MC-029", "Done", False, True, {"Sensor": 1}, True),
    ("MC_Stop", "MC-030", "Done", False, True, {}, True),
    ("MC_SetAxisSTW", "MC-031", "Done", False, True, {"STW1": 0x1000, "STW1BitMask": 0x1000}, True),
    ("MC_WriteParameter", "MC-032", "Done", False, True, {"ParameterNumber": 1000, "Value": False}, True),
]  # fmt: skip
ENABLE = [
    ("MC_Power", "MC-019", "Enable", "Status", False),
    ("MC_MoveJog", "MC-026", "JogForward", "InVelocity", True),
    ("MC_MotionInVelocity", "MC-034", "Enable", None, True),
    ("MC_MotionInPosition", "MC-034", "Enable", None, True),
    ("MC_MotionInSuperimposed", "MC-034", "Enable", None, True),
    ("MC_TorqueAdditive", "MC-035", "Enable", None, False),
    ("MC_TorqueRange", "MC-035", "Enable", None, False),
    ("MC_TorqueLimiting", "MC-036", "Enable", "InLimitation", False),
]
ILLEGAL = {
    "MC_Home": {"Mode": 4},
    "MC_Halt": {"Deceleration": 0.0},
    "MC_MoveAbsolute": {"Velocity": 0.0},
    "MC_MoveRelative": {"Acceleration": 0.0},
    "MC_MoveVelocity": {"Acceleration": 0.0},
    "MC_MoveSuperimposed": {"VelocityDiff": 0.0},
    "MC_HaltSuperimposed": {"Deceleration": 0.0},
    "MC_SetSensor": {"Sensor": 9},
    "MC_Stop": {"Mode": 1},
    "MC_SetAxisSTW": {"STW1BitMask": 0x0001},
    "MC_WriteParameter": {"ParameterNumber": 1},
    "MC_Reset": {"Restart": True},
}
"""Inputs with which each is refused on an enabled axis."""


def ready(**variables):
    """Return an enabled, homed axis on a drive with every ability."""
    rig = Rig(port=TorquePort(), variables=variables).enabled()
    rig.until(rig.axis.home(0.0).done)
    return rig


class Watched:
    """An instance that the test calls itself, with the outputs of every call."""

    def __init__(self, rig, name, **inputs):
        self.rig = rig
        self.instance = getattr(instructions, name)(rig.axis.object, **inputs)
        self.calls = []

    def call(self, **inputs):
        self.instance(**inputs)
        shown = {one: getattr(self.instance, one, False) for one in ("Busy", "InVelocity", *TERMINAL)}
        shown["ErrorID"] = self.instance.ErrorID
        self.calls.append(shown)
        self.rig.cycles(1)
        return shown

    def call_until(self, condition, **inputs):
        for _ in range(2000):
            if condition(self.call(**inputs)):
                return
        pytest.fail(f"{self.instance.name} did not get there: {self.calls[-1]}")

    def counts(self):
        return {one: sum(bool(call[one]) for call in self.calls) for one in ("Busy", *TERMINAL)}


def prepared(name):
    """Return a rig on which `name` has something to do."""
    rig = ready()
    if name in ("MC_Halt", "MC_Stop"):
        rig.axis.move_velocity(50.0)
        rig.run(0.3)
    if name == "MC_HaltSuperimposed":
        rig.axis.move_superimposed(100.0)
        rig.run(0.3)
    return rig


@pytest.mark.parametrize(
    ("name", "success", "active", "aborted", "inputs", "ends"),
    [
        pytest.param(row[0], *row[2:], marks=pytest.mark.requirement(row[1], "G2-002"), id=row[0])
        for row in EXECUTE
    ],
)
def test_execute_class(name, success, active, aborted, inputs, ends):
    """Started by the edge alone, in the same call; success at its own output; only what is printed has
    Active.
    """
    rig = prepared(name)
    one = Watched(rig, name)
    assert hasattr(one.instance, "Active") is active
    assert hasattr(one.instance, "CommandAborted") is aborted
    assert not any(one.call(**inputs).values())
    first = one.call(Execute=True)
    assert first["Busy"] or first["Done"]
    one.call_until(lambda shown: shown[success])
    assert one.calls[-1]["Busy"] is not ends
    started = len(rig.events("job.started"))
    for _ in range(5):
        held = one.call()
        assert held[success]
    assert len(rig.events("job.started")) == started
    if ends:
        assert not any(one.call(Execute=False).values())
    else:
        assert one.call(Execute=False)["Busy"]


@pytest.mark.parametrize(
    ("name", "ident", "start", "success", "aborted"),
    [pytest.param(*row, marks=pytest.mark.requirement(row[1]), id=row[0]) for row in ENABLE],
)
def test_enable_class(name, ident, start, success, aborted):
    """Started by the level, Busy in the same call and as long as it holds; no Done, no Active."""
    rig = Rig(port=TorquePort())
    if name != "MC_Power":
        rig.enabled()
    rig.cycles(5)
    one = Watched(rig, name)
    assert not hasattr(one.instance, "Active")
    assert not hasattr(one.instance, "Done")
    assert hasattr(one.instance, "CommandAborted") is aborted
    assert success is None or getattr(one.instance, success) is False
    assert not one.call()["Busy"]
    assert one.call(**{start: True})["Busy"]
    for _ in range(30):
        assert one.call()["Busy"]
    one.call_until(lambda shown: not shown["Busy"], **{start: False})
    assert not any(one.call().values())


@pytest.mark.requirement("MC-082", "MC-035", "MC-036", "G2-003")
def test_inputs_of_an_enable_job_act_at_every_call():
    """Value, limits, Limit and Mode are taken over while Enable is TRUE."""
    rig = ready(**{"Actor.DriveParameter.ReferenceTorque": 4.0})
    additive = Watched(rig, "MC_TorqueAdditive", Value=0.5)
    additive.call(Enable=True)
    assert rig.port.additive_nm == 0.5
    additive.call(Value=-0.25)
    assert rig.port.additive_nm == -0.25
    limits = Watched(rig, "MC_TorqueRange", UpperLimit=2.0, LowerLimit=-1.0)
    limits.call(Enable=True)
    assert rig.port.torque_range == (0.5, -0.25)
    limits.call(UpperLimit=3.0)
    assert rig.port.torque_range == (0.75, -0.25)
    limits.call(Enable=False)
    assert rig.port.torque_range == (1.0, -1.0)
    limiting = Watched(rig, "MC_TorqueLimiting", Limit=2.0)
    limiting.call(Enable=True)
    assert rig.port.torque_share == 0.5
    limiting.call(Limit=1.0)
    assert rig.port.torque_share == 0.25
    limiting.call(Mode=1)
    assert rig.axis.torque.limits.detects


@pytest.mark.requirement("MC-083")
def test_the_end_of_an_enable_job():
    """The effect goes with the level, and Busy with it."""
    rig = ready()
    additive = Watched(rig, "MC_TorqueAdditive", Value=0.5)
    additive.call(Enable=True)
    assert not additive.call(Enable=False)["Busy"]
    assert rig.port.additive_nm == 0.0
    limiting = Watched(rig, "MC_TorqueLimiting", Limit=1.0)
    limiting.call(Enable=True)
    assert not limiting.call(Enable=False)["Busy"]
    assert rig.port.torque_share is None


@pytest.mark.requirement("MC-085")
@pytest.mark.parametrize(
    ("name", "wrong", "right"),
    [
        ("MC_TorqueAdditive", {"Value": 2.0e12}, {"Value": 0.5}),
        ("MC_TorqueRange", {"UpperLimit": 0.0, "LowerLimit": 1.0}, {"UpperLimit": 2.0}),
        ("MC_TorqueLimiting", {"Limit": float("nan")}, {"Limit": 1.0}),
    ],
)
def test_an_enable_job_in_error_needs_a_new_edge(name, wrong, right):
    """Error stays while Enable does, also with values that are permitted again; the next edge starts the
    function.
    """
    rig = ready()
    one = Watched(rig, name)
    one.call(Enable=True)
    assert one.call(**wrong)["Error"]
    shown = one.call(**right)
    assert (shown["Error"], shown["Busy"]) == (True, False)
    assert one.calls[-1]["ErrorID"] != 0
    assert not any(one.call(Enable=False).values())
    assert one.call(Enable=True)["Busy"]


@pytest.mark.requirement("MC-598", "MC-068", "MC-077", "MC-081", "G2-006")
@pytest.mark.parametrize("row", EXECUTE, ids=[row[0] for row in EXECUTE])
def test_pulse_of_one_call_then_the_end(row):
    """Execute TRUE for one call: exactly one call shows the end of the job, none after it shows anything."""
    name, _, success, _, _, inputs, ends = row
    rig = prepared(name)
    one = Watched(rig, name, **inputs)
    one.call(Execute=True)
    one.call(Execute=False)
    for _ in range(400 if ends else 100):
        one.call()
    if not ends:
        rig.axis.halt()
        for _ in range(20):
            one.call()
    counts = one.counts()
    assert counts["Done" if ends else "CommandAborted"] == 1, counts
    assert sum(counts[output] for output in TERMINAL) == 1
    assert not any(one.calls[-1].values())
    assert success == "Done" or any(call[success] for call in one.calls)


@pytest.mark.requirement("MC-598", "MC-068", "MC-079")
@pytest.mark.parametrize(
    "name", [row[0] for row in EXECUTE if row[0].startswith(("MC_Move", "MC_Halt", "MC_Stop"))]
)
def test_pulse_of_one_call_then_an_abort(name):
    """A job that was started by a pulse and is aborted by the disabling shows CommandAborted in one call."""
    rig = prepared(name)
    inputs = dict(next(row[5] for row in EXECUTE if row[0] == name))
    if name.endswith(("Absolute", "Relative", "Superimposed")):
        inputs |= dict.fromkeys(inputs, 100.0)
    one = Watched(rig, name, **inputs)
    one.call(Execute=True)
    one.call(Execute=False)
    rig.axis.power(False)
    for _ in range(20):
        one.call()
    assert [one.counts()[output] for output in TERMINAL] == [0, 1, 0]


@pytest.mark.requirement("MC-598", "MC-080", "MC-059", "MC-014", "MC-073")
@pytest.mark.parametrize("name", [row[0] for row in EXECUTE])
def test_pulse_of_one_call_that_is_refused(name):
    """The refusal is shown in the call of the edge and in no other; the instance was never Busy."""
    rig = prepared(name)
    one = Watched(rig, name, **ILLEGAL[name])
    first = one.call(Execute=True)
    assert first["Error"]
    assert first["ErrorID"] != 0
    for _ in range(5):
        assert not any(one.call(Execute=False).values())
    assert one.counts() == {"Busy": 0, "Done": 0, "CommandAborted": 0, "Error": 1}


@pytest.mark.requirement("MC-598", "MC-466", "MC-047", "CFG-054")
def test_pulse_of_one_call_for_the_card(tmp_path):
    """MC_SaveAbsoluteEncoderData has no axis and serves every object; its end is shown in one call as
    well.
    """
    rig = Rig(variables={"Sensor[1].Type": 1})
    rig.runtime.insert_card(tmp_path)
    save = MC_SaveAbsoluteEncoderData(rig.runtime)
    shown = []
    for number in range(10):
        save(Execute=number == 0)
        shown.append((save.Busy, save.Done, save.Error))
        rig.cycles(1)
    assert shown.count((False, True, False)) == 1
    assert shown[0] == (True, False, False)
    assert shown[-1] == (False, False, False)
    assert not hasattr(save, "CommandAborted")

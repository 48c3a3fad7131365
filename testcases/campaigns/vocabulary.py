"""The vocabulary of matrix campaigns that ships with the product: jobs, moments, stops and faults of a
positioning axis.

What is expected of a combination is derived: a stop has ramp, time and travel of `stop_modes`, two stops what
the superseding matrix says, a fault its alarm and reaction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from hil.campaign import CaseContext
from testcases.campaigns._matrix_faults import FAULTS
from testcases.campaigns._matrix_jobs import JOBS, MOMENTS, bring
from testcases.campaigns._matrix_reactions import fault_in_motion, fault_in_stop
from testcases.campaigns._matrix_stops import superseded, verdict
from testcases.campaigns.stop_modes import STOPS, WORDS, stops_as_specified
from testcases.campaigns.support import enable

NONE: Final = "none"
_DRIVES: Final = {
    "cia402": "CiA 402", "profidrive": "PROFIdrive", "analog": "analog setpoint", "stepper": "stepper motor",
}  # fmt: skip
_TRANSPORTS: Final = {
    "can": "CAN",
    "can-1ms": "CAN with 1 ms",
    "modbus-tcp": "Modbus TCP",
    "modbus-rtu": "Modbus RTU",
    "pulses": "pulses",
}
_SLOW: Final = ("starting", "arriving", "standstill")


class AxisVocabulary:
    """Jobs, moments, stops, second stops and faults of a positioning axis; see `hil.matrix.Vocabulary`."""

    factors: Final[Mapping[str, Mapping[str, str]]] = {
        "drive": _DRIVES,
        "transport": _TRANSPORTS,
        "job": JOBS,
        "moment": MOMENTS,
        "stop": {NONE: "no stop", **WORDS},
        "then": {NONE: "no second stop", **WORDS},
        "fault": {NONE: "no fault", **{name: word.words for name, word in FAULTS.items()}},
    }
    defaults: Final[Mapping[str, str]] = {
        "job": "velocity", "moment": "constant", "stop": NONE, "then": NONE, "fault": NONE,
    }  # fmt: skip
    benches: Final[Mapping[tuple[str, str], str]] = {
        ("cia402", "can"): "reference",
        ("cia402", "can-1ms"): "fast",
        ("profidrive", "can"): "profidrive",
        ("profidrive", "modbus-tcp"): "profidrive_tcp",
        ("profidrive", "modbus-rtu"): "profidrive_rtu",
        ("analog", "modbus-tcp"): "analog",
        ("stepper", "pulses"): "stepper",
    }

    def impossible(self, values: Mapping[str, str]) -> str:
        """Return why a combination cannot exist."""
        job, moment = values.get("job"), values.get("moment")
        stop, then, fault = values.get("stop"), values.get("then"), values.get("fault")
        if stop == then == fault == NONE:
            return "nothing happens"
        if moment == "standstill" and job not in {None, "velocity"}:
            return "at standstill no job has been started; it is there with the job velocity"
        if then not in {None, NONE}:
            if stop == NONE:
                return "a second stop needs a first one"
            if fault not in {None, NONE}:
                return "a second stop and a fault are not combined"
            if stop is not None and verdict(stop, then)[1] == "-":
                return "the superseding matrix has no such pair of stops"
            if moment in _SLOW:
                return "the first stop is over before the second one comes"
        if fault not in {None, NONE}:
            return self._fault_impossible(values, str(fault))
        return ""

    def _fault_impossible(self, values: Mapping[str, str], fault: str) -> str:
        word = FAULTS[fault]
        stop = values.get("stop")
        if "transport" in values and values["transport"] not in word.transports:
            return "the fault belongs to another transport"
        if "drive" in values and values["drive"] not in word.drives:
            return "the fault belongs to another drive"
        if word.moving and values.get("moment") in _SLOW:
            return "the fault shows only while the axis moves well"
        if stop not in {None, NONE}:
            if word.moving or word.controller or (word.alarm is not None and word.alarm[1] != 4):
                return "the fault is judged without a stop"
            if values.get("moment") in _SLOW:
                return "the stop is over before the fault comes"
        return ""

    def title(self, values: Mapping[str, str]) -> str:
        """Return what a combination tests, in words."""
        moment = MOMENTS[values["moment"]]
        where = moment if values["moment"] == "standstill" else f"{JOBS[values['job']]}, {moment}"
        happens = [
            self.factors[factor][values[factor]]
            for factor in ("stop", "then", "fault")
            if values[factor] != NONE
        ]
        text = f"{', then '.join(happens)}: {where}"
        if "drive" in values:
            text += f" ({_DRIVES[values['drive']]}, {_TRANSPORTS[values['transport']]})"
        return text

    def requirements(self, values: Mapping[str, str]) -> Sequence[str]:
        """Return the identifiers that a combination checks."""
        stop, then, fault = values["stop"], values["then"], values["fault"]
        if then != NONE:
            return ("STP-575", *verdict(stop, then)[0])
        if fault != NONE:
            return FAULTS[fault].requirements
        return tuple(STOPS[stop]["ids"])

    def run(self, ctx: CaseContext, values: Mapping[str, str]) -> None:
        """Bring the axis into the moment, let happen what is to happen, and state what is expected."""
        stop, then, fault = values["stop"], values["then"], values["fault"]
        enable(ctx)
        job = bring(ctx, values["job"], values["moment"])
        if fault != NONE and stop != NONE:
            fault_in_stop(ctx, FAULTS[fault], stop)
        elif fault != NONE:
            fault_in_motion(ctx, FAULTS[fault], values["moment"], job)
        elif then != NONE:
            superseded(ctx, stop, then, job)
        else:
            stops_as_specified(ctx, stop, values["moment"], job)


VOCABULARY: Final = AxisVocabulary()

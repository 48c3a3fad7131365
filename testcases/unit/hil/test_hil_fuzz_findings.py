"""Programs that searches have once found something with, on the bench and configuration that they were found
on.
"""

import pytest

from hil.bench import load_bench
from hil.fuzz import Program, run_program

ON = [{"do": "power_on"}, {"wait": 0.3}]
SLOW = {"configuration": {"interpolator": {"bench": {"interpolator_ms": 16}}}}
FINDINGS = {
    "a refusal of Modbus at an I/O station": (
        "analog",
        [{"fault": {"kind": "modbus.exception", "duration_s": 0.02, "parameters": {"code": 1}}}],
    ),
    "a word that the telegram has not": (
        "stepper",
        [{"fault": {"kind": "telegram.scale", "parameters": {"signal": "NSOLL_B", "factor": 0.0}}}],
    ),
    "a response that is cut off": (
        "profidrive_tcp",
        [{"fault": {"kind": "modbus.truncate", "duration_s": 0.02, "parameters": {"length": 14}}}],
    ),
    "a fault of an analog drive": (
        "analog",
        [
            *ON,
            {
                "fault": {
                    "kind": "drive.fault",
                    "duration_s": 0.02,
                    "parameters": {"code": 8976, "persistent": False},
                }
            },
        ],
    ),
    "a stop within a cycle of the interpolator": (
        "reference",
        [SLOW, *ON, {"do": "move_velocity", "velocity": 10.0}, {"do": "power_off", "stop_mode": 2}],
    ),
    "a stop while the controller stands still": (
        "reference",
        [
            *ON,
            {"do": "move_relative", "distance": 10.0, "velocity": 10.0},
            {"do": "power_off", "stop_mode": 2},
            {"fault": {"kind": "controller.stall", "duration_s": 0.02}},
        ],
    ),
    "an axis with a slow bus that comes up": ("profidrive_rtu", ON),
    "a warning while the drive starts": (
        "profidrive",
        [
            {"fault": {"kind": "drive.reset", "parameters": {"boot_s": 0.02}}},
            {"fault": {"kind": "drive.warning", "duration_s": 0.02}},
        ],
    ),
    "a restart while the drive warns": (
        "profidrive",
        [
            {"fault": {"kind": "drive.warning", "duration_s": 0.04}},
            {"fault": {"kind": "drive.reset", "parameters": {"boot_s": 0.02}}},
        ],
    ),
    "a speed axis between cycles of the interpolator": (
        "speed",
        [SLOW, *ON, {"do": "move_velocity", "velocity": 100.0}],
    ),
}


@pytest.mark.parametrize("name", FINDINGS)
def test_what_was_found_stays_corrected(name):
    """No invariant and no rule is broken any more."""
    bench, steps = FINDINGS[name]
    assert run_program(Program.from_json(steps), load_bench(bench)).violation is None

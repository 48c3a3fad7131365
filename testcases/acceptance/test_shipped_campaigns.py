"""The campaigns that ship with the product pass on the embedded benches; each case is a test with its
requirements.

Of most campaigns a sample runs: a case of every family, and one for every requirement, on one of the
benches. With HYPOTHESIS_PROFILE=nightly all cases run on all benches, and so they do with
`python -m testcases.digests`.
"""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path

import pytest

from hil.campaign import SHIPPED, CaseSettings, execute_case, load_bench_file, requirements_here
from reports.model import Verdict
from testcases.campaigns import (
    ads_device,
    analog_drive,
    as_new,
    axis_borders,
    axis_configurations,
    axis_faults,
    axis_motion,
    axis_options,
    axis_services,
    axis_signals,
    axis_values,
    bus_log,
    bus_parts,
    camming,
    cams,
    can_adapter,
    can_bus,
    can_traffic,
    canopen_device,
    canopen_master,
    canopen_services,
    cia402_details,
    cia402_drive,
    cia402_homing,
    cia402_modes,
    cia402_options,
    commissioning,
    control,
    control_unit,
    controller_data,
    controllers,
    device_again,
    device_objects,
    device_settings,
    drive_faults,
    drive_parameters,
    drive_parts,
    drives_of_eds,
    eds_files,
    encoder_states,
    encoders,
    external_encoder,
    fault_effects,
    fault_ends,
    fault_reactions,
    gearing,
    holding_brake,
    homing,
    homing_anywhere,
    initial_states,
    instruction_makes,
    instructions,
    io_parts,
    job_dynamics,
    job_queue,
    leading_values,
    library,
    limits,
    limits_in_motion,
    machine_law,
    machine_parts,
    measuring_inputs,
    modbus_faults,
    modbus_services,
    modbus_stations,
    modulo_axis,
    monitoring,
    motion_in,
    nc_axes,
    nc_components,
    nc_drives,
    nc_machines,
    nc_options,
    nc_situations,
    node_guarding,
    object_lifecycles,
    parameter_access,
    personalities,
    profidrive_channels,
    profidrive_facts,
    profidrive_options,
    profidrive_parameters,
    profidrive_positioner,
    profidrive_safety,
    profidrive_speed,
    profidrive_words,
    pulse_module,
    rare_jobs,
    repeated,
    servo_core,
    stop_modes,
    stops_meet,
    synchronising,
    synchronous_jobs,
    telegram_faults,
    time_and_logs,
    vendor_drives,
)

WHOLE = os.environ.get("HYPOTHESIS_PROFILE") == "nightly"
LARGE = (
    fault_reactions.CAMPAIGN,
    axis_faults.CAMPAIGN,
    homing.CAMPAIGN,
    limits.CAMPAIGN,
    motion_in.CAMPAIGN,
    commissioning.CAMPAIGN,
)
SMALL_ON_CANOPEN = (
    stop_modes.CAMPAIGN,
    drive_faults.CAMPAIGN,
    axis_signals.CAMPAIGN,
    cia402_drive.CAMPAIGN,
)
ON_CANOPEN = (*SMALL_ON_CANOPEN, *LARGE)
ON_PROFIDRIVE = (drive_faults.CAMPAIGN, telegram_faults.CAMPAIGN)
SAMPLED_ON_PROFIDRIVE = (*LARGE, monitoring.CAMPAIGN)
"""What the controller does, whatever its drive; causes inside of a drive are in the campaigns above."""
SERVICES = "testcases.campaigns.modbus_services"
GUARDED = "testcases.campaigns.profidrive_safety"
CAN_BUS = "testcases.campaigns.can_bus:BENCH"
SPEED = "testcases.campaigns.profidrive_speed:BENCH"
POSITIONER = "testcases.campaigns.profidrive_positioner:BENCH"
WITH_ENCODERS = "testcases.campaigns.external_encoder:{}"
BLOCKED = {
    ("profidrive", "drive-faults/withdrawn/constant"): "offers no force_switch_on_disabled",
    ("profidrive", "drive-faults/withdrawn/standstill"): "offers no force_switch_on_disabled",
    **{
        ("reference", f"homing/search-fails/{code}"): "an encoder with a PROFIdrive interface"
        for code in ("0001", "0002", "0004", "0005")
    },
    (
        "reference",
        "external-encoder/follows/wheel/forward",
    ): "external encoders, as the benches REFERENCE and PROFIDRIVE",
    **{
        ("reference", f"motion-in/telegram/{kind}"): "a drive with a PROFIdrive telegram"
        for kind in ("freeze", "late", "sign_of_life")
    },
    **{
        ("reference", case.identifier): "dynamic servo control"
        for case in control.CAMPAIGN.cases
        if case.parameters.get("where") == "drive" or "telegram" in case.identifier
    },
    ("reference", "control/safety/ss2/controller"): "offers no set_ss2",
    **{
        ("reference", f"monitoring/late/{cycles}"): "controlled by no PROFIdrive telegram"
        for cycles in (1, 2)
    },
}
"""Cases that a bench cannot have, and why: a PROFIdrive axis has no such state to fall to without fault or
safety input, a CiA 402
drive no words of its encoder."""


def possible(bench, campaign):
    """Return the cases that a bench can have."""
    return [case for case in campaign.cases if (bench, case.identifier) not in BLOCKED]


COVERED: dict[str, set[str]] = {}
"""Families and requirements of each campaign (by title) that the cases so far have, whatever their bench."""


def sample(bench, campaign, profile):
    """Return the first case of every family, and one for every requirement that they leave out.

    On a second bench these are the cases whose requirements no case of the first one has, and one more.
    """
    covered = COVERED.setdefault(campaign.title, set())
    chosen = []
    for case in possible(bench, campaign):
        facts = {case.identifier.rpartition("/")[0], *requirements_here(case.requirements, [profile])}
        if not chosen or facts - covered:
            covered |= facts
            chosen.append(case)
    return chosen


def cases(bench, profile, campaigns, *, sampled=False):
    """Yield the cases of campaigns; all but the first of each are exhaustive."""
    for campaign in campaigns:
        quick = True
        whole = WHOLE or not sampled
        for case in possible(bench, campaign) if whole else sample(bench, campaign, profile):
            marks = [pytest.mark.requirement(*requirements_here(case.requirements, [profile]))]
            if not quick:
                marks.append(pytest.mark.exhaustive)
            quick = False
            yield pytest.param(bench, case, id=f"{bench.rpartition(':')[2]}-{case.identifier}", marks=marks)


def few(bench, campaigns):
    """Yield every twelfth case of the samples of campaigns."""
    for campaign in campaigns:
        yield from list(cases(bench, "cia402", [campaign], sampled=True))[:: None if WHOLE else 12]


def some(bench, profile, campaigns):
    """Yield every twentieth case of campaigns whose cases each have many checks."""
    for campaign in campaigns:
        yield from list(cases(bench, profile, [campaign]))[:: None if WHOLE else 20]


@cache
def bench_file(name):
    return load_bench_file(name)


@pytest.mark.parametrize(
    ("bench", "case"),
    [
        *cases("reference", "cia402", SMALL_ON_CANOPEN, sampled=True),
        *cases("reference", "cia402", LARGE, sampled=True),
        *cases("profidrive", "profidrive", ON_PROFIDRIVE, sampled=True),
        *cases("profidrive", "profidrive", SAMPLED_ON_PROFIDRIVE, sampled=True),
        *cases("reference", "cia402", [monitoring.CAMPAIGN], sampled=True),
        *cases("profidrive", "profidrive", [control.CAMPAIGN], sampled=True),
        *cases("reference", "cia402", [control.CAMPAIGN], sampled=True),
        *cases("reference", "cia402", [axis_motion.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns.modulo_axis:BENCH", "cia402", [modulo_axis.CAMPAIGN]),
        *cases("testcases.campaigns.axis_motion:SLOW", "cia402", [axis_motion.INTERPOLATOR]),
        *cases("testcases.campaigns.axis_motion:TWO", "cia402", [axis_motion.ENCODERS]),
        *cases("testcases.campaigns.axis_motion:PLAY", "cia402", [axis_motion.BACKLASH]),
        *cases("profidrive_tcp", "profidrive", [modbus_faults.CAMPAIGN], sampled=True),
        *cases("profidrive_rtu", "profidrive", [modbus_faults.LINE], sampled=True),
        *cases("testcases.campaigns.modbus_faults:UNWATCHED", "profidrive", [modbus_faults.MONITORED]),
        *cases("profidrive", "profidrive", [axis_signals.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns._hanging_load:BENCH", "cia402", [holding_brake.CAMPAIGN]),
        *cases("testcases.campaigns._led_drive:BENCH", "profidrive", [profidrive_words.CAMPAIGN]),
        *cases("testcases.campaigns._led_servo:BENCH", "cia402", [cia402_modes.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns._led_servo:BENCH", "cia402", [canopen_services.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns.encoders:BENCH", "profidrive", [encoders.CAMPAIGN], sampled=True),
        *cases(f"{SERVICES}:TCP", "profidrive", [modbus_services.CAMPAIGN], sampled=True),
        *cases(f"{SERVICES}:LINE", "profidrive", [modbus_services.ON_A_LINE], sampled=True),
        *cases(f"{SERVICES}:MAILBOX", "profidrive", [modbus_services.WITH_MAILBOX], sampled=True),
        *cases(SPEED, "profidrive", [profidrive_speed.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns.node_guarding:BENCH", "cia402", [node_guarding.CAMPAIGN], sampled=True),
        *cases(POSITIONER, "profidrive", [profidrive_positioner.CAMPAIGN], sampled=True),
        *cases("testcases.campaigns.nc_axes:BENCH", "cia402", [nc_axes.CAMPAIGN], sampled=True),
        *cases(WITH_ENCODERS.format("REFERENCE"), "cia402", [external_encoder.CAMPAIGN], sampled=True),
        *cases(WITH_ENCODERS.format("PROFIDRIVE"), "profidrive", [external_encoder.CAMPAIGN], sampled=True),
        *some(CAN_BUS, "cia402", [can_bus.CAMPAIGN, canopen_device.CAMPAIGN, can_adapter.CAMPAIGN]),
        *some(CAN_BUS, "cia402", [can_traffic.CAMPAIGN, canopen_master.CAMPAIGN]),
        *some(CAN_BUS, "cia402", [eds_files.CAMPAIGN, time_and_logs.CAMPAIGN]),
        *some(CAN_BUS, "cia402", [device_settings.CAMPAIGN, machine_parts.CAMPAIGN, servo_core.CAMPAIGN]),
        *some(CAN_BUS, "cia402", [drive_parts.CAMPAIGN, as_new.CAMPAIGN]),
        *some(CAN_BUS, "cia402", [cia402_options.CAMPAIGN, vendor_drives.CAMPAIGN, bus_parts.CAMPAIGN]),
        *some(CAN_BUS, "profidrive", [profidrive_options.CAMPAIGN, profidrive_facts.CAMPAIGN]),
        *some(
            CAN_BUS,
            "profidrive",
            [profidrive_channels.CAMPAIGN, io_parts.CAMPAIGN, parameter_access.CAMPAIGN],
        ),
        *some(CAN_BUS, "cia402", [modbus_stations.CAMPAIGN, ads_device.CAMPAIGN, analog_drive.CAMPAIGN]),
        *some("testcases.campaigns.personalities:RETRY", "cia402", [personalities.OF_RETRY]),
        *some(CAN_BUS, "profidrive", [encoder_states.CAMPAIGN, pulse_module.CAMPAIGN, control_unit.CAMPAIGN]),
        *some(f"{GUARDED}:BENCH", "profidrive", [profidrive_safety.CAMPAIGN]),
        *some(SPEED, "profidrive", [profidrive_safety.FUNCTIONS]),
        *some("testcases.campaigns.cia402_details:BENCH", "cia402", [cia402_details.CAMPAIGN]),
        *some(f"{SERVICES}:TCP", "profidrive", [profidrive_parameters.CAMPAIGN]),
        *few(SPEED, [device_again.OF_SPEED]),
        *few("testcases.campaigns.cia402_homing:PLAIN", [cia402_homing.CAMPAIGN]),
        *few("testcases.campaigns.machine_law:BENCH", [machine_law.CAMPAIGN]),
        *few("testcases.campaigns.machine_law:BRAKED", [machine_law.OF_BRAKE]),
        *few("testcases.campaigns.cia402_details:TOLERANT", [cia402_details.OF_WARNINGS]),
        *few(POSITIONER, [device_again.OF_TASKS]),
        *few("testcases.campaigns._led_servo:BENCH", [fault_effects.OF_SERVO]),
        *few("testcases.campaigns.fault_ends:EQUIPPED", [fault_ends.CAMPAIGN]),
        *few("testcases.campaigns.fault_ends:SHAFTS", [fault_ends.OF_ENCODERS]),
        *few("testcases.campaigns.nc_machines:BENCH", [nc_machines.CAMPAIGN]),
        *few("testcases.campaigns.cams:BENCH", [cams.CAMPAIGN]),
        *few("testcases.campaigns._led_servo:BENCH", [bus_log.CAMPAIGN]),
        *few("testcases.campaigns.device_objects:BENCH", [device_objects.CAMPAIGN]),
        *few("testcases.campaigns.device_again:BENCH", [device_again.CAMPAIGN]),
        *few("reference", [controllers.STATES, repeated.CAMPAIGN, initial_states.CAMPAIGN]),
        *few("reference", [axis_borders.CAMPAIGN, axis_services.CAMPAIGN]),
        *few("reference", [axis_values.CAMPAIGN, homing_anywhere.CAMPAIGN]),
        *few("testcases.campaigns.axis_services:ABSOLUTE", [axis_services.OF_CARDS]),
        *few("reference", [job_dynamics.CAMPAIGN]),
        *list(few("reference", [instructions.CAMPAIGN]))[:: 1 if WHOLE else 2],
        *few("testcases.campaigns.instruction_makes:S7_1200_G2", [instruction_makes.OF_G2]),
        *few("speed", [instruction_makes.SPEED_AXIS]),
        *few("testcases.campaigns.axis_options:PROBES", [axis_options.MEASURING]),
        *few("testcases.campaigns.axis_options:TORQUE_BENCH", [axis_options.TORQUE]),
        *few("testcases.campaigns.axis_options:IN_POUND_FEET", [axis_options.OTHER_UNIT]),
        *few("testcases.campaigns.axis_options:SIMULATED_BENCH", [axis_options.SIMULATED]),
        *few("testcases.campaigns.measuring_inputs:REFERENCE", [measuring_inputs.CAMPAIGN]),
        *few("testcases.campaigns.controllers:CELL", [controllers.PROXIES]),
        *few("testcases.campaigns.controller_data:ABSOLUTE", [controller_data.CARD]),
        *few("testcases.campaigns.controller_data:UNWATCHED", [controller_data.BITS]),
        *few("testcases.campaigns.controller_data:BLOCK", [controller_data.WORDS]),
        *few("testcases.campaigns.nc_options:LAWS", [nc_options.OF_LAWS]),
        *few("testcases.campaigns.nc_options:OUTPUTS", [nc_options.OF_OUTPUTS]),
        *few("testcases.campaigns.nc_options:KEPT", [nc_options.OF_TASKS]),
        *few("testcases.campaigns.nc_components:SINGLES", [nc_components.OF_SINGLES]),
        *few("testcases.campaigns.nc_components:OUTPUTS", [nc_components.OF_OUTPUTS]),
        *few("testcases.campaigns.axis_configurations:AXES", [axis_configurations.OF_AXES]),
        *few("testcases.campaigns.drive_parameters:ON_MODBUS", [drive_parameters.OF_MODBUS]),
        *few("reference", [library.CAMPAIGN, limits_in_motion.CAMPAIGN, job_queue.QUEUE]),
        *few("reference", [rare_jobs.CAMPAIGN, stops_meet.CAMPAIGN]),
        *few("testcases.campaigns.controllers:CELL", [object_lifecycles.OF_PROXIES]),
        *few("testcases.campaigns.nc_drives:HOIST", [nc_situations.OF_HOIST]),
        *some("reference", "cia402", [drives_of_eds.CAMPAIGN]),
        *few("testcases.campaigns.nc_drives:TORQUE", [nc_drives.OF_TORQUE]),
        *few("testcases.campaigns.nc_drives:BOTH_EDGES", [nc_drives.OF_EDGES]),
        *few("testcases.campaigns.nc_drives:HOIST", [nc_drives.OF_HOIST]),
        *few("synchronous", [gearing.CAMPAIGN, camming.CAMPAIGN, leading_values.CAMPAIGN]),
        *few("testcases.campaigns.gearing:ROUND", [gearing.TURNING]),
        *few("testcases.campaigns.synchronising:OPEN", [synchronising.CAMPAIGN]),
        *few("testcases.campaigns.synchronising:ROUND", [synchronising.TURNING]),
        *few("testcases.campaigns.synchronous_jobs:WITH_LINE", [synchronous_jobs.CAMPAIGN]),
        *few("testcases.campaigns.leading_values:ACTUAL", [leading_values.COUPLINGS]),
        *few("testcases.campaigns.leading_values:DIFFERENT", [leading_values.OTHER_VALUES]),
        *few("testcases.campaigns.leading_values:MODULO", [leading_values.RANGES]),
        *few("testcases.campaigns.leading_values:ACROSS", [leading_values.PROXIES]),
    ],
)
def test_case_passes(bench, case):
    """Every shipped case passes: stop, alarm, reaction, standstill and all always-on checkers."""
    result = execute_case(case, bench_file(bench), CaseSettings(seed=1)).result

    assert result.verdict is Verdict.PASSED, result.message


@pytest.mark.parametrize(("bench", "identifier"), BLOCKED)
def test_what_a_profile_cannot_have_is_blocked_with_its_reason(bench, identifier):
    """A case whose fault the drive has no seam for is blocked, not passed, and says why."""
    campaigns = (*ON_CANOPEN, external_encoder.CAMPAIGN, monitoring.CAMPAIGN, control.CAMPAIGN)
    (case,) = [campaign[identifier] for campaign in campaigns if identifier in campaign]
    result = execute_case(case, bench_file(bench), CaseSettings(seed=1)).result

    assert result.verdict is Verdict.BLOCKED
    assert BLOCKED[bench, identifier] in result.message


def test_a_bench_speaks_for_the_requirements_of_its_own_profiles_only():
    """A case that names requirements of both profiles claims those of the bench that it runs on (and every
    neutral one).
    """
    case = fault_reactions.CAMPAIGN["fault-reactions/drive-fault/2310/standstill"]
    claimed = {
        name: set(execute_case(case, bench_file(name), CaseSettings(seed=1)).result.requirements)
        for name in ("reference", "profidrive")
    }

    assert claimed["reference"] == {"STP-559", "TA-020", "C402-014", "C402-015"}
    assert claimed["profidrive"] == {"STP-559", "TA-020", "PD-104", "PD-115"}


def test_the_campaign_crosses_all_stops_with_all_phases():
    """Four StopModes, three MC_Stop modes, four reactions and MC_Halt are crossed with four phases of
    motion.
    """
    assert {case.identifier for case in stop_modes.CAMPAIGN.cases} == {
        f"stop-modes/{stop}/{phase}"
        for stop in (
            "power-0",
            "power-1",
            "power-2",
            "power-3",
            "stop-0",
            "stop-2",
            "stop-3",
            "reaction-1",
            "reaction-2",
            "reaction-3",
            "reaction-4",
            "halt",
        )
        for phase in ("constant", "accelerating", "decelerating", "standstill")
    }


CAMPAIGNS = re.compile(r"= _?[Cc]ampaign\(")
"""A module has a campaign; `_campaign` is one of its own functions that makes it."""


def test_every_campaign_of_the_package_has_a_short_name():
    """No module with a campaign and no matrix file is left out of the list that `hil run` shows."""
    folder = Path(stop_modes.__file__).parent
    modules = {path.stem for path in folder.glob("[!_]*.py") if CAMPAIGNS.search(path.read_text("utf-8"))}
    matrices = {path.stem for path in folder.glob("*.toml")}
    assert {one.name for one in SHIPPED if not one.matrix} == modules - {"own_axis", "support", "vocabulary"}
    assert {one.name for one in SHIPPED if one.matrix} == matrices

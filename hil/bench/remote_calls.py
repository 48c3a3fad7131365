"""What a bench may ask of the devices in the drive process, by the name of the method."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import HilError
from hil.bench.devices import DEVICE_METHODS
from hil.bench.encoders import ENCODER_METHODS

FAULT_METHODS: Final = frozenset(
    (
        "raise_fault",
        "clear_fault_cause",
        "set_sto",
        "freeze_encoder",
        "jump_encoder",
        "suppress_index",
        "invert_input",
        "swap_limit_switches",
        "jam",
        "set_load_force",
        "set_added_friction",
        "slip_coupling",
        "break_coupling",
        "set_added_backlash",
        "force_input",
        "stop_heartbeat",
        "power_off",
        "power_on",
        "set_encoder_noise",
        "reverse_encoder",
        "lose_encoder_steps",
        "set_ss1",
        "set_ss2",
        "set_sos",
        "set_sbc",
        "set_sls",
        "set_sdi",
        "set_slp",
        "acknowledge_safety",
        "open_interlock",
        "delay_heartbeat",
        "disconnect_mains",
        "set_mains_voltage_share",
        "disconnect_phase",
        "set_dc_link_voltage",
        "restore_dc_link",
        "disable_chopper",
        "limit_torque",
        "set_brake_stuck",
        "set_brake_torque_share",
        "scale_ramps",
        "set_local_control",
        "refuse_transitions",
        "force_switch_on_disabled",
        "force_warning",
        "freeze_statusword",
        "override_statusword_bits",
        "toggle_target_reached",
        "override_mode_display",
        "reset_node",
        "abort_sdo",
        "suppress_sdo_responses",
        "repeat_emcy",
        "force_temperature",
        "set_encoder_drift",
        "set_encoder_scale",
        "break_encoder_wire",
        "set_encoder_error",
        "force_ready",
        "short_outputs",
        "restore_outputs",
        "disconnect_load_supply",
        "unplug_module",
        "report_encoder_error",
        "clear_encoder_error",
        "lose_steps",
        "set_clock_drift",
        "set_clock_jitter",
    )
)
"""Methods of a drive that may be called through the pipe."""


PARAMETER_METHODS: Final = frozenset(("read_parameter", "write_parameter", "request_parameters"))
"""What `RemoteParameters` sends through the pipe."""

REMOTE_METHODS: Final = FAULT_METHODS | ENCODER_METHODS | DEVICE_METHODS
"""Methods of any device that may be called through the pipe."""


class RemoteError(HilError):
    """The drive process failed or does not answer."""

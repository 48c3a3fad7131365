"""Emulated drives and encoders serve the seams of faults, with the types of the protocols: mypy checks
this file.
"""

from __future__ import annotations

from typing import Protocol

import pytest

from emulators.drive.analog import AnalogDrive
from emulators.drive.cia402.drive import CiA402Drive
from emulators.drive.profidrive.canopen.drive import ProfidriveCanDrive
from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
from emulators.drive.profidrive.second_encoder import SecondEncoder
from emulators.drive.stepper_can import StepperCanDrive
from emulators.encoder.cia406.encoder import CiA406Encoder
from emulators.encoder.profidrive.can import ProfidriveCanEncoder
from emulators.io import ModbusIoStation
from fieldbus.can import CanMedium
from fieldbus.can.live import LiveSegment
from hil.bench.bench import Bench
from hil.bench.modbus_links import ModbusSegment
from hil.faults import CATALOGUE, seams
from motion.drives.profidrive_can import ProfidriveCanPort
from motion.drives.profidrive_modbus import ProfidriveModbusPort
from motion.s7.controller import Controller


class CiA402DriveSeams(
    seams.KeepsFaultCauses,
    seams.HasSafeTorqueOff,
    seams.HasSupply,
    seams.SendsHeartbeat,
    seams.HasSafeStop1,
    seams.HasInterlock,
    seams.HasMains,
    seams.HasMainsVoltage,
    seams.HasMainsPhases,
    seams.HasDcLink,
    seams.HasBrakeChopper,
    seams.HasTemperatureSensors,
    seams.LimitsTorque,
    seams.HasHoldingBrake,
    seams.HasWearingBrake,
    seams.HasRamps,
    seams.HasLocalControl,
    seams.MakesTransitions,
    seams.CanDisableItself,
    seams.ShowsWarnings,
    seams.ShowsStatusword,
    seams.ShowsStatuswordBits,
    seams.ShowsTargetReached,
    seams.ShowsMode,
    seams.RestartsNode,
    seams.DelaysHeartbeat,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.AbortsSdo,
    seams.AnswersSdo,
    seams.SendsEmcy,
    seams.HasInputs,
    seams.HasInputPolarity,
    seams.HasLimitSwitches,
    seams.HasShaft,
    seams.HasLoad,
    seams.HasGuides,
    seams.HasCoupling,
    seams.HasBacklash,
    seams.HasBreakableCoupling,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasDriftingEncoder,
    seams.HasScaledEncoder,
    seams.HasEncoderWire,
    Protocol,
):
    """What faults can do to it."""


class ProfidriveCanDriveSeams(
    seams.KeepsFaultCauses,
    seams.HasSafeTorqueOff,
    seams.HasSupply,
    seams.SendsHeartbeat,
    seams.HasSafeStop1,
    seams.HasMains,
    seams.HasMainsVoltage,
    seams.HasMainsPhases,
    seams.HasDcLink,
    seams.HasBrakeChopper,
    seams.HasTemperatureSensors,
    seams.LimitsTorque,
    seams.HasHoldingBrake,
    seams.HasWearingBrake,
    seams.HasRamps,
    seams.MakesTransitions,
    seams.ShowsWarnings,
    seams.ShowsStatusword,
    seams.ShowsStatuswordBits,
    seams.RestartsNode,
    seams.DelaysHeartbeat,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.AbortsSdo,
    seams.AnswersSdo,
    seams.SendsEmcy,
    seams.HasSafeStop2,
    seams.HasSafeOperatingStop,
    seams.HasSafeBrakeControl,
    seams.HasSafelyLimitedSpeed,
    seams.HasSafeDirection,
    seams.HasSafelyLimitedPosition,
    seams.AcknowledgesSafety,
    seams.HasInputs,
    seams.HasInputPolarity,
    seams.HasLimitSwitches,
    seams.HasShaft,
    seams.HasLoad,
    seams.HasGuides,
    seams.HasCoupling,
    seams.HasBacklash,
    seams.HasBreakableCoupling,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasDriftingEncoder,
    seams.HasScaledEncoder,
    seams.HasEncoderWire,
    seams.ReportsEncoderErrors,
    Protocol,
):
    """What faults can do to it."""


class ProfidriveModbusDriveSeams(
    seams.KeepsFaultCauses,
    seams.HasSafeTorqueOff,
    seams.HasSupply,
    seams.HasSafeStop1,
    seams.HasMains,
    seams.HasMainsVoltage,
    seams.HasMainsPhases,
    seams.HasDcLink,
    seams.HasBrakeChopper,
    seams.HasTemperatureSensors,
    seams.LimitsTorque,
    seams.HasHoldingBrake,
    seams.HasWearingBrake,
    seams.HasRamps,
    seams.MakesTransitions,
    seams.ShowsWarnings,
    seams.ShowsStatusword,
    seams.ShowsStatuswordBits,
    seams.RestartsNode,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.HasSafeStop2,
    seams.HasSafeOperatingStop,
    seams.HasSafeBrakeControl,
    seams.HasSafelyLimitedSpeed,
    seams.HasSafeDirection,
    seams.HasSafelyLimitedPosition,
    seams.AcknowledgesSafety,
    seams.HasInputs,
    seams.HasInputPolarity,
    seams.HasLimitSwitches,
    seams.HasShaft,
    seams.HasLoad,
    seams.HasGuides,
    seams.HasCoupling,
    seams.HasBacklash,
    seams.HasBreakableCoupling,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasDriftingEncoder,
    seams.HasScaledEncoder,
    seams.HasEncoderWire,
    seams.ReportsEncoderErrors,
    Protocol,
):
    """What faults can do to it."""


class AnalogDriveSeams(
    seams.KeepsFaultCauses,
    seams.HasSafeTorqueOff,
    seams.HasSupply,
    seams.LimitsTorque,
    seams.HasHoldingBrake,
    seams.HasWearingBrake,
    seams.HasRamps,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.HasInputs,
    seams.HasInputPolarity,
    seams.HasLimitSwitches,
    seams.HasShaft,
    seams.HasLoad,
    seams.HasGuides,
    seams.HasCoupling,
    seams.HasBacklash,
    seams.HasBreakableCoupling,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasDriftingEncoder,
    seams.HasScaledEncoder,
    seams.HasEncoderWire,
    seams.HasReadySignal,
    Protocol,
):
    """What faults can do to it."""


class StepperCanDriveSeams(
    seams.KeepsFaultCauses,
    seams.HasSupply,
    seams.SendsHeartbeat,
    seams.RestartsNode,
    seams.DelaysHeartbeat,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.AbortsSdo,
    seams.AnswersSdo,
    seams.SendsEmcy,
    seams.HasInputs,
    seams.HasInputPolarity,
    seams.HasLimitSwitches,
    seams.HasShaft,
    seams.HasLoad,
    seams.HasReadySignal,
    seams.HasPulseOutputs,
    seams.HasLoadSupply,
    seams.IsPluggedIn,
    seams.HasEncoderFeedback,
    seams.HasStepperMotor,
    Protocol,
):
    """What faults can do to it."""


class CiA406EncoderSeams(
    seams.HasSupply,
    seams.SendsHeartbeat,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasPreset,
    seams.HasRange,
    seams.ReportsAlarms,
    seams.ReportsWarnings,
    seams.SendsCyclically,
    Protocol,
):
    """What faults can do to it."""


class ProfidriveCanEncoderSeams(
    seams.HasSupply,
    seams.SendsHeartbeat,
    seams.HasClock,
    seams.HasUnsteadyClock,
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasEncoderWire,
    seams.ReportsEncoderErrors,
    Protocol,
):
    """What faults can do to it."""


class SecondEncoderSeams(
    seams.HasEncoder,
    seams.HasJumpingEncoder,
    seams.HasNoisyEncoder,
    seams.HasReversibleEncoder,
    seams.HasLossyEncoder,
    seams.HasIndex,
    seams.HasEncoderWire,
    seams.ReportsEncoderErrors,
    Protocol,
):
    """What faults can do to it."""


def _typed(
    p0: CiA402Drive,
    p1: ProfidriveCanDrive,
    p2: ProfidriveModbusDrive,
    p3: AnalogDrive,
    p4: StepperCanDrive,
    p5: CiA406Encoder,
    p6: ProfidriveCanEncoder,
    p7: SecondEncoder,
) -> tuple[
    CiA402DriveSeams,
    ProfidriveCanDriveSeams,
    ProfidriveModbusDriveSeams,
    AnalogDriveSeams,
    StepperCanDriveSeams,
    CiA406EncoderSeams,
    ProfidriveCanEncoderSeams,
    SecondEncoderSeams,
]:
    """Never called: the type checker compares the signatures."""
    return p0, p1, p2, p3, p4, p5, p6, p7


def _typed_parts(
    medium: CanMedium,
    live: LiveSegment,
    modbus: ModbusSegment,
    station: ModbusIoStation,
    controller: Controller,
    on_can: ProfidriveCanPort,
    on_modbus: ProfidriveModbusPort,
    drive_on_can: ProfidriveCanDrive,
    drive_on_modbus: ProfidriveModbusDrive,
) -> tuple[
    seams.VirtualSegment,
    seams.BridgedSegment,
    seams.SegmentWithKernelGateway,
    seams.ModbusSegment,
    seams.IoStation,
    seams.ProgrammedController,
    seams.TelegramPort,
    seams.TelegramPort,
    seams.TelegramDevice,
    seams.TelegramDevice,
]:
    """Never called: the type checker compares the signatures."""
    return medium, live, live, modbus, station, controller, on_can, on_modbus, drive_on_can, drive_on_modbus


def _typed_bench(
    bench: Bench,
) -> tuple[
    seams.BenchWithEncoders,
    seams.BenchWithSecondEncoders,
    seams.BenchWithStations,
    seams.BenchWithController,
    seams.BenchWithPorts,
    seams.BenchWithSegments,
    seams.BenchWithNodes,
    seams.BenchWithComponents,
    seams.BenchWithAxes,
    seams.BenchWithVocabulary,
]:
    """Never called: the type checker compares the signatures."""
    return bench, bench, bench, bench, bench, bench, bench, bench, bench, bench


DEVICES = ("drive", "switch", "mechanics", "encoder")
OFFERED: dict[type, type] = {
    CiA402Drive: CiA402DriveSeams,
    ProfidriveCanDrive: ProfidriveCanDriveSeams,
    ProfidriveModbusDrive: ProfidriveModbusDriveSeams,
    AnalogDrive: AnalogDriveSeams,
    StepperCanDrive: StepperCanDriveSeams,
    CiA406Encoder: CiA406EncoderSeams,
    ProfidriveCanEncoder: ProfidriveCanEncoderSeams,
    SecondEncoder: SecondEncoderSeams,
}


@pytest.mark.parametrize("device", OFFERED, ids=lambda device: device.__name__)
def test_a_device_offers_the_seams_that_are_checked_for_it(device: type) -> None:
    """The protocols in this file are those of the kinds that a device serves, no more and no fewer."""
    needs = {entry.effect.needs for entry in CATALOGUE if entry.target in DEVICES} - {None}
    served = {seam for seam in needs if seam is not None and seams.offers(device, seam)}
    assert served == set(OFFERED[device].__bases__) - {Protocol}


def test_every_kind_at_a_device_is_served_by_one() -> None:
    """No kind needs what no emulated drive and no emulated encoder offers."""
    for entry in CATALOGUE:
        if entry.target in DEVICES and entry.effect.needs is not None:
            assert any(not seams.missing(device, entry.effect.needs) for device in OFFERED), entry.name

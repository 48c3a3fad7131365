"""Transfer of parameters and data blocks with the emulated PROFIdrive axis on a bench."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import pytest

from fieldbus.profidrive.requests import ParameterError
from hil.bench import load_bench
from hil.bench.bench import Bench
from hil.bench.bench_file import parse, read
from hil.faults import Injector

BOTH = {"Actor.DataAdaption": 1, "Sensor[1].DataAdaption": 1}


def bench(variables=(), profidrive=(), **drive):
    """Return the PROFIdrive bench with other axis variables and drive settings; a variable None is left
    out.
    """
    config = load_bench("profidrive").config
    section = config.drive["drive1"]
    section = section.model_copy(
        update={"profidrive": replace(section.profidrive, **dict(profidrive)), **drive}
    )
    axis = config.axis["axis1"]
    merged = {
        path: value for path, value in {**axis.variables, **dict(variables)}.items() if value is not None
    }
    axis = axis.model_copy(update={"variables": merged})
    return Bench(config.model_copy(update={"drive": {"drive1": section}, "axis": {"axis1": axis}}), seed=1)


def settled(machine):
    """Wait until both parts have a final state; returns them."""
    axis = machine.axis()
    paths = ("StatusDrive.AdaptionState", "StatusSensor[1].AdaptionState")
    assert machine.run_until(lambda: all(axis.var(path) >= 2 for path in paths), 2.0)
    return tuple(axis.var(path) for path in paths)


class TestTransfer:
    """Over SDO, from the objects of the parameters."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-346", "CFG-353", "CFG-598", "VAR-150", "VAR-219", "PD-343")
    def test_what_is_wrong_in_the_controller_is_put_right(self):
        """Reference speed, torque, steps and fine resolution that do not fit are replaced by those of the
        drive.
        """
        wrong = {
            "Actor.DriveParameter.ReferenceSpeed": 1000.0,
            "Actor.DriveParameter.ReferenceTorque": 9.0,
            "Actor.DriveParameter.MaxSpeed": 500.0,
            "Sensor[1].Parameter.StepsPerRevolution": 100,
            "Sensor[1].Parameter.FineResolutionXist1": 3,
        }
        with bench({**BOTH, **wrong}, {"reference_speed_rpm": 4000.0, "reference_torque_nm": 3.5}) as machine:
            assert settled(machine) == (2, 2)
            axis = machine.axis()
            place = "Actor.DriveParameter."
            assert [axis.var(place + one) for one in ("ReferenceSpeed", "ReferenceTorque", "MaxSpeed")] == [
                4000.0,
                3.5,
                3000.0,
            ]
            names = ("StepsPerRevolution", "FineResolutionXist1", "DeterminableRevolutions")
            assert [axis.var(f"Sensor[1].Parameter.{one}") for one in names] == [2048, 11, 0]
            assert machine.run_until(axis.power().status, 2.0)
            begun = machine.drive().mechanics.position
            assert machine.run_until(axis.move_relative(40.0).done, 5.0)
            assert machine.drive().mechanics.position - begun == pytest.approx(0.040, abs=2e-5)
            assert machine.run_until(axis.reset().done, 1.0)  # 551 was true of the wrong maximum speed
            assert axis.var("WarningWord") == 0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-279", "CFG-598", "CFG-273")
    def test_without_transfer_a_wrong_reference_speed_is_a_wrong_speed(self):
        """3000 rpm in the controller and 6000 rpm in the drive: twice the speed, until the following error
        ends it with 521.
        """
        with bench(
            {"Actor.DriveParameter.ReferenceSpeed": 3000.0}, {"reference_speed_rpm": 6000.0}, telegram=102
        ) as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power(start_mode=0).status, 2.0)
            axis.move_velocity(100.0, PositionControlled=False)
            machine.run_for(1.0)
            assert machine.drive().core.speed_rpm == pytest.approx(1200.0, rel=0.02)
            assert machine.run_until(axis.halt().done, 2.0)
            axis.move_velocity(300.0)
            assert machine.run_until(lambda: axis.var("ErrorDetail.Number") == 521, 2.0)

    @pytest.mark.requirement("CFG-580", "CFG-581", "CFG-575", "CFG-576")
    @pytest.mark.parametrize("dsc", [True, False])
    def test_inertias(self, dsc):
        """With DSC p0341 and p1498 are taken over, the load at the load: 40 kg and the screw's share of a
        screw of 10 mm.
        """
        settings = {**BOTH, "PositionControl.EnableDSC": dsc, "Actor.LoadInertia": 1.0}
        with bench(settings) as machine:
            assert settled(machine) == (2, 2)
            axis = machine.axis()
            load, motor = axis.var("Actor.LoadInertia"), axis.var("Actor.DriveParameter.MotorInertia")
            if not dsc:
                assert (load, motor) == (1.0, 0.0)
                return
            parts = machine.drive().drive.config.mechanics
            assert motor == pytest.approx(parts.motor_inertia_kgm2, rel=1e-6)
            per_metre = 2.0 * pi / 0.010
            expected = parts.load_mass_kg + parts.screw_inertia_kgm2 * per_metre**2
            assert load == pytest.approx(expected, rel=1e-5)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-345", "STP-538")
    def test_again_after_a_loss_of_supply(self):
        """A drive that was switched off is read again, and the axis can be enabled again after the
        acknowledgement.
        """
        with bench(BOTH) as machine:
            assert settled(machine) == (2, 2)
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            machine.drive().power_off()
            machine.run_for(0.5)
            assert axis.var("StatusDrive.AdaptionState") == 0
            machine.drive().power_on()
            machine.run_for(1.0)
            assert settled(machine) == (2, 2)
            assert machine.run_until(axis.reset().done, 1.0)
            assert machine.run_until(axis.power().status, 2.0)
            states = [
                event.data["state"]
                for event in machine.history.select(kind="axis.adaption")
                if event.data["part"] == "Actor"
            ]
            assert states == ["NOT_ADAPTED", "IN_ADAPTION", "ADAPTED"] * 2

    @pytest.mark.requirement("CFG-355", "CFG-599", "CFG-623", "TA-025", "STP-538")
    def test_refused(self):
        """Parameters that the drive refuses: 102 and 103, the axis stays disabled until access is granted and
        it is restarted.
        """
        with bench(BOTH) as machine:
            store = machine.drive().parameters.store
            settled(machine)
            axis = machine.axis()
            store.refusals.update({2000: ParameterError.NO_CONTROL, 979: ParameterError.NO_CONTROL})
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            assert settled(machine) == (4, 4)
            assert {one.number for one in axis.alarms.engine.pending} == {102, 103}
            power = axis.power()
            machine.run_for(0.5)
            assert (power.Status, power.Error) == (False, True)
            axis.power(False)
            machine.run_for(0.1)
            store.refusals.clear()
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            assert settled(machine) == (2, 2)
            assert machine.run_until(axis.power().status, 2.0)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-355", "CFG-599", "STP-538")
    def test_silent(self):
        """A drive whose SDO server does not answer: both transfers end with their alarm, and the bus goes on
        meanwhile.
        """
        with bench(BOTH) as machine:
            settled(machine)
            axis = machine.axis()
            Injector(machine).inject("drive.sdo_timeout", "drive1")
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            machine.run_for(0.05)
            assert axis.var("StatusDrive.AdaptionState") == 1
            assert axis.communication_ok is True
            machine.run_for(3.0)
            assert (axis.var("StatusDrive.AdaptionState"), axis.var("StatusSensor[1].AdaptionState")) == (
                4,
                4,
            )
            assert "time" in axis.alarms.engine.pending[0].text.lower()

    @pytest.mark.requirement("CFG-370", "CFG-372", "CFG-366")
    def test_absolute_encoder(self):
        """An absolute encoder brings its revolutions and the fine resolution of XIST2; the type agrees."""
        with bench(BOTH, encoder="absolute") as machine:
            assert settled(machine) == (2, 2)
            axis = machine.axis()
            assert axis.var("Sensor[1].Type") == 1
            assert axis.var("Sensor[1].Parameter.DeterminableRevolutions") == 4096
            assert axis.var("WarningWord") == 0

    def test_no_parameters_on_cia_402(self):
        """A CiA 402 drive has no such parameters: selected all the same, it is alarm 102."""
        text = read("reference")[1].replace(
            "[axis.axis1.variables]\n", '[axis.axis1.variables]\n"Actor.DataAdaption" = 1\n'
        )
        with Bench(parse(text, "bench.toml"), seed=1) as machine:
            machine.run_for(0.1)
            assert machine.axis().var("ErrorDetail.Number") == 102
            assert machine.axis().var("StatusDrive.AdaptionState") == 4


def block_bench(telegram=3, *, dsc=False):
    """Return the PROFIdrive bench whose telegram passes a data block."""
    text = read("profidrive")[1].replace("telegram = 105", f"telegram = {telegram}")
    text = text.replace('drive = "drive1"\n', 'drive = "drive1"\nconnection = "data_block"\n', 1)
    if dsc:
        text = text.replace(
            "[axis.axis1.variables]\n", '[axis.axis1.variables]\n"PositionControl.EnableDSC" = true\n'
        )
    return parse(text, "bench.toml")


class TestDataBlock:
    """A program of the test between telegram and axis."""

    def machine(self, **options):
        """Return a bench whose programs pass everything through."""
        machine = Bench(block_bench(**options), seed=1)
        machine.axis().port.block.pass_through()
        machine.run_for(0.1)
        return machine

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-252", "CFG-253", "CFG-255", "CFG-256", "CFG-289")
    def test_passed_through(self):
        """With programs that copy, the axis moves as over a direct connection; the block holds actual values
        and setpoints.
        """
        with self.machine(telegram=105) as machine:
            axis = machine.axis()
            block = axis.port.block
            assert block.name == "PD_TEL105"
            assert machine.run_until(axis.power().status, 2.0)
            assert machine.run_until(axis.move_relative(30.0).done, 5.0)
            assert machine.drive().mechanics.position == pytest.approx(0.030, abs=2e-4)
            assert block.Output["STW1"] == 0x047F
            assert block.Input["ZSW1"] & 0x0007 == 0x0007
            assert set(block.Input) >= {"ZSW1", "NIST_B", "G1_XIST1"}

    @pytest.mark.requirement("CFG-254")
    def test_without_programs(self):
        """Without programs the axis sees initial values: no communication, no enable, nothing reaches the
        drive.
        """
        with Bench(block_bench(), seed=1) as machine:
            axis = machine.axis()
            power = axis.power()
            machine.run_for(0.5)
            assert (power.Status, axis.var("StatusDrive.CommunicationOK")) == (False, False)
            assert set(axis.port.block.Input.values()) == {0}
            assert axis.port.block.received["ZSW1"] != 0
            assert machine.drive().slave.get(0x5800) == 0

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-253", "CFG-261", "CFG-607")
    def test_same_cycle(self):
        """What MC_PreServo writes is used, and what MC_PostServo writes is sent, in the same cycle."""
        with self.machine() as machine:
            axis = machine.axis()
            block = axis.port.block
            assert machine.run_until(axis.power().status, 2.0)
            machine.run_for(0.1)

            def fault(one):
                one.copy_input()
                one.Input["ZSW1"] |= 0x0008

            block.pre_servo = fault
            machine.run_for(machine.cycle_ns / 1e9)
            assert axis.var("ErrorDetail.Number") == 421
            block.pre_servo = type(block).copy_input
            marked = []

            def mark(one):
                one.copy_output_alive()
                one.sent["STW1"] |= 0x0100
                marked.append(one.sent["STW1"])

            block.post_servo = mark
            machine.run_for(2 * machine.cycle_ns / 1e9)
            assert machine.drive().slave.get(0x5800) & 0xFFFF == marked[-2]

    @pytest.mark.requirement("CFG-607", "CFG-539")
    def test_frozen_count(self):
        """A count that MC_PreServo freezes runs the axis into its following error."""
        with self.machine() as machine:
            axis = machine.axis()
            block = axis.port.block
            assert machine.run_until(axis.power().status, 2.0)
            count = block.Input["G1_XIST1"]

            def freeze(one):
                one.copy_input()
                one.Input["G1_XIST1"] = count

            block.pre_servo = freeze
            axis.move_velocity(100.0)
            assert machine.run_until(lambda: axis.var("ErrorDetail.Number") == 521, 3.0)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-260", "CFG-607")
    def test_sign_of_life_with_dsc(self):
        """With DSC a program that does not count the sign of life makes the drive report it."""
        with self.machine(telegram=105, dsc=True) as machine:
            axis = machine.axis()
            assert machine.run_until(axis.power().status, 2.0)
            axis.port.block.pass_through(sign_of_life=False)
            machine.run_for(0.5)
            assert [one.number for one in machine.drive().drive.faults.buffer.present] == [1912]
            assert axis.var("StatusWord.X0") is False

    @pytest.mark.requirement("CFG-627", "CFG-623")
    def test_no_transfer(self):
        """Selected with a data block, the transfer of the drive is alarm 102, that of the encoder 103."""
        with self.machine() as machine:
            axis = machine.axis()
            for path in BOTH:
                axis.variables.write_start(path, 1)
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            machine.run_for(0.05)
            assert {one.number for one in axis.alarms.engine.pending} == {102, 103}

    @pytest.mark.requirement("CFG-263", "CFG-265", "CFG-266", "CFG-267")
    def test_times_can_be_written(self):
        """T_i, T_o and T_DC can be written here, and count from the next restart on."""
        with self.machine() as machine:
            axis = machine.axis()
            for number in (1010, 1011, 1012):
                assert machine.run_until(axis.write_parameter(number, 0.001).done, 1.0)
            assert axis.var("StatusWord.X3") is True
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            assert axis.object.delay_s == pytest.approx(0.007)


class TestOverModbus:
    """The same through the registers of data record 47."""

    @staticmethod
    def bench(name="profidrive_tcp"):
        config = load_bench(name).config
        axis = config.axis["axis1"]
        wrong = {
            **BOTH,
            "Actor.DriveParameter.ReferenceSpeed": 1000.0,
            "Sensor[1].Parameter.FineResolutionXist1": 3,
        }
        axis = axis.model_copy(update={"variables": {**axis.variables, **wrong}})
        return Bench(config.model_copy(update={"axis": {"axis1": axis}}), seed=1)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-346", "PD-326", "PD-327", "PD-328")
    @pytest.mark.parametrize("name", ["profidrive_tcp", "profidrive_rtu"])
    def test_transfer(self, name):
        """Over TCP and over a serial line the values of the drive replace those of the controller, and the
        axis moves.
        """
        with self.bench(name) as machine:
            assert settled(machine) == (2, 2)
            axis = machine.axis()
            assert axis.var("Actor.DriveParameter.ReferenceSpeed") == 3000.0
            assert axis.var("Sensor[1].Parameter.FineResolutionXist1") == 11
            assert machine.run_until(axis.power().status, 2.0)
            axis.move_velocity(50.0)
            machine.run_for(1.0)
            assert machine.drive().core.speed_rpm == pytest.approx(300.0, rel=0.02)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("CFG-355", "CFG-623")
    def test_refused(self):
        """A refusal of the drive is alarm 102 with its error number."""
        with self.bench() as machine:
            settled(machine)
            axis = machine.axis()
            machine.drive().parameters.store.refusals[2003] = ParameterError.NO_CONTROL
            assert machine.run_until(axis.reset(restart=True).done, 1.0)
            assert settled(machine) == (4, 2)
            assert "p2003: 0Bh" in axis.alarms.engine.highest.text

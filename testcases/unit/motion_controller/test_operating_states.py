"""RUN, STOP, STARTUP and POWER OFF: what stops, what goes on, what is refused (section 1.9 of the instruction
specification).
"""

from __future__ import annotations

import pytest

from motion.s7.axis.state import AxisState
from motion.s7.controller import ControllerError, OperatingState
from motion.s7.instructions import MC_MoveVelocity

RUN, STOP, STARTUP, POWER_OFF = (
    OperatingState.RUN,
    OperatingState.STOP,
    OperatingState.STARTUP,
    OperatingState.POWER_OFF,
)


class TestStop:
    """RUN -> STOP (MC-629, STP-506)."""

    @pytest.mark.exhaustive
    @pytest.mark.requirement("MC-629", "STP-506", "STP-588")
    @pytest.mark.parametrize(
        ("reaction", "word"),
        [(1, 0x047E), (3, 0x047C), (5, 0x047A), (7, 0x047B)],
        ids=["OFF1", "OFF2", "OFF3+1", "OFF3"],
    )
    def test_the_drive_stops_as_remove_enable_says(self, make_rig, reaction, word):
        """The job ends with CommandAborted and without alarm; the control word is that of the configured
        drive stop.
        """
        rig = make_rig(variables={"Actor.RemoveEnableReaction": reaction}).travelling(300.0)
        rig.controller.stop()
        rig.cycles(1)
        assert rig.column("stw1")[-1] == word
        assert [event.data["job"] for event in rig.events("job.aborted")] == [rig.job.name]
        rig.until(lambda: rig.axis.state is AxisState.DISABLED)
        assert rig.axis.var("ErrorDetail.Number") == 0
        assert abs(rig.axis.var("ActualVelocity")) <= 2.0
        assert rig.controller.state is STOP

    @pytest.mark.requirement("MC-629", "MC-632", "STP-506")
    def test_outputs_are_off_when_the_drive_is(self, rig):
        """Zeros are sent then, while the data block goes on: a shaft that is turned shows its position
        (CFG-294).
        """
        rig.enabled().stopped()
        assert rig.column("stw1")[-1] == 0
        before = rig.axis.var("ActualPosition")
        rig.turn(0.25)
        rig.cycles(2)
        assert rig.axis.var("ActualPosition") == pytest.approx(before + 2.5, abs=1e-3)

    @pytest.mark.requirement("MC-632")
    def test_no_program(self, rig):
        """Neither instances nor functions of the program are called in STOP."""
        calls = []
        rig.runtime.call(lambda: calls.append(rig.scheduler.now))
        rig.cycles(3)
        rig.stopped()
        called = len(calls)
        power = rig.axis.power()
        move = rig.axis.move_velocity(50.0)
        rig.cycles(20)
        assert len(calls) == called
        assert not power.Status
        assert not move.Busy
        assert rig.axis.state is AxisState.DISABLED

    @pytest.mark.requirement("STP-506")
    @pytest.mark.parametrize("enter", ["halting", "stop_held", "disabling", "enabling", "alarm", "disabled"])
    def test_from_every_kind_of_state(self, make_rig, enter):
        """Whatever the axis is doing, it ends disabled, at rest, with every job ended."""
        rig = make_rig()
        if enter == "enabling":
            rig.axis.power()
            rig.until(lambda: rig.axis.state is AxisState.ENABLING)
        elif enter != "disabled":
            rig.travelling(200.0)
        if enter == "halting":
            rig.axis.halt()
        elif enter == "stop_held":
            rig.axis.stop()
            rig.until(lambda: rig.axis.state is AxisState.STOP_HOLD)
        elif enter == "disabling":
            rig.axis.power(False, stop_mode=1)
        elif enter == "alarm":
            rig.axis.object.alarms.raise_alarm(521)
        rig.cycles(2)
        rig.stopped()
        assert rig.axis.state is (AxisState.ALARM_DISABLED if enter == "alarm" else AxisState.DISABLED)
        started = {event.data["job"] for event in rig.events("job.started")}
        ended = {
            event.data["job"]
            for event in rig.events("job.")
            if event.kind in {"job.aborted", "job.error", "job.done"}
        }
        assert started == ended
        assert rig.column("stw1")[-1] == 0

    @pytest.mark.requirement("MC-629", "VAR-229", "STP-506", "STP-081")
    def test_a_changed_start_value_takes_effect(self, rig):
        """An object with X3 is restarted by the controller itself; one without is not."""
        rig.axis.variables.write_start("Actor.RemoveEnableReaction", 5)
        rig.axis.write("Override.Velocity", 40.0)
        rig.cycles(1)
        assert rig.axis.var("StatusWord.X3")
        rig.stopped()
        assert not rig.axis.var("StatusWord.X3")
        assert rig.axis.var("Actor.RemoveEnableReaction") == 5
        assert rig.axis.var("Override.Velocity") == 100.0  # a restart: values assigned are lost
        restarts = [event for event in rig.events("axis.state") if event.data["to"] == "RESTARTING"]
        assert len(restarts) == 1
        rig.running().stopped()
        again = [event for event in rig.events("axis.state") if event.data["to"] == "RESTARTING"]
        assert len(again) == 2  # only the initialisation after STARTUP has come on top

    def test_the_program_may_stop_its_controller(self, rig):
        """A stop from within a cycle acts when the cycle has ended; the instances after it do not take the
        axis back.
        """
        rig.runtime.call(lambda: rig.controller.stop("STP"), first=True)
        rig.axis.power()
        rig.cycles(10)
        assert rig.controller.state is STOP
        rig.until(lambda: rig.axis.state is AxisState.DISABLED)
        assert not rig.axis.enabling.enable


class TestStartup:
    """STOP -> STARTUP -> RUN (MC-631)."""

    @pytest.mark.requirement("MC-631", "STP-609")
    def test_motion_jobs_are_rejected(self, rig):
        """A job of the start-up program ends with 16#800D; outputs are off."""
        rig.stopped()
        jobs = []

        def startup() -> None:
            job = MC_MoveVelocity(rig.axis.object, name="ob100", Velocity=10.0)
            job(Execute=True)
            jobs.append(job)

        rig.controller.startup_program.append(startup)
        rig.controller.run()
        rig.reach(STARTUP)
        rig.cycles(2)
        assert [(job.Error, job.ErrorID) for job in jobs] == [(True, 0x800D)]
        assert rig.column("stw1")[-1] == 0
        rig.reach(RUN)
        assert len(jobs) == 1

    @pytest.mark.requirement("MC-631", "VAR-008")
    def test_initialised_one_after_the_other(self, make_rig):
        """In the first cycles of RUN an object that has not had its turn answers with 16#800D."""
        rig = make_rig()
        other = make_rig()  # only for its axis
        rig.runtime.add(other.axis.object)
        rig.stopped()
        first, second = (MC_MoveVelocity(axis, Velocity=10.0) for axis in rig.runtime.axes)
        answers = []

        def program() -> None:
            for job in (first, second):
                job(Execute=False)
                job(Execute=True)
            answers.append((first.ErrorID, second.ErrorID))

        rig.runtime.call(program)
        rig.controller.run()
        rig.reach(RUN)
        rig.cycles(4)
        assert answers[0] == (0x800F, 0x800D)  # the first one is only disabled
        assert answers[1] == (0x800F, 0x800F)

    @pytest.mark.requirement("MC-631")
    def test_nothing_starts_by_itself(self, rig):
        """After a warm restart inputs that start something are FALSE: the axis stays disabled until the
        program enables it.
        """
        rig.travelling(100.0).stopped().running()
        rig.run(0.2)
        assert rig.axis.state is AxisState.DISABLED
        assert not rig.job.Execute
        assert not rig.job.Busy
        assert rig.job.Velocity == 100.0
        rig.enabled()
        rig.job.set(Execute=True)
        rig.until(rig.job.in_velocity)

    def test_run_waits_for_the_drives(self, rig):
        """RUN asked for at once after STOP comes when the drive is off."""
        rig.travelling(300.0)
        rig.controller.stop()
        rig.controller.run()
        rig.cycles(3)
        assert rig.controller.state is STOP
        rig.reach(RUN)
        assert abs(rig.axis.var("ActualVelocity")) <= 2.0

    def test_stop_in_startup(self, rig):
        """A stop while objects are held back leaves them disabled, not in a restart for ever."""
        rig.stopped()
        rig.controller.run()
        rig.reach(STARTUP)
        rig.controller.stop()
        rig.cycles(2)
        assert rig.controller.state is STOP
        assert rig.axis.state is AxisState.DISABLED
        rig.running().enabled()


class TestPower:
    """POWER OFF and POWER ON."""

    @pytest.mark.requirement("MC-630", "VAR-229")
    def test_everything_begins_again(self, rig):
        """Jobs, alarms and values are gone; the objects have the start values of load memory."""
        rig.axis.variables.write_start("PositionControl.Kv", 11.0)
        rig.travelling(200.0)
        rig.controller.power_off()
        assert rig.axis.state is AxisState.DISABLED
        assert rig.axis.var("Velocity") == 0.0
        assert [event.data["job"] for event in rig.events("job.aborted")] == [rig.job.name]
        rig.run(0.5)
        rig.controller.power_on()
        rig.reach(RUN)
        assert rig.axis.var("PositionControl.Kv") == 11.0
        rig.cycles(3)
        rig.enabled()

    def test_nothing_is_sent_without_supply(self, rig):
        """The drive gets no telegram any more."""
        sent = []
        rig.enabled()
        rig.axis.object.servo.port = rig.axis.object.servo.drive_port = Spy(rig.port, sent)
        rig.cycles(2)
        assert len(sent) == 2
        rig.controller.power_off()
        rig.cycles(20)
        assert len(sent) == 2

    @pytest.mark.requirement("CFG-290", "CFG-291", "CFG-295")
    @pytest.mark.parametrize("kind", [0, 1], ids=["incremental", "absolute"])
    def test_position_before_the_first_run(self, make_rig, kind):
        """After POWER ON 0 is shown, whatever the shaft does, until the first RUN; later it is followed in
        STOP too.
        """
        rig = make_rig(variables={"Sensor[1].Type": kind})
        rig.enabled()
        rig.until(rig.axis.move_relative(33.0).done)
        rig.controller.power_off()
        rig.run(0.1)
        rig.controller.power_on(run=False)
        rig.turn(1.0)
        rig.cycles(5)
        assert rig.axis.var("ActualPosition") == 0.0
        rig.running()
        assert rig.axis.var("ActualPosition") == pytest.approx(43.0 if kind else 0.0, abs=1e-2)
        rig.stopped()
        rig.turn(0.5)
        rig.cycles(2)
        assert rig.axis.var("ActualPosition") == pytest.approx(48.0 if kind else 5.0, abs=1e-2)

    def test_a_wrong_start_value(self, rig):
        """What was written in load memory and cannot be used disables the object with alarm 101."""
        rig.axis.variables.write_start("Mechanics.LeadScrew", 0.0)
        rig.power_cycled()
        assert rig.axis.var("ErrorDetail.Number") == 101
        assert rig.axis.state is AxisState.ALARM_DISABLED


class Spy:
    """Notes what is written to a port."""

    def __init__(self, port, sent):
        self.__dict__.update(_port=port, _sent=sent)

    def __getattr__(self, name):
        return getattr(self._port, name)

    def __setattr__(self, name, value):
        setattr(self._port, name, value)

    def write(self, stw1, speed, torque=0.0):
        self._sent.append(stw1)
        self._port.write(stw1, speed, torque)


@pytest.mark.requirement("MC-633")
def test_a_breakpoint(rig):
    """The controller stops, the object is restarted without a command, and has to be homed again."""
    rig.enabled()
    rig.until(rig.axis.home(50.0).done)
    assert rig.axis.var("StatusWord.X5")
    rig.controller.breakpoint()
    rig.stopped()
    assert rig.controller.state is STOP
    assert not rig.axis.var("StatusWord.X5")
    assert any(event.data["to"] == "RESTARTING" for event in rig.events("axis.state"))
    assert rig.reported("overflow of MC_Servo")


@pytest.mark.parametrize("command", ["memory_reset", "factory_reset", "download"])
def test_what_needs_stop(rig, command):
    """In RUN it is refused, and as long as an axis is not at rest; the message says what to wait for."""
    call = getattr(rig.controller, command)
    arguments = ("axis1",) if command == "download" else ()
    with pytest.raises(ControllerError, match="needs STOP, not RUN"):
        call(*arguments)
    rig.travelling(300.0)
    rig.controller.stop()
    with pytest.raises(ControllerError, match="not yet: axis1"):
        call(*arguments)
    rig.stopped()
    call(*arguments)
    with pytest.raises(ControllerError, match="a breakpoint needs RUN"):
        rig.controller.breakpoint()
    rig.controller.power_off()
    with pytest.raises(ControllerError, match="needs supply"):
        rig.controller.run()


def test_states_are_reported(rig):
    """Every change is an event and an entry, with its reason."""
    rig.stopped().running()
    rig.power_cycled()
    reported = [(event.data["from"], event.data["to"]) for event in rig.events("controller.state")]
    assert reported == [
        ("RUN", "STOP"),
        ("STOP", "STARTUP"),
        ("STARTUP", "RUN"),
        ("RUN", "power off"),
        ("power off", "STOP"),
        ("STOP", "STARTUP"),
        ("STARTUP", "RUN"),
    ]
    assert rig.reported("RUN -> STOP") == ["RUN -> STOP: by command"]
    for call in (rig.controller.stop, rig.controller.run, rig.controller.power_on):
        call()  # harmless where they change nothing


@pytest.mark.requirement("MC-629", "MC-630")
@pytest.mark.parametrize("way", ["stop", "power_off"])
@pytest.mark.parametrize("mode", [2, 3], ids=["passive", "active"])
def test_a_homing_that_waits_for_its_mark(rig, way, mode):
    """It ends with CommandAborted in the instant of the stop, and nothing of it is left when the controller
    is back.
    """
    rig.enabled()
    job = rig.axis.home(10.0, mode=mode)
    rig.until(job.busy)
    rig.cycles(3)
    assert rig.axis.object.homings
    now = rig.scheduler.now
    getattr(rig.controller, way)()
    rig.cycles(1)
    assert [(event.time_ns, event.data["job"]) for event in rig.events("job.aborted")] == [(now, job.name)]
    assert not rig.axis.object.homings
    rig.run(1.0)
    if way == "power_off":
        rig.controller.power_on()
    else:
        rig.controller.run()
    rig.reach(RUN)
    rig.cycles(3)
    rig.enabled()
    rig.until(rig.axis.move_relative(5.0).done)

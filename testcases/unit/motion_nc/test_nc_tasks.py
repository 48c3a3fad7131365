"""Tasks of the NC: order, load, ADS commands, a PLC that halts, retain data, activation of the project."""

import pytest

from fieldbus.clock import VirtualScheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from motion.nc.blocks import JogMode
from motion.nc.handles import NcAxisHandle
from motion.nc.parameters import ParameterSet
from motion.nc.project import AxisKind, Licence, LicenceError, Project
from motion.nc.retain import RetainStore, StartAbortedError
from motion.nc.tasks import NcRuntime
from testcases.unit.motion_nc.nc_rig import Plant, Rig

pytestmark = pytest.mark.exhaustive

CYCLE = 2_000_000


class System:
    """An NC with a project, whose axes are simulated or linked to plants."""

    def __init__(self, retain=None, licence=None, **tasks):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.runtime = NcRuntime(
            self.scheduler,
            cycle_ns=CYCLE,
            parameters=ParameterSet({f"task.{key}": value for key, value in tasks.items()}),
            retain=retain,
            history=self.history,
        )
        self.project = Project(self.runtime, licence=licence, history=self.history)
        self.handles = {}

    def add(self, name="x", plant=None, kind=AxisKind.CONTINUOUS, **values):
        link = None if plant is None else (lambda _: plant)
        return self.project.add(
            name, kind=kind, link=link, values={key.replace("__", "."): one for key, one in values.items()}
        )

    def start(self):
        self.project.activate()
        for entry in self.project:
            self.handles.setdefault(entry.name, NcAxisHandle(self.runtime, entry.ref))
        self.cycles(2)
        return self

    def cycles(self, count=1):
        self.scheduler.run_for(count * CYCLE)

    def until(self, condition, seconds=10.0):
        assert self.scheduler.run_until(condition, int(seconds * 1e9))

    def kinds(self):
        return [event.kind for event in self.history.events]

    def __getitem__(self, name):
        return self.handles[name]


# -- order and load


@pytest.mark.requirement("NC-753", "NC-047", "NC-046")
def test_order_within_a_cycle():
    """Inputs, ADS commands of high priority, SAF with outputs, ADS commands of low priority, SVB, PLC."""
    for high in (True, False):
        rig = Rig(task__ads_high_priority=high)
        order = []

        def noted(name, call, order=order):
            def wrapper(*arguments):
                order.append(name)
                return call(*arguments)

            return wrapper

        rig.device.read = noted("inputs", rig.device.read)
        rig.device.write = noted("outputs", rig.device.write)
        rig.runtime.call(lambda order=order: order.append("PLC"))
        while (rig.runtime.cycles % rig.runtime.svb_cycles) != 0:
            rig.cycles()
        rig.axis.prepared.append(lambda order=order: order.append("SVB"))
        rig.runtime.post(lambda order=order: order.append("ADS"))
        order.clear()
        rig.cycles()
        expected = ["inputs", "ADS", "outputs", "SVB", "PLC"]
        if not high:
            expected = ["inputs", "outputs", "ADS", "SVB", "PLC"]
        assert order == expected


@pytest.mark.requirement("NC-047")
def test_priority_of_ads_commands():
    """With high priority an ADS command acts in the cycle after it came, without it one cycle later."""
    for high, moved in ((True, 1), (False, 2)):
        rig = Rig(task__ads_high_priority=high).enabled()
        rig.until(rig.handle.move_velocity(100.0).in_velocity)
        rig.runtime.post(lambda rig=rig: rig.axis.set_position(1000.0))
        seen = []
        for _ in range(3):
            rig.cycles()
            seen.append(rig.axis.nc_to_plc.ActPos > 900.0)
        assert seen.index(True) + 1 == moved


@pytest.mark.requirement("NC-023", "NC-024", "NC-025", "NC-767")
def test_cycle_exceeded(subtests):
    """An overrun of either task is one event, one message, one count, and changes no state; the load can be
    read.
    """
    for name in ("saf", "svb"):
        for monitored in (True, False):
            with subtests.test(name, monitored=monitored):
                rig = Rig(task__cycle_exceed_monitoring=monitored).enabled()
                move = rig.handle.move_absolute(50.0, Velocity=100.0)
                rig.cycles(50)
                task = getattr(rig.runtime, name)
                task.take(0.5 * task.cycle_ns * 1e-9)
                rig.cycles(20)
                assert task.load == 0.5
                assert task.exceeds == 0
                before = rig.axis.nc_to_plc.StateDWord
                task.take(2.5 * task.cycle_ns * 1e-9)
                rig.cycles(30)
                assert task.load == 2.5
                assert [load for _, load in task.over_time] == [0.5, 2.5]
                assert task.exceeds == monitored
                kinds = [event.kind for event in rig.history.events]
                assert kinds.count("nc.cycle_exceeded") == kinds.count("nc.message") == monitored
                assert rig.axis.nc_to_plc.StateDWord == before
                other = rig.runtime.svb if name == "saf" else rig.runtime.saf
                assert other.exceeds == 0
                assert not other.over_time
                rig.until(move.done)
                assert rig.generator.s == 50.0
                assert rig.handle.error_id == 0


@pytest.mark.requirement("NC-767")
def test_an_overrun_delays_the_motion():
    """While a SAF cycle lasts longer, setpoints wait: the profile is the same, later by whole cycles."""
    plain, late = Rig(), Rig()
    paths = []
    for rig in (plain, late):
        rig.enabled()
        rig.handle.move_absolute(20.0, Velocity=100.0)
        rig.cycles(20)
        if rig is late:
            rig.runtime.saf.take(3.5 * 0.002)
        path = []
        for _ in range(400):
            rig.cycles()
            path.append(rig.generator.s)
        paths.append(path)
    on_time, delayed = paths
    assert delayed[:4] == on_time[:1] * 4
    assert delayed[4:] == on_time[1:-3]


@pytest.mark.requirement("NC-041", "NC-055", "NC-056")
def test_svb_prepares_homing_and_not_moves():
    """A move begins with the next SAF cycle, a homing sequence with the next cycle of the slower SVB task."""
    rig = Rig().enabled()
    assert rig.runtime.svb_cycles == 5
    assert rig.runtime.svb.cycle_ns > rig.runtime.saf.cycle_ns
    for phase in range(5):
        rig = Rig().enabled()
        while rig.runtime.cycles % 5 != phase:
            rig.cycles()
        move = rig.handle.move_relative(1.0, Velocity=100.0)
        rig.cycles(2)
        assert rig.generator.v > 0.0
        rig.until(move.done)
        while rig.runtime.cycles % 5 != phase:
            rig.cycles()
        rig.handle.home()
        waited = 0
        rig.cycles()
        while not rig.status("HomingBusy"):
            assert rig.ref.NcToPlc.SvbEntries == (1 if waited else rig.ref.NcToPlc.SvbEntries)
            rig.cycles()
            waited += 1
        assert waited <= 6
        assert rig.ref.NcToPlc.SvbEntries == 0


@pytest.mark.requirement("NC-018", "NC-019", "NC-765")
def test_a_plc_that_hangs_or_halts(subtests):
    """A stop, an endless loop and an exception of the arithmetic end the exchange: after N cycles enables and
    override are 0 and the axis stops, at every phase of the watchdog.
    """
    for cause in ("stop", "loop", "exception"):
        for limit in (1, 2, 5):
            for plc_cycles in (1, 3):
                with subtests.test(cause, limit=limit, plc_cycles=plc_cycles):
                    rig = Rig(task__watchdog_cycles=limit, plc_cycles=plc_cycles).enabled()
                    rig.until(rig.handle.move_velocity(50.0).in_velocity)
                    while rig.runtime.cycles % plc_cycles:
                        rig.cycles()
                    if cause == "exception":
                        rig.runtime.call(lambda: 1 // 0)
                        rig.cycles(plc_cycles)
                        assert not rig.runtime.plc_running
                        halted = [one for one in rig.history.events if one.kind == "plc.halted"]
                        assert "ZeroDivisionError" in halted[0].data["reason"]
                    else:
                        rig.runtime.plc_running = False
                    rig.cycles(limit * plc_cycles + 1)  # the data of the last call were fresh once
                    assert rig.axis.plc_to_nc.ControlDWord == 0x7
                    assert rig.generator.v == 50.0
                    rig.cycles()
                    assert rig.axis.plc_to_nc.pack() == bytes(128)
                    assert rig.handle.error_id == 0x4356
                    rig.cycles(20)
                    assert rig.device.velocity == 0.0
                    assert not rig.device.enabled


@pytest.mark.requirement("NC-013")
def test_written_enables():
    """Enables written from outside stay without a PLC that writes, and are overwritten by one that does."""
    rig = Rig()
    rig.axis.plc_to_nc.ControlDWord = 0x7
    rig.axis.plc_to_nc.Override = 500_000
    rig.cycles()
    assert rig.axis.plc_to_nc.ControlDWord == 0
    rig = Rig(task__watchdog_cycles=0)
    rig.runtime.plc_running = False
    rig.cycles()
    rig.axis.plc_to_nc.ControlDWord = 0x7
    rig.axis.plc_to_nc.Override = 500_000
    rig.cycles(50)
    assert rig.axis.plc_to_nc.ControlDWord == 0x7
    assert rig.axis.operational


# -- retain data

_MODES = ("None", "Store only", "Load/Store", "Load (if available)/Store")
_MODULO = {
    "enc__reference_system": "ABSOLUTE (modulo)",
    "enc__encoder_mask": 0xFFFFF,
    "enc__scaling_numerator": 0.001,
    "axis__data_persistence": True,
    "enc__type": "Hardware encoder",
}


def _run(store, mode, raw=400, persistent=True, position=None):
    """Start, give the axis a position, and stop; returns the axis as it was after the start."""
    plant = Plant(0.001)
    plant.read = lambda: None
    plant.raw = raw
    system = System(store, retain_data=mode)
    system.add(plant=plant, **{**_MODULO, "axis__data_persistence": persistent})
    system.start()
    axis = system["x"].object
    found = axis.homed, axis.position
    if position is not None:
        axis.set_position(position)
    system.runtime.stop()
    return found


@pytest.mark.requirement("NC-049", "NC-050", "NC-051", "NC-205", "NC-216", "NC-054")
def test_retain_modes(subtests):
    """Which modes store at the stop and load at the start; only axes with Data Persistence take part."""
    for mode, stores, loads in zip(
        _MODES, (False, True, True, True), (False, False, True, True), strict=True
    ):
        with subtests.test(mode):
            store = RetainStore()
            if mode == "Load/Store":  # cannot be the first one
                _run(store, _MODES[3], position=5.0)
                kept = store.content
                _run(store, mode, position=7.0)
                assert store.content != kept
                _run(store, _MODES[3], position=5.0)
            else:
                _run(store, mode, position=5.0)
            assert (store.content is not None) is stores
            _run(store, _MODES[3], position=5.0)
            assert _run(store, mode) == ((True, pytest.approx(5.0)) if loads else (False, 0.4))
            assert _run(store, mode, persistent=False) == (False, 0.4)
    store = RetainStore()
    _run(store, _MODES[3], persistent=False, position=5.0)
    assert _run(store, _MODES[3]) == (False, 0.4)


@pytest.mark.requirement("NC-052", "NC-053", "NC-054", "NC-762", "NC-779")
def test_missing_and_corrupt_data(subtests, tmp_path):
    """Missing and corrupt data: Load/Store aborts the start with an error, Load (if available) starts with an
    axis that is not referenced, the other modes do not look.
    """

    def missing(store):
        store.content = None

    def shortened(store):
        store.content = store.content[:-5]

    def changed(store):
        store.content = store.content.replace(b"5.0", b"6.0")

    def garbage(store):
        store.content = b"\xff\x00"

    for mode in _MODES:
        for damage in (missing, shortened, changed, garbage):
            with subtests.test(mode, damage=damage.__name__):
                store = RetainStore(tmp_path / "retain.dat")
                _run(store, _MODES[3], position=5.0)
                damage(store)
                if mode != "Load/Store":
                    assert _run(store, mode) == (False, 0.4)
                    continue
                plant = Plant(0.001)
                system = System(store, retain_data=mode)
                system.add(plant=plant, **_MODULO)
                with pytest.raises(StartAbortedError, match="missing" if damage is missing else "corrupt"):
                    system.project.activate()
                assert "nc.start_aborted" in system.kinds()
                system.cycles(10)
                assert system.runtime.cycles == 0
                assert not plant.written


@pytest.mark.requirement("NC-054")
def test_power_failure():
    """Without UPS nothing is stored: what is there is that of the stop before."""
    store = RetainStore()
    _run(store, _MODES[3], position=5.0)
    system = System(store, retain_data=_MODES[3])
    plant = Plant(0.001)
    plant.read = lambda: None
    plant.raw = 400
    system.add(plant=plant, **_MODULO)
    system.start()
    system["x"].object.set_position(50.0)
    system.runtime.lose_power()
    system.runtime.stop()
    assert store.read()["x"].position == pytest.approx(5.0)


@pytest.mark.requirement("NC-269", "NC-273", "NC-276")
def test_restored_positions():
    """Single-turn and modulo systems restore their position with the way since, and are homed by it."""
    for system, stored, raw, restored in (
        ("INCREMENTAL (singleturn absolute)", 10.0, 500_000, 10.1),
        ("ABSOLUTE (modulo)", 725.0, 500_000, 5.1),
    ):
        store = RetainStore()
        found = []
        for count, position in ((400_000, stored), (raw, None)):
            plant = Plant(0.001)
            plant.read = lambda: None
            plant.raw = count
            one = System(store, retain_data=_MODES[3])
            values = {**_MODULO, "enc__reference_system": system, "enc__scaling_numerator": 1e-6}
            one.add(plant=plant, **values)
            one.start()
            axis = one["x"].object
            found.append((axis.homed, axis.position))
            if position is not None:
                axis.set_position(position)
            one.runtime.stop()
        assert found[0][0] is False
        assert found[1] == (True, pytest.approx(restored))


# -- project and activation


@pytest.mark.requirement("NC-005")
def test_licence(subtests):
    """A licence includes its axes and can be extended up to 255; with more none starts."""
    for name, included in (("TF5000", 10), ("TF5010", 25), ("TF5020", 255)):
        with subtests.test(name):
            assert Licence(name).axes == included
            if included < 255:
                assert Licence(name, 255 - included).axes == 255
            with pytest.raises(ConfigurationError, match="additional_axes"):
                Licence(name, 256 - included)
    with pytest.raises(ConfigurationError, match="TF5000"):
        Licence("TF500")
    system = System(licence=Licence("TF5000", 1))
    for number in range(12):
        system.add(f"a{number}")
    with pytest.raises(LicenceError, match="12 axes"):
        system.project.activate()
    system.cycles(5)
    assert system.runtime.cycles == 0
    assert not system.runtime.axes
    system.project.remove("a11")
    system.start()
    assert len(system.runtime.axes) == 11


@pytest.mark.requirement("NC-045", "NC-078", "NC-065")
def test_ids_of_axes():
    """Axes get the next free id, deleted ones are used again, names are unique, the type does not change."""
    system = System()
    for name in ("a", "b", "c"):
        system.add(name)
    assert [entry.number for entry in system.project] == [1, 2, 3]
    assert system.project["a"].object_ids == {
        "axis": 0x05010010,
        "encoder": 0x05020010,
        "drive": 0x05030010,
        "controller": 0x05040010,
    }
    system.project.remove("b")
    assert system.add("d").number == 2
    assert system.project["d"].object_ids["drive"] == 0x05030020
    assert system.add("e").number == 4
    every = [one for entry in system.project for one in entry.object_ids.values()]
    assert len(set(every)) == len(every)
    with pytest.raises(ConfigurationError, match="no other axis"):
        system.add("a")
    with pytest.raises(AttributeError):
        system.project["a"].kind = AxisKind.ENCODER
    system.start()
    assert system["d"].ref.NcToPlc.AxisId == 2


@pytest.mark.requirement("NC-014", "NC-249", "NC-247", "NC-057")
def test_missing_resources():
    """An axis whose type needs hardware and has none is not operational: error at activation, again after a
    reset; a linked one is.
    """
    for values in (
        {"axis__axis_type": "SERCOS Drive"},
        {"axis__axis_type": "CANopen DS402/Profile MDP 742 (e.g. EtherCAT CoE Drive)"},
        {"enc__type": "Hardware encoder"},
    ):
        system = System()
        system.add(**values)
        system.start()
        power = system["x"].power()
        system.cycles(20)
        assert system["x"].error_id == 0x4650
        assert not power.Status
        system["x"].reset()
        system.cycles(20)
        assert system["x"].error_id == 0x4650
        system = System()
        system.add(plant=Plant(0.0001), enc__encoder_mask=0xFFFFFFFF, **values)
        system.start()
        system.until(system["x"].power().status)


@pytest.mark.requirement("NC-007", "NC-062", "NC-069")
def test_an_axis_without_hardware():
    """A standard axis without a link is a simulation axis: a program runs on it."""
    system = System()
    system.add()
    system.start()
    system.until(system["x"].power().status)
    move = system["x"].move_absolute(100.0, Velocity=200.0)
    system.until(move.done)
    assert system["x"].position == pytest.approx(100.0, abs=0.001)
    system["x"].ref.ReadStatus()
    assert system["x"].ref.NcToPlc.OpModeDWord & 0x100


@pytest.mark.requirement("NC-070", "NC-080")
def test_simulation_of_a_linked_axis():
    """Simulation: the outputs of the drive do not change, actual values come from the simulation encoder; the
    link is back with the next activation after it is reset.
    """
    plant = Plant(0.0001)
    system = System()
    entry = system.add(plant=plant, axis__simulation=True, enc__encoder_mask=0xFFFFFFFF)
    system.start()
    system.until(system["x"].power().status)
    system.until(system["x"].move_absolute(20.0, Velocity=100.0).done)
    assert system["x"].position == pytest.approx(20.0, abs=0.001)
    assert not plant.written
    assert system["x"].ref.NcToPlc.OpModeDWord & 0x100
    system["x"].write_parameter("axis.simulation", False)
    entry.write("axis.simulation", False)
    system.cycles(10)
    assert not plant.written
    system.start()
    system.until(system["x"].power().status)
    assert plant.written
    assert not system["x"].ref.NcToPlc.OpModeDWord & 0x100


@pytest.mark.requirement("NC-067", "NC-248", "NC-331")
def test_disabled_axis():
    """A disabled axis is not executed, nor are its encoder and drive; these cannot be disabled alone."""
    plant = Plant(0.0001)
    reads = []
    plant.read = lambda: reads.append(1)
    system = System()
    system.add(plant=plant, axis__disabled=True)
    system.add("y")
    system.start()
    power = system["x"].power()
    system.cycles(20)
    assert not power.Status
    assert not reads
    assert not plant.written
    assert system["x"].ref.NcToPlc.pack() == bytes(256)
    assert system["y"].ref.NcToPlc.StateDWord
    for key in ("enc.disabled", "drv.disabled"):
        with pytest.raises(ConfigurationError, match=key):
            system.add("z", **{key.replace(".", "__"): True})
        system.project.entries.pop("z", None)


@pytest.mark.requirement("NC-026")
def test_warnings_at_activation():
    """Missing monitoring is a warning of the activation."""
    system = System()
    system.add(axis__position_lag_monitoring=False)
    system.start()
    texts = [one.data["text"] for one in system.history.events if one.kind == "nc.warning"]
    assert any("position_lag" in text for text in texts)
    assert any("soft_limit_max" in text for text in texts)


def test_offline_and_online_parameters():
    """An offline value acts with the next activation or a download, an online one at once; an upload keeps
    it. A refused activation leaves what runs.
    """
    system = System()
    entry = system.add(axis__maximum_velocity=1000.0)
    system.start()
    x = system["x"]
    system.until(x.power().status)
    entry.write("axis.maximum_velocity", 500.0)
    assert x.read_parameter("axis.maximum_velocity") == 1000.0
    system.project.download("x")
    assert x.read_parameter("axis.maximum_velocity") == 500.0
    x.write_parameter("axis.manual_velocity_slow", 55.0)
    assert entry.read("axis.manual_velocity_slow") == 100.0
    system.project.upload("x")
    assert entry.read("axis.manual_velocity_slow") == 55.0
    x.write_parameter("axis.manual_velocity_slow", 66.0)
    system.start()
    assert x.read_parameter("axis.manual_velocity_slow") == 55.0
    system.until(x.power().status)
    jog = x.jog(JogMode.MC_JOGMODE_STANDARD_SLOW)
    system.cycles(500)
    assert x.ref.NcToPlc.SetVelo == 55.0
    entry.write("axis.maximum_velocity", 5000.0)
    with pytest.raises(ConfigurationError, match=r"axis x: axis\.maximum_velocity"):
        system.project.activate()
    system.cycles(5)
    assert jog.Busy
    assert x.ref.NcToPlc.SetVelo == 55.0


# -- encoder axes

_ENCODER = {"enc__encoder_mask": 0xFFFFFFFF, "enc__scaling_numerator": 0.001}


@pytest.mark.requirement("NC-058", "NC-059", "NC-060", "NC-066")
def test_encoder_axis():
    """An encoder axis has neither drive nor controller, leads but never follows, shows its actual values as
    set values, and refuses commands, enable and homing; a position may be set.
    """
    plant = Plant(0.001)
    system = System()
    entry = system.add("e", plant=plant, kind=AxisKind.ENCODER, **_ENCODER)
    assert set(entry.object_ids) == {"axis", "encoder"}
    system.add("s")
    system.start()
    e, s = system["e"], system["s"]
    system.until(s.power().status)
    power = e.power()
    refused = [e.move_absolute(5.0, Velocity=10.0), e.home(), e.gear_in(s), e.halt()]
    system.cycles(3)
    assert power.Error
    assert not power.Status
    assert [one.ErrorID for one in refused] == [0x4B05] * 4
    gear = s.gear_in(e, 2.0)
    system.cycles(2)
    assert gear.in_gear()
    noise = iter([0.3, -0.2, 0.4, 0.1, 0.0, 0.25] * 20)
    for _ in range(60):
        plant.position += 0.1 + next(noise)
        system.cycles()
        image = e.ref.NcToPlc
        assert image.SetPos == image.ActPos == pytest.approx(plant.raw * 0.001)
        assert image.SetVelo == image.ActVelo
        assert s.ref.NcToPlc.SetPos == pytest.approx(2.0 * image.SetPos)
    assert not plant.written
    assert not e.ref.NcToPlc.StateDWord & 1 << 20
    e.power(False)
    e.set_position(100.0)
    system.cycles(3)
    assert e.position == pytest.approx(100.0)
    system.cycles(5)
    assert s.ref.NcToPlc.SetPos == pytest.approx(2.0 * plant.raw * 0.001)
    assert not s.error_id


def test_ended_blocks_are_not_called():
    """A program does not grow with the commands that have ended: they are called again when Execute falls."""
    rig = Rig().enabled()
    first = rig.handle.move_absolute(1.0, Velocity=100.0)
    rig.until(first.done)
    for target in range(2, 30):
        rig.until(rig.handle.move_absolute(float(target), Velocity=100.0).done)
    assert len(rig.runtime.program) <= 3
    assert first.Done
    first.set(Execute=False)
    rig.cycles(2)
    assert not first.Done
    first.set(Execute=True, Position=0.0)
    rig.cycles(2)
    rig.until(first.done)
    assert rig.generator.s == 0.0

"""Access classes of the variables of technology objects: who may write what, and when it takes effect."""

import math

import pytest

from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from motion.s7.variables import (
    ParameterError,
    VariableAccessError,
    VariableError,
    VariableStore,
    Violation,
)
from testcases.catalogue import each

TYPES = ("SpeedAxis", "PositioningAxis", "SynchronousAxis", "ExternalEncoder")


@pytest.fixture
def store() -> VariableStore:
    return VariableStore("PositioningAxis")


def every(access):
    """Return (object type, path) of every variable of an access class; of arrays the first element."""
    return [
        pytest.param(kind, path, id=f"{kind} {path}")
        for kind in TYPES
        for path in VariableStore(kind).paths(access)
        if not any(f"[{number}]" in path for number in range(2, 33))
    ]


def other_value(store, path):
    """Return a permitted value that differs from the present one."""
    variable = store.describe(path)
    present = store.read(path)
    if variable.data_type == "BOOL":
        return not present
    if variable.enum:
        return next((value for value in variable.enum if value != present), None)
    motion_type = store.read("Properties.MotionType") if variable.variants else 0
    low, high = variable.limits(motion_type)
    return high if present != high else low


class TestDirect:
    """Access class DIR."""

    def check_next_servo_cycle(self, kind, path):
        store = VariableStore(kind)
        cell, before = store.bind(path), store.read(path)
        in_force, factor = cell.value, store.factors.of(store.describe(path).unit)
        value = other_value(store, path)

        store.write(path, value)
        assert (cell.value, store.read(path)) == (in_force, value)
        store.latch()

        assert (cell.value, store.read(path), store.start_value(path)) == (value * factor, value, before)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-001", "VAR-217")
    def test_next_servo_cycle(self, subtests):
        """An assigned value is read back at once and takes effect with the next MC_Servo, start value
        untouched.
        """
        for label, values in each(every("DIR")):
            with subtests.test(label):
                self.check_next_servo_cycle(*values)

    def test_last_assignment_counts(self, store):
        """Of several assignments before one MC_Servo the last one takes effect; later cycles keep it."""
        for value in (10.0, 20.0, 30.0):
            store.write("Override.Velocity", value)
        store.latch()
        store.latch()

        assert store.bind("Override.Velocity").value == 30.0

    @pytest.mark.requirement("VAR-015", "VAR-230")
    @pytest.mark.parametrize(
        ("path", "value", "effective"),
        [
            ("Override.Velocity", 250.0, 200.0),
            ("Override.Velocity", -1.0, 0.0),
            ("PositionControl.Kpc", 151.0, 150.0),
            ("FollowingError.WarningLevel", 101.0, 100.0),
            ("DynamicLimits.MaxJerk", math.inf, 1e12),
        ],
    )
    def test_clamped_silently(self, path, value, effective):
        """An LREAL outside its range becomes the nearest bound, with neither error nor OB 121."""
        errors = []
        store = VariableStore("PositioningAxis", on_programming_error=lambda *args: errors.append(args))

        store.write(path, value)
        store.latch()

        assert store.bind(path).value == effective
        assert errors == []

    def check_both_bounds(self, kind, path):
        store = VariableStore(kind)
        variable = store.describe(path)
        if variable.data_type == "BOOL":
            low, high, below, above = False, True, -1, 2
        else:
            low, high = variable.limits(0)
            below, above = (
                (low - 1, high + 1)
                if variable.data_type != "LREAL"
                else (math.nextafter(low, -math.inf), math.nextafter(high, math.inf))
            )
        for value in (low, high):
            store.write(path, value)
            store.latch()
            assert store.read(path) == value
            for outside in (below, above):
                store.write(path, outside)
                store.latch()
                assert low <= store.read(path) <= high

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-015", "VAR-217")
    def test_both_bounds(self, subtests):
        """Both ends of a range are permitted; one step outside is not kept."""
        for label, values in each(every("DIR") + every("CAL")):
            with subtests.test(label):
                self.check_both_bounds(*values)

    @pytest.mark.requirement("CTL-105", "VAR-015")
    @pytest.mark.parametrize(
        ("path", "value"),
        [
            ("Sensor[1].Backlash.DirectionAbsoluteHoming", 2),
            ("Sensor[1].Backlash.Enable", 2),
            ("Sensor[1].PassiveHoming.Direction", -1),
            ("PositioningMonitoring.Window", math.nan),
        ],
    )
    def test_dropped_with_ob_121(self, path, value):
        """DINT and BOOL outside their range, and NaN, change nothing and start OB 121."""
        errors = []
        history = History(VirtualScheduler())
        store = VariableStore(
            "PositioningAxis",
            name="axis",
            history=history,
            on_programming_error=lambda *args: errors.append(args),
        )
        before = store.read(path)

        store.write(path, value)
        store.latch()

        assert store.read(path) == before
        assert errors == [(path, value)]
        assert [
            (event.source, event.kind, event.data["ob"], event.data["path"]) for event in history.events
        ] == [("axis", "program.error", 121, path)]

    @pytest.mark.parametrize(
        ("path", "value"),
        [
            ("Override.Velocity", True),
            ("Override.Velocity", "50"),
            ("Sensor[1].ActiveHoming.Direction", 1.0),
            ("Sensor[1].ActiveHoming.Direction", True),
            ("PositionLimits_SW.Active", 1.0),
            ("PositionLimits_SW.Active", None),
        ],
    )
    def test_wrong_type(self, store, path, value):
        """A value of another type is a mistake of the caller and names variable, type and value."""
        with pytest.raises(VariableError, match=r"is of type \w+ and cannot take"):
            store.write(path, value)


class TestOnCall:
    """Access class CAL."""

    def check_readable_at_once(self, kind, path):
        store = VariableStore(kind)
        cell, before = store.bind(path), store.read(path)
        factor = store.factors.of(store.describe(path).unit)
        value = other_value(store, path)

        store.write(path, value)

        assert (cell.value, store.read(path), store.start_value(path)) == (value * factor, value, before)

    @pytest.mark.requirement("VAR-002", "VAR-217")
    def test_readable_at_once(self, subtests):
        """An assigned value is there at once for the reader and for the next call of an instruction."""
        for label, values in each(every("CAL")):
            with subtests.test(label):
                self.check_readable_at_once(*values)


class TestRestartRelevant:
    """Access class RES, start values and restart."""

    def check_only_by_restart(self, kind, path):
        store = VariableStore(kind)
        before, value = store.read(path), other_value(store, path)
        with pytest.raises(VariableAccessError, match=r"write_start.*MC_Reset with Restart = TRUE"):
            store.write(path, value)
        assert not store.online_start_values_changed

        store.write_start(path, value)
        store.latch()
        assert (store.read(path), store.start_value(path), store.online_start_values_changed) == (
            before,
            value,
            True,
        )

        assert store.restart() == ()
        assert (store.read(path), store.online_start_values_changed) == (value, False)

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-005", "VAR-009", "VAR-216", "VAR-217", "STP-064", "STP-076")
    def test_only_by_restart(self, subtests):
        """An assignment is refused; a start value takes effect with the restart and X3 shows it until
        then.
        """
        for label, values in each(every("RES")):
            with subtests.test(label):
                self.check_only_by_restart(*values)

    @pytest.mark.requirement("STP-075")
    def test_all_together(self, store):
        """Start values that depend on each other come into force together."""
        store.write_start("LoadGear.Numerator", 3)
        store.write_start("LoadGear.Denominator", 2)
        store.restart()

        assert (store.read("LoadGear.Numerator"), store.read("LoadGear.Denominator")) == (3, 2)

    def test_change_taken_back(self, store):
        """A start value written back to the value in force needs no restart."""
        store.write_start("LoadGear.Numerator", 3)
        store.write_start("LoadGear.Numerator", 1)

        assert not store.online_start_values_changed

    @pytest.mark.requirement("VAR-227")
    def test_direct_values_fall_back(self, store):
        """DIR and CAL values return to their start values with the restart, an assignment under way
        included.
        """
        store.write("PositionControl.Kv", 50.0)
        store.write("DynamicDefaults.Velocity", 1.0)
        store.latch()
        store.write("Override.Velocity", 10.0)

        store.restart()
        store.latch()

        assert store.read("PositionControl.Kv") == store.start_value("PositionControl.Kv")
        assert store.read("DynamicDefaults.Velocity") == store.start_value("DynamicDefaults.Velocity")
        assert store.read("Override.Velocity") == 100.0

    @pytest.mark.requirement("VAR-227")
    def test_start_value_of_a_direct_variable(self, store):
        """A start value written for a DIR variable lasts; it takes effect with the restart and needs none
        (X3).
        """
        store.write_start("PositionControl.Kv", 50.0)
        assert (store.read("PositionControl.Kv"), store.online_start_values_changed) == (10.0, False)

        store.restart()

        assert store.read("PositionControl.Kv") == 50.0

    @pytest.mark.requirement("VAR-018", "STP-355")
    def test_start_values_out_of_range(self, store):
        """Start values are not clipped; those out of range stop the restart, which then changes nothing."""
        store.write_start("Modulo.Length", 500.0)
        store.write_start("LoadGear.Numerator", 0)
        store.write_start("Actor.RemoveEnableReaction", 2)

        assert store.restart() == (
            Violation("Actor.RemoveEnableReaction", 2, "1 (OFF1), 3 (OFF2), 5 (OFF3), 7 (OFF3_COMPAT)"),
            Violation("LoadGear.Numerator", 0, "1 to 4.29497e+09"),
        )
        assert (store.read("Modulo.Length"), store.online_start_values_changed) == (1000.0, True)

        store.write_start("LoadGear.Numerator", 1)
        store.write_start("Actor.RemoveEnableReaction", 5)
        assert store.restart() == ()
        assert store.read("Modulo.Length") == 500.0

    def test_values_of_the_runtime_stay(self, store):
        """Read-only values are the runtime's and no restart touches them."""
        store.set_internal("StatusSensor[1].AbsEncoderOffset", 12.5)
        store.restart()

        assert store.read("StatusSensor[1].AbsEncoderOffset") == 12.5


class TestReadOnly:
    """Access class RON."""

    def check_refused(self, kind, path):
        store = VariableStore(kind)
        before = store.read(path)

        with pytest.raises(VariableAccessError, match="is read only"):
            store.write(path, before)
        with pytest.raises(VariableAccessError, match="is read only"):
            store.write_start(path, before)

        assert store.read(path) == before

    @pytest.mark.exhaustive
    @pytest.mark.requirement("VAR-009", "VAR-014", "VAR-217")
    def test_refused(self, subtests):
        """Neither the value nor the start value of a read-only variable can be written."""
        for label, values in each(every("RON")):
            with subtests.test(label):
                self.check_refused(*values)

    def test_bit_refused(self, store):
        """Bits of status words are read only as well."""
        with pytest.raises(VariableAccessError, match=r"StatusWord\.X5 is read only"):
            store.write("StatusWord.X5", True)


class TestWriteParameter:
    """`MC_WriteParameter`."""

    @pytest.mark.requirement("VAR-010", "STP-356")
    @pytest.mark.parametrize(
        ("number", "path", "value"),
        [(1000, "PositionLimits_HW.Active", True), (1020, "Actor.RemoveEnableReaction", 3)],
    )
    def test_at_once(self, store, number, path, value):
        """1000 and 1020 change their restart-relevant variable at once, without a need for a restart."""
        store.write_parameter(number, value)

        assert (store.read(path), store.online_start_values_changed) == (value, False)

    @pytest.mark.requirement("VAR-013", "STP-081")
    def test_direct_parameter_falls_back(self, store):
        """A restart brings the start value back."""
        store.write_parameter(1020, 1)
        store.restart()

        assert store.read("Actor.RemoveEnableReaction") == 7

    @pytest.mark.requirement("VAR-012")
    @pytest.mark.parametrize("kind", TYPES)
    @pytest.mark.parametrize("number", [1010, 1011, 1012])
    def test_after_restart(self, kind, number):
        """1010 to 1012 (default 0.0 s) set X3, take effect with the restart, outlast the next and not a power
        cycle.
        """
        store = VariableStore(kind)
        cell = store.parameter(number)
        assert cell.cell.value == 0.0

        store.write_parameter(number, 0.002)
        assert (cell.cell.value, store.online_start_values_changed) == (0.0, True)

        store.restart()
        store.restart()
        assert (cell.cell.value, store.online_start_values_changed) == (0.002, False)

        store.power_cycle()
        assert cell.cell.value == 0.0

    @pytest.mark.requirement("STP-355")
    @pytest.mark.parametrize(
        ("number", "value", "error_id"),
        [
            (1001, 1.0, 0x805A),
            (1010, True, 0x805C),
            (1010, -0.001, 0x805C),
            (1000, 1.0, 0x805C),
            (1020, 2, 0x8FFF),
        ],
    )
    def test_rejected(self, store, number, value, error_id):
        """An unknown number, a wrong type and a value that is not permitted are rejected; the old value
        stays.
        """
        with pytest.raises(ParameterError) as caught:
            store.write_parameter(number, value)

        assert caught.value.error_id == error_id
        assert store.read("Actor.RemoveEnableReaction") == 7
        assert not store.online_start_values_changed

    def test_not_for_every_object(self):
        """An external encoder has no limit switches and no drive."""
        with pytest.raises(ParameterError, match="there are 1010, 1011, 1012"):
            VariableStore("ExternalEncoder").write_parameter(1000, True)


def test_access_classes_are_complete():
    """The numbers of variables per access class are those of the guide to the data blocks."""
    counts = {
        kind: [
            len([path for path in store.paths(access) if keep(path)])
            for access in ("DIR", "CAL", "RES", "RON")
        ]
        for kind, store in ((kind, VariableStore(kind)) for kind in TYPES if kind != "SynchronousAxis")
    }

    assert counts == {
        "SpeedAxis": [6, 6, 16, 34],
        "PositioningAxis": [45, 15, 65, 84],
        "ExternalEncoder": [9, 3, 24, 39],
    }


def keep(path):
    """Return whether a path is no repetition of another array element, and no further part of an address."""
    if "SwitchAddress." in path and not path.endswith(".RID"):
        return False
    return not any(f"[{number}]" in path for number in range(2, 33))

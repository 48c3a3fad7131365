"""Pending technology alarms: words, detail, acknowledging, held causes and restart."""

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from fieldbus.clock import MS, VirtualScheduler
from fieldbus.history import History
from motion.s7.alarms import AlarmEngine, AlarmError, catalogue, severity


class Bench:
    """An engine with its history and the calls it makes."""

    def __init__(self, object_type="PositioningAxis"):
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.calls = []
        self.engine = AlarmEngine(
            "axis",
            object_type=object_type,
            history=self.history,
            on_alarm=lambda raised: self.calls.append((raised.number, raised.reaction)),
        )

    def kinds(self):
        return [(event.kind, event.data.get("number")) for event in self.history.events]


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.requirement("TA-011")
def test_the_end_of_a_cause_is_reported(bench):
    """`alarm.gone` comes once, while the alarm is pending; after an acknowledgement nobody has to know."""
    bench.engine.set_cause(421, True)
    bench.engine.set_cause(421, False)
    bench.engine.set_cause(421, False)
    bench.engine.acknowledge()
    bench.engine.set_cause(431, True)
    bench.engine.acknowledge()
    bench.engine.set_cause(431, False)
    assert [kind for kind, _ in bench.kinds()].count("alarm.gone") == 1
    assert bench.kinds()[:2] == [("alarm.raised", 421), ("alarm.gone", 421)]


class TestRaising:
    """What an alarm does at the moment of raising."""

    @pytest.mark.requirement("TA-001")
    def test_error(self, bench):
        """An alarm of class F sets its bit of the error word and shows in the detail."""
        raised = bench.engine.raise_alarm(521)

        engine = bench.engine
        assert (engine.error_word, engine.warning_word, engine.error) == (1 << 11, 0, True)
        assert (engine.number, engine.reaction, engine.highest) == (521, 4, raised)
        assert bench.calls == [(521, 4)]

    @pytest.mark.requirement("TA-002", "VAR-085")
    def test_warning(self, bench):
        """An alarm of class W sets its bit of the warning word only and is no error."""
        bench.engine.raise_alarm(501)

        engine = bench.engine
        assert (engine.error_word, engine.warning_word, engine.error) == (0, 1 << 6, False)
        assert (engine.number, engine.reaction) == (501, 0)

    @pytest.mark.requirement("TA-023", "VAR-029")
    def test_error_without_reaction(self, bench):
        """202 has no reaction but an error bit: it is an error."""
        bench.engine.raise_alarm(202)

        assert (bench.engine.error, bench.engine.reaction) == (True, 0)

    def test_words_are_set_when_the_axis_is_called(self):
        """The call comes after words and detail have changed."""
        seen = []
        engine = AlarmEngine("axis", on_alarm=lambda raised: seen.append((engine.error_word, engine.number)))

        engine.raise_alarm(431)

        assert seen == [(1 << 7, 431)]

    def test_event(self, bench):
        """The history shows number, reaction, text, supplementary value and class, at the time of raising."""
        bench.scheduler.run_for(5 * MS)
        bench.engine.raise_alarm(541, info=2)

        (event,) = bench.history.events
        assert (event.time_ns, event.source, event.kind) == (5 * MS, "axis", "alarm.raised")
        assert event.data == {
            "number": 541,
            "reaction": 4,
            "text": "Positioning monitoring error: target window left again within the minimum dwell time",
            "info": 2,
            "alarm_class": "F",
        }

    def test_own_text(self, bench):
        """A text given takes the place of the cause from the catalogue."""
        raised = bench.engine.raise_alarm(101, text="LoadGear.Numerator = 0")

        assert raised.text.endswith(": LoadGear.Numerator = 0")

    @pytest.mark.parametrize(
        ("number", "reaction"), [(531, 3), (531, 4), (533, 1), (533, 2), (534, 3), (534, 4)]
    )
    def test_configurable_reaction(self, bench, number, reaction):
        """The configured reaction is shown and reported."""
        bench.engine.raise_alarm(number, reaction=reaction)

        assert (bench.engine.number, bench.engine.reaction, bench.calls) == (
            number,
            reaction,
            [(number, reaction)],
        )

    @pytest.mark.requirement("VAR-095")
    def test_external_encoder(self):
        """An external encoder shows reaction 10."""
        bench = Bench("ExternalEncoder")
        bench.engine.raise_alarm(411)

        assert bench.engine.reaction == 10

    def test_pending_already(self, bench):
        """A pending alarm is not raised a second time."""
        first = bench.engine.raise_alarm(541, info=1)

        assert bench.engine.raise_alarm(541, info=2) is first
        assert (len(bench.history.events), len(bench.calls)) == (1, 1)

    def test_stronger_reaction(self, bench):
        """A pending alarm raised with a stronger reaction takes it, keeps its place, and the axis is
        informed.
        """
        bench.engine.raise_alarm(531, reaction=3)
        bench.engine.raise_alarm(321)
        bench.engine.raise_alarm(531, reaction=4)

        assert bench.calls == [(531, 3), (321, 3), (531, 4)]
        assert [(pending.number, pending.reaction) for pending in bench.engine.pending] == [
            (531, 4),
            (321, 3),
        ]

    def test_stronger_reaction_keeps_the_order(self, bench):
        """An alarm whose reaction became stronger counts as raised when it was raised first."""
        bench.engine.raise_alarm(531, reaction=3)
        bench.engine.raise_alarm(521)
        assert bench.engine.number == 521

        bench.engine.raise_alarm(531, reaction=4)

        assert bench.engine.number == 531

    @pytest.mark.requirement("TA-011")
    def test_diagnostic_buffer(self, bench):
        """The diagnostic buffer gets exactly the alarms that the catalogue marks; the history gets all."""
        numbers = [entry.number for entry in catalogue().values() if "PositioningAxis" in entry.applies_to]
        bench.scheduler.run_for(MS)
        for number in numbers:
            bench.engine.raise_alarm(number)

        recorded = [entry.number for entry in bench.engine.diagnostic_buffer]
        assert recorded == [number for number in numbers if catalogue()[number].diagnostic_buffer]
        assert {entry.time_ns for entry in bench.engine.diagnostic_buffer} == {MS}
        assert bench.kinds() == [("alarm.raised", number) for number in numbers]

    @pytest.mark.parametrize(
        ("object_type", "number", "options", "message"),
        [
            ("PositioningAxis", 999, {}, "there is no technology alarm 999"),
            ("SpeedAxis", 411, {}, "alarm 411 cannot occur on SpeedAxis, only on PositioningAxis"),
            ("PositioningAxis", 521, {"reaction": 3}, "alarm 521 has no reaction 3; it has 4"),
            ("PositioningAxis", 533, {"reaction": 4}, "alarm 533 has no reaction 4; it has 2, 1"),
            ("ExternalEncoder", 411, {"reaction": 4}, "alarm 411 has no reaction 4; it has 10"),
            ("PositioningAxis", 521, {"restart": True}, "alarm 521 has a fixed way of clearing it"),
        ],
    )
    def test_mistakes(self, object_type, number, options, message):
        """What the catalogue does not provide for is refused, and nothing becomes pending."""
        engine = Bench(object_type).engine
        with pytest.raises(AlarmError) as caught:
            engine.raise_alarm(number, **options)

        assert str(caught.value).startswith(message)
        assert engine.pending == ()


class TestPriority:
    """Which alarm the detail shows."""

    @pytest.mark.requirement("TA-003", "TA-004", "VAR-097", "STP-346")
    @pytest.mark.parametrize(
        ("numbers", "shown"),
        [
            pytest.param([501, 522], 501, id="the earlier of equals"),
            pytest.param([501, 202], 202, id="an error before a warning"),
            pytest.param([321, 550], 550, id="tracking before emergency stop"),
            pytest.param([550, 421], 421, id="remove enable before tracking"),
            pytest.param([533, 321], 321, id="emergency stop before maximum dynamics"),
            pytest.param([521, 101], 101, id="restart class before acknowledgeable class"),
            pytest.param([521, 431], 521, id="equal effect and class: the earlier"),
            pytest.param([431, 521], 431, id="equal effect and class: the earlier, other order"),
        ],
    )
    def test_highest_is_shown(self, bench, numbers, shown):
        """The strongest effect counts, then the class, then the order of raising."""
        for number in numbers:
            bench.engine.raise_alarm(number)

        assert bench.engine.number == shown
        assert bench.engine.reaction == catalogue()[shown].reactions[0]

    @pytest.mark.requirement("VAR-086")
    def test_group_bit(self, bench):
        """A group bit stays as long as one alarm of the group is pending."""
        bench.engine.raise_alarm(101)
        bench.engine.raise_alarm(104)
        assert bench.engine.acknowledge() == (101,)
        assert bench.engine.error_word == 1 << 1

        bench.engine.restart()
        assert bench.engine.error_word == 0


class TestClearing:
    """Acknowledging and restarting."""

    @pytest.mark.requirement("TA-007", "STP-066", "STP-067", "VAR-087", "VAR-097")
    def test_acknowledge(self, bench):
        """Acknowledging clears all warnings and class F alarms together, words and detail with them."""
        for number in (501, 521, 541):
            bench.engine.raise_alarm(number)

        assert bench.engine.acknowledge() == ()

        engine = bench.engine
        assert (engine.error_word, engine.warning_word, engine.number, engine.reaction) == (0, 0, 0, 0)
        assert (engine.pending, engine.highest, engine.error) == ((), None, False)
        assert bench.kinds()[3:] == [
            ("alarm.acknowledged", None),
            ("alarm.cleared", 501),
            ("alarm.cleared", 521),
            ("alarm.cleared", 541),
        ]

    def test_nothing_to_acknowledge(self, bench):
        """A second acknowledgement has no effect and leaves no trace."""
        bench.engine.raise_alarm(521)
        bench.engine.acknowledge()
        count = len(bench.history.events)

        assert bench.engine.acknowledge() == ()
        assert len(bench.history.events) == count

    @pytest.mark.requirement("TA-008", "STP-064", "VAR-087")
    def test_restart_class(self, bench):
        """A class R alarm survives acknowledging; the restart clears it."""
        bench.engine.raise_alarm(101)
        assert bench.engine.acknowledge() == (101,)
        assert (bench.engine.number, bench.engine.error) == (101, True)

        assert bench.engine.restart() == ()
        assert (bench.engine.number, bench.engine.error) == (0, False)

    @pytest.mark.requirement("STP-079")
    def test_restart_acknowledges_all(self, bench):
        """The restart clears the acknowledgeable alarms as well."""
        for number in (501, 521, 202):
            bench.engine.raise_alarm(number)
        bench.engine.restart()

        assert bench.engine.pending == ()

    def test_cause_decides_about_the_restart(self, bench):
        """For 531 the cause decides whether acknowledging is enough."""
        bench.engine.raise_alarm(531, info=5, restart=True)
        assert bench.engine.acknowledge() == (531,)
        bench.engine.restart()

        bench.engine.raise_alarm(531, info=5)
        assert bench.engine.acknowledge() == ()

    @pytest.mark.requirement("TA-007", "STP-072")
    def test_cause_still_present(self, bench):
        """An acknowledged alarm whose cause is present is raised again in the next cycle, others are not."""
        bench.engine.set_cause(411, True, info=2)
        bench.engine.raise_alarm(521)
        bench.engine.update()
        assert bench.engine.acknowledge() == ()
        assert bench.engine.number == 0

        bench.engine.update()

        assert [pending.number for pending in bench.engine.pending] == [411]
        assert bench.engine.pending[0].text.endswith("encoder hardware error")
        assert bench.calls == [(411, 4), (521, 4), (411, 4)]

    @pytest.mark.requirement("TA-007")
    def test_cause_reported_in_every_cycle(self, bench):
        """A cause reported in every cycle raises its alarm once, and once more after an acknowledgement."""
        for _ in range(3):
            bench.engine.set_cause(431, True)
        bench.engine.acknowledge()
        for _ in range(3):
            bench.engine.set_cause(431, True)
            bench.engine.update()

        assert bench.calls == [(431, 4), (431, 4)]

    @pytest.mark.requirement("TA-007")
    def test_cause_gone(self, bench):
        """When a cause goes, the alarm stays until it is acknowledged, and does not come back after that."""
        bench.engine.set_cause(411, True)
        bench.engine.set_cause(411, False)
        bench.engine.update()
        assert bench.engine.is_pending(411)
        assert not bench.engine.cause_active(411)

        bench.engine.acknowledge()
        bench.engine.update()
        assert bench.engine.pending == ()

    def test_cause_returns_while_pending(self, bench):
        """A cause that comes back before the acknowledgement is no new alarm, but holds the old one."""
        bench.engine.set_cause(411, True)
        bench.engine.set_cause(411, False)
        bench.engine.set_cause(411, True)
        assert len(bench.calls) == 1

        bench.engine.acknowledge()
        bench.engine.update()
        assert bench.engine.is_pending(411)

    def test_cause_survives_a_restart(self, bench):
        """A cause that is present raises its alarm again after a restart."""
        bench.engine.set_cause(101, True, text="Modulo.Length")
        bench.engine.restart()
        bench.engine.update()

        assert bench.engine.pending[0].text.endswith(": Modulo.Length")


AXIS_ALARMS = [entry.number for entry in catalogue().values() if "PositioningAxis" in entry.applies_to]


class EngineMachine(RuleBasedStateMachine):
    """Any order of calls against a plain list of pending alarms."""

    def __init__(self):
        super().__init__()
        self.engine = AlarmEngine("axis")
        self.pending = {}
        self.causes = set()
        self.acknowledged = False

    def put(self, number):
        self.pending.setdefault(number, len(self.pending) and max(self.pending.values()) + 1)

    @rule(number=st.sampled_from(AXIS_ALARMS))
    def raise_alarm(self, number):
        self.engine.raise_alarm(number)
        self.put(number)

    @rule(number=st.sampled_from(AXIS_ALARMS), active=st.booleans())
    def set_cause(self, number, active):
        self.engine.set_cause(number, active)
        if active:
            self.causes.add(number)
            self.put(number)
        else:
            self.causes.discard(number)

    @rule()
    def acknowledge(self):
        kept = {
            number: order for number, order in self.pending.items() if catalogue()[number].alarm_class == "R"
        }
        assert set(self.engine.acknowledge()) == set(kept)
        self.pending = kept
        self.acknowledged = True

    @rule()
    def restart(self):
        self.engine.restart()
        self.pending = {}
        self.acknowledged = True

    @rule()
    def update(self):
        self.engine.update()
        if self.acknowledged:
            self.acknowledged = False
            for number in [one for one in AXIS_ALARMS if one in self.causes]:
                if number not in self.pending:
                    assert self.engine.is_pending(number)
            for pending in self.engine.pending:
                self.put(pending.number)
            assert set(self.pending) >= self.causes

    @invariant()
    def words_and_detail(self):
        """Words are the bits of the pending alarms; the detail shows the first of the highest rank."""
        entries = [catalogue()[number] for number in self.pending]
        assert {pending.number for pending in self.engine.pending} == set(self.pending)
        assert self.engine.error_word == sum(
            1 << bit for bit in {entry.error_bit for entry in entries} if bit is not None
        )
        assert self.engine.warning_word == sum(
            1 << bit for bit in {entry.warning_bit for entry in entries} if bit is not None
        )
        ranked = sorted(
            self.pending,
            key=lambda number: (
                -severity(catalogue()[number].reactions[0]),
                "RFW".index(catalogue()[number].alarm_class),
                self.pending[number],
            ),
        )
        assert self.engine.number == (ranked[0] if ranked else 0)


TestEngineMachine = pytest.mark.exhaustive(EngineMachine.TestCase)

"""The history: one ordered log, and listeners that cannot disturb each other."""

import pytest

from fieldbus.clock import VirtualScheduler
from fieldbus.history import Event, History


@pytest.fixture
def scheduler():
    return VirtualScheduler()


@pytest.fixture
def history(scheduler):
    return History(scheduler)


def test_events_carry_the_time_and_keep_their_order(scheduler, history):
    """An event has the present time, its source, kind and data, in the order of emission."""
    scheduler.at(5, lambda: history.emit("drive", "drive.state", to="Operation enabled"))
    scheduler.at(5, lambda: history.emit("axis", "job.done", job="move"))
    scheduler.at(9, lambda: history.emit("drive", "drive.fault", code=0x7500, text="communication"))
    scheduler.run_for(10)
    assert history.events == [
        Event(5, "drive", "drive.state", {"to": "Operation enabled"}),
        Event(5, "axis", "job.done", {"job": "move"}),
        Event(9, "drive", "drive.fault", {"code": 0x7500, "text": "communication"}),
    ]


def test_data_may_be_named_like_the_parameters(history):
    """`source` and `kind` are free as names of details."""
    history.emit("bench", "fault.applied", source="medium", kind="drop")
    assert history.events[0].data == {"source": "medium", "kind": "drop"}


def test_listeners_hear_every_event_from_then_on(history):
    """A listener hears what comes after it, in order, until it is ended; ending twice is harmless."""
    heard = []
    history.emit("a", "before")
    end = history.listen(lambda event: heard.append(event.kind))
    history.emit("a", "one")
    history.emit("a", "two")
    end()
    end()
    history.emit("a", "after")
    assert heard == ["one", "two"]
    assert [event.kind for event in history.events] == ["before", "one", "two", "after"]


def test_a_listener_that_ends_itself_hides_nothing_from_the_next(history):
    """Ending a listener from inside of it does not make the following one miss the event."""
    heard = []

    def once(event):
        heard.append(("once", event.kind))
        end()

    end = history.listen(once)
    history.listen(lambda event: heard.append(("always", event.kind)))
    history.emit("a", "one")
    history.emit("a", "two")
    assert heard == [("once", "one"), ("always", "one"), ("always", "two")]


def test_a_listener_that_comes_in_an_event_hears_the_next_one(history):
    """A listener entered by another listener starts with the following event."""
    heard = []

    def first(event):
        if event.kind == "one":
            history.listen(lambda later: heard.append(later.kind))

    history.listen(first)
    history.emit("a", "one")
    assert heard == []
    history.emit("a", "two")
    assert heard == ["two"]


def test_the_same_function_can_listen_twice(history):
    """Each `listen` is a subscription of its own, ended by its own function."""
    heard = []
    history.listen(heard.append)
    end = history.listen(heard.append)
    history.emit("a", "one")
    assert len(heard) == 2
    end()
    end()
    history.emit("a", "two")
    assert len(heard) == 3


def test_select_by_source_and_kind(history):
    """A kind selects exactly; with a trailing dot it selects the family; conditions add up."""
    history.emit("drive1", "alarm.raised", number=1)
    history.emit("drive2", "alarm.cleared", number=2)
    history.emit("drive1", "alarms", number=3)
    history.emit("drive1", "alarm", number=4)

    def numbers(**condition):
        return [event.data["number"] for event in history.select(**condition)]

    assert numbers() == [1, 2, 3, 4]
    assert numbers(kind="alarm.") == [1, 2]
    assert numbers(kind="alarm.raised") == [1]
    assert numbers(kind="alarm") == [4]
    assert numbers(source="drive1") == [1, 3, 4]
    assert numbers(source="drive1", kind="alarm.") == [1]
    assert numbers(source="nobody") == []

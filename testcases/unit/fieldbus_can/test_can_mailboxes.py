"""Mailboxes of a port: frames go straight to whoever takes them, and to nobody else."""

from __future__ import annotations

import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.clock import MS, VirtualScheduler


class Node:
    """A port with mailboxes, and what its handlers and its receiver have been given."""

    def __init__(self, medium: CanMedium, name: str, *identifiers: int) -> None:
        self.boxed: list[tuple[int, bytes, int]] = []
        self.loose: list[CanFrame] = []
        self.port = medium.attach(name, lambda frame, _time_ns: self.loose.append(frame))
        self.listen(*identifiers)

    def listen(self, *identifiers: int) -> None:
        self.port.accept(dict.fromkeys(identifiers, self._take))

    def _take(self, frame: CanFrame, time_ns: int) -> None:
        self.boxed.append((frame.can_id, frame.data, time_ns))


@pytest.fixture
def medium() -> CanMedium:
    return CanMedium(VirtualScheduler())


def sent(medium: CanMedium, *frames: CanFrame) -> list[int]:
    """Send frames from a node of their own, and return when they ended."""
    names = {port.name for port in medium.ports}
    sender = medium.port("sender") if "sender" in names else medium.attach("sender", lambda *_: None)
    before = len(medium.log)
    sender.send_all(frames)
    medium.scheduler.run_for(MS)
    return [end for end, *_ in medium.log[before:]]


def test_frames_go_to_their_mailbox_at_the_end_of_eof(medium: CanMedium) -> None:
    """A data frame with a mailbox is given to it at its end; one without is not handed over, but on the bus
    all the same.
    """
    node = Node(medium, "node", 0x181)
    ends = sent(medium, CanFrame(0x181, b"\1"), CanFrame(0x182, b"\2"))
    assert len(ends) == 2
    assert node.boxed == [(0x181, b"\1", ends[0])]
    assert node.loose == []


def test_other_frames_go_to_the_receiver_of_the_port(medium: CanMedium) -> None:
    """Remote frames and frames with 29-bit identifiers do not have mailboxes."""
    node = Node(medium, "node", 0x181)
    frames = (CanFrame(0x181, b"\1", extended=True), CanFrame(0x181, remote=True))
    sent(medium, *frames)
    assert node.boxed == []
    assert node.loose == list(frames)


def test_a_changed_table_holds_for_the_next_frame(medium: CanMedium) -> None:
    """Who takes a frame is looked up again when a table changes, and when nodes come."""
    node = Node(medium, "node", 0x181)
    sent(medium, CanFrame(0x181), CanFrame(0x182))
    node.listen(0x182)
    late = Node(medium, "late", 0x181, 0x182)
    sent(medium, CanFrame(0x181), CanFrame(0x182))
    assert [can_id for can_id, *_ in node.boxed] == [0x181, 0x182]
    assert [can_id for can_id, *_ in late.boxed] == [0x181, 0x182]


def test_a_taker_can_take_others_off_the_bus(medium: CanMedium) -> None:
    """A node that is switched off while a frame is handed over to the nodes before it does not get this
    frame.
    """
    first, second, third = (Node(medium, name) for name in ("first", "second", "third"))
    first.port.accept({0x181: lambda _frame, _time_ns: setattr(second.port, "online", False)})
    for node in (second, third):
        node.listen(0x181)
    sent(medium, CanFrame(0x181))
    assert second.boxed == []
    assert second.loose == []
    # What the third takes of this frame goes by its receiver, because its table may have changed as well.
    assert third.loose == [CanFrame(0x181)]


def test_delayed_reception_goes_by_the_receiver(medium: CanMedium) -> None:
    """Frames whose reception is delayed come through the receiver, in order and late."""
    node = Node(medium, "node", 0x181)
    node.port.receive_delay_ns = 200_000
    sent(medium, CanFrame(0x181, b"\1"), CanFrame(0x182, b"\2"))
    assert node.boxed == []
    assert [frame.can_id for frame in node.loose] == [0x181, 0x182]


def test_frames_sent_at_once_are_frames_sent_in_a_row(medium: CanMedium) -> None:
    """Times and order on the bus do not depend on whether frames are handed over one by one or together."""
    other = CanMedium(VirtualScheduler())
    frames = [CanFrame(can_id, bytes([can_id & 0xFF]) * 8) for can_id in (0x181, 0x381, 0x281, 0x381, 0x081)]
    for one in (medium, other):
        one.attach("listener", lambda *_: None)
    sender = other.attach("sender", lambda *_: None)
    for frame in frames:
        sender.send(frame)
    other.scheduler.run_for(MS)
    sent(medium, *frames)
    assert medium.log == other.log

"""The fault buffer: situations, acknowledgement, counters."""

from __future__ import annotations

import pytest

from emulators.drive.profidrive.faults.buffer import MESSAGES, SITUATIONS, FaultBuffer, FaultMessage


@pytest.mark.requirement("PD-133", "PD-134", "PD-135", "PD-137")
def test_acknowledging_shifts_by_a_situation():
    """Messages collect in the present situation; acknowledged, they are found one situation further."""
    buffer = FaultBuffer()
    assert buffer.enter(FaultMessage(7900, 3))
    assert buffer.enter(FaultMessage(30001))
    assert not buffer.enter(FaultMessage(7900, 9))  # is there already
    assert [message.number for message in buffer.present] == [7900, 30001]
    assert buffer.counter == 2
    assert buffer.acknowledge()
    assert (buffer.present, buffer.counter, buffer.situations) == ((), 3, 1)
    assert buffer.entry(0) is None
    assert (buffer.entry(8), buffer.entry(9)) == (FaultMessage(7900, 3), FaultMessage(30001))
    assert not buffer.acknowledge()  # nothing to acknowledge: no shift, no count
    assert buffer.counter == 3


@pytest.mark.requirement("PD-135", "PD-136", "PD-243", "PD-245")
def test_a_full_buffer():
    """Eight messages in a situation, the last place is overwritten; eight situations, the oldest goes."""
    buffer = FaultBuffer()
    for number in range(1, 12):
        buffer.enter(FaultMessage(number))
    assert [message.number for message in buffer.present] == [1, 2, 3, 4, 5, 6, 7, 11]
    for number in range(100, 100 + SITUATIONS + 3):
        buffer.acknowledge()
        buffer.enter(FaultMessage(number))
    assert buffer.situations == SITUATIONS
    assert [buffer.entry(MESSAGES * place).number for place in range(SITUATIONS)] == list(range(110, 102, -1))
    assert buffer.entry(MESSAGES * SITUATIONS) is None
    buffer.clear()
    assert (buffer.situations, buffer.present) == (0, ())


@pytest.mark.requirement("PD-134")
def test_the_counter_wraps_to_one():
    """65535 is followed by 1, never by 0."""
    buffer = FaultBuffer()
    buffer.counter = 0xFFFF
    buffer.enter(FaultMessage(1))
    assert buffer.counter == 1

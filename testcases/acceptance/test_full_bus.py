"""Ten nodes at a full bus, in virtual time: order, counters and the time on the wire stay exact."""

from __future__ import annotations

from itertools import pairwise

import pytest

from fieldbus.can import CanFrame, CanMedium, HookResult, frame_bits
from fieldbus.clock import MS, S, VirtualScheduler

pytestmark = pytest.mark.exhaustive

NODES = 10
SECONDS = 2


def saturate(*, corrupt_every: int = 0):
    """Let ten nodes keep their queues full for two seconds; return segment, ports, what was sent and
    received.
    """
    scheduler = VirtualScheduler()
    segment = CanMedium(scheduler, bitrate=1_000_000, name="full")
    received = [[] for _ in range(NODES)]
    sent = [[] for _ in range(NODES)]

    def receiver(number):
        return lambda frame, time_ns: received[number].append((time_ns, frame.can_id, frame.data))

    ports = [segment.attach(f"node{number}", receiver(number)) for number in range(NODES)]
    if corrupt_every:
        count = 0

        def disturb(_frame, _sender, _time_ns):
            nonlocal count
            count += 1
            return HookResult.corrupt(1) if count % corrupt_every == 0 else None

        segment.add_hook(disturb)

    def refill(number):
        port, own = ports[number], sent[number]
        while len(port.queue) < 4:
            data = len(own).to_bytes(4, "little") + bytes((number,)) * (len(own) % 5)
            # The priorities rotate, so that everybody gets the bus in turn.
            port.send(CanFrame(0x100 + (len(own) * 7 + number) % 50 * 10 + number, data))
            own.append(data)

    scheduler.every(MS, lambda: [refill(number) for number in range(NODES)])
    scheduler.run_for(SECONDS * S)
    return segment, ports, sent, received


@pytest.mark.requirement("CANP-011", "CANP-027", "CANP-031", "CANP-077")
def test_order_and_counters_at_full_load():
    """Every node hears every frame of the others, in the order of the wire; the bus never rests and nobody
    has an error.
    """
    segment, ports, sent, received = saturate()
    log = segment.log
    assert segment.bus_load() > 0.999
    assert len(log) > 14_000
    # Frame follows frame without a gap, and each takes exactly its bits.
    for (before, *_), (end, _, frame, error) in pairwise(log[1000:]):
        assert not error
        assert end - before == frame_bits(frame) * 1000
    for number, course in enumerate(received):
        assert [(end, can_id) for end, can_id, _ in course] == [
            (end, frame.can_id) for end, sender, frame, _ in log if sender != f"node{number}"
        ]
    # A node's frames leave it by priority; none is lost, none comes twice.
    for number in range(NODES):
        out = [frame.data for _, sender, frame, _ in log if sender == f"node{number}"]
        assert len(out) > 100  # low priorities wait long at a full bus, but get through
        assert len(set(out)) == len(out)
        assert set(out) <= set(sent[number])
        assert len(sent[number]) - len(out) <= 8
    assert [(port.tec, port.rec, port.overruns) for port in ports] == [(0, 0, 0)] * NODES


@pytest.mark.requirement("CANP-030", "CANP-043", "CANP-045", "CANP-051", "CANP-052", "CANP-077")
def test_counters_at_full_load_with_errors():
    """With every twentieth frame destroyed once all of them arrive, and the counters settle as they
    should.
    """
    segment, ports, _, _ = saturate(corrupt_every=20)
    bad = [entry for entry in segment.log if entry[3]]
    good = [entry for entry in segment.log if not entry[3]]
    assert len(bad) == pytest.approx(len(good) / 20, rel=0.02)
    # Every destroyed frame is on the wire again, whole, from the same sender.
    for end, sender, frame, _ in bad:
        assert any(
            sender == other and frame == again
            for later, other, again, _ in good
            if end < later < end + 100 * MS
        )
    # One error in twenty frames: +8 and then -1 per success for a sender in turn, never near the limits.
    assert all(port.tec < 96 and port.rec < 96 for port in ports)
    assert all(port.state.value == "ERROR_ACTIVE" for port in ports)


def test_a_full_bus_is_repeatable():
    """Two runs are equal to the nanosecond."""
    assert saturate(corrupt_every=33)[0].log == saturate(corrupt_every=33)[0].log

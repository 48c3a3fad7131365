"""Any interleaving of sends: the wire shows what a brute-force model of arbitration says."""

import itertools
from typing import NamedTuple

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium, HookResult, frame_bits
from fieldbus.clock import MS, US, VirtualScheduler

pytestmark = pytest.mark.exhaustive

PORTS = 4


class Send(NamedTuple):
    time_ns: int
    port: int
    frame: CanFrame
    reply: tuple[int, CanFrame] | None  # who answers when it has received this frame, and with what


def wire_order(frame):
    """Return the arbitration field as the text of its bits; of two the first in the alphabet wins."""
    if frame.extended:
        return f"{frame.can_id >> 18:011b}11{frame.can_id & 0x3FFFF:018b}{frame.remote:b}"
    return f"{frame.can_id:011b}{frame.remote:b}0"


def model(sends, bit_ns):
    """Return (end, port, frame) of everything on the wire, by looking at all pending frames each time."""
    waiting = [(send.time_ns, number, send.port, send.frame, send.reply) for number, send in enumerate(sends)]
    number = len(waiting)
    free = 0
    log = []
    while waiting:
        start = max(free, min(entry[0] for entry in waiting))
        offered = [entry for entry in waiting if entry[0] <= start]
        winner = min(offered, key=lambda entry: (wire_order(entry[3]), entry[0], entry[1]))
        waiting.remove(winner)
        _, _, port, frame, reply = winner
        end = start + (frame_bits(frame) - 3) * bit_ns
        free = end + 3 * bit_ns
        log.append((end, port, frame))
        if reply is not None:
            waiting.append((end, number, reply[0], reply[1], None))
            number += 1
    return log


@st.composite
def programmes(draw):
    """Draw sends of several ports; no two ports ever send the same identifier."""
    sends = []
    instants = st.one_of(st.integers(0, 600_000), st.sampled_from([0, 100 * US, 200 * US, 300 * US]))
    for number in range(draw(st.integers(1, 25))):
        port = draw(st.integers(0, PORTS - 1))
        extended = draw(st.booleans())
        can_id = draw(st.integers(0, 5)) * PORTS + port
        if extended:
            can_id = can_id << 18 | draw(st.integers(0, 3))
        frame = CanFrame(
            can_id, bytes([number, *draw(st.binary(max_size=7))]), extended=extended, remote=False
        )
        if draw(st.integers(0, 5)) == 0:
            frame = CanFrame(can_id, extended=extended, remote=True, dlc=draw(st.integers(0, 8)))
        reply = None
        if not frame.remote and draw(st.booleans()):
            who = (port + draw(st.integers(1, PORTS - 1))) % PORTS
            # Identifiers of replies are apart from the others, so that the order within a port is defined.
            reply = (
                who,
                CanFrame(0x400 + draw(st.integers(0, 1)) * 0x100 + number * PORTS + who, bytes([number])),
            )
        sends.append(Send(draw(instants), port, frame, reply))
    sends.sort(key=lambda send: send.time_ns)
    return sends


def run(sends, *, bitrate, hook):
    scheduler = VirtualScheduler()
    medium = CanMedium(scheduler, bitrate=bitrate)
    received = [[] for _ in range(PORTS)]
    replies = {send.frame.data: send.reply for send in sends if send.reply is not None}
    ports = []

    def receiver(number):
        def receive(frame, time_ns):
            received[number].append((time_ns, frame))
            reply = replies.get(frame.data) if not frame.remote else None
            if reply is not None and reply[0] == number and frame.can_id != reply[1].can_id:
                ports[number].send(reply[1])

        return receive

    ports += [medium.attach(f"n{number}", receiver(number)) for number in range(PORTS)]
    if hook:
        medium.add_hook(lambda frame, sender, time_ns: None)
    for send in sends:
        scheduler.at(send.time_ns, lambda send=send: ports[send.port].send(send.frame))
    scheduler.run_for(100 * MS)
    return medium, received


@pytest.mark.requirement("CANP-027", "CANP-028", "CANP-031", "CANP-079")
@pytest.mark.parametrize("hook", [False, True], ids=["no hook", "idle hook"])
@pytest.mark.parametrize("bitrate", [1_000_000, 250_000])
@given(sends=programmes())
@example(
    sends=[
        Send(0, 0, CanFrame(0x0C, b"\x00"), (1, CanFrame(0x405, b"\x00"))),
        Send(0, 1, CanFrame(0x01, b"\x01"), None),
    ]
)
def test_wire_is_what_the_model_says(bitrate, hook, sends):
    """Order and times on the wire are those of the model, with and without a hook that changes nothing."""
    medium, received = run(sends, bitrate=bitrate, hook=hook)
    expected = model(sends, 1_000_000_000 // bitrate)
    assert medium.log == [(end, f"n{port}", frame, "") for end, port, frame in expected]
    for number in range(PORTS):
        assert received[number] == [(end, frame) for end, port, frame in expected if port != number]


@pytest.mark.requirement("CANP-077")
@given(sends=programmes())
def test_no_frame_is_lost_doubled_or_overlapped(sends):
    """Every frame that was sent is on the wire once, and frames do not overlap."""
    medium, _ = run(sends, bitrate=1_000_000, hook=False)
    wanted = [send.frame for send in sends] + [send.reply[1] for send in sends if send.reply is not None]
    assert sorted(map(repr, wanted)) == sorted(repr(frame) for _, _, frame, _ in medium.log)
    free = 0
    for end, _, frame, _ in medium.log:
        assert end - (frame_bits(frame) - 3) * US >= free
        free = end + 3 * US


RESULTS = {
    "pass": None,
    "drop": HookResult.drop(),
    "delay": HookResult.delay(150 * US),
    "corrupt": HookResult.corrupt(),
    "duplicate": HookResult.duplicate(2),
}


def replacement(sender):
    return CanFrame(0x700 + int(sender[1:]), b"changed")  # an own identifier for each, or they would collide


@given(sends=programmes(), kinds=st.lists(st.sampled_from([*RESULTS, "replace"]), max_size=30))
def test_faulty_traffic_is_conserved_and_repeatable(sends, kinds):
    """Whatever hooks do, each good frame on the wire is accounted for, nothing overlaps, and a second run is
    equal.
    """

    def once():
        scheduler = VirtualScheduler()
        medium = CanMedium(scheduler)
        ports = [medium.attach(f"n{number}", lambda frame, time_ns: None) for number in range(PORTS)]
        left = list(kinds)
        asked = []

        def hook(frame, sender, time_ns):
            asked.append((time_ns, sender, frame))
            kind = left.pop(0) if left else "pass"
            return HookResult.replace(replacement(sender)) if kind == "replace" else RESULTS[kind]

        medium.add_hook(hook)
        for send in sends:
            scheduler.at(send.time_ns, lambda send=send: ports[send.port].send(send.frame))
        scheduler.run_for(100 * MS)
        return asked, list(medium.log)

    asked, log = once()
    assert (asked, log) == once()
    assert len(asked) == len(sends)  # once per frame, never again for copies, delays and retransmissions
    expected = []
    failures = 0
    for number, (_, sender, frame) in enumerate(asked):
        kind = kinds[number] if number < len(kinds) else "pass"
        failures += kind == "corrupt"
        copies = {"drop": 0, "duplicate": 3}.get(kind, 1)
        expected += [(sender, repr(replacement(sender) if kind == "replace" else frame))] * copies
    good = [(sender, repr(frame)) for _, sender, frame, error in log if not error]
    assert sorted(good) == sorted(expected)
    assert len(log) - len(good) == failures
    for (earlier, *_), (later, _, frame, error) in itertools.pairwise(log):
        assert later > earlier
        if not error:
            assert later - (frame_bits(frame) - 3) * US >= earlier + 3 * US

"""Fault hooks and injection on the virtual segment."""

import pytest

from fieldbus.can import CanFrame, CanMedium, HookResult, frame_bits
from fieldbus.clock import MS, US, VirtualScheduler
from fieldbus.errors import BusError


@pytest.fixture
def scheduler():
    return VirtualScheduler()


@pytest.fixture
def medium(scheduler):
    return CanMedium(scheduler)


@pytest.fixture
def received():
    return []


@pytest.fixture
def port(medium, received):
    """Port `a`; what it sends arrives in `received` at port `b`."""
    medium.attach("b", lambda frame, time_ns: received.append((time_ns, frame)))
    return medium.attach("a", lambda frame, time_ns: None)


def only(can_id, result):
    return lambda frame, sender, time_ns: result if frame.can_id == can_id else None


FIRST, SECOND = CanFrame(0x100, b"first"), CanFrame(0x200, b"second")


def air(frame):
    return (frame_bits(frame) - 3) * US


def test_hook_sees_frame_sender_and_start_of_frame(scheduler, medium, port):
    """A hook is asked when a frame starts, once, with the name of the node that sends it."""
    seen = []
    medium.add_hook(lambda frame, sender, time_ns: seen.append((frame, sender, time_ns, scheduler.now)))
    scheduler.run_for(5 * US)
    port.send(SECOND)
    port.send(FIRST)
    scheduler.run_for(MS)
    start = 5 * US + air(FIRST) + 3 * US
    assert seen == [(FIRST, "a", 5 * US, 5 * US), (SECOND, "a", start, start)]


def test_drop(scheduler, medium, port, received):
    """A dropped frame takes no bus time and is not in the log; the next one goes at once."""
    medium.add_hook(only(0x100, HookResult.drop()))
    port.send(FIRST)
    port.send(SECOND)
    scheduler.run_for(MS)
    assert received == [(air(SECOND), SECOND)]
    assert len(medium.log) == 1


def test_delay(scheduler, medium, port, received):
    """A delayed frame is offered later, is not asked about again, and others go in between."""
    medium.add_hook(only(0x100, HookResult.delay(MS)))
    port.send(FIRST)
    port.send(SECOND)
    scheduler.run_for(3 * MS)
    assert received == [(air(SECOND), SECOND), (MS + air(FIRST), FIRST)]


def test_delayed_frame_of_a_node_that_went_offline_is_lost(scheduler, medium, port, received):
    """A frame held back inside of a node dies with it."""
    medium.add_hook(only(0x100, HookResult.delay(MS)))
    port.send(FIRST)
    scheduler.run_for(500 * US)
    port.online = False
    port.online = True
    scheduler.run_for(2 * MS)
    assert received == []


def test_replace(scheduler, medium, port, received):
    """The replacement goes out under the sender's name, and has to win the bus with its own identifier."""
    replacement = CanFrame(0x300, b"instead")
    medium.add_hook(only(0x100, HookResult.replace(replacement)))
    port.send(FIRST)
    port.send(SECOND)
    scheduler.run_for(MS)
    assert [frame for _, frame in received] == [SECOND, replacement]
    assert [sender for _, sender, _, _ in medium.log] == ["a", "a"]
    with pytest.raises(BusError, match=r"outside 0\.\.7FFh"):
        HookResult.replace(CanFrame(0x800))


def test_duplicate(scheduler, medium, port, received):
    """Copies follow the original at once, before later frames of the same identifier."""
    medium.add_hook(
        lambda frame, sender, time_ns: HookResult.duplicate(2) if frame.data == b"first" else None
    )
    port.send(FIRST)
    port.send(CanFrame(0x100, b"later"))
    scheduler.run_for(2 * MS)
    assert [frame.data for _, frame in received] == [b"first", b"first", b"first", b"later"]


def test_corrupt(scheduler, medium, port, received):
    """A corrupted frame is retransmitted; the receiver gets it once, the log shows every attempt."""
    medium.add_hook(only(0x100, HookResult.corrupt(2)))
    port.send(FIRST)
    scheduler.run_for(2 * MS)
    assert [frame for _, frame in received] == [FIRST]
    assert [error for *_, error in medium.log] == ["BIT_ERROR", "BIT_ERROR", ""]
    assert port.tec == 15


def test_hooks_act_together_in_their_order(scheduler, medium, port, received):
    """Later hooks see the replaced frame; delay and copies add up; a drop spares the rest the question."""
    seen = []

    def spy(frame, sender, time_ns):
        seen.append(frame)

    medium.add_hook(only(0x100, HookResult.replace(SECOND)))
    medium.add_hook(only(0x200, HookResult.duplicate()))
    medium.add_hook(only(0x200, HookResult.delay(MS)))
    medium.add_hook(spy)
    port.send(FIRST)
    scheduler.run_for(5 * MS)
    assert seen == [SECOND]
    assert received == [(MS + air(SECOND), SECOND), (MS + air(SECOND) * 2 + 3 * US, SECOND)]
    medium.add_hook(only(0x7F, HookResult.drop()))
    medium.add_hook(spy)
    port.send(CanFrame(0x7F))
    scheduler.run_for(MS)
    assert seen == [SECOND, CanFrame(0x7F)]


def test_hook_is_not_asked_about_a_repetition(scheduler, medium):
    """A hook that comes after the first attempt of a frame is not asked when the frame is repeated."""
    port = medium.attach("a", lambda frame, time_ns: None)
    port.send(FIRST)  # nobody acknowledges
    scheduler.run_for(MS)
    asked = []
    medium.add_hook(lambda frame, sender, time_ns: asked.append(frame))
    scheduler.run_for(MS)
    assert len(medium.log) > 10
    assert asked == []


def test_removed_hook_is_not_asked(scheduler, medium, port, received):
    """The remover ends the hook, also between queueing and start of the frame; removing twice is harmless."""
    remove = medium.add_hook(only(0x100, HookResult.drop()))
    other = medium.add_hook(only(0x200, HookResult.drop()))
    port.send(FIRST)
    remove()
    remove()
    scheduler.run_for(MS)
    assert [frame for _, frame in received] == [FIRST]
    port.send(SECOND)
    other()
    port.send(FIRST)
    scheduler.run_for(MS)
    assert [frame for _, frame in received] == [FIRST, FIRST, SECOND]


def test_the_same_hook_twice(scheduler, medium, port, received):
    """A function that was added twice acts twice, and each remover takes away one of them."""
    hook = only(0x100, HookResult.duplicate())
    removers = [medium.add_hook(hook), medium.add_hook(hook)]
    port.send(FIRST)
    scheduler.run_for(MS)
    assert len(received) == 3
    removers[0]()
    port.send(FIRST)
    scheduler.run_for(MS)
    assert len(received) == 5


def test_hook_applies_to_a_frame_that_is_queued_already(scheduler, medium, port, received):
    """A hook that comes before the start of a frame is asked about it, one that comes later is not."""
    port.send(FIRST)
    medium.add_hook(only(0x100, HookResult.drop()))
    port.send(SECOND)
    scheduler.run_for(1)
    medium.add_hook(only(0x200, HookResult.drop()))
    scheduler.run_for(MS)
    assert [frame for _, frame in received] == [SECOND]


def test_hook_may_send_inject_and_remove_itself(scheduler, medium, port, received):
    """What a hook does to the segment takes part in the arbitration of the same instant."""

    def hook(frame, sender, time_ns):
        remove()
        medium.inject(CanFrame(0x001, b"injected"))
        port.send(CanFrame(0x002, b"sent"))

    remove = medium.add_hook(hook)
    port.send(FIRST)
    scheduler.run_for(MS)
    assert [frame.can_id for _, frame in received] == [0x001, 0x002, 0x100]
    assert received[0][0] == air(CanFrame(0x001, b"injected"))


def test_hook_may_silence_the_sender(scheduler, medium, port, received):
    """A node that a hook takes offline does not send the frame in question."""

    def hook(frame, sender, time_ns):
        port.online = False

    medium.add_hook(hook)
    port.send(FIRST)
    scheduler.run_for(MS)
    assert received == []
    assert medium.log == []


def test_failing_hook_loses_its_frame_only(scheduler, medium, port, received):
    """An exception in a hook reaches the caller of the scheduler, and the traffic goes on."""

    def hook(frame, sender, time_ns):
        if frame is FIRST:
            raise ZeroDivisionError

    medium.add_hook(hook)
    port.send(FIRST)
    port.send(SECOND)
    with pytest.raises(ZeroDivisionError):
        scheduler.run_for(MS)
    port.send(CanFrame(0x300))
    scheduler.run_for(MS)
    assert [frame.can_id for _, frame in received] == [0x200, 0x300]


def test_injected_frames_pass_the_hooks_by(scheduler, medium, port, received):
    """An injected frame is arbitrated and logged under the given name, and no hook touches it."""
    medium.add_hook(lambda frame, sender, time_ns: HookResult.drop())
    medium.inject(FIRST)
    medium.inject(SECOND, sender="a")
    scheduler.run_for(MS)
    assert medium.log == [
        (air(FIRST), "fault", FIRST, ""),
        (air(FIRST) + 3 * US + air(SECOND), "a", SECOND, ""),
    ]
    assert [frame for _, frame in received] == [FIRST, SECOND]
    with pytest.raises(BusError, match=r"outside 0\.\.7FFh"):
        medium.inject(CanFrame(0x800))


def test_injected_flood_starves_lower_ranks(scheduler, medium, port, received):
    """A babbling high-priority sender keeps everybody else waiting, and nothing is lost when it ends."""
    flood = CanFrame(0x001, bytes(8))
    for _ in range(50):
        medium.inject(flood)
    port.send(FIRST)
    scheduler.run_for(60 * MS)
    assert [frame.can_id for _, frame in received] == [0x001] * 50 + [0x100]
    assert received[-1][0] == 50 * frame_bits(flood) * US + air(FIRST)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HookResult.delay(0), "delay 0 ns"),
        (lambda: HookResult.corrupt(0), "at least one"),
        (lambda: HookResult.duplicate(0), "at least one"),
    ],
)
def test_hook_results_are_checked(make, message):
    """A result that means nothing is refused where it is made."""
    with pytest.raises(BusError, match=message):
        make()


def test_hook_result_says_what_it_is():
    """The text of a result names kind and parameters, for fault logs."""
    assert repr(HookResult.delay(5)) == "HookResult.delay(delay_ns=5)"
    assert repr(HookResult.drop()) == "HookResult.drop()"

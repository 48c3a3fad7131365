"""A node without a partner repeats its frame some ten thousand times a second: the short way of doing that
changes nothing.
"""

import random
from collections import Counter

import pytest

from fieldbus.can import CanFrame, CanMedium
from fieldbus.can.section import BusSection
from fieldbus.clock import MS, VirtualScheduler
from fieldbus.history import History

pytestmark = pytest.mark.exhaustive

STEPS = 60


def disturbed(seed):
    """Return all that can be seen of a segment on which nodes come, go, send and recover at random
    instants.
    """
    draw = random.Random(seed)
    scheduler = VirtualScheduler()
    history = History(scheduler)
    medium = CanMedium(scheduler, name="can", history=history)
    heard = []
    ports = [
        medium.attach(
            name,
            lambda frame, time_ns, name=name: heard.append((name, time_ns, frame.can_id)),
            auto_recovery=draw.random() < 0.7,
            one_shot=draw.random() < 0.1,
            listen_only=name == "ear",
        )
        for name in ("a", "b", "c", "ear")
    ]
    for port in ports[1:]:
        port.online = False
    removers = []

    def send(port):
        frames = [
            CanFrame(draw.choice([0x80, 0x181, 0x201, 0x701]), bytes(draw.randrange(9))) for _ in range(2)
        ]
        for frame in frames[: draw.randint(1, 2)]:
            if not port.listen_only:
                port.send(frame)

    for _ in range(STEPS):
        port = draw.choice(ports)
        step = draw.random()
        if step < 0.5:
            send(ports[0] if draw.random() < 0.6 else port)
        elif step < 0.7:
            port.online = draw.random() < (0.9 if port is ports[0] else 0.3)
        elif step < 0.76:
            port.set_acknowledge(draw.random() < 0.5)
        elif step < 0.82:
            port.set_error_counters(tec=draw.choice([0, 127, 128, 200, 256]), rec=draw.choice([0, 130]))
        elif step < 0.87:
            port.recover()
        elif step < 0.9:
            medium.inject(CanFrame(draw.choice([0x000, 0x7FF]), b"\x01"))
        elif step < 0.95:
            removers.append(medium.add_hook(lambda *_: None))
        elif removers:
            removers.pop()()
        scheduler.run_for(draw.choice([1_000, 97_000, 131_500, MS, 5 * MS]))
    state = [(port.tec, port.rec, port.state, port.not_before_ns, len(port.queue)) for port in ports]
    events = [(entry.time_ns, entry.source, entry.kind, entry.data) for entry in history.events]
    loads = [medium.bus_load(window) for window in range(MS, scheduler.now, 7 * MS)]
    return medium.log, medium.busy_bits, loads, events, heard, state


def test_the_short_way_of_repeating_is_the_long_one(monkeypatch):
    """Log, events, counters and what is heard are equal, whatever comes between two attempts of a lone
    node.
    """
    asked = Counter()
    whether = BusSection._only_repeats

    def counted(self, sender, entry):
        answer = whether(self, sender, entry)
        asked[answer] += 1
        return answer

    for seed in range(25):
        with monkeypatch.context() as patch:
            patch.setattr(BusSection, "_only_repeats", counted)
            short = disturbed(seed)
            patch.setattr(BusSection, "_only_repeats", lambda *_: False)
            assert disturbed(seed) == short, f"seed {seed}"
    assert asked[True] > 1000
    assert asked[False] > 300

"""The segment against a model that reads every bit: `_can_model`."""

import pytest
from hypothesis import event, given, reject
from hypothesis import strategies as st

from fieldbus.can import CanFrame, CanMedium
from fieldbus.clock import US, VirtualScheduler
from testcases.campaigns import _can_model

pytestmark = pytest.mark.exhaustive


def key(frame):
    return frame.can_id, frame.extended, frame.remote, frame.dlc, bytes(frame.data)


class EndlessError(Exception):
    """The scenario goes on for ever: a frame that nobody acknowledges."""


class Segment:
    """The medium at 1 Mbit/s, so that a bit is a microsecond, with the same nodes as the oracle."""

    def __init__(self, nodes, flips):
        self.scheduler = VirtualScheduler()
        self.medium = CanMedium(self.scheduler)
        self.received, self.sent, self.states, self.ports = {}, {}, {}, {}
        for node in nodes:
            self._attach(node)
        for time, names in flips.items():
            self.scheduler.at(time * US, lambda names=names: self.medium.flip_bit(names))

    def _attach(self, node):
        received, sent, states = [], [], []
        port = self.medium.attach(
            node.name,
            lambda frame, time_ns: received.append((time_ns / US, key(frame))),
            confirm=lambda frame, time_ns: sent.append((time_ns / US, frame)),
            auto_recovery=False,
            one_shot=node.one_shot,
        )
        port.set_error_counters(tec=node.tec, rec=node.rec)
        port.on_state.append(lambda old, new: states.append(new.value))
        port.set_acknowledge(node.acknowledges)
        port.set_overload_frames(node.overloads)
        self.received[node.name], self.sent[node.name], self.states[node.name] = received, sent, states
        self.ports[node.name] = port
        for time, frame in node.frames:
            self.scheduler.at(time * US, lambda frame=frame: port.send(frame))

    def check(self, nodes):
        """Compare everything that the two models say."""
        for node in nodes:
            port = self.ports[node.name]
            assert self.received[node.name] == node.received, node.name
            assert self.sent[node.name] == node.sent, node.name
            assert (port.tec, port.rec, port.state.value) == (min(node.tec, 256), node.rec, node.state), (
                node.name
            )
            assert self.states[node.name] == node.states, node.name
            assert port.pending == 0


def compare(make_nodes, flips):
    """Let both models run until nothing happens any more, and compare them."""
    nodes = make_nodes()
    segment = Segment(nodes, flips)
    levels = _can_model.run(nodes, flips)
    if levels is None:
        raise EndlessError
    segment.scheduler.run_for((len(levels) + 20) * US)
    segment.check(nodes)
    return nodes, segment, levels


FRAMES = st.builds(
    lambda can_id, extended, remote, data, dlc: CanFrame(
        can_id << 18 if extended else can_id,
        b"" if remote else data if dlc is None else bytes(8),
        extended=extended,
        remote=remote,
        dlc=dlc if dlc is not None or not remote else len(data),
    ),
    st.sampled_from([0x000, 0x001, 0x07F, 0x0F0, 0x123, 0x555, 0x5F0, 0x7FF]),
    st.booleans(),
    st.booleans(),
    st.binary(max_size=3),
    st.sampled_from([None, None, None, 8, 9, 15]),
)

COUNTERS = st.sampled_from([0, 0, 0, 1, 8, 96, 119, 120, 126, 127, 128, 135, 200, 247, 248, 254, 255])


@st.composite
def scenarios(draw):
    """Draw nodes as arguments of the oracle's `Node`, and wrong bits."""
    names = "abcd"[: draw(st.integers(2, 4))]
    nodes = []
    for name in names:
        times = draw(st.lists(st.sampled_from([0, 0, 1, 30, 60, 61, 130, 131]), max_size=2, unique=True))
        nodes.append(
            {
                "name": name,
                "frames": [(time, draw(FRAMES)) for time in times],
                "tec": draw(COUNTERS),
                "rec": draw(COUNTERS),
                "acknowledges": draw(st.sampled_from([True, True, True, False])),
                "overloads": draw(st.sampled_from([0, 0, 0, 1, 2])),
                "one_shot": draw(st.sampled_from([False, False, True])),
            }
        )
    who = st.one_of(st.none(), st.sets(st.sampled_from(names), min_size=1).map(frozenset))
    flips = draw(st.dictionaries(st.integers(0, 260), who, max_size=6))
    return nodes, flips


@pytest.mark.requirement(
    "CANP-005",
    "CANP-006",
    "CANP-007",
    "CANP-010",
    "CANP-011",
    "CANP-013",
    "CANP-027",
    "CANP-033",
    "CANP-034",
    "CANP-035",
    "CANP-036",
    "CANP-037",
    "CANP-038",
    "CANP-039",
    "CANP-040",
    "CANP-041",
    "CANP-042",
    "CANP-043",
    "CANP-044",
    "CANP-045",
    "CANP-046",
    "CANP-047",
    "CANP-048",
    "CANP-049",
    "CANP-050",
    "CANP-051",
    "CANP-052",
    "CANP-053",
)
@given(scenarios())
def test_segment_is_what_the_bitwise_model_says(scenario):
    """Whatever bits are wrong, and for whom: end times, receivers, counters and states are those of the plain
    model.
    """
    nodes, flips = scenario
    try:
        _, segment, _ = compare(lambda: [_can_model.Node(**node) for node in nodes], flips)
    except EndlessError:
        reject()
    event(f"{min(len(segment.medium.log), 8)} attempts")


@pytest.mark.requirement("CANP-010")
@pytest.mark.parametrize("dlc", range(9, 16))
def test_dlc_above_8_is_passed_on_bit_by_bit_as_well(dlc):
    """A DLC of 9 to 15 means 8 bytes, and the receiver gets the DLC as it was sent, whichever way the
    frame took.
    """
    frame = CanFrame(0x123, bytes(range(8)), dlc=dlc)
    for flips in ({}, {40: None}):
        _, segment, _ = compare(lambda: [_can_model.Node("a", [(0, frame)]), _can_model.Node("b")], flips)
        assert segment.received["b"] == [(segment.received["b"][0][0], key(frame))]

"""Faults of synchronous operation across controllers: of the telegrams with a leading value, and of the clock
of a second controller (SYN-073, SYN-357, SYN-466, SYN-479).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import nan
from typing import Final

from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError, UnknownNameError
from hil.faults import seams
from hil.faults._kind import Action, Custom, Family, FaultType, Injection, override_action
from hil.faults._parameters import Parameter

_WRONG: Final[dict[str, float]] = {
    "version": 9,
    "modulo_start": nan,
    "modulo_length": -1.0,
    "sign_of_life": 0,
    "position": nan,
    "velocity": 1e300,
    "acceleration": nan,
}
"""Fields of the telegram, and a content that makes no sense."""


def _proxy(injection: Injection) -> tuple[str, seams.LeadingWay]:
    """Return name and way of the telegrams of the proxy that is meant; without a name the first one."""
    bench, name = injection.bench, injection.target
    known = bench.proxy_names if seams.offers(bench, seams.BenchWithProxies) else ()
    if not known:
        injection.refuse("the bench has no leading-axis proxies")
    if name and name not in known:
        raise UnknownNameError(f"{injection.kind.name}: target", name, "a leading-axis proxy", known)
    assert seams.offers(bench, seams.BenchWithProxies)  # it has names of proxies
    name = name or known[0]
    return name, bench.proxy(name).link


def _lost(injection: Injection) -> Action:
    name, link = _proxy(injection)

    def operate(_: Sequence[bool]) -> None:
        link.lost = True

    def restore() -> None:
        link.lost = False

    return override_action(name, injection.override((name, "lost"), True, operate, restore))


def _late(injection: Injection) -> Action:
    name, link = _proxy(injection)
    more = round(injection.values.number("delay_ms") * MS)

    def add(ns: int) -> None:
        link.delay_ns += ns

    return Action(name, lambda: add(more), lambda: add(-more))


def _changed(injection: Injection, change: Callable[[seams.LeadingTelegram], None]) -> Action:
    """Return the action that changes every telegram."""
    name, link = _proxy(injection)

    def operate(changes: Sequence[Callable[[seams.LeadingTelegram], None]]) -> None:
        present = tuple(changes)

        def disturb(telegram: seams.LeadingTelegram) -> None:
            for one in present:
                one(telegram)

        link.disturb = disturb

    def restore() -> None:
        link.disturb = None

    override = injection.override((name, "disturb"), change, operate, restore, effective=tuple)
    return override_action(name, override)


def _invalid(injection: Injection) -> Action:
    def change(telegram: seams.LeadingTelegram) -> None:
        telegram.valid = False

    return _changed(injection, change)


def _corrupt(injection: Injection) -> Action:
    field = injection.values.text("field")
    return _changed(injection, lambda telegram: setattr(telegram, field, _WRONG[field]))


def _drift(injection: Injection) -> Action:
    bench, name = injection.bench, injection.target
    clocks = bench.controller_clocks if seams.offers(bench, seams.BenchWithControllerClocks) else {}
    if not clocks:
        injection.refuse("the bench has no second controller; [controller.NAME] of the bench file makes one")
    if name and name not in clocks:
        raise ConfigurationError(f"{injection.kind.name}: target", name, f"one of {', '.join(clocks)}")
    name = name or next(iter(clocks))
    clock, drift = clocks[name], injection.values.number("drift_ppm")
    override = injection.override(
        (name, "clock"), drift, lambda drifts: clock.drift(drifts[-1]), lambda: clock.drift(0.0)
    )
    return override_action(name, override)


# -- kinds -----------------------------------------------------------------------------------------------
_kind: Final = partial(FaultType, target="proxy", seam="telegrams with the leading value", fuzzed=False)

FAMILY: Final = Family(
    kinds=(
        _kind(
            "proxy.lost",
            "Telegrams with the leading value are lost",
            Custom(_lost),
            example={"target": "line", "duration_s": 0.5},
            text="""
        The connection between two controllers is lost. The proxy goes on with the last velocity for
        `Parameter.ToleranceTimeExternalLeadingValueInvalid`, then it is alarm 900, and its followers stop
        with alarm 601.
        """,
        ),
        _kind(
            "proxy.late",
            "Telegrams with the leading value come late",
            Custom(_late),
            parameters=(
                Parameter(
                    "delay_ms",
                    "float",
                    "How much later",
                    unit="ms",
                    minimum=0.0,
                    maximum=1000.0,
                    required=True,
                ),
            ),
            example={"target": "line", "duration_s": 0.5, "parameters": {"delay_ms": 6.0}},
            text="""
        Every telegram takes longer. A leading value that is older than the proxy assumes puts its followers
        behind by the way of that time; the step comes when the delay begins, and when it ends.
        """,
        ),
        _kind(
            "proxy.invalid",
            "The leading value is marked as invalid",
            Custom(_invalid),
            example={"target": "line", "duration_s": 0.5},
            text="""
        Telegrams come, and say that their value is none. It is bridged as a lost connection is.
        """,
        ),
        _kind(
            "proxy.corrupt",
            "A field of the telegrams with the leading value makes no sense",
            Custom(_corrupt),
            parameters=(Parameter("field", "text", "Which one", required=True, choices=tuple(_WRONG)),),
            example={"target": "line", "duration_s": 0.1, "parameters": {"field": "position"}},
            text="""
        Alarm 901 of the proxy with the number of the field, and alarm 601 of its followers, at once. A sign
        of life that stands is no error of its field: the telegram counts as missing.
        """,
        ),
        FaultType(
            "controller.clock_drift",
            "The clock of a second controller runs fast or slow",
            Custom(_drift),
            seam="clock of the controller",
            target="controller",
            parameters=(
                Parameter(
                    "drift_ppm",
                    "float",
                    "How much faster, in parts per million; below 0 slower",
                    unit="ppm",
                    minimum=-100_000.0,
                    maximum=100_000.0,
                    required=True,
                ),
            ),
            remark="a controller of [controller.NAME]; that of [bench] is the clock of the bench",
            fuzzed=False,
            example={"target": "plc2", "duration_s": 0.5, "parameters": {"drift_ppm": 10_000.0}},
            text="""
        Its application cycle slides along that of the first controller, as without clock synchronisation.
        Now and then a cycle of its proxies gets no telegram, or misses one: the leading value is then a cycle
        older or younger, and the position of a follower off by the way of a cycle. At the end it runs as fast
        as the others, from where it is.
        """,
        ),
    ),
)

"""The list of event kinds agrees with what the product emits."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import hil
from fieldbus.clock import VirtualScheduler
from fieldbus.history import History
from hil.bench import load_bench
from hil.campaign import CaseSettings, execute_case
from hil.record import EVENT_KINDS
from testcases.campaigns import drive_faults

pytestmark = pytest.mark.exhaustive

ROOT = Path(hil.__file__).parent.parent
PACKAGES = ("fieldbus", "emulators", "motion", "hil")
KIND = re.compile(r"[a-z]+\.[a-z_]+")
EMITTERS = {"emit", "_emit", "_log"}


@pytest.fixture(scope="module")
def sources():
    """Return the nodes that matter, of every file: calls, and texts that look like a kind."""
    calls, texts = [], set()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path.name != "_kinds.py":
                for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                    if isinstance(node, ast.Call):
                        calls.append(node)
                    elif is_kind(node):
                        texts.add(node.value)
    return calls, texts


def is_kind(node):
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and KIND.fullmatch(node.value)


def literals(node):
    return {one.value for one in ast.walk(node) if is_kind(one)}


def test_every_kind_that_the_product_emits_is_listed(sources):
    """What an emitter gets as its kind is in the list, so that a trigger on it is taken."""
    emitted = set()
    for node in sources[0]:
        function = node.func
        name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
        if name in EMITTERS:
            emitted.update(*(literals(argument) for argument in node.args[:2]), set())
    assert len(emitted) > 50
    assert not emitted - set(EVENT_KINDS), "kinds of events that hil/record/_kinds.py does not list"


def test_every_listed_kind_stands_in_the_product(sources):
    """The list holds no kind that nobody emits; `guarding.lost` is made of two parts."""
    assert set(EVENT_KINDS) - sources[1] <= {"guarding.lost", "heartbeat.lost"}


def test_a_whole_case_emits_listed_kinds_only(monkeypatch):
    """The same, observed: a drive that restarts in operation on a PROFIdrive bench."""
    seen = set()
    emit = History.emit

    def listening(self, source, kind, /, **data):
        seen.add(kind)
        emit(self, source, kind, **data)

    monkeypatch.setattr(History, "emit", listening)
    execute_case(
        drive_faults.CAMPAIGN["drive-faults/reset/constant"], load_bench("profidrive"), CaseSettings()
    )
    assert len(seen) > 25
    assert seen <= set(EVENT_KINDS)


def test_declared_kinds_are_remembered():
    """`declare` takes any number of kinds."""
    history = History(VirtualScheduler())
    history.declare("bench.mark", "lamp.on")
    assert history.declared == {"bench.mark", "lamp.on"}

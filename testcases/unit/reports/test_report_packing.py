"""Packing with helper processes: the same files as without, also when a helper dies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reports import CaseResult, Message, RunResult, Signal, StoreError, Verdict, load_run, save_run
from reports.html import packing
from reports.html.packing import Order, pack_files
from reports.store import StoredSignals

pytestmark = pytest.mark.exhaustive


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    """Ninety cases whose signals and bus logs are on the disk."""
    folder = tmp_path_factory.mktemp("run")
    time = np.arange(20) * 0.004
    made = [
        CaseResult(
            f"case-{n}",
            "<b>&",
            Verdict.PASSED,
            messages=[Message(0.004, "can0", 0x181, "00", "drive1", "TPDO1")],
            signals=[Signal("axis1.position", "mm", time, np.sin(time * n))],
        )
        for n in range(90)
    ]
    save_run(folder, RunResult("t", 1, "b", "", {}, "", made))
    return load_run(folder, lazy=True).cases


def packed(cases, folder: Path, processes: int) -> dict[str, bytes]:
    folder.mkdir()
    pack_files(Order(folder, "key", 200, 5, cases), processes=processes)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def alone(cases, tmp_path_factory) -> dict[str, bytes]:
    return packed(cases, tmp_path_factory.mktemp("alone") / "data", 1)


def test_helpers_write_the_same_files(cases, alone, tmp_path):
    """Every case, byte for byte, numbered from the first."""
    assert alone.keys() == {f"{n}.js" for n in range(5, 95)}
    assert packed(cases, tmp_path / "helped", 2) == alone


def test_helpers_that_cannot_work_are_replaced(cases, alone, tmp_path, monkeypatch):
    """A helper that dies at once costs time, no case."""
    monkeypatch.setattr(packing.sys, "executable", "false")
    assert packed(cases, tmp_path / "helped", 2) == alone


def test_what_is_wrong_with_a_case_is_reported_here(cases, tmp_path):
    """A missing archive is named as without helpers."""
    lost = StoredSignals(tmp_path, {"file": "signals/lost.npz", "columns": [["a.b", "", "t", "c", []]]})
    broken = CaseResult("broken", "", Verdict.PASSED, signals=lost)
    with pytest.raises(StoreError, match="signals missing or damaged"):
        packed([*cases[:64], broken, *cases[64:]], tmp_path / "helped", 2)

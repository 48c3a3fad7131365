"""Running a case away from the command: everything is found again by reference,
nothing but plain data travels.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hil.campaign._benches import load_bench_file
from hil.campaign._case import Case
from hil.campaign._discover import load_campaign
from hil.campaign._execute import CaseSettings, execute_case, make_token
from hil.campaign._files import Keep, write_evidence
from hil.errors import CannotRunError
from hil.protocols import BenchFile
from reports.model import CaseResult

if TYPE_CHECKING:
    from hil.bench.bench import Bench


@dataclass(frozen=True)
class Order:
    """One case to be run, as it travels to a worker."""

    identifier: str
    campaign: str
    """Reference of the campaign."""
    bench: str
    """Reference of the bench."""
    seed: int
    """Seed of the case."""
    twice: bool
    evidence: Keep
    directory: str
    """Folder of the report; empty: no evidence files."""
    bench_digest: str = ""
    """SHA-256 of the bench file that the run was started with; empty: not compared."""
    wall_limit_s: float = 0.0
    """Limit of wall time in place of that of the case, s; 0: that of the case."""
    patience_s: float = 0.0
    """Time after which a worker that has not answered is taken for hanging, s; 0: never."""
    packed: bool = False
    """Evidence files come back with the result: the worker does not share the folder of the report."""

    def run(self, send: Callable[[Parcel], None]) -> None:
        """Run the case, on a worker process."""
        send(run_parcel(self))

    def patience(self, answers: int) -> float:  # noqa: ARG002 - there is one answer
        """Return how long the worker process may take, s."""
        return self.patience_s or float("inf")


@dataclass(frozen=True)
class Parcel:
    """A result on its way back."""

    result: CaseResult
    files: dict[str, bytes] = field(default_factory=dict)
    """Evidence files by their path below the folder of the report."""

    def unpack(self, directory: Path) -> None:
        """Write the evidence files below the folder of the report."""
        for name, content in self.files.items():
            path = directory / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


_benches: dict[str, BenchFile[Bench]] = {}


def bench_of(reference: str) -> BenchFile[Bench]:
    """Return a bench file, loaded once per process."""
    if reference not in _benches:
        _benches[reference] = load_bench_file(reference or None)
    return _benches[reference]


def run_order(order: Order, case: Case | None = None) -> CaseResult:
    """Run a case and return its result; evidence files are written on the way.

    Args:
        order: What to run.
        case: The case, if it is already known.

    Raises:
        CannotRunError: The campaign here has no such case, or the bench file here is another one.

    """
    if case is None:
        campaign = load_campaign(order.campaign)
        if order.identifier not in campaign:
            raise CannotRunError(
                f"{order.campaign} has no case {order.identifier!r} here: is it an older one?"
            )
        case = campaign[order.identifier]
    if order.wall_limit_s:
        case = replace(case, wall_limit_s=order.wall_limit_s)
    bench_file = bench_of(order.bench)
    if order.bench_digest and bench_file.digest != order.bench_digest:
        raise CannotRunError(
            f"the bench {order.bench or bench_file.name!r} is another one here: its text differs"
        )
    token = make_token(
        case, seed=order.seed, campaign=order.campaign, bench=order.bench, bench_digest=bench_file.digest
    )
    execution = execute_case(case, bench_file, CaseSettings(seed=order.seed, token=token, twice=order.twice))
    if order.directory:
        write_evidence(execution, Path(order.directory), order.evidence)
    return execution.result


def run_parcel(order: Order) -> Parcel:
    """Run a case and return its result, with the evidence files where the order wants them packed."""
    if not order.packed:
        return Parcel(run_order(order))
    with tempfile.TemporaryDirectory(prefix="hil-") as folder:
        result = run_order(replace(order, directory=folder))
        return Parcel(result, {name: (Path(folder) / name).read_bytes() for name in result.files.values()})

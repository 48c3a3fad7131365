"""What a laboratory asks of a test tool, collected from one run: what it is made of, what has been run with
it, how far its verdicts were put to the test, and what nobody claims.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from reports.coverage import PrefixTotal, RequirementRow, prefix_totals, requirement_matrix
from reports.errors import ReportError
from reports.model import PRODUCT_DIGEST, CaseResult, RunResult, Verdict
from reports.seeding import Seeding
from reports.summary import run_digest

SOFTWARE: Final = "software"
"""Property of a test in a JUnit file: name and version of the software of others with which it ran."""
NOT_CLAIMED: Final = (
    (
        "This is no certificate, and no tool qualification as IEC 61508-3, ISO 26262-8 or EN 50128 "
        "mean it. It is evidence that whoever qualifies a tool may use; classification of the tool "
        "and judgement are theirs."
    ),
    (
        "Drives, mechanics and buses of a virtual bench are models. What passes on them says nothing "
        "about the stopping distance, the brake or the firmware of a machine; that takes the machine."
    ),
    (
        "Requirement identifiers are those of the product's own digest of published handbooks and "
        "standards. It is not authorised by their publishers, and may misunderstand them."
    ),
    (
        "A requirement counts as covered when a check names it and passes. The check may test a part "
        "of it, in the situations of its cases only."
    ),
    (
        "The share of defects that are caught measures the campaigns that judged them. It is no "
        "probability that a defect of a product is found."
    ),
    ("Interoperation is shown with the peers that are listed, in their tested versions, and with no other."),
    (
        "The run holds for the versions and the platform below. Digests say whether another run was "
        "the same, not whether it was right."
    ),
)
"""What the page does not claim, before anything else on it."""


@dataclass(frozen=True)
class PeerResult:
    """Tests with software of others."""

    name: str
    passed: int
    failed: int
    skipped: int
    software: tuple[str, ...] = ()
    """Names and versions of the software, as the tests recorded them."""


@dataclass(frozen=True)
class Source:
    """Where cases come from, and on what they ran."""

    campaign: str
    """Empty: cases that cannot be repeated by a token."""
    bench: str
    bench_digest: str
    """SHA-256 of the bench file; empty: it is not known."""
    cases: int


@dataclass(frozen=True)
class Defects:
    """A set of defects that cases have judged."""

    title: str
    seeding: Seeding

    @property
    def rows(self) -> list[tuple[str, int]]:
        """How many there are of each status, the good ones first."""
        statuses = dict.fromkeys(["caught", "explained", *(one.status for one in self.seeding.defects)])
        return [(status, count) for status in statuses if (count := self.seeding.count(status))]


@dataclass
class Qualification:
    """Everything on the page."""

    run: RunResult
    digest: str
    """Of all traces of the run, `run_digest`."""
    product: tuple[tuple[str, str], ...]
    """Package and SHA-256 of its files."""
    product_digest: str
    """Over all of these, as they are now."""
    known_limits: tuple[tuple[str, str], ...]
    """Areas of the product with what it cannot do there."""
    sources: tuple[Source, ...]
    bench_digest: str
    rows: list[RequirementRow]
    totals: list[PrefixTotal]
    defects: list[Defects] = field(default_factory=list)
    peers: list[PeerResult] = field(default_factory=list)

    @property
    def touched(self) -> list[RequirementRow]:
        """Requirements that a case names."""
        return [row for row in self.rows if row.cases]

    @property
    def untouched(self) -> dict[str, list[str]]:
        """Section and identifiers of the requirements that no case names."""
        found: dict[str, list[str]] = {}
        for row in self.rows:
            if not row.cases:
                found.setdefault(f"{row.document}: {row.section}", []).append(row.identifier)
        return found

    @property
    def open_cases(self) -> list[CaseResult]:
        """Cases that have not passed."""
        return [case for case in self.run.cases if case.verdict is not Verdict.PASSED]

    @property
    def ran_with(self) -> str:
        """Digest of the product that the run was made with; empty: the run does not say."""
        return self.run.environment.get(PRODUCT_DIGEST, "")

    @property
    def limits(self) -> list[str]:
        """What this run leaves open, in sentences."""
        run = self.run
        left = sum(map(len, self.untouched.values()))
        found = [f"{left} of {len(self.rows)} requirements are named by no case of this run."]
        blocked = run.count(Verdict.BLOCKED)
        if blocked:
            found.append(f"{blocked} cases were blocked: the bench could not do what they need.")
        bad = run.count(Verdict.FAILED) + run.count(Verdict.ERROR)
        if bad:
            found.append(f"{bad} cases have failed or ended with an error.")
        if not self.ran_with:
            found.append("The run does not say which state of the product it was made with.")
        elif self.ran_with != self.product_digest:
            found.append(
                "The product has changed since the run: the digests of its packages are not those of the run."
            )
        if run.interrupted:
            found.append("The run was interrupted: not all of its cases have run.")
        if run.shard:
            found.append(f"The run is part {run.shard} of a campaign.")
        if not self.defects:
            found.append("No results of seeded defects are given: nothing shows that a case can be red.")
        for one in self.defects:
            missed = len(one.seeding.defects) - one.seeding.count("caught") - one.seeding.count("explained")
            if missed:
                found.append(f"{one.title}: {missed} of {len(one.seeding.defects)} were not noticed.")
            if not one.seeding.defects:
                found.append(f"{one.title}: none was judged, so nothing shows that a case can be red.")
            if one.seeding.defects and one.seeding.product != self.ran_with:
                found.append(f"{one.title}: they were not put into the product that the run was made with.")
            if one.seeding.left_out:
                found.append(
                    f"{one.title}: {one.seeding.left_out} cases judged nothing, their time was used up."
                )
            if one.seeding.interrupted:
                found.append(f"{one.title}: the run was interrupted, not all of them were judged.")
        if not self.peers:
            found.append("No results of tests with software of others are given.")
        found += [
            f"{peer.name}: the version of its software is not recorded."
            for peer in self.peers
            if not peer.software
        ]
        found += [f"{peer.name}: {peer.failed} tests have failed." for peer in self.peers if peer.failed]
        found += [f"{peer.name}: {peer.skipped} tests were left out." for peer in self.peers if peer.skipped]
        return found


def qualify(
    run: RunResult,
    *,
    product: Sequence[tuple[str, str]],
    product_digest: str,
    known_limits: Sequence[tuple[str, str]],
    sources: Sequence[Source],
    bench_digest: str,
    defects: Sequence[Defects] = (),
    peers: Sequence[PeerResult] = (),
) -> Qualification:
    """Collect what the page shows.

    Args:
        run: The run, with its catalogue of requirements.
        product: Package and digest of its files.
        product_digest: Digest over all of them.
        known_limits: Areas of the product with what it cannot do there.
        sources: Campaigns and benches of the run.
        bench_digest: SHA-256 of the text of the bench file.
        defects: Seeded and drawn defects, with who caught them.
        peers: Tests with software of others.

    """
    rows = requirement_matrix(run)
    return Qualification(
        run,
        run_digest(run),
        tuple(product),
        product_digest,
        tuple(known_limits),
        tuple(sources),
        bench_digest,
        rows,
        prefix_totals(rows),
        list(defects),
        list(peers),
    )


def load_peers(path: Path) -> list[PeerResult]:
    """Return the tests of a JUnit file by module, as `pytest --junitxml` writes it.

    Raises:
        ReportError: It cannot be read.

    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ReportError(f"{path}: cannot be read: {error}") from error
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ReportError(f"{path}: a JUnit file has no document type and no entities")
    try:
        root = ET.fromstring(text)  # noqa: S314 - without entities
    except ET.ParseError as error:
        raise ReportError(f"{path}: this is no JUnit file: {error}") from error
    counts: dict[str, list[int]] = {}
    software: dict[str, dict[str, None]] = {}
    for test in root.iter("testcase"):
        name = test.get("classname", "").rpartition(".")[2] or "tests"
        bad = test.find("failure") is not None or test.find("error") is not None
        which = 1 if bad else 2 if test.find("skipped") is not None else 0
        counts.setdefault(name, [0, 0, 0])[which] += 1
        for recorded in test.iterfind(f"properties/property[@name='{SOFTWARE}']"):
            software.setdefault(name, {})[recorded.get("value", "")] = None
    if not counts:
        raise ReportError(f"{path}: there is no test in it")
    return [
        PeerResult(name, passed, failed, skipped, tuple(software.get(name, ())))
        for name, (passed, failed, skipped) in counts.items()
    ]

"""Values of variables at the ends of their ranges and beyond, for every kind of technology object, by the
table of its variables: what is assigned, what is a start value, what is read only.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from motion.s7.variables import UnknownVariableError, VariableAccessError, VariableError
from testcases.campaigns._reactions import cycles
from testcases.campaigns.initial_states import objects_of
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign("axis values", tags=("axis", "variables"), bench="reference")
SPEED_AXIS: Final = Campaign("values of a speed axis", tags=("axis", "variables"), bench="speed")
SYNCHRONOUS: Final = Campaign(
    "values of a synchronous machine", tags=("axis", "variables"), bench="synchronous"
)
WRONG_VALUE: Final = 101
_TRIED: Final = 6
"""So many start values are tried in a case, drawn from all that have a range."""


def _ranges(one: Any, *access: str) -> Iterator[tuple[str, Any, float, float]]:
    """Yield the real variables of an access class that have a range: path, definition, both ends."""
    motion_type = int(one.var("Properties.MotionType")) if _has(one, "Properties.MotionType") else 0
    for kind in access:
        for path in one.variables.paths(kind):
            definition = one.variables.describe(path)
            low, high = definition.limits(motion_type)
            if definition.data_type == "LREAL" and low is not None and high is not None and low < high:
                yield path, definition, float(low), float(high)


def _has(one: Any, path: str) -> bool:
    return path in set(one.variables.paths())


def assigned(ctx: CaseContext) -> None:
    """A real number that is assigned beyond its range becomes the nearest end; both ends are inside; what is
    no number is dropped.
    """
    for name, one in objects_of(ctx).items():
        wrong = []
        for path, _, low, high in _ranges(one, "DIR", "CAL"):
            before = float(one.var(path))
            for given, wanted in (
                (low, low), (high, high), (high + 1.0 + abs(high), high), (low - 1.0 - abs(low), low),
            ):  # fmt: skip
                one.write(path, given)
                ctx.run_for(cycles(ctx, 1))
                if not math.isclose(float(one.var(path)), wanted, rel_tol=1e-9, abs_tol=1e-12):
                    wrong.append(f"{path} = {given:g} is {one.var(path):g}")
            one.write(path, math.nan)
            ctx.run_for(cycles(ctx, 1))
            if not math.isclose(float(one.var(path)), low, rel_tol=1e-9, abs_tol=1e-12):
                wrong.append(f"{path} is {one.var(path):g} after no number")
            one.write(path, before)
        ctx.run_for(cycles(ctx, 2))
        many = f"values of {name} that are not as assigned{''.join(f'; {text}' for text in wrong)}"
        ctx.measure(many, len(wrong), high=0.0, requirements=("VAR-015",))


def started(ctx: CaseContext) -> None:
    """A start value beyond its range ends the restart with alarm 101, and nothing has changed; with a good
    value the next restart is done.
    """
    for name, one in objects_of(ctx).items():
        if name in ctx.bench.proxy_names:
            continue
        every = list(_ranges(one, "RES"))
        rng = ctx.rng(f"variables of {name}")
        for number in sorted(rng.permutation(len(every))[:_TRIED]):
            path, _, low, high = every[int(number)]
            before = float(one.variables.read(path))
            for beyond in (high + 1.0 + abs(high), low - 1.0 - abs(low)):
                one.variables.write_start(path, beyond)
                ctx.run_for(cycles(ctx, 2))
                equal(ctx, f"{name}: X3 after a new {path}", one.var("StatusWord.X3"), 1.0, "VAR-005")
                reset = one.reset(restart=True)
                ctx.run_for(0.1)
                what = f"{name}: {path} = {beyond:g}"
                equal(ctx, f"{what}: alarm", one.var("ErrorDetail.Number"), WRONG_VALUE, "VAR-018")
                equal(ctx, f"{what}: Done", reset.Done, 0.0, "VAR-018")
                equal(ctx, f"{what}: value in force", one.variables.read(path), before, "VAR-018")
                one.variables.write_start(path, before)
                ctx.wait_until(one.reset(restart=True).done, 2.0, f"{name} restarts with a good value")
                equal(ctx, f"{what}: ErrorWord afterwards", one.var("ErrorWord"), 0.0)
                equal(ctx, f"{what}: X3 afterwards", one.var("StatusWord.X3"), 0.0, "VAR-006")


def refused(ctx: CaseContext) -> None:
    """What is read only, restart-relevant, of another type or unknown is refused, and says which variable."""
    for name, one in objects_of(ctx).items():
        wrong = []

        def tried(
            what: str, path: str, value: Any, kind: type[Exception], write: Any, wrong: Any = wrong
        ) -> None:
            try:
                write(path, value)
            except kind as error:
                if path.partition("[")[0].split(".")[0] not in str(error):
                    wrong.append(f"{what} {path}: {error}")
            else:
                wrong.append(f"{what} {path} is taken")

        for path in one.variables.paths("RON"):
            tried("read only", path, 0, VariableAccessError, one.write)
            tried("read only", path, 0, VariableAccessError, one.variables.write_start)
        for path in one.variables.paths("RES"):
            tried("restart-relevant", path, one.variables.read(path), VariableAccessError, one.write)
        for path, *_ in _ranges(one, "DIR", "CAL"):
            tried("a text in", path, "fast", VariableError, one.write)
        tried("unknown", "Velocty", 1.0, UnknownVariableError, one.write)
        many = f"refusals of {name} that are missing{''.join(f'; {text}' for text in wrong[:5])}"
        ctx.measure(many, len(wrong), high=0.0, requirements=("VAR-009",))


for _campaign in (CAMPAIGN, SPEED_AXIS, SYNCHRONOUS):
    _campaign.case("assigned", requirements=("VAR-015",))(assigned)
    _campaign.case("refused", requirements=("VAR-009",))(refused)
    if _campaign is not SYNCHRONOUS:
        _campaign.case("started", requirements=("VAR-018",))(started)

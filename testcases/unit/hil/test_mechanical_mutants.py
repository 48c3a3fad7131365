"""Defects that a program draws: what the operators change, and that the draw is fair and repeatable."""

import ast
import random
import textwrap
from importlib import import_module

import pytest

from hil.errors import CannotRunError
from hil.mutants import (
    Judge,
    Mutant,
    MutantResult,
    Outcome,
    Seeding,
    credits_of,
    draw,
    seeded,
    shares,
)
from hil.mutants._coverage import Covered, MarkNumbers
from hil.mutants._mechanical import live_code
from hil.mutants._operators import OPERATORS, replacements
from hil.mutants._plan import most_different, most_special

SOURCE = '''
def step(self, limit: float = 2.0) -> None:
    """Not this 1 < 2."""
    if self.speed < limit and not self.held:
        self.ramp(self.speed, -limit)
    elif limit >= 0.5 * self.speed + 3:
        raise ValueError(f"{limit + 1}")
    self.count += 1
    self.peak = max(self.peak, self.speed)
    self.done = False
'''
CHANGED = {
    ("border", "<="),
    ("border", ">"),
    ("relation", ">"),
    ("relation", "<="),
    ("logic", "or"),
    ("logic", "(self.held)"),
    ("call", "pass"),
    ("arguments", "-limit, self.speed"),
    ("sign", "limit"),
    ("sign", "-"),
    ("sign", "-="),
    ("arithmetic", "/"),
    ("constant", "0.55"),
    ("constant", "4"),
    ("constant", "2"),
    ("constant", "True"),
    ("assignment", "pass"),
    ("extreme", "min"),
    ("return", "return\n    "),
}


def mutated(source, change):
    """Return the source with a change."""
    lines = source.splitlines(keepends=True)
    (first, left), (last, right) = change.start, change.end
    lines[first - 1 : last] = [lines[first - 1][:left] + change.text + lines[last - 1][right:]]
    return "".join(lines)


def test_operators_change_what_a_machine_does_and_nothing_else():
    """Every operator finds its places; texts, messages, annotations and defaults stay; each result is
    another program.
    """
    (function,) = ast.parse(SOURCE).body
    found = list(replacements(function, SOURCE.splitlines()))
    assert {(change.operator, change.text) for change in found} == CHANGED
    assert {change.operator for change in found} == OPERATORS.keys()
    programs = {ast.dump(ast.parse(mutated(SOURCE, change))) for change in found}
    assert len(programs) == len(found)
    assert ast.dump(ast.parse(SOURCE)) not in programs


def test_a_function_ends_before_its_last_statement_not_before_a_text():
    """Behind a description of an attribute there is nothing to leave out; one statement alone stays."""
    source = textwrap.dedent("""\
        def start(self):
            self.clear()
            self.begin()
            "What has begun."
    """)
    (function,) = ast.parse(source).body
    ended = [one for one in replacements(function, source.splitlines()) if one.operator == "return"]
    assert [mutated(source, one) for one in ended] == [
        source.replace("self.begin()", "return\n    self.begin()")
    ]
    (short,) = ast.parse(source.replace("    self.clear()\n", "")).body
    assert "return" not in {one.operator for one in replacements(short, source.splitlines())}


def test_places_are_found_behind_wide_characters():
    """Columns count characters, not bytes."""
    source = textwrap.dedent("""\
        def step(text):
            return (text, "\u00b5\u00b0", 1 + 2)
    """)
    (function,) = ast.parse(source).body
    results = {mutated(source, one) for one in replacements(function, source.splitlines())}
    assert source.replace("1 + 2", "1 - 2") in results


@pytest.mark.exhaustive
def test_the_draw_is_repeatable_and_covers_all_packages():
    """The same seed draws the same, another seed others; packages by their size; every defect can be
    switched on.
    """
    first, again, other = draw(30, 1), draw(30, 1), draw(30, 2)
    assert first == again
    assert len({mutant.name for mutant in first}) == 30
    assert len({one.name for one in first} & {one.name for one in other}) < 5, "30 of some thousands"
    assert {mutant.area for mutant in first} == {"motion", "emulators", "fieldbus"}
    for mutant in random.Random(1).sample(first, 5):
        with seeded(mutant, set()):
            pass
    inside = draw(5, 1, ["emulators.encoder"])
    assert all(mutant.name.startswith("emulators.encoder.") for mutant in inside)


@pytest.mark.parametrize(
    ("number", "areas", "words"),
    [
        (5, ["axis"], "--area 'axis' is not allowed with --mechanical; allowed: motion, emulators, fieldbus"),
        (5, ["motion.none"], "--area 'motion.none': there is no such module"),
        (10**6, [], "--mechanical 1000000: there are only"),
    ],
)
def test_what_cannot_be_drawn_is_refused(number, areas, words):
    """The message says what is allowed."""
    with pytest.raises(CannotRunError) as caught:
        draw(number, 1, areas)
    assert str(caught.value).startswith(words)


def test_live_code_is_not_drawn():
    """Every entry names a module or class of the product, with a reason; nothing is drawn there."""
    for name, reason in live_code().items():
        module, _, inside = name.partition(":")
        assert name == module or hasattr(import_module(module), inside), name
        assert reason, name
    with pytest.raises(CannotRunError, match="there are only 0 statements"):
        draw(1, 1, ["fieldbus.can.live"])
    targets = [mutant.edits[0].target for mutant in draw(40, 1, ["fieldbus.clock"])]
    assert all("RealtimeScheduler" not in target for target in targets)


def test_a_limited_number_of_cases_comes_to_as_much_as_it_can():
    """The widest case first, then what adds most to it; the module of the defect counts more; when nothing
    is added any more it begins anew.
    """
    judges = [Judge(f"case/{number}", "", "") for number in range(5)]
    marks = dict(zip(judges, (0b1111_0000, 0b1110_0000, 0b0000_0111, 0b1000_0000, 0b0000_1000), strict=True))

    def taken(most, near=0):
        return [one.identifier[-1] for one in most_different(judges, most, marks, near)]

    assert taken(3) == ["0", "2", "4"]
    assert taken(4) == ["0", "2", "4", "1"]
    assert taken(1, near=0b1000) == ["4"]
    assert taken(0) == ["0", "1", "2", "3", "4"]
    assert taken(5) == ["0", "1", "2", "3", "4"]


def test_special_cases_look_at_little_else_than_the_module():
    """The greatest share of marks in the modules of the defect; of equal ones the first."""
    judges = [Judge(f"family/{one}", "", "") for one in range(4)]
    passed = (0b1111_0001, 0b0000_0011, 0b0000_0111, 0b0000_0011)
    marks = dict(zip(judges, passed, strict=True))

    assert most_special(judges, 3, marks, near=0b11) == [judges[1], judges[3], judges[2]]
    assert most_special(judges, 1, marks, near=0b1111_0000) == [judges[0]]
    assert most_special(judges, 2, {}, near=1) == judges[:2]


def test_marks_of_all_modules_are_bits_of_one_number():
    """Every module has bits of its own, whatever the order in which it is met."""
    numbers = MarkNumbers()
    first = numbers.of(Covered("passed", 0.1, {"a": b"\x01\x80", "b": b"\x03"}))
    second = numbers.of(Covered("passed", 0.1, {"b": b"\x02", "c": b"\x01"}))
    assert first & numbers.modules(["a"]) == 0x8001
    assert (first & numbers.modules(["b"])).bit_count() == 2
    assert (first & second).bit_count() == 1
    assert numbers.modules(["a", "c"]) & numbers.modules(["b"]) == 0
    assert numbers.modules(["none"]) == 0


@pytest.mark.exhaustive
def test_shares_count_what_a_named_requirement_noticed():
    """Equivalent defects are not counted; a catch without a requirement is an accident."""
    first, second, third = draw(3, 1, ["motion"])
    judge = Judge("limits/a", "", "")
    found = frozenset({"x"})
    results = [
        MutantResult(
            first, [Outcome(judge, "failed", "", 0.1, found, requirements=("LIM-001",))], able=1, over=True
        ),
        MutantResult(second, [Outcome(judge, "error", "", 0.1, found)], able=1, over=True),
        MutantResult(
            third, [Outcome(judge, "passed", "", 0.1, found)], able=1, changed=["limits/a"], over=True
        ),
    ]
    same = Mutant("e", "motion", "", third.edits, explained="equal", operator="border")
    results.append(MutantResult(same, [Outcome(judge, "passed", "", 0.1, found)], able=1, over=True))
    row = shares(Seeding(results))[0]
    assert (row.what, row.noticed, row.judged, row.named, row.seen) == ("all", 2, 3, 1, 1)


@pytest.mark.exhaustive
def test_it_is_said_what_noticed_defects():
    """Campaigns and rules with the number of defects that they noticed first; exceptions and the like."""
    judges = [Judge(name, "", "") for name in ("limits/a", "limits/b", "homing/a", "homing/b")]
    how = [
        {"verdict": "failed", "check": "actual velocity", "rule": True},
        {"verdict": "failed", "check": "Stop time"},
        {"verdict": "error"},
        {"verdict": "blocked"},
    ]
    results = [
        MutantResult(
            mutant,
            [Outcome(judge=judge, message="", seconds=0.1, reached=frozenset(), **more)],
            able=1,
            over=True,
        )
        for mutant, judge, more in zip(draw(4, 1, ["motion"]), judges, how, strict=True)
    ]
    lines = [one.line for one in credits_of(Seeding(results))]
    assert lines == [
        "by campaign: limits 2, homing 2",
        "by rule: actual velocity 1",
        "otherwise by: an expectation of a case 1, an exception 1, a bench that does not start 1",
    ]

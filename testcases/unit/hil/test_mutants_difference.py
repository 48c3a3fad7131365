"""Where defects would make a difference: told by the product as it is, for many at once."""

import pytest

from hil.campaign import CaseSettings, execute_case, load_bench_file, load_campaign
from hil.mutants import Edit, Mutant, TargetChangedError, draw, seeded
from hil.mutants._difference import differences_of

CALLS = []


def noted(value):
    """Return a value, with an effect."""
    CALLS.append(value)
    return value


class Part:
    """What defects are put into."""

    def __init__(self):
        self.limit = 2.0
        self.high = False
        self.count = 0
        self.items = [0.0, 1.0]

    def border(self, value):
        """Compare."""
        return value < self.limit

    def condition(self, value):
        """Compare in a condition, where only the truth counts."""
        if value + 1.0:
            return 1
        return 2

    def called(self, value):
        """Compare what a call returns."""
        return noted(value) < self.limit

    def total(self, value):
        """Add what a call returns."""
        return noted(value) + self.count

    def negative(self, value):
        """Negate what a call returns."""
        return -noted(value)

    def least(self, value):
        """Return the smaller one of what calls return."""
        return min(noted(value), noted(self.limit))

    def swapped(self, value):
        """Give two arguments."""
        return self.pair(noted(value), self.limit)

    @staticmethod
    def pair(one, other):
        """Return both."""
        return one, other

    def assign(self, value):
        """Assign what may have been there before."""
        self.high = value > self.limit
        return self.high

    def element(self, value):
        """Assign an element that may be new."""
        table = {1.0: 2.0}
        table[value] = 2.0
        return table

    def step(self, value):
        """Step by nothing or something."""
        self.count += int(value)
        return self.count

    def division(self, value):
        """Divide."""
        return value and self.limit * value

    def loop(self, value):
        """Look through a list."""
        return [one for one in self.items if one >= value]

    def later(self, value):
        """Use a variable that is made by the statement before, and a method with an effect."""
        near = abs(value - self.limit)
        CALLS.append(near)
        return near


def mutant(name, old, new):
    """Return a defect in `Part`."""
    return Mutant(f"{name} {new}", "motion", "", (Edit(f"{__name__}:Part.{name}", old, new),))


DEFECTS = (
    mutant("border", "value < self", "value <= self"),
    mutant("border", "value < self", "value > self"),
    mutant("condition", "value + 1.0", "value + 2.0"),
    mutant("called", ") < self", ") <= self"),
    mutant("total", ") + self", ") - self"),
    mutant("negative", "-noted(value)", "noted(value)"),
    mutant("least", "min", "max"),
    mutant("swapped", "noted(value), self.limit", "self.limit, noted(value)"),
    mutant("assign", "self.high = value > self.limit", "pass"),
    mutant("element", "table[value] = 2.0", "pass"),
    mutant("step", "+=", "-="),
    mutant("division", "*", "/"),
    mutant("division", "and", "or"),
    mutant("loop", ">=", ">"),
    mutant("later", "value - self", "value + self"),
)
VALUES = (-2.0, -1.0, -0.0, 0.0, 1.0, 2.0, 3.0)


def outcome(name, value):
    """Return all that a call brings about."""
    CALLS.clear()
    part = Part()
    try:
        result = getattr(part, name)(value)
    except ZeroDivisionError:
        result = "divided by zero"
    return repr((result, vars(part), sorted(CALLS)))


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.name)
def test_a_difference_is_told_exactly_where_there_is_one(defect, subtests):
    """For every value: the code that tells behaves like the code as it is, and tells of a difference where
    the defect changes what comes of it, and nowhere else.
    """
    code = differences_of([defect])
    name = defect.name.partition(" ")[0]
    told = set()
    for value in VALUES:
        with subtests.test(value=value):
            as_it_is = outcome(name, value)
            with seeded(defect, set()):
                changed = outcome(name, value)
            found = set()
            with code.applied(found):
                assert outcome(name, value) == as_it_is
            assert (defect.name in found) == (changed != as_it_is)
            told |= {defect.name in found}
    assert told == {False, True} or defect.name.startswith("negative")


def test_one_run_tells_it_of_many_defects():
    """Several in one function, in one expression, one inside of another."""
    inner, outer = mutant("later", "value - self", "value + self"), mutant("later", "abs(", "float(")
    some = [DEFECTS[0], DEFECTS[1], inner, outer]
    found = set()
    with differences_of(some).applied(found):
        outcome("border", 1.0)
        assert found == {DEFECTS[1].name}
        found.clear()
        outcome("later", 0.0)
        assert found == {outer.name}
        found.clear()
        outcome("later", 3.0)
        assert found == {inner.name}


def test_where_nothing_can_be_compared_a_defect_counts_when_it_is_reached():
    """A call that is left out, a return, an assignment of what a call returns, a constant."""
    defects = [
        mutant("later", "CALLS.append(near)", "pass"),
        mutant("called", "return noted", "return; noted"),
        mutant("condition", "return 2", "return 3"),
    ]
    found = set()
    with differences_of(defects).applied(found):
        outcome("border", 1.0)
        outcome("condition", 1.0)
        assert found == set()
        for name, value in (("later", 1.0), ("called", 1.0), ("condition", -1.0)):
            outcome(name, value)
    assert found == {defect.name for defect in defects}


def test_a_changed_product_is_noticed():
    """The text that a defect replaces is not there."""
    with pytest.raises(TargetChangedError, match="stands there 0 times"):
        differences_of([mutant("border", "value << self", "value >> self")])


def test_the_product_goes_on_as_it_is():
    """With a hundred drawn defects in it that are only looked at, a motion leaves the same trace; some of
    them make a difference, others do not.
    """
    campaign = load_campaign("testcases.campaigns.axis_motion:CAMPAIGN")
    case = next(iter(campaign.cases))
    bench = load_bench_file(case.bench or None)

    def run():
        return execute_case(case, bench, CaseSettings(seed=1)).result

    as_it_is = run()
    assert as_it_is.verdict.value == "passed"
    defects = draw(100, 4, ["motion.s7.axis", "motion.kernel", "emulators.drive"])
    found = set()
    with differences_of(defects).applied(found):
        assert run().trace_digest == as_it_is.trace_digest != ""
    assert 3 < len(found) < len(defects)

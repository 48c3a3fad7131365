"""The digest of the source of a test: what changes it, and what does not."""

import pytest

from hil._plugin_source import _definitions, source_digest

pytestmark = pytest.mark.exhaustive

pytest_plugins = ["pytester"]

SOURCE = '''
import pytest

SPEED = 100.0  # mm/s

def enable(bench):
    return bench.axis(), SPEED

@pytest.fixture
def enabled():
    return 1

@pytest.mark.parametrize("n", [1, 2])
def test_one(enabled, n):
    """A rule."""
    assert enable

class TestGroup:
    LIMIT = 3
    def test_in_class(self, of_conftest):
        assert self.LIMIT

def test_other():
    assert True
'''
CONFTEST = "import pytest\n@pytest.fixture\ndef of_conftest(): return {}\n"


def digests(pytester, source=SOURCE, returned=1):
    """Return the digests of the tests by their names."""
    pytester.makepyfile(test_it=source)
    pytester.makeconftest(CONFTEST.format(returned))
    _definitions.cache_clear()
    items, _ = pytester.inline_genitems("-p", "no:cacheprovider")
    return {item.name: source_digest(item) for item in items}


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        ("# mm/s", "# in mm/s", set()),
        ("assert enable", "assert (  enable  )", set()),
        ("A rule.", "Another rule.", set()),
        ("assert True", "assert 1", {"test_other"}),
        ("100.0", "101.0", {"test_one[1]", "test_one[2]"}),
        ("return bench.axis()", "return bench.drive()", {"test_one[1]", "test_one[2]"}),
        ("return 1", "return 2", {"test_one[1]", "test_one[2]"}),
        ("LIMIT = 3", "LIMIT = 4", {"test_in_class"}),
    ],
)
def test_what_makes_another_digest(pytester, old, new, changed):
    """Function, class, fixtures, helpers and constants count; comments, docstrings, layout and other tests do
    not.
    """
    before, after = digests(pytester), digests(pytester, SOURCE.replace(old, new))
    assert all(before.values())
    assert before["test_one[1]"] == before["test_one[2]"]
    assert {name for name in before if before[name] != after[name]} == changed


def test_a_fixture_of_conftest_counts(pytester):
    """An edited fixture is an edited test, wherever it stands in the project."""
    before, after = digests(pytester), digests(pytester, returned=2)
    assert {name for name in before if before[name] != after[name]} == {"test_in_class"}

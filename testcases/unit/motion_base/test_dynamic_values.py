"""Where dynamic values come from."""

import pytest

from motion.setpoint import resolve


@pytest.mark.requirement("STP-082", "STP-084", "MC-093")
@pytest.mark.parametrize(
    ("default", "given", "limit", "effective", "limited"),
    [
        pytest.param(2000.0, -1.0, 4000.0, 2000.0, False, marks=pytest.mark.requirement("STP-094")),
        pytest.param(2000.0, -1.0, 500.0, 500.0, True, marks=pytest.mark.requirement("STP-095")),
        pytest.param(2000.0, 3000.0, 4000.0, 3000.0, False, marks=pytest.mark.requirement("STP-096")),
        pytest.param(2000.0, 6000.0, 4000.0, 4000.0, True, marks=pytest.mark.requirement("STP-097")),
    ],
)
def test_default_and_limit(default, given, limit, effective, limited):
    """A negative input takes the default; the result never exceeds the limit, and says so."""
    assert resolve(given, default, limit) == (effective, limited)


def test_zero_is_a_value():
    """Zero is no request for the default: jerk 0.0 means no jerk limit (MC-089)."""
    assert resolve(0.0, 5.0, 10.0) == (0.0, False)


def test_equal_to_the_limit_is_not_limited():
    """A value equal to its limit raises no warning."""
    assert resolve(10.0, 5.0, 10.0) == (10.0, False)

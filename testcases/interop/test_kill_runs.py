"""A campaign that is killed loses nothing that had ended, and is completed by resuming."""

import pytest

from testcases.kill_runs import after_cases, after_seconds, kill_until_through

pytestmark = pytest.mark.realtime

ARGUMENTS = ["testcases.unit.hil.toycampaign", "-t", "toy", "-k", "move", "-j"]


@pytest.mark.exhaustive
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_killed_run_loses_nothing_and_is_completed(jobs):
    """Killed by signal 9 at its beginning and behind a case, the journal is whole, and the resumed run is an
    undisturbed one.
    """
    plan = [after_seconds(0.05), after_cases(1)]
    undisturbed = kill_until_through([*ARGUMENTS, jobs], lambda _kills: None)
    session = kill_until_through([*ARGUMENTS, jobs], lambda kills: plan[kills] if kills < len(plan) else None)

    assert (session.digest, session.cases) == (undisturbed.digest, undisturbed.cases)
    assert session.kills == len(plan)
    assert session.reported, "the second kill is behind a case"

"""Cases that use up their time, for the tests of the runner; they must not run in the process of a test."""

import signal
import time
from contextlib import suppress

from hil.campaign import Campaign

CAMPAIGN = Campaign("hang", bench="testcases.unit.hil.toybench:BENCH")


@CAMPAIGN.case("asleep", wall_limit_s=1000.0)
def asleep(ctx):
    """A case that waits for ever, and hears its time limit."""
    time.sleep(1000.0)


@CAMPAIGN.case("deaf", wall_limit_s=1000.0)
def deaf(ctx):
    """A case that does not even hear its time limit, as a library that never returns."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    time.sleep(1000.0)


@CAMPAIGN.case("stubborn", wall_limit_s=1000.0)
def stubborn(ctx):
    """A case that takes whatever is raised for a small mistake."""
    while True:
        with suppress(Exception):
            time.sleep(1000.0)


@CAMPAIGN.case("fine")
def fine(ctx):
    """A case that ends."""
    ctx.run_for(0.1)

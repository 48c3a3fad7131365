"""Where a search gets its choices from: the seed alone.

Hypothesis mixes in constants that it finds in the modules of the project, those that happen to be loaded: the
same seed would give other programs in another process, or after another test.
"""

from __future__ import annotations

from typing import Final

from hypothesis.internal.conjecture.providers import AVAILABLE_PROVIDERS, HypothesisProvider

BACKEND: Final = "motion-hil"
"""Name of the provider, for `hypothesis.settings`."""


class SeededProvider(HypothesisProvider):
    """Makes the choices of Hypothesis, without the constants of loaded modules."""

    def _maybe_draw_constant(self, *_arguments: object, **_options: object) -> None:
        return None


AVAILABLE_PROVIDERS[BACKEND] = SeededProvider

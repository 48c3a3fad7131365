"""Exceptions of the orchestrator; all are rooted in `fieldbus.errors.HilError`."""

from __future__ import annotations

from collections.abc import Sequence

from fieldbus.errors import ConfigurationError, HilError, UnsupportedFaultError

__all__ = [
    "BlockedError",
    "CampaignNotFoundError",
    "CannotRunError",
    "CaseEndedError",
    "CaseTimeoutError",
    "ConfigurationError",
    "ExpectationFailedError",
    "HilError",
    "NotNamedError",
    "NotRecordedError",
    "RecordingError",
    "TokenError",
    "UnsupportedFaultError",
    "name_the",
]


class CannotRunError(HilError):
    """The command cannot be carried out (exit code 2)."""


class NotNamedError(ConfigurationError):
    """Something is about a part, does not say which one, and there are several.

    Args:
        where: What lacks the name.
        what: What it is about: `axis`.
        names: Names of the parts.

    """

    def __init__(self, where: str, what: str, names: Sequence[str]) -> None:
        wanted = name_the(what, names)
        super().__init__(where, None, wanted)
        self.args = (f"{where}: {wanted}",)


def name_the(what: str, names: Sequence[str]) -> str:
    """Return what to do where there are several parts: `name the axis: x, y or z`."""
    return f"name the {what}: {' or '.join([', '.join(names[:-1]), names[-1]] if names[1:] else names)}"


class CampaignNotFoundError(CannotRunError):
    """A path or module name given to `hil run` leads to no campaign.

    Args:
        reference: What the user gave.
        reason: Why nothing was found there.

    """

    def __init__(self, reference: str, reason: str) -> None:
        super().__init__(
            f"{reference!r} leads to no campaign: {reason}. Give a short name (`hil run` lists them), "
            "a Python file, directory or module that defines a hil.campaign.Campaign, or a matrix file"
        )
        self.reference = reference
        self.reason = reason


class TokenError(CannotRunError):
    """A replay token cannot be read, or what it points at has changed."""


class BlockedError(HilError):
    """The bench does not meet the requirements of the case; the case ends with the verdict *blocked*."""


class CaseTimeoutError(HilError):
    """A case has used up its limit of simulated or wall time."""


class CaseEndedError(BaseException):
    """A case that has used up its limit of wall time has gone on regardless; no `except Exception` of a case
    takes this.
    """


class RecordingError(HilError):
    """Misuse of a recorder or trace, such as the name of a signal that does not exist."""


class NotRecordedError(HilError):
    """This sort of recording cannot hold it: a bus log has no jobs of the controller."""


class ExpectationFailedError(HilError, AssertionError):
    """An expectation that was checked at once did not hold; the message says expected, observed and when."""

"""A test of pytest again, from its token."""

from __future__ import annotations

from pathlib import Path

from hil.campaign import Token
from hil.errors import TokenError


def arguments_of_test(token: Token, *, report: Path | None = None) -> list[str]:
    """Return the arguments with which pytest repeats a test.

    Args:
        token: Its token.
        report: Folder of report and evidence; None: no report.

    Raises:
        TokenError: The file of the test is not here.

    """
    if not Path(token.test_file).exists():
        raise TokenError(
            f"{token.test_file} is not here: start the command in the folder in which pytest ran"
        )
    _, sign, rest = token.case.partition("::")
    arguments = [f"{token.test_file}{sign}{rest}", f"--hil-seed={token.seed}"]
    if token.bench:
        arguments.append(f"--hil-bench={token.bench}")
    if token.example:
        arguments.append(f"--hil-example={token.example}")
    if report is not None:
        arguments += [f"--hil-report={report}", "--hil-evidence=all"]
    return arguments

"""Text of the reports: headlines, limits, margins, durations, names of reactions."""

from __future__ import annotations

import math
import re
from typing import Final

from reports.model import CaseResult, Check, RunResult, Verdict

VERDICTS: Final = (Verdict.FAILED, Verdict.ERROR, Verdict.BLOCKED, Verdict.PASSED)
"""Worst first: the order in which reports show them."""


def duration(value: float) -> str:
    """Return a time [s] in the unit that suits its size."""
    if not math.isfinite(value):
        return "unknown"
    if value >= 120:
        minutes, rest = divmod(round(value), 60)
        return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min {rest:02d} s"
    if value >= 1:
        return f"{value:.2f} s"
    return f"{value * 1000:.0f} ms" if value else "0 s"


REACTION_NAMES: Final[dict[int, str]] = {
    0: "no reaction",
    1: "stop, current dynamics",
    2: "stop, maximum dynamics",
    3: "emergency stop ramp",
    4: "remove enable",
    5: "follow-up",
    6: "end output cam",
    7: "end cam track",
    8: "end measuring input",
    9: "end cam",
    10: "end external encoder",
    11: "stop on the path",
    12: "stop axes, maximum dynamics",
    13: "end leading axis proxy",
    14: "stop interpreter",
    15: "stop and recompile interpreter",
}
"""Alarm reactions of a technology object (TA catalogue)."""

_LEADS_ON: Final = re.compile(
    r"(within|at most|at least|at|before|after|between|not|never|no later|until|by|in|to|from|no)\b",
    re.IGNORECASE,
)
_VERB: Final = re.compile(
    r"(came|was|were|did|does|stayed|stays|reached|rose|fell|stopped|moved|never|is|has|had|went|kept|got|remained)\b",
    re.IGNORECASE,
)
_MOMENT: Final = re.compile(r"(after|at|before)\b", re.IGNORECASE)


def reaction_name(code: int) -> str:
    """Return the name of a reaction, `reaction 99` for an unknown code."""
    return REACTION_NAMES.get(code, f"reaction {code}")


def number(value: float, digits: int = 6) -> str:
    """Return a number with up to `digits` significant digits, without an
    exponent where that stays readable.
    """
    if not math.isfinite(value):
        return {True: "∞", False: "-∞"}[value > 0] if math.isinf(value) else "not a number"
    if value == 0:
        return "0"
    size = abs(value)
    if 1e-4 <= size < 1e9:
        decimals = max(0, digits - 1 - math.floor(math.log10(size)))
        text = f"{value:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits}g}"


_CODES: Final = re.compile(r"(^|_)(code|error_id|controlword|statusword|stw\d|zsw\d|mask|cob_id|index)$")


def code_text(name: str, value: object) -> str:
    """Return a value as the manuals write it: codes and words hexadecimal (`2310h`), others as they are."""
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0 and _CODES.search(name):
        return f"{value:04X}h"
    return str(value)


def quantity(value: float, unit: str, digits: int = 6) -> str:
    """Return a number with its unit."""
    return f"{number(value, digits)} {unit}".rstrip()


def _in_size(unit: str, *values: float | None) -> tuple[float, str]:
    """Return the factor and the unit in which values are readable: times below a second in ms."""
    sizes = [abs(value) for value in values if value is not None]
    return (1e3, "ms") if unit == "s" and sizes and max(sizes) < 1.0 else (1.0, unit)


def limits(check: Check) -> str:
    """Return the limits of a measurement in symbols; empty without limits."""
    factor, name = _in_size(check.unit, check.low, check.high)
    unit = f" {name}" if name else ""
    if check.high is not None and (check.low is None or (check.low == 0 and name in ("s", "ms"))):
        return f"≤ {number(check.high * factor)}{unit}"
    if check.low is not None and check.high is not None:
        return f"{number(check.low * factor)} … {number(check.high * factor)}{unit}"
    return "" if check.low is None else f"≥ {number(check.low * factor)}{unit}"


def limit_words(low: float | None, high: float | None, unit: str) -> str:
    """Return limits in words: `45 … 55 mm`, `at most 5 mm`, `0`."""
    if low is not None and high is not None:
        if low == high:
            return quantity(low, unit)
        if low == -high:
            return f"± {quantity(high, unit)}"
        return f"{quantity(low, '')} … {quantity(high, unit)}"
    if high is not None:
        return f"at most {quantity(high, unit)}"
    return "" if low is None else f"at least {quantity(low, unit)}"


def margin(check: Check) -> float | None:
    """Return the distance of a measurement to its nearest limit: negative
    outside; None without value or limits.
    """
    if check.value is None or not math.isfinite(check.value):
        return None
    distances = []
    if check.low is not None:
        distances.append(check.value - check.low)
    if check.high is not None:
        distances.append(check.high - check.value)
    return min(distances) if distances else None


def margin_text(check: Check) -> str:
    """Return the margin as text: `28 ms over the limit`, `3.2 mm to spare`; empty where there is none."""
    distance = margin(check)
    if distance is None or check.value is None or not math.isfinite(distance):
        return ""
    factor, unit = _in_size(check.unit, distance)
    text = quantity(abs(distance) * factor, unit, 4)
    if distance >= 0:
        return f"{text} to spare"
    over = check.high is not None and check.value > check.high
    return f"{text} {'over' if over else 'under'} the limit"


def expected_text(check: Check) -> str:
    """Return what was expected, from the limits where the check has no text."""
    return check.expected.strip() or limits(check)


def observed_text(check: Check) -> str:
    """Return what was observed, from the value where the check has no text."""
    if check.observed.strip():
        return check.observed.strip()
    if check.value is None:
        return ""
    factor, unit = _in_size(check.unit, check.value)
    return quantity(check.value * factor, unit)


def capital(text: str) -> str:
    """Return the text with a capital letter in front."""
    return text[:1].upper() + text[1:]


def _strip_name(name: str, text: str) -> str:
    """Drop the subject where the text repeats it: `alarm 521` from `alarm 521 within 20 ms`."""
    if name and text.lower().startswith(name.lower()):
        rest = text[len(name) :]
        if rest[:1] in {"", " ", ":", ","}:
            return rest.lstrip(" :,")
    return text


def check_sentence(check: Check) -> str:
    """Return what came of a check in one sentence: its own, else one of expected against observed (`Alarm 521
    expected within 20 ms, came after 48 ms`).
    """
    if check.sentence:
        return check.sentence
    name = " ".join(check.name.split())
    expected = _strip_name(name, " ".join(expected_text(check).split()))
    observed = _strip_name(name, " ".join(observed_text(check).split()))
    if not expected and not observed:
        return capital(name)
    if _MOMENT.match(observed):
        observed = f"came {observed}"
    elif observed and not _VERB.match(observed):
        observed = f"observed {observed}"
    colon = "" if _LEADS_ON.match(expected) else ":"
    parts = [f"{name}{colon} expected {expected}"] if expected else [f"{name}:"]
    if observed:
        parts.append(observed)
    return capital((", " if expected else " ").join(parts))


def _first_line(text: str) -> str:
    return next((line.strip() for line in text.splitlines() if line.strip()), "")


def headline(case: CaseResult) -> str:
    """Return why a case is not green, in one sentence; empty for a passed one.

    A failed case speaks through its first failed check, a blocked or broken one through its message.
    """
    if case.verdict is Verdict.PASSED:
        return ""
    if case.verdict is Verdict.FAILED:
        failed = [check for check in case.checks if check.verdict is Verdict.FAILED]
        if failed:
            return check_sentence(min(failed, key=lambda check: check.rule))
    if message := _first_line(case.message):
        return message
    for check in case.checks:
        if check.verdict not in {Verdict.PASSED, Verdict.BLOCKED}:
            return check_sentence(check)
    return {
        Verdict.FAILED: "Failed without saying why",
        Verdict.BLOCKED: "Blocked without saying why",
        Verdict.ERROR: "The harness failed without saying why",
    }[case.verdict]


def own_title(case: CaseResult) -> str:
    """Return the title of a case as far as it says more than its identifier; empty where it does not."""
    title = case.title.removeprefix(case.identifier).strip(" :-")
    return "" if title and case.identifier.endswith(title) else title


def run_state(run: RunResult) -> str:
    """Return the state of the run in one word.

    `failed` (a case failed or broke), `interrupted`, `empty` (nothing passed, so
    nothing was shown), or `passed`.
    """
    if run.count(Verdict.FAILED) or run.count(Verdict.ERROR):
        return "failed"
    if run.interrupted:
        return "interrupted"
    return "passed" if run.count(Verdict.PASSED) else "empty"


def replay_command(token: str) -> str:
    """Return the shell command that repeats a case."""
    plain = re.fullmatch(r"[A-Za-z0-9@%+=:,./_-]+", token)
    return "hil replay " + (token if plain else "'" + token.replace("'", "'\\''") + "'")

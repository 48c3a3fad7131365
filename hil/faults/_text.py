"""A fault as one word of a command line: `KIND[@TARGET][:KEY=VALUE,...]`."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import ConfigurationError
from hil.faults._catalogue import CATALOGUE
from hil.faults._fault import Fault
from hil.faults._parameters import Scalar
from hil.faults._trigger import Immediately, after

FORM: Final = "KIND[@TARGET][:KEY=VALUE,...]"


def split_text(text: str, *, where: str) -> tuple[str, str, dict[str, Scalar]]:
    """Return kind, target (empty: none) and parameters.

    Args:
        text: `frame.drop@can0:drive=x,message=tpdo1`.
        where: What the text was given as, for the message.

    Raises:
        ConfigurationError: It is written otherwise.

    """
    head, colon, tail = text.partition(":")
    kind, _, target = (one.strip() for one in head.partition("@"))
    # A text may look like a number: `data=8001`.
    texts = {
        parameter.name
        for entry in CATALOGUE
        if entry.name == kind
        for parameter in entry.parameters
        if parameter.type == "text"
    }
    parameters: dict[str, Scalar] = {}
    for part in tail.split(",") if colon else ():
        key, equals, value = part.partition("=")
        if not equals or not key.strip():
            raise ConfigurationError(where, text, FORM)
        parameters[key.strip()] = value.strip() if key.strip() in texts else _scalar(value.strip())
    return kind, target, parameters


def fault_from_text(text: str, *, where: str) -> Fault:
    """Return the fault that a text describes.

    `at_s` (s from arming), `duration_s` and `count` are those of every fault, all other keys parameters of
    its kind.

    Raises:
        ConfigurationError: It is written otherwise; or there is no such kind or parameter, or it cannot have
            the value.

    """
    kind, target, parameters = split_text(text, where=where)
    at_s = number(parameters, "at_s", kind)
    duration_s = number(parameters, "duration_s", kind)
    count = number(parameters, "count", kind)
    if count is not None and count != int(count):
        raise ConfigurationError(f"{kind}.count", count, "a whole number, 1 or more")
    return Fault(
        kind,
        target,
        Immediately() if at_s is None else after(at_s),
        None,
        duration_s,
        None if count is None else int(count),
        parameters,
    )


def number(parameters: dict[str, Scalar], key: str, kind: str) -> float | None:
    """Take a number out of parameters; None: it is not there.

    Raises:
        ConfigurationError: It is something else.

    """
    value = parameters.pop(key, None)
    if value is not None and isinstance(value, (str, bool)):
        raise ConfigurationError(f"{kind}.{key}", value, "a number")
    return value


def _scalar(text: str) -> Scalar:
    if text.lower() in {"true", "false"}:
        return text.lower() == "true"
    for read in (lambda one: int(one, 0), float):
        try:
            return read(text)
        except ValueError:
            continue
    return text

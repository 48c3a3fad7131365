"""Payloads and identifiers of CAN frames as parameters of faults."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from hil.faults._parameters import Values

_LARGEST_STANDARD: Final = 0x7FF


def parse_payload(kind: str, values: Values) -> bytes:
    """Return the parameter `data`, hexadecimal, as 0 to 8 bytes; blanks are ignored.

    Raises:
        ConfigurationError: It is no hexadecimal text, or too long.

    """
    where, text = f"{kind}.parameters.data", values.text("data")
    try:
        data = bytes.fromhex(text)
    except ValueError:
        raise ConfigurationError(where, text, "hexadecimal text such as '3702 0000'") from None
    if len(data) > 8:
        raise ConfigurationError(where, text, "0 to 8 bytes")
    return data


def check_payload(kind: str, values: Values) -> None:
    """Raise `ConfigurationError` if `data` is no payload."""
    parse_payload(kind, values)


def check_identifiers(kind: str, values: Values, *names: str) -> None:
    """Raise `ConfigurationError` if an identifier needs 29 bits and `extended` is not set."""
    if values.flag("extended"):
        return
    for name in names:
        if values.integer(name) > _LARGEST_STANDARD:
            raise ConfigurationError(
                f"{kind}.parameters.{name}", values.get(name), "0..7FFh, or extended = true"
            )

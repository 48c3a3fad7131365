"""Options of homing in a CiA 402 drive."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Final, Literal, get_args

from emulators.checked_fields import BENCH_FILE_TABLE, check_fields
from fieldbus.errors import ConfigurationError

StopMethod = Literal["positive", "negative", "positive_index", "negative_index", "unsupported"]
"""What a manufacturer's homing method can be."""
_STOP_NUMBERS: Final = ("-1", "-2", "-3", "-4")


@dataclass(frozen=True, kw_only=True)
class HomingConfig:
    """`[drive.NAME.homing]`: what manufacturers of drives do differently (C402-131, C402-138).

    Raises:
        ConfigurationError: A value is not among those that are allowed.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    offset: Literal["profile", "vendor"] | None = None
    """Position at the home point: -607Ch (`profile`), or +607Ch (`vendor`); none: as the personality
    has it, else `profile`.
    """
    move: Literal["none", "zero"] = "none"
    """Whether the drive moves to position zero when it has found home."""
    hard_stop_methods: dict[Literal["-1", "-2", "-3", "-4"], StopMethod] = field(default_factory=dict)
    """Meaning of methods -1 to -4 where it differs (`{ "-1" = "negative_index" }`): side of the stop, and
    whether the index on the way back is home. Else: -1 `positive_index`, -2 `negative_index`, -3
    `positive`, -4 `negative`.
    """

    def __post_init__(self) -> None:
        check_fields(self, "homing")
        for number, name in self.hard_stop_methods.items():
            if number not in _STOP_NUMBERS:
                raise ConfigurationError("homing hard_stop_methods", number, ", ".join(_STOP_NUMBERS))
            if name not in get_args(StopMethod):
                raise ConfigurationError(
                    f"homing hard_stop_methods {number}", name, ", ".join(get_args(StopMethod))
                )

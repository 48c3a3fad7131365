"""Register maps as TOML files: which registers a drive shows, and what is behind each of them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import parsed_toml

SHIPPED: Final = ("sinamics_g120", "sinamics_g220", "festo")

Order = Literal["high_first", "low_first"]


class BlockFile(BaseModel):
    """A run of registers. Neither hook nor parameter: plain storage."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    register_: int = Field(alias="register", ge=0)
    """Number as the manual gives it; `first` is address 0 on the wire."""
    count: int = Field(default=1, ge=1, le=65536)
    hook: Literal["setpoints", "actual_values", "ds47", "mailbox", "error_code"] | None = None
    parameter: int | None = Field(default=None, ge=1, le=65535)
    """PNU; value n of the block is its sub-index `sub_index` + n."""
    sub_index: int = Field(default=0, ge=0, le=65535)
    """First sub-index."""
    bit: int | None = Field(default=None, ge=0, le=31)
    """Register n of the block is the bit `bit` + n of the parameter; read-only."""
    words: Literal[1, 2] = 1
    """Registers of a value, in the `word_order` of the map."""
    scale: float = Field(default=1.0, gt=0)
    """Register = value x scale, saturated (PD-294)."""
    signed: bool = False
    writable: bool = True
    minimum: int | None = None
    maximum: int | None = None

    @model_validator(mode="after")
    def _one_meaning(self) -> BlockFile:
        if self.hook is not None and self.parameter is not None:
            raise ValueError("a block has a hook or a parameter, not both")
        if self.parameter is None and (self.bit is not None or self.sub_index or self.words != 1):
            raise ValueError("bit, sub_index and words are of a parameter")
        if self.count % self.words or (self.bit is not None and self.words != 1):
            raise ValueError("values of two registers need an even count, and bits one register each")
        return self


class MapFile(BaseModel):
    """A register map."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    first: int = Field(default=0, ge=0)
    """Register number that is address 0 on the wire (MODB-034)."""
    functions: tuple[int, ...] = (3, 6, 16, 23)
    """Function codes; with an identification also 43 (PD-334)."""
    identification: dict[int, str] = Field(default_factory=dict)
    """Objects of function 43/14 by number (MODB-021)."""
    limits: dict[int, int] = Field(default_factory=dict)
    partial_writes: bool = False
    word_order: Order = "high_first"
    """Of double words, in process data too; with the low word first the bytes of the mailbox are in that
    order as well.
    """
    watched: int | None = Field(default=None, ge=1)
    """How many registers of either process data block keep the time-out from running out; None: all (PD-292).
    """
    timeout_ms: int = Field(default=0, ge=0, le=2_000_000)
    """Time-out of the process data; 0 = off (p2040)."""
    faults: dict[int, int] = Field(default_factory=dict)
    """Number of a fault of the axis -> number that FAULT_CODE shows in its place."""
    warnings: dict[int, int] = Field(default_factory=dict)
    """Number of a warning -> number that WARN_CODE shows in its place."""
    block: tuple[BlockFile, ...]


def load_map(source: str | Path) -> MapFile:
    """Return a register map by the name of a shipped one or from a file.

    Raises:
        ConfigurationError: There is none, or it cannot be used; the message names
            file, key and what is allowed.

    """
    where = str(source)
    if where in SHIPPED:
        return _shipped(where)
    try:
        text = Path(source).read_text(encoding="utf-8")
    except OSError:
        raise ConfigurationError("register map", where, f"a file, or one of {', '.join(SHIPPED)}") from None
    return _parsed(where, text)


@cache
def _shipped(name: str) -> MapFile:
    return _parsed(
        name, files("fieldbus.modbus").joinpath("maps", f"{name}.toml").read_text(encoding="utf-8")
    )


def _parsed(where: str, text: str) -> MapFile:
    try:
        found = MapFile.model_validate(parsed_toml(where, text))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ConfigurationError(f"{where}: {place}", first.get("input"), first["msg"]) from None
    for block in found.block:
        if block.register_ < found.first:
            raise ConfigurationError(f"{where}: block.register", block.register_, f"{found.first} or more")
    return found

"""The engine: a corpus per target, mutations of it from a seed, and the shortest input that still fails."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

CORPUS: Final = Path(__file__).parent / "corpus"
LONGEST_INPUT: Final = 400
_EDGES: Final = (0x00, 0x01, 0x02, 0x05, 0x10, 0x20, 0x40, 0x7F, 0x80, 0x81, 0xA0, 0xC0, 0xFE, 0xFF)


@dataclass(frozen=True, slots=True)
class Target:
    """Something that takes bytes.

    Args:
        name: Name, also of its corpus.
        what: What it is, for the listing.
        make: Returns a function that takes one input and raises if a promise is broken. It has to bring what
            it tests back to a known state by itself: inputs do not depend on each other.

    """

    name: str
    what: str
    make: Callable[[], Callable[[bytes], None]]

    @property
    def path(self) -> Path:
        """File of the corpus: one input a line, hexadecimal; `#` begins a comment."""
        return CORPUS / f"{self.name}.txt"


@dataclass(frozen=True, slots=True)
class Failure:
    """An input on which a promise was broken."""

    data: bytes
    error: str


def read_corpus(path: Path) -> list[bytes]:
    """Return the inputs of a corpus file, in order."""
    lines = path.read_text(encoding="ascii").splitlines() if path.exists() else []
    return [bytes.fromhex(text) for line in lines if (text := line.partition("#")[0].strip())]


def add_to_corpus(path: Path, inputs: list[bytes], why: str) -> int:
    """Append inputs that are not there yet; return how many these were."""
    known = set(read_corpus(path))
    new = [one for one in dict.fromkeys(inputs) if one and one not in known]
    if new:
        with path.open("a", encoding="ascii") as file:
            file.write(f"# {why}\n")
            file.writelines(f"{one.hex()}\n" for one in new)
    return len(new)


def mutate(generator: random.Random, data: bytes, other: bytes) -> bytes:
    """Return `data` with one to six changes; `other` lends pieces."""
    out = bytearray(data)
    for _ in range(generator.choice((1, 1, 2, 3, 6))):
        kind = generator.randrange(7)
        at = generator.randrange(len(out) + 1)
        if kind == 0 and out:
            out[at % len(out)] ^= 1 << generator.randrange(8)
        elif kind == 1 and out:
            out[at % len(out)] = generator.choice(_EDGES)
        elif kind == 2 and out:
            out[at % len(out)] = generator.randrange(256)
        elif kind == 3:
            out[at:at] = generator.randbytes(generator.choice((1, 2, 4, 8, 10)))
        elif kind == 4:
            del out[at : at + generator.choice((1, 2, 8, 10, 20))]
        elif kind == 5 and other:
            start = generator.randrange(len(other))
            out[at:at] = other[start : start + generator.choice((2, 10, 20, 40))]
        elif out:
            start = generator.randrange(len(out))
            out[at:at] = out[start : start + 10] * generator.choice((1, 2, 5))
    return bytes(out[:LONGEST_INPUT])


def inputs(corpus: list[bytes], count: int, seed: int) -> Iterator[bytes]:
    """Yield the corpus, then mutations of it, `count` in all (at least the corpus); the same for the same
    seed.
    """
    yield from corpus
    generator = random.Random(seed)
    pool = list(corpus) or [b""]
    for _ in range(count - len(corpus)):
        if generator.random() < 0.03:
            yield generator.randbytes(generator.randrange(80))
        else:
            yield mutate(generator, generator.choice(pool), generator.choice(pool))


def run(target: Target, count: int, seed: int, tell: Callable[[int], object] | None = None) -> Failure | None:
    """Run inputs until one fails; return it in its shortest form, or None.

    Args:
        target: What to test.
        count: Number of inputs.
        seed: Seed of the mutations.
        tell: Called with the number of inputs done, now and then.

    """
    take = target.make()
    for number, data in enumerate(inputs(read_corpus(target.path), count, seed)):
        error = _error(take, data)
        if error is not None:
            return shorten(target, data, error)
        if tell is not None and number % 1000 == 0:
            tell(number)
    return None


def shorten(target: Target, data: bytes, error: str) -> Failure:
    """Return the shortest input found that fails as `data` does, each tried on a fresh instance of the
    target.
    """
    kind = error.partition(":")[0]

    def fails(candidate: bytes) -> str | None:
        found = _error(target.make(), candidate)
        return found if found is not None and found.partition(":")[0] == kind else None

    if fails(data) is None:
        return Failure(data, f"{error} (only after the inputs before it)")
    size = max(1, len(data) // 2)
    tries = 0
    while size and tries < 500:
        at = 0
        while at < len(data) and tries < 500:
            candidate = data[:at] + data[at + size :]
            tries += 1
            found = fails(candidate)
            if found is not None:
                data, error = candidate, found
            else:
                at += size
        size //= 2
    return Failure(data, error)


def _error(take: Callable[[bytes], None], data: bytes) -> str | None:
    try:
        take(data)
    except Exception as error:  # noqa: BLE001 - whatever comes out is what is looked for
        return f"{type(error).__name__}: {error}"
    return None

"""One target under atheris: `python -m testcases.fuzz.coverage TARGET [options of libFuzzer]`; see
`cover`.
"""

from __future__ import annotations

import sys


def main() -> None:
    """Instrument the product, then hand over to libFuzzer, which ends the process."""
    import atheris

    with atheris.instrument_imports(include=["fieldbus", "emulators"]):
        from testcases.fuzz.targets import targets
    name = sys.argv.pop(1)
    take = targets()[name].make()
    atheris.Setup(sys.argv, take)
    atheris.Fuzz()


if __name__ == "__main__":
    main()

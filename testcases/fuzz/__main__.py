"""`python -m testcases.fuzz`: run mutated inputs against the targets, or let atheris look for new ones by
coverage.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from testcases.fuzz.engine import add_to_corpus, read_corpus, run
from testcases.fuzz.targets import targets

app = typer.Typer(add_completion=False, help=__doc__)
Names = Annotated[list[str] | None, typer.Argument(help="targets; default: all")]


def _chosen(names: list[str] | None) -> list[str]:
    known = targets()
    unknown = [name for name in names or [] if name not in known]
    if unknown:
        raise typer.BadParameter(f"{', '.join(unknown)}; there are: {', '.join(known)}")
    return names or list(known)


@app.command()
def show() -> None:
    """List the targets with the size of their corpus."""
    for target in targets().values():
        print(f"{target.name:10} {len(read_corpus(target.path)):5} inputs  {target.what}")


@app.command("run")
def run_inputs(
    names: Names = None,
    inputs: Annotated[int, typer.Option(help="inputs per target")] = 20_000,
    seed: Annotated[int, typer.Option(help="seed of the mutations")] = 1,
) -> None:
    """Run the corpus and mutations of it; exit code 1 with the shortest input that fails."""
    failed = False
    for name in _chosen(names):
        started = time.perf_counter()
        failure = run(targets()[name], inputs, seed)
        seconds = time.perf_counter() - started
        if failure is None:
            print(f"{name:10} {inputs:9,} inputs in {seconds:7.1f} s, no promise broken", flush=True)
        else:
            failed = True
            print(f"{name:10} FAILED: {failure.error}\n{'':10} input {failure.data.hex()}", flush=True)
    raise typer.Exit(int(failed))


@app.command()
def once(name: str, data: Annotated[str, typer.Argument(help="input, hexadecimal")]) -> None:
    """Run one input; what it raises is shown in full."""
    targets()[_chosen([name])[0]].make()(bytes.fromhex(data))


@app.command()
def cover(
    names: Names = None,
    seconds: Annotated[int, typer.Option(help="time per target")] = 60,
) -> None:
    """Look for inputs that reach new code, with atheris, and add them to the corpus."""
    for name in _chosen(names):
        target = targets()[name]
        with tempfile.TemporaryDirectory() as found, tempfile.TemporaryDirectory() as known:
            for number, data in enumerate(read_corpus(target.path)):
                (Path(known) / f"{number:05}").write_bytes(data)
            child = [sys.executable, "-m", "testcases.fuzz.coverage", name]
            limits = [f"-max_total_time={seconds}", "-max_len=400", "-seed=1", "-timeout=20"]
            # What reaches code that nothing before has reached goes into the first directory.
            done = subprocess.run(
                [*child, *limits, found, known], check=False, capture_output=True, text=True
            )
            if done.returncode:
                print(f"{name}: {done.stderr[-3000:]}")
                raise typer.Exit(1)
            new = [path.read_bytes() for path in sorted(Path(found).iterdir())]
        print(f"{name}: {add_to_corpus(target.path, new, 'found by coverage')} new inputs", flush=True)


if __name__ == "__main__":
    app()

"""`hil keep`: what a search has found becomes a case."""

from __future__ import annotations

from pathlib import Path

from hil._commands.terminal import console, print_json, quiet_stdout
from hil.campaign import Token, load_bench_file
from hil.fuzz import Program, keep_program, run_program


def keep(text: str, *, folder: Path, title: str, as_json: bool) -> int:
    """Write the program of a token as a case, run it once, and say how it ends now."""
    token = Token.decode(text)
    with quiet_stdout(as_json):
        bench_file = load_bench_file(token.bench or None)
        violation = None
        if token.program is not None:
            program = Program.from_json(token.program)
            violation = run_program(program, bench_file, seed=token.seed).violation
        if not title:
            title = "Program of a search" if violation is None else f"Found: {violation.invariant}"
        file = keep_program(token, folder, title)
    out = console()
    out.print(f"kept as {file}", markup=False)
    verdict = "passes" if violation is None else f"fails: {violation}"
    out.print(f"at present it {verdict}", style="green" if violation is None else "red", markup=False)
    out.print(f"run it with: hil run {folder / 'regressions.py'}", markup=False)
    if as_json:
        print_json({"file": str(file), "passes": violation is None, "message": str(violation or "")})
    return 0

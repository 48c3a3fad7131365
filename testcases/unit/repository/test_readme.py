"""The examples in README and reference do what the text says: they are taken out of the text and run.

Those of README, tutorial and guides are run page by page in `test_pages.py`.
"""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from hil.bench import BenchFile, load_bench
from hil.cli import app
from hil.faults import Injector
from reports import summary
from reports.model import RunResult
from testcases.pages import ROOT, Block, blocks

pytestmark = pytest.mark.exhaustive

PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")),
]

REDIRECTED = re.compile(r"(?:\s(?:2?>\s*[\w.]+|&))+$")
"""What a shell makes of the end of a line, and the command never sees."""


def lines(page: str) -> list[str]:
    """Return the commands in the shell blocks of a page, without comments."""
    texts = [block.text.replace("\\\n", "") for block in blocks(page) if block.language == "sh"]
    found = [line for text in texts for line in text.splitlines()]
    return [REDIRECTED.sub("", line.partition(" # ")[0].strip()) for line in found if line.strip()]


FILES = [block for page in PAGES if "reference" in page for block in blocks(page) if block.file]
MATRICES = [block for block in FILES if block.language == "toml" and "[factors]" in block.text]
BENCHES = [block for block in FILES if block.language == "toml" and block not in MATRICES]
COMMANDS = sorted({line for page in PAGES for line in lines(page) if line.startswith("hil ")})
SAFETY = "slp_ranges_mm = [[-400.0, 400.0]]"
"""A safety function of a PROFIdrive axis that acts on nothing unless it is set up."""
FAULTS = [
    block.text
    for block in blocks("docs/reference/faults.md")
    if block.text.startswith("faults.inject(") and "armed" not in block.text
]


def name_of(value) -> str:
    return f"{value.page}-{value.file}" if isinstance(value, Block) else str(value)


def run_python(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False, timeout=300
    )


def test_readme_sets_up_with_two_commands():
    """The start section has exactly the two commands that do all set-up."""
    start = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Start")[2].partition("\n## ")[0]

    assert re.findall(r"```sh\n(.*?)```", start, re.DOTALL) == ["./run demo\n./run tests\n"]


def test_quick_start_of_the_readme_can_fail(tmp_path):
    """The quick start sees it when the drive does not trip."""
    for block in blocks("README.md"):
        if block.file:
            text = block.text.replace('faults.inject("drive.fault", drive.name, code=0x2310)', "pass")
            (tmp_path / block.file).write_text(text, encoding="utf-8")

    done = run_python(
        tmp_path, "-m", "pytest", "--hil-bench", "bench.toml", "test_axis.py", "-p", "no:cacheprovider"
    )

    assert done.returncode == 1
    assert "The fault did not come, from which on alarm 421 was expected" in done.stdout


@pytest.mark.parametrize("block", MATRICES, ids=name_of)
def test_matrices_in_the_docs_are_campaigns(block, tmp_path):
    """A matrix that a page shows is valid, and one of its cases passes as it stands."""
    (tmp_path / block.file).write_text(block.text, encoding="utf-8")

    done = run_python(tmp_path, "-m", "hil.cli", "run", block.file, "--json", "-k", "last-winter")

    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["passed"] == 1


@pytest.mark.parametrize("block", BENCHES, ids=name_of)
def test_bench_files_in_the_docs_come_up(block, tmp_path):
    """A bench file that a page shows is valid, and its axes can be enabled."""
    path = tmp_path / block.file
    path.write_text(block.text, encoding="utf-8")

    with load_bench(path).build() as bench:
        powers = [bench.axis(name).power() for name in bench.axis_names]

        assert bench.run_until(lambda: all(power.Status for power in powers), timeout=3.0)


def test_encoders_in_the_docs_come_up():
    """The encoders that the page about bench files shows fit the bench of that page, and all of them
    start.
    """
    page = [block.text for block in blocks("docs/reference/bench-file.md") if block.language == "toml"]
    whole = page[0] + next(text for text in page if text.startswith("[encoder."))

    with BenchFile("own.toml", whole).build() as bench:
        bench.run_for(0.5)
        states = [bench.trace()[f"{name}.nmt_state"].text_at(bench.now_s) for name in bench.encoder_names]

    assert states == ["OPERATIONAL"] * 3


def test_examples_of_the_fault_catalogue_are_applied(subtests):
    """The example of a fault kind can be injected as it stands where encoder, brake and interlock are fitted.

    What only a PROFIdrive axis, an I/O station or a pulse module has is injected there.
    """
    for example in FAULTS:
        kind = example.split('"')[1]
        with subtests.test(kind), bench_for(kind).build() as bench:
            faults = Injector(bench)
            exec(example, {"faults": faults, "bench": bench})
            bench.run_for(0.02)
            (armed,) = faults.armed
            assert armed.applied_ns is not None


def bench_for(kind):
    """Return the bench file that has what a kind of fault acts on."""
    if kind.startswith(("io.", "pto.", "terminal.")):
        return load_bench("stepper" if kind.startswith("pto.") else "analog")
    if kind.startswith("modbus."):
        line = kind in ("modbus.crc", "modbus.broadcast", "modbus.noise")
        return load_bench("profidrive_rtu" if line else "profidrive_tcp")
    at_profidrive = kind.startswith(("telegram.", "safety.", "encoder.error"))
    base, safety = ("profidrive", SAFETY) if at_profidrive else ("reference", 'interlock = "inhibit"')
    fitted = (
        f"[drive.drive1.brake]\ntorque_nm = 5.0\n[drive.drive1.safety]\n{safety}\n\n"
        '[encoder.encoder1]\nsegment = "can0"\nnode_id = 20\n\n[axis.axis1]\n'
    )
    return BenchFile("fitted.toml", load_bench(base).text.replace("[axis.axis1]\n", fitted))


def test_commands_in_the_docs_exist(subtests):
    """Every `hil` command that a page shows is understood, with all its options."""
    for line in COMMANDS:
        with subtests.test(line=line):
            _, name, *arguments = shlex.split(line)
            command = typer.main.get_command(app).commands[name]

            with command.make_context(name, arguments) as context:
                assert context.command is command


def test_json_of_a_run_is_as_documented():
    """The JSON that the command line page shows for a run has the keys that `hil run --json` prints."""
    (block,) = [block for block in blocks("docs/reference/cli.md") if block.language == "json"]

    assert list(json.loads(block.text)) == list(summary(RunResult("", 0, "", "", {}, "")))

"""Code blocks of the documentation: found in a page, and run in order in an empty folder.

What a block is, it says itself:

* its first line is a comment with a file name, `# bench.toml` or `# tests/test_axis.py`: it becomes that
  file; where a format has no comments, `<!-- file: NAME -->` stands above the block;
* `sh`: the commands run in the folder and have to succeed; a comment `<!-- exit code: 1 -->` above the block
  names another exit code for the last of them;
* `text` behind `sh`: the output of these commands has its lines, in this order; `...` stands for anything;
* `python`: runs in the namespace of the page; `<!-- on a bench: reference -->` above it, or `<!-- on a bench,
  axis enabled: reference -->`, gives it a fresh bench as the fixtures of the plugin have it;
* `toml` and `json` have to be well-formed;
* `<!-- not run: REASON -->` above a block exempts it.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt

from hil.bench import BenchFile, load_bench
from hil.faults import Injector
from hil.testing import CurrentTrace

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S = 300
"""Wall time after which a hanging command is ended."""


class Block(NamedTuple):
    """A code block of a page."""

    page: str
    line: int
    language: str
    text: str
    orders: dict[str, str]
    """From the comment above it: what it says before the colon, and behind it."""

    @property
    def file(self) -> str:
        """Name of the file that the block is, from the comment in its first line or above it; empty when it
        is none.
        """
        if "file" in self.orders:
            return self.orders["file"]
        match = re.match(r"# ([\w./-]+\.\w+)\n", self.text)
        return match[1] if match else ""

    @property
    def place(self) -> str:
        """Page and line."""
        return f"{self.page}:{self.line}"


def blocks(page: str) -> list[Block]:
    """Return the fenced blocks of a page of this repository, in order."""
    found = []
    orders: dict[str, str] = {}
    for token in MarkdownIt().parse((ROOT / page).read_text(encoding="utf-8")):
        if token.type == "html_block":
            orders = dict(re.findall(r"<!-- ([a-z, ]+): (.*?) -->", token.content))
        elif token.type == "fence" and token.map is not None:
            found.append(Block(page, token.map[0] + 1, token.info.strip(), token.content, orders))
            orders = {}
        elif token.level == 0 and token.type.endswith("_open"):
            orders = {}
    return found


@dataclass
class PageRun:
    """The blocks of one page, run one after the other."""

    folder: Path
    prepared: Path | None = None
    """Folder with the commands of `testcases.prepared`, where they take the place of the installed ones."""
    namespace: dict[str, object] = field(default_factory=lambda: {"__name__": "page"})
    output: str = ""

    def run(self, block: Block) -> None:
        """Do what a block says.

        Raises:
            AssertionError: It does not do what the page says.

        """
        if "not run" in block.orders:
            assert block.orders["not run"], "a reason"
            return
        if block.file:
            path = self.folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        if block.language == "sh":
            self._shell(block)
        elif block.language == "text" and not block.file:
            self._compare(block.text)
        elif block.language == "toml":
            tomllib.loads(block.text)
        elif block.language == "json":
            json.loads(block.text)
        elif block.language == "python" and not block.file:
            self._python(block)

    def _shell(self, block: Block) -> None:
        environment = {
            name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "GITHUB_"))
        }
        programs = [str(Path(sys.executable).parent), os.environ["PATH"]]
        if (
            self.prepared is not None and "&" not in block.text
        ):  # what goes on in the background hears signals
            programs.insert(0, str(self.prepared))
        environment["PATH"] = os.pathsep.join(programs)
        environment.update(COLUMNS="120", NO_COLOR="1", PYTEST_ADDOPTS=" ".join(self._left_out(block)))
        done = subprocess.run(
            ["bash", "-e", "-c", block.text],
            cwd=self.folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )
        self.output = done.stdout
        assert done.returncode == int(block.orders.get("exit code", "0")), done.stdout

    @staticmethod
    def _left_out(block: Block) -> Iterator[str]:
        """Yield the options that leave out plugins which a reader does not have, or the page does not use."""
        for plugin in ("anyio", "benchmark", "pytest_cov", "rerunfailures"):
            yield f"-p no:{plugin}"
        yield "-W ignore::pytest.PytestAssertRewriteWarning"  # prepared: the plugin is imported already
        if "hypothesis" not in (ROOT / block.page).read_text(encoding="utf-8"):
            yield "-p no:hypothesispytest"

    def _compare(self, expected: str) -> None:
        """Check that the lines that a page shows are in the output, in their order."""
        rest = [" ".join(line.split()) for line in self.output.splitlines()]
        for line in expected.splitlines():
            if line.strip() in ("", "..."):
                continue
            wanted = re.escape(" ".join(line.split())).replace(r"\.\.\.", ".*")
            at = next((number for number, text in enumerate(rest) if re.fullmatch(wanted, text)), None)
            assert at is not None, f"not in the output: {line}\n\n{self.output}"
            del rest[: at + 1]

    def _python(self, block: Block) -> None:
        code = compile("\n" * block.line + block.text, str(ROOT / block.page), "exec")
        enabled = block.orders.get("on a bench, axis enabled")
        name = enabled or block.orders.get("on a bench")
        before = Path.cwd()
        os.chdir(self.folder)
        try:
            with ExitStack() as stack:
                if name:
                    self._enter_bench(stack, load_bench(name), enable=bool(enabled))
                exec(code, self.namespace)
        finally:
            os.chdir(before)

    def _enter_bench(self, stack: ExitStack, file: BenchFile, *, enable: bool) -> None:
        bench = stack.enter_context(file.build())
        self.namespace.update(
            bench=bench, hil_bench_file=file, faults=Injector(bench), trace=CurrentTrace(bench)
        )
        if bench.axis_names:
            self.namespace["axis"] = bench.axis()
        if bench.drive_names:
            self.namespace["drive"] = bench.drive()
        if enable:
            power = bench.axis().power()
            assert bench.run_until(power.status, timeout=2.0)
            bench.axis().home(0.0)
            bench.run_for(0.05)

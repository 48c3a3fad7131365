"""The documentation is complete and true where that can be checked: keys, kinds, commands, links."""

import inspect
import re
import struct
import tomllib
from pathlib import Path

import pytest
import typer

import hil.expect
import hil.faults
from hil.bench import EMBEDDED, Bench, BenchFile, load_bench
from hil.cli import app
from hil.faults import CATALOGUE, ENVIRONMENTS, trigger_from_dict
from hil.fuzz import default_invariants
from hil.matrix import load_matrix
from hil.matrix._file import _BENCH_KEYS, _CASE_KEYS, _KEYS
from motion.s7.axis.axis import MODULO_COLUMNS
from testcases.campaigns.vocabulary import VOCABULARY

ROOT = Path(__file__).resolve().parents[3]
PAGES = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md")),
]
IMAGE_LIMIT = 300_000


def page(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def section(text: str, heading: str) -> str:
    """Return the text below a heading, up to the next one of any level."""
    _, found, rest = text.partition(f"\n{heading}\n")
    assert found, f"there is no heading {heading!r}"
    return re.split(r"^#+ ", rest, maxsplit=1, flags=re.MULTILINE)[0]


def rows(text: str) -> dict[str, list[str]]:
    """Return the rows of the tables in a text: name in the first column -> the other columns."""
    found = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if line.startswith("| `"):
            found[cells[0].strip("`")] = cells[1:]
    return found


# -- bench file
# ------------------------------------------------------------------------------------------------------


def test_every_embedded_bench_is_documented():
    """The page about bench files has a row for every bench that comes with the product."""
    documented = rows(section(page("docs/reference/bench-file.md"), "## Embedded benches"))

    assert sorted(documented) == sorted(EMBEDDED)


# -- faults
# ----------------------------------------------------------------------------------------------------------


def number(value: float, kind: str) -> str:
    if kind == "int":
        return f"0x{int(value):X}" if value == 0x1FFFFFFF else str(int(value))
    return f"{value:.6f}".rstrip("0").rstrip(".")


def range_of(parameter) -> str:
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    if parameter.type in {"bool", "text"}:
        return "`true`, `false`" if parameter.type == "bool" else "text"
    ends = f"{number(parameter.minimum, parameter.type)} to {number(parameter.maximum, parameter.type)}"
    return ends + (", whole" if parameter.type == "int" else "")


def default_of(parameter) -> str:
    default = parameter.default
    if parameter.required or default is None:
        return "required" if parameter.required else "none"
    if isinstance(default, bool | str):
        return str(default).lower() or "empty"
    return number(default, parameter.type)


def test_every_fault_kind_is_in_the_catalogue_of_the_docs():
    """The overview has exactly the kinds of the catalogue, with target, seam and the benches that can inject
    them.
    """
    documented = rows(section(page("docs/reference/faults.md"), "## The catalogue"))

    assert documented == {
        entry.name: [
            entry.target,
            entry.seam,
            "yes" if entry.lasting else "no",
            ", ".join(where for where in ENVIRONMENTS if not entry.injectable(where)),
        ]
        for entry in CATALOGUE
    }


def test_every_parameter_of_a_fault_is_documented(subtests):
    """The parameters of a kind stand in its own table or in that of the choice of frames, with unit, range
    and default.
    """
    for entry in CATALOGUE:
        with subtests.test(entry.name):
            text = page("docs/reference/faults.md")
            documented = rows(section(text, "### Which frames are hit")) | rows(
                section(text, f"### `{entry.name}`")
            )

            assert {parameter.name: documented[parameter.name][:3] for parameter in entry.parameters} == {
                parameter.name: [parameter.unit, range_of(parameter), default_of(parameter)]
                for parameter in entry.parameters
            }


def test_every_trigger_is_documented():
    """Every trigger has a row, and its TOML means the same as its Python."""
    documented = {
        re.match(r"\w+", call)[0]: (call, cells[-1].strip("`"))
        for call, cells in rows(section(page("docs/reference/faults.md"), "## Triggers")).items()
    }
    makers = {
        name
        for name in hil.faults.__all__
        if inspect.isfunction(getattr(hil.faults, name))
        and name not in {"fault_from_text", "fault_type", "trigger_from_dict"}
    }

    assert set(documented) == makers
    for call, toml in documented.values():
        made = eval(call, dict(vars(hil.faults)))
        assert trigger_from_dict(tomllib.loads(f"trigger = {toml}")["trigger"]) == made


def test_number_of_fault_kinds_is_true(subtests):
    """Where a page counts the kinds of faults, it counts right."""
    for name in ["README.md", "CHANGELOG.md", "docs/reference/features.md"]:
        with subtests.test(name=name):
            assert set(re.findall(r"(\d+) kinds", page(name))) == {str(len(CATALOGUE))}


# -- matrices
# ----------------------------------------------------------------------------------------------------------

MATRICES = ROOT / "testcases" / "campaigns"


def _fits(word: str, text: str) -> bool:
    """Return whether a page names a word, or the family or the range that it belongs to."""
    family = re.match(r"(tcp|rtu|exception|power|reaction|trip)-", word)
    return f"`{word}`" in text or (family is not None and f"`{family[1]}-" in text)


def test_every_word_of_a_matrix_is_documented(subtests):
    """Every factor, its words and its default stand on the page about matrices."""
    for factor in VOCABULARY.factors:
        with subtests.test(factor=factor):
            text = page("docs/reference/campaign-matrix.md")

            assert f"| `{factor}` |" in text
            assert [word for word in VOCABULARY.factors[factor] if not _fits(word, text)] == []


@pytest.mark.exhaustive
def test_the_number_of_cases_of_a_shipped_matrix_is_true(subtests):
    """The table of the matrices that ship says how many cases each has."""
    for path in sorted(MATRICES.glob("*.toml")):
        with subtests.test(path.stem):
            (row,) = re.findall(
                rf"\| `{path.name}` \|.*\| (\d+) \|", page("docs/reference/campaign-matrix.md")
            )

            assert int(row) == len(load_matrix(path).cases)


def test_every_key_of_a_matrix_is_documented():
    """Keys of the file, of an exclusion, a case and a bench stand on the page about matrices."""
    text = page("docs/reference/campaign-matrix.md")

    assert [
        key
        for key in (*_KEYS, *_CASE_KEYS, *_BENCH_KEYS)
        if f"`{key}`" not in text and f"[{key}]" not in text
    ] == []


# -- command line and plugin
# -----------------------------------------------------------------------------------------


@pytest.mark.exhaustive
def test_every_command_is_documented(subtests):
    """Every command has a section that names all its long options; each option is explained there or in the
    common table.
    """
    for name in sorted(typer.main.get_command(app).commands):
        with subtests.test(name=name):
            text = page("docs/reference/cli.md")
            own = section(text, f"## `hil {name}`")
            common = text.partition("\n## ")[0]
            options = [
                option
                for parameter in typer.main.get_command(app).commands[name].params
                for option in [*parameter.opts, *parameter.secondary_opts]
                if option.startswith("-")
            ]

            assert "--json" in options or name in (
                "cockpit",
                "emulate",
                "eds",
                "init",
                "panel",
                "schema",
                "vcan",
            )
            assert [option for option in options if f"`{option}`" not in own + common] == []
            assert [
                option for option in options if option.startswith("--") and not re.search(rf"{option}\b", own)
            ] == []
            for parameter in typer.main.get_command(app).commands[name].params:
                if isinstance(parameter.default, Path):
                    assert f"`{parameter.default}`" in own + common, "its default folder"
            assert f"`{name}`" in page("CHANGELOG.md") or f"`hil {name}`" in page("CHANGELOG.md")


def test_every_option_of_the_plugin_is_documented():
    """Fixtures, options and settings of the pytest plugin stand in the page about writing tests."""
    files = ("pytest_plugin.py", "_plugin_settings.py")
    source = "".join((ROOT / "hil" / name).read_text(encoding="utf-8") for name in files)
    names = [
        *re.findall(r"^@pytest\.fixture\ndef (\w+)", source, re.MULTILINE),
        *re.findall(r'"(--hil-\w+)"', source),
        *re.findall(r'addini\("(\w+)"', source),
    ]
    text = page("docs/guides/writing-tests.md")

    assert len(names) >= 11
    assert [name for name in names if f"`{name}" not in text] == []


def test_every_method_of_a_bench_is_documented():
    """Every public method and property of `hil.Bench` stands in the page about writing tests."""
    text = page("docs/guides/writing-tests.md")
    names = [name for name in dir(Bench) if not name.startswith("_")]

    assert len(names) > 40
    assert [name for name in names if not re.search(rf"\bbench\.{name}\b", text)] == []


def test_every_expectation_is_documented():
    """Every expectation, and every function that makes one, is in the page about writing tests."""
    classes = {
        name
        for name in hil.expect.__all__
        if inspect.isclass(one := getattr(hil.expect, name))
        and issubclass(one, hil.expect.Expectation)
        and one is not hil.expect.Expectation
    }
    makers = classes | {
        name
        for name in hil.expect.__all__
        if inspect.isfunction(function := getattr(hil.expect, name))
        and function.__annotations__.get("return") in classes
    }
    text = page("docs/guides/writing-tests.md")

    assert len(makers) >= 17
    assert [name for name in sorted(makers) if f"`{name}(" not in text] == []


def test_every_recorded_column_is_documented():
    """The columns of axis, drive and encoder in the page about writing tests are those that a bench
    records.
    """
    text = load_bench("reference").text + '[encoder.encoder1]\nsegment = "can0"\nnode_id = 20\n'
    with BenchFile("own.toml", text).build() as bench:
        recorded = {group.name: [name for name, _ in group.columns] for group in bench.trace().groups}
    table = section(page("docs/guides/writing-tests.md"), "## The trace")

    for component, name in (("axis", "axis1"), ("drive", "drive1"), ("encoder", "encoder1")):
        (line,) = re.findall(
            rf"^\| {component} \| (.*) \|$", table.partition("A signal has")[0], re.MULTILINE
        )
        always, _, in_range = line.partition("; with a modulo range ")
        assert re.findall(r"`(\w+)`", always) == recorded[name]
        if component == "axis":
            assert re.findall(r"`(\w+)`", in_range) == [column for column, _ in MODULO_COLUMNS]


@pytest.mark.exhaustive
def test_every_event_kind_of_a_run_is_documented():
    """The kinds of events that a move, a fault and an acknowledgement leave in the log stand in the page."""
    with load_bench("reference").build() as bench:
        axis = bench.axis()
        power = axis.power()
        assert bench.run_until(power.status, timeout=2.0)
        axis.home(0.0)
        axis.move_velocity(100.0)
        bench.run_for(0.5)
        bench.drive().raise_fault(0x2310)
        bench.drive().force_input("home", True)
        bench.run_for(1.0)
        axis.reset()
        bench.run_for(0.5)
        bench.drive().power_off()
        bench.run_for(0.5)
        kinds = {event.kind for event in bench.history.events}
    text = section(page("docs/guides/writing-tests.md"), "## The trace")

    assert len(kinds) > 15
    assert sorted(kind for kind in kinds if f"`{kind}`" not in text) == []


def test_every_invariant_is_documented():
    """The page about writing tests names the invariants of a fuzz search."""
    with load_bench("reference").build() as bench:
        names = [invariant.name for invariant in default_invariants(bench)]
    text = page("docs/guides/writing-tests.md").replace("\n", " ")

    assert [name for name in names if name not in text] == []


# -- links and pictures
# ----------------------------------------------------------------------------------------------


def test_links_lead_somewhere(subtests):
    """Every relative link, and every file below docs/ that a page names, exists."""
    for name in PAGES:
        with subtests.test(name=name):
            text = page(name)
            links = [
                link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link
            ]
            targets = [(ROOT / name).parent / link for link in links if link]
            targets += [ROOT / mention for mention in re.findall(r"`(docs/[\w./-]+)`", text)]

            assert [str(target) for target in targets if not target.exists()] == []


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("report-list.png", "docs/reference/reports.md"),
        ("report-case.png", "README.md"),
        ("cockpit-axis.png", "README.md"),
        ("cockpit-scope.png", "docs/guides/cockpit.md"),
    ],
)
def test_pictures_are_small_enough(name, where):
    """The pictures of report and cockpit are screenshots of 1440 x 900 and small enough for a repository."""
    content = (ROOT / "docs" / "images" / name).read_bytes()

    assert struct.unpack(">II", content[16:24]) == (1440, 900)
    assert len(content) < IMAGE_LIMIT
    assert f"images/{name})" in page(where)


@pytest.mark.exhaustive
def test_nothing_is_said_twice_in_a_table_or_list(subtests):
    """No two rows of a table begin with the same two cells, no two points of a page with the same words in
    bold.
    """
    for name in PAGES:
        with subtests.test(name=name):
            text = page(name)
            said: list[tuple[str, ...]] = []
            table = -1
            for number, line in enumerate(text.splitlines()):
                if not line.startswith("|"):
                    table = -1
                    if found := re.match(r"\* (\*\*.+?\*\*)", line):
                        said.append((found[1],))
                    continue
                table = number if table < 0 else table
                cells = [cell.strip() for cell in line.strip("|").split("|")]
                if set(line) - set("|- :"):
                    said.append((str(table), *cells[:2]))
            assert sorted(said) == sorted(set(said))

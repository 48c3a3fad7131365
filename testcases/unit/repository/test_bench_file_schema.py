"""The JSON Schema of the bench file and the tables of keys in the documentation come from the models."""

from __future__ import annotations

import json
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from hil.bench import EMBEDDED, load_bench, rules
from hil.bench.schema import headings, json_schema, with_key_tables
from hil.cli import main

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "reference" / "bench-file.md"


@cache
def schema() -> dict[str, Any]:
    return json_schema()


@cache
def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(schema())


def errors(text: str) -> list[str]:
    """Return what the schema says against a bench file."""
    return [error.json_path for error in validator().iter_errors(tomllib.loads(text))]


@pytest.mark.exhaustive
def test_the_schema_is_valid_and_the_command_prints_it(capsys):
    """`hil schema` prints JSON Schema of draft 2020-12."""
    jsonschema.Draft202012Validator.check_schema(schema())
    assert main(["schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed == json.loads(json.dumps(schema()))
    assert printed["$schema"] == "https://json-schema.org/draft/2020-12/schema"


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", EMBEDDED)
def test_embedded_benches_fit_the_schema(name):
    """Every bench file that ships with the product is valid."""
    assert not errors(load_bench(name).text)


@pytest.mark.exhaustive
def test_bench_files_of_the_page_fit_the_schema():
    """Every complete example of the documentation is valid."""
    examples = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    whole = [text for text in examples if "[bench]" in text]
    assert whole
    for text in whole:
        assert not errors(text)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("reference", "cycle_ms = 4", "cycle_ms = 0"),
        ("reference", "cycle_ms = 4", "cycle = 4"),
        ("reference", "node_id = 5", ""),
        ("reference", "node_id = 5", 'node_id = "5"'),
        ("reference", "node_id = 5", "node_id = 5\ntelegram = 105"),
        ("reference", "bitrate = 1_000_000", "bitrate = 123456"),
        ("reference", 'type = "positioning"', 'type = "position"'),
        ("profidrive", "telegram = 105", "telegram = 107"),
        ("profidrive", "telegram = 105", 'telegram = 105\nsync_loss = "none"'),
        ("profidrive_tcp", 'map = "', 'node_id = 5\nmap = "'),
        ("profidrive_tcp", "latency_us = 100", "baud = 9600"),
        ("analog", 'profile = "analog"', 'profile = "analogue"'),
        ("stepper", "rated_torque_nm = 2.0", "rated_torque_nm = 2.0\nbrake = { torque_nm = 1.0 }"),
    ],
)
def test_mistakes_do_not_fit_the_schema(name, old, new):
    """A wrong range, key, type, choice or profile is an error of the schema too."""
    text = load_bench(name).text
    assert old in text
    assert errors(text.replace(old, new, 1))


def test_every_key_has_a_description_and_numbers_have_their_unit():
    """An editor shows what a key means; a key that ends in a unit names it."""
    for name, table in {"BenchConfig": schema(), **schema()["$defs"]}.items():
        for key, described in table["properties"].items():
            assert described.get("description"), f"{name}.{key}"
            if key.endswith(("_mm", "_ms", "_rpm", "_nm", "_v")):
                assert described["x-unit"], f"{name}.{key}"


def test_key_tables_of_the_page_are_current():
    """`python -m hil.bench.schema docs/reference/bench-file.md` has been run since the models changed."""
    text = PAGE.read_text(encoding="utf-8")
    assert with_key_tables(text) == text
    assert sorted(re.findall(r"<!-- keys: (\S+) -->", text)) == sorted(headings())


def test_rules_of_the_page_are_current():
    """`python -m hil.bench.rules docs/reference/bench-file.md` has been run since the rules changed."""
    text = PAGE.read_text(encoding="utf-8")
    assert rules.with_rules(text) == text
    assert rules.table() in text

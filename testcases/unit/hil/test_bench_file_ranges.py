"""Every key of a drive and of an encoder with a range: what the bench file says when the range is left."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Annotated, Any, get_args, get_origin

import pytest
import tomli_w
from annotated_types import Ge, Gt, Le, Lt
from pydantic.fields import FieldInfo

from hil.bench import BenchFile, BenchFileError, load_bench
from hil.bench._models import alternatives, hints_of, range_of, variants_of

SECOND = {"rotary": {"type": "multi_turn"}, "scale": {"type": "incremental_linear", "mounting": "load"}}
BENCHES = {
    "reference": ("reference", "drive", {}),
    "profidrive": ("profidrive", "drive", {"encoder2": SECOND["rotary"]}),
    "profidrive, scale": ("profidrive", "drive", {"encoder2": SECOND["scale"]}),
    "positioner": ("profidrive", "drive", {"telegram": 111, "positioner": {}}),
    "profidrive_tcp": ("profidrive_tcp", "drive", {}),
    "analog": ("analog", "drive", {}),
    "stepper": ("stepper", "drive", {}),
    "cia406": ("reference", "encoder", {"profile": "cia406", "type": "multi_turn"}),
    "cia406, scale": ("reference", "encoder", {"profile": "cia406", "type": "absolute_linear"}),
    "profidrive encoder": ("reference", "encoder", {"profile": "profidrive", "type": "multi_turn"}),
}


def table_of(name: str) -> tuple[dict[str, Any], str, type]:
    """Return a bench file as a dictionary, the path of the table under test, and its model."""
    bench, kind, keys = BENCHES[name]
    data = tomllib.loads(load_bench(bench).text)
    if kind == "encoder":
        data["encoder"] = {"e": {"segment": next(iter(data["segment"])), "node_id": 40}}
    if "telegram" in keys:
        data.pop("axis")
    owner = next(iter(data[kind]))
    data[kind][owner] |= keys
    model = type(getattr(BenchFile("own.toml", tomli_w.dumps(data)).config, kind)[owner])
    return data, f"{kind}.{owner}", model


def limits_of(hint: object) -> Iterator[tuple[float, float]]:
    """Yield a value beyond each limit of a number, and that limit."""
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        for mark in marks:
            for one in mark.metadata if isinstance(mark, FieldInfo) else (mark,):
                if isinstance(one, Ge):
                    yield one.ge - 1, one.ge
                elif isinstance(one, Gt):
                    yield one.gt, one.gt
                elif isinstance(one, Le):
                    yield one.le + 1, one.le
                elif isinstance(one, Lt):
                    yield one.lt, one.lt
        yield from limits_of(inner)
    elif get_origin(hint) is not tuple:
        for one in get_args(hint):
            yield from limits_of(one)


def keys_with_limits(model: type, chosen: object) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield the path and type of every key with a limit; of a union the model that the table has."""
    for key, hint in hints_of(model).items():
        tables = variants_of(hint)
        inner = getattr(chosen, key, None)
        if tables and get_origin(next(alternatives(hint))) is not tuple:
            for path, one in keys_with_limits(type(inner), inner) if type(inner) in tables else ():
                yield (key, *path), one
        elif any(limits_of(hint)):
            yield (key,), hint


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", BENCHES)
def test_a_key_out_of_its_range_is_named_with_what_is_allowed(name):
    """File, table, key, value and limit are in the message, below and above the range, all keys at once."""
    data, place, model = table_of(name)
    text = tomli_w.dumps(data)
    kind, owner = place.split(".")
    keys = list(keys_with_limits(model, getattr(BenchFile("own.toml", text).config, kind)[owner]))
    assert len(keys) > 5
    beyond = {path: list(limits_of(hint)) for path, hint in keys}
    for side in range(2):
        broken = tomllib.loads(text)
        for path, values in beyond.items():
            inner = broken[kind][owner]
            for key in path[:-1]:
                inner = inner.setdefault(key, {})
            inner[path[-1]] = values[min(side, len(values) - 1)][0]
        with pytest.raises(BenchFileError) as caught:
            BenchFile("own.toml", tomli_w.dumps(broken))
        lines = str(caught.value).splitlines()
        unclear = []
        for path, hint in keys:
            value, limit = beyond[path][min(side, len(beyond[path]) - 1)]
            where = f"own.toml: {place}.{'.'.join(path)}: {value!r} is not allowed; "
            line = next((one for one in lines if one.startswith(where)), "")
            if f"{limit:.12g}" not in line.removeprefix(where):
                unclear.append(f"{where}{range_of(hint)}")
        assert not unclear


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", BENCHES)
def test_a_number_is_no_truth_value_and_no_text(name):
    """`true` and `"5"` in the place of a number are refused in every table, with file, table and key."""
    data, place, model = table_of(name)
    text = tomli_w.dumps(data)
    kind, owner = place.split(".")
    keys = list(keys_with_limits(model, getattr(BenchFile("own.toml", text).config, kind)[owner]))
    for value in (True, "5"):
        broken = tomllib.loads(text)
        for path, _ in keys:
            inner = broken[kind][owner]
            for key in path[:-1]:
                inner = inner.setdefault(key, {})
            inner[path[-1]] = value
        with pytest.raises(BenchFileError) as caught:
            BenchFile("own.toml", tomli_w.dumps(broken))
        lines = str(caught.value).splitlines()
        places = [
            f"own.toml: {place}.{'.'.join(path)}: {value!r} is not allowed; allowed: " for path, _ in keys
        ]
        assert not [one for one in places if not any(line.startswith(one) for line in lines)]


@pytest.mark.parametrize("name", BENCHES)
def test_defaults_and_every_key_survive_the_way_to_the_drive_process(name):
    """What a live bench sends to the process of its drives is the configuration of the file."""
    data, *_ = table_of(name)
    config = BenchFile("own.toml", tomli_w.dumps(data)).config
    assert type(config).model_validate(config.model_dump(mode="json", exclude_unset=True)) == config


def test_a_supplement_that_the_telegram_cannot_have_is_refused():
    """Telegram 750 goes with telegrams of a speed or torque: the table and both numbers are named."""
    data, *_ = table_of("positioner")
    next(iter(data["drive"].values())).setdefault("profidrive", {})["torque_telegram"] = True
    with pytest.raises(BenchFileError, match=r"drive1\.profidrive: telegram 750 .* telegram 111"):
        BenchFile("own.toml", tomli_w.dumps(data))

"""The table of a stop envelope as a Parquet file, read with Apache Arrow."""

import pytest

from hil.envelope import MEASURES, move_absolute, sweep

pytestmark = pytest.mark.peers


def test_table_of_an_envelope(tmp_path):
    """Every branch and axis is a row; numbers are numbers, and what was not measured is null."""
    import pyarrow.parquet  # only the environment of these tests has it

    found = sweep("reference", move_absolute("", 5.0, 200.0), ["operator.halt"], every=20, watch_s=0.2)
    table = pyarrow.parquet.read_table(found.save_parquet(tmp_path / "table" / "envelope.parquet"))

    assert table.column_names[:5] == ["stimulus", "cycle", "time_s", "axis", "position_unit"]
    assert table["cycle"].to_pylist() == [branch.cycle for branch in found.branches]
    for measure in MEASURES:
        assert table[measure].to_pylist() == [branch.value(measure, "axis1") for branch in found.branches]

"""Museum of field errors: published defects of real products, each with the case that catches it.

A `FieldError` is one entry: what happened to whom, with the public source, what makes the bench show it (a
seeded defect, or a drive with other settings), and the shipped case that has to be red with it and green
without. The entries that ship are in `testcases.museum`.
"""

from __future__ import annotations

from hil.museum._field_error import FieldError, Source, field_error_page, load_museum, select_entries
from hil.museum._judging import Judgement, judge_entry

__all__ = [
    "FieldError",
    "Judgement",
    "Source",
    "field_error_page",
    "judge_entry",
    "load_museum",
    "select_entries",
]

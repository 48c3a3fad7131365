"""Matrix campaigns: a file that crosses factors - jobs, faults, moments, stops, benches - and becomes cases.

A vocabulary says what the values of the factors mean and what is expected of a combination; this package
knows only how they are combined, reduced, left out and named.
"""

from __future__ import annotations

from hil.matrix._campaign import combinations_of, load_matrix
from hil.matrix._combine import Combined, combine
from hil.matrix._file import MatrixFile, read_matrix
from hil.matrix._vocabulary import Vocabulary

__all__ = ["Combined", "MatrixFile", "Vocabulary", "combinations_of", "combine", "load_matrix", "read_matrix"]

"""Fuzzing of everything that takes bytes from a bus: `python -m testcases.fuzz --help`; it is explained in
docs/explanation/development.md.
"""

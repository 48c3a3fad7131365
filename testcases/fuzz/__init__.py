"""Fuzzing of everything that takes bytes from a bus: `python -m testcases.fuzz --help`; docs/development.md
explains it.
"""

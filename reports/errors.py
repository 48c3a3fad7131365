"""Errors of the reports package, which stands alone and so has a root of its own."""


class ReportError(Exception):
    """Base of all errors of this package."""


class StoreError(ReportError):
    """A stored run cannot be written or read; the message names the file and, in the journal, the line."""

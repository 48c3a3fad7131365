"""The HTML report."""

from reports.html.bundle import EMBEDDED_LIMIT
from reports.html.page import render_html

__all__ = ["EMBEDDED_LIMIT", "render_html"]

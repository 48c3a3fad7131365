"""The HTML report."""

from reports.html.page import html_text, render_html

__all__ = ["html_text", "render_html"]

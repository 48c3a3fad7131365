"""The page about a qualification; it needs no network and no script."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from reports.model import Verdict
from reports.qualification import NOT_CLAIMED, Qualification


def write_qualification(found: Qualification, path: Path) -> Path:
    """Write the page and return its path; its folder is made."""
    from jinja2 import Environment, PackageLoader, select_autoescape
    from markupsafe import Markup

    environment = Environment(loader=PackageLoader("reports.html"), autoescape=select_autoescape(["j2"]))
    style = files("reports.html").joinpath("templates", "style.css").read_text(encoding="utf-8")
    page = environment.get_template("qualification.html.j2").render(
        q=found,
        not_claimed=NOT_CLAIMED,
        verdicts=[(verdict.value, found.run.count(verdict)) for verdict in Verdict],
        style=Markup(style),  # noqa: S704 - our own
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(page, encoding="utf-8", errors="replace")
    return path

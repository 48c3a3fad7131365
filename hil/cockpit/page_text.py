"""The HTML of the pages: one frame, and what each loads into it."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from pathlib import Path
from string import Template
from typing import Final

PAGE: Final = Path(__file__).parent / "page"


def page_text(title: str, *, styles: Iterable[str], module: str, scripts: Iterable[str] = ()) -> str:
    """Return a page whose content its script module makes.

    Args:
        title: Until the module knows better.
        styles: Addresses of style sheets, in order.
        module: Address of the module.
        scripts: Addresses of scripts that come before it.

    """
    head = [
        *(f'<link rel="stylesheet" href="{escape(one)}">' for one in styles),
        *(f'<script src="{escape(one)}" defer></script>' for one in scripts),
        f'<script type="module" src="{escape(module)}"></script>',
    ]
    frame = Template((PAGE / "page.html").read_text(encoding="utf-8"))
    return frame.substitute(title=escape(title), head="\n".join(head))

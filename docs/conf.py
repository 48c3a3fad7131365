"""How Sphinx builds these pages: `./run docs`. Nothing here or in the theme asks for anything from a
network.
"""

import ast
import importlib
import inspect
import itertools
import re
from pathlib import Path

import typer

import hil.campaign
import hil.errors
import hil.expect
import hil.faults
import hil.testing
from hil.cli import app as command_line
from motion.kernel.cams import LAWS, End, Interpolation, Point, interpolate, law_between
from reports.html.curves import Panel, markup, picture

project = "motion-hil"
author = "the authors of motion-hil"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "motion-hil"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
pygments_style = "friendly"
pygments_dark_style = "monokai"

# Links: those between pages and headings are checked (a broken one ends the build); names of types in
# signatures lead on where there is a page of them.
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]
myst_heading_anchors = 4

# Python pages.
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100

COMMANDS_MARK = "<!-- the commands, from the definition of `hil` -->"
INTERPOLATIONS_MARK = "<!-- the interpolations, drawn -->"
LAWS_MARK = "<!-- the laws, drawn -->"
OWNERS = [hil.campaign, hil.errors, hil.expect, hil.faults, hil.testing]
"""Packages with a section of their own; `hil` repeats some of their names."""
NAMES_MARK = re.compile(r"<!-- the public names of ([\w.]+) -->")
ESCAPED = str.maketrans({"|": "\\|", "<": "&lt;"})


def options_table(parameters):
    """Return the rows of one command: option or argument, value, meaning, default."""
    rows = []
    for parameter in parameters:
        is_option = parameter.opts[0].startswith("-")
        names = ", ".join(f"`{name}`" for name in [*parameter.opts, *parameter.secondary_opts])
        value = "" if getattr(parameter, "is_flag", False) else parameter.metavar or kind_of(parameter)
        if not is_option:
            names, value = f"`{parameter.metavar or parameter.name.upper()}`", "argument"
        default = parameter.default
        if default is True and parameter.secondary_opts:
            default = parameter.opts[0]
        shown = "" if default in (None, "", False) or callable(default) else f"`{default}`"
        meaning = (parameter.help or "").translate(ESCAPED)
        rows.append(f"| {names} | {value.translate(ESCAPED)} | {meaning} | {shown} |")
    if not rows:
        return "This command takes nothing but `--help`."
    return "\n".join(["| name | value | meaning | default |", "|---|---|---|---|", *rows])


def kind_of(parameter):
    """Return the type of an option as a word."""
    annotation = parameter.type_descriptor.annotation
    return {"int": "whole number", "float": "number", "str": "text", "Path": "file"}.get(
        getattr(annotation, "__name__", ""), "text"
    )


def commands_page():
    """Return the reference of the command line in Markdown."""
    parts = []
    for name, command in sorted(typer.main.get_command(command_line).commands.items()):
        usage = " ".join(
            ["hil", name]
            + [
                parameter.metavar or parameter.name.upper()
                for parameter in command.params
                if not parameter.opts[0].startswith("-")
            ]
            + ["[OPTIONS]"]
        )
        text = inspect.cleandoc(command.help or "")
        parts.append(
            f"## `hil {name}`\n\n{text}\n\n```text\n{usage}\n```\n\n{options_table(command.params)}\n"
        )
    return "\n".join(parts)


def public_names(match):
    """Return directives for every name that a package exports."""
    package = importlib.import_module(match[1])
    lines = []
    constants = []
    elsewhere = []
    for name in package.__all__:
        value = getattr(package, name)
        owner = next((other for other in OWNERS if name in other.__all__), package)
        if package.__name__ == "hil" and owner is not package:
            elsewhere.append(f":py:obj:`hil.{name} <{owner.__name__}.{name}>`")
        elif inspect.isclass(value):
            lines += [f".. autoclass:: {package.__name__}.{name}", "   :members:", ""]
        elif inspect.isfunction(value):
            lines += [f".. autofunction:: {package.__name__}.{name}", ""]
        else:
            constants.append(name)
    texts = texts_of_constants(package)
    for name in constants:
        lines += [f".. py:data:: {package.__name__}.{name}", ""]
        lines += [f"   {line}" for line in texts.get(name, "").splitlines()] + [""]
    if elsewhere:
        lines += [f"Also here: {', '.join(elsewhere)}.", ""]
    introduction = inspect.cleandoc(package.__doc__ or "")
    return "\n".join([introduction, "", "```{eval-rst}", *lines, "```"])


def texts_of_constants(package):
    """Return the docstrings below constants in the modules of a package."""
    found = {}
    place = Path(package.__file__)
    for path in sorted(place.parent.rglob("*.py")) if place.stem == "__init__" else [place]:
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for statement, following in itertools.pairwise(body):
            targets = getattr(statement, "targets", [getattr(statement, "target", None)])
            if isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant):
                text = re.sub(r"`([^`]+)`", r"``\1``", inspect.cleandoc(str(following.value.value)))
                found |= {target.id: text for target in targets if isinstance(target, ast.Name)}
    return found


def fill_in(_, page, source):
    """Put what is generated into a page."""
    if page == "reference/commands":
        source[0] = source[0].replace(COMMANDS_MARK, commands_page())
    if page == "reference/cams":
        source[0] = (
            source[0].replace(INTERPOLATIONS_MARK, cam_interpolations()).replace(LAWS_MARK, cam_laws())
        )
    if page.startswith("reference/python/"):
        source[0] = NAMES_MARK.sub(public_names, source[0])


def drawn(node):
    """Return a picture as a block of a page."""
    return f"```{{raw}} html\n{markup(node)}\n```"


def cam_interpolations():
    """Return a picture of every way to interpolate the same points."""
    points = [Point(*pair) for pair in ((0.0, 0.0), (60.0, 40.0), (140.0, 20.0), (200.0, 70.0), (360.0, 0.0))]
    parts = []
    for mode in Interpolation:
        curve = interpolate(points, [], mode)
        x = [curve.start + curve.period * number / 360.0 for number in range(361)]
        values = [curve.evaluate(one) for one in x]
        panels = [
            Panel("following value", [one[0] for one in values], [(one.x, one.y) for one in points]),
            Panel("first derivative", [one[1] for one in values]),
            Panel("second derivative", [one[2] for one in values]),
        ]
        parts += [f"### {mode.name.capitalize()}", "", drawn(picture(x, panels, label="leading value")), ""]
    return "\n".join(parts)


def cam_laws():
    """Return picture and characteristic values of every law, for the first transition that it is for."""
    ends = {"R": {}, "G": {"slope": 0.5}, "U": {"reversal": True}}
    parts = []
    for name, kind in LAWS.items():
        task = (kind.tasks or ("RR",))[0]
        slopes = {"slope": 1.0} if name == "straight_line" else {}
        law = law_between(name, End(0, 0, **ends[task[0]] | slopes), End(1, 1, **ends[task[1]] | slopes))
        x = [number / 400.0 for number in range(401)]
        values = [(*law.evaluate(one), law.third(one)) for one in x]
        labels = ("way", "velocity", "acceleration", "jerk")
        panels = [Panel(label, [one[order] for one in values]) for order, label in enumerate(labels)]
        found = law.characteristics
        numbers = ", ".join(
            f"{label} {'infinite' if value == float('inf') else format(value, '.4g')}"
            for label, value in zip(("Cv", "Ca", "Ca*", "Cj", "Cmdyn"), found, strict=True)
        )
        tasks = ", ".join(kind.tasks) or "all"
        text = f"For {tasks}. Here {task}: {numbers}."
        parts += [f"### `{name}`", "", text, "", drawn(picture(x, panels, label="leading value")), ""]
    return "\n".join(parts)


def markdown_code(_sphinx, _what, _name, _object, _options, lines):
    """Write code in docstrings, which have Markdown's single backticks, as reStructuredText wants it."""
    lines[:] = re.sub(r"(?<![`:\w])`([^`]+)`(?!`)", r"``\1``", "\n".join(lines)).split("\n")


def setup(sphinx):
    """Called by Sphinx."""
    sphinx.connect("autodoc-process-docstring", markdown_code, priority=100)  # before napoleon
    sphinx.connect("source-read", fill_in)

"""The page itself: Jinja templates, the style and the script inlined, and a policy that forbids everything else.

Every value reaches the page through autoescaping and the ``shown`` filter, which makes control characters visible. The
Content-Security-Policy names the hashes of the one style and the one script, so that markup which got in by mistake
could neither run nor load anything.
"""

from __future__ import annotations

import base64
import functools
import hashlib
from importlib import resources
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.report import wording
from shadowbench.rows import OUTCOME_MEANINGS, Outcome
from shadowbench.tables.numbers import number_text

if TYPE_CHECKING:
    from shadowbench.tables.table import Cell

_MEANINGS = {
    "false_lit": "in shadow, shown lit",
    "peter_panning": "false lit away from shadow edges, its blocker near",
    "false_shadow": "lit, shown in shadow",
    "acne": "false shadow away from shadow edges",
    "classified": "a failure by the method's own test",
}

LEGEND = [
    (name.replace("_", " "), "#{:02x}{:02x}{:02x}".format(*FAILURE_COLOURS[name]), meaning)
    for name, meaning in _MEANINGS.items()
]
"""(name, colour, meaning) of what the failure pictures show."""


def render(**content: Any) -> str:
    """Return the whole page; ``content`` is what the templates name."""
    style, script = _static("report.css"), _static("report.js")
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )
    template = _environment().get_template("report.html")
    return template.render(
        policy=Markup(policy),  # noqa: S704 - our own constants; quotes in it are single
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704 - a file of this package
        legend=LEGEND,
        meanings=OUTCOME_MEANINGS,
        **content,
    )


@functools.cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("shadowbench.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(shown=wording.shown, tone=_tone, mark=_mark, sort_value=_sort_value, interval=_interval)
    return environment


def _static(name: str) -> str:
    return resources.files("shadowbench.report").joinpath("static", name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def _tone(outcome: Outcome) -> str:
    """The class that colours an outcome."""
    return "is-failed" if outcome.is_failure else f"is-{outcome.value}"


def _mark(outcome: Outcome) -> str:
    """A sign beside the colour, for readers who cannot tell colours apart."""
    return "\u2715" if outcome.is_failure else "\u2713" if outcome is Outcome.OK else "\u2013"


def _sort_value(cell: Cell) -> Markup:
    """The attribute by which the script sorts: the value as the row holds it, empty where there is none."""
    value = "" if cell.value is None or cell.outcome is not None else cell.value
    return Markup(' data-value="{}"').format(wording.shown(value))


def _interval(cell: Cell) -> str:
    if cell.interval is None:
        return ""
    low, high = (number_text(end, cell.unit, thousands=True) for end in cell.interval)
    return f"[{low}, {high}]"

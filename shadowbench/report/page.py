"""The page itself: Jinja templates, the style and the scripts inlined, and a policy that forbids everything else.

Every value reaches the page through autoescaping and the ``shown`` filter, which makes control characters visible, or
as JSON in which no ``<`` is left. The Content-Security-Policy names the hashes of the one style and the one script, so
that markup which got in by mistake could neither run nor load anything.
"""

from __future__ import annotations

import base64
import functools
import hashlib
import itertools
import json
from dataclasses import replace
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.report import svg, wording
from shadowbench.rows import OUTCOME_MEANINGS, Outcome
from shadowbench.tables.claims import Verdict
from shadowbench.tables.numbers import number_text
from shadowbench.tables.plain_text import shortened

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shadowbench.report.sections import Names
    from shadowbench.tables.table import Cell, Header, Table

SCRIPTS = ("theme.js", "tables.js", "masks.js", "gallery.js", "case.js", "downloads.js")
"""Joined into the page's one script, in this order."""

_MEANINGS = {
    "false_lit": "in shadow, shown lit",
    "peter_panning": "false lit away from shadow edges, its blocker near",
    "false_shadow": "lit, shown in shadow",
    "acne": "false shadow away from shadow edges",
    "classified": "a failure by the method's own test; painted below the others",
}

LEGEND = [
    (name.replace("_", " "), "#{:02x}{:02x}{:02x}".format(*FAILURE_COLOURS[name]), meaning)
    for name, meaning in _MEANINGS.items()
]
"""(name, colour, meaning) of what the failure pictures show."""


def render(*, content: Any, pictures: Any, **more: Any) -> str:
    """Return the whole page.

    Args:
        content: What the script needs of views and cases, as JSON values.
        pictures: Picture number -> address.
        more: What the templates name.
    """
    style = _static("report.css")
    script = "\n".join(['"use strict";', *map(_static, SCRIPTS)])
    policy = (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
        "base-uri 'none'; form-action 'none'"
    )
    template = _environment().get_template("report.html")
    return template.render(
        policy=Markup(policy),  # noqa: S704 - our own constants; quotes in it are single
        style=Markup(style),  # noqa: S704 - a file of this package
        script=Markup(script),  # noqa: S704 - files of this package
        content=_json(content),
        pictures=_json(pictures),
        legend=LEGEND,
        meanings=OUTCOME_MEANINGS,
        **more,
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
    environment.filters.update(
        shown=wording.shown,
        brief=shortened,
        tone=_tone,
        mark=_mark,
        verdict_tone=verdict_tone,
        verdict_mark=verdict_mark,
        header_groups=_header_groups,
        case_links=_case_links,
        own_lines=_own_lines,
        sort_value=_sort_value,
        interval=_interval,
        drawn=svg.drawn,
        legend_of=svg.legend,
    )
    return environment


def _static(name: str) -> str:
    return resources.files("shadowbench.report").joinpath("static", name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def _json(value: Any) -> Markup:
    """Return JSON that stands in a ``script`` element: ASCII, and without a ``<`` that could end it."""
    text = json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")
    return Markup(text)  # noqa: S704 - cannot end its element


def _tone(outcome: Outcome) -> str:
    """The class that colours an outcome."""
    return "is-failed" if outcome.is_failure else f"is-{outcome.value}"


def _mark(outcome: Outcome) -> str:
    """A sign beside the colour, for readers who cannot tell colours apart."""
    return "\u2715" if outcome.is_failure else "\u2713" if outcome is Outcome.OK else "\u2013"


def verdict_tone(verdict: Verdict) -> str:
    return {Verdict.HOLDS: "is-ok", Verdict.DOES_NOT_HOLD: "is-failed"}.get(verdict, "is-skipped")


def verdict_mark(verdict: Verdict) -> str:
    return {Verdict.HOLDS: "\u2713", Verdict.DOES_NOT_HOLD: "\u2715"}.get(verdict, "?")


def _header_groups(table: Table) -> list[tuple[str, int]]:
    """A pivoted table's groups of neighbouring columns, and how many each spans."""
    groups = itertools.groupby(header.group for header in table.headers)
    return [(group, len(list(members))) for group, members in groups]


class CaseLink(NamedTuple):
    """What a cell opens: a case's anchor, and its title where the line does not say which case it is."""

    anchor: str
    title: str


def _case_links(line: Sequence[Cell], index_count: int, names: Names) -> list[CaseLink | None]:
    """For each cell of a table's line what it opens: the first cell the line's case.

    A line of several cases, one a pivoted column, has a link in the first cell of each.
    """
    keys = list(dict.fromkeys(cell.case_key for cell in line if cell.case_key in names))
    links: list[CaseLink | None] = [None] * len(line)
    for key in keys:
        own = [place for place, cell in enumerate(line) if cell.case_key == key]
        title, anchor = names[key]
        if len(keys) == 1:
            own, title = [*range(index_count), *own], ""
        place = next((place for place in own if line[place].text()), None)
        if place is not None:
            links[place] = CaseLink(anchor, title)
    return links


def _own_lines(header: Header) -> list[str]:
    """A heading's lines without its group, which stands above it."""
    return replace(header, group="").lines()


def _sort_value(cell: Cell) -> Markup:
    """The attribute by which the script sorts: the value as the row holds it, empty where there is none."""
    value = "" if cell.value is None or cell.outcome is not None else cell.value
    return Markup(' data-value="{}"').format(wording.shown(value))


def _interval(cell: Cell) -> str:
    if cell.interval is None:
        return ""
    low, high = (number_text(end, cell.unit, thousands=True) for end in cell.interval)
    return f"[{low}, {high}]"

"""Templates, and the one style and one script that every page carries inside it."""

from __future__ import annotations

import base64
import functools
import hashlib
from importlib import resources
from typing import Any
from urllib.parse import quote, urlencode

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

import shadowbench
from shadowbench.report import page, wording
from shadowbench.rows import OUTCOME_MEANINGS, Outcome
from shadowbench.tables.columns import header_text, header_unit
from shadowbench.tables.decisions import Verdict


def _file(package: str, name: str) -> str:
    return resources.files(package).joinpath("static", name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


DOCS_STYLE = _file("shadowbench.service", "docs.css")
"""Of the API's page, beside the style that its script brings."""

STYLE = _file("shadowbench.report", "report.css") + _file("shadowbench.service", "service.css")
SCRIPT = '"use strict";\n' + _file("shadowbench.report", "tables.js") + _file("shadowbench.service", "service.js")

POLICY = (
    f"default-src 'none'; img-src 'self' data:; style-src '{_hash(STYLE)}'; script-src '{_hash(SCRIPT)}'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)

HEADERS = {"Content-Security-Policy": POLICY}
"""Of every page."""


def render(template: str, **content: Any) -> str:
    """Return a page."""
    return _environment().get_template(template).render(**content)


def address(path: str, **query: Any) -> str:
    """Return the address of a page: ``path`` and what of the query is not empty."""
    given = {name: value for name, value in query.items() if value not in (None, "", ())}
    return quote(path, safe="/") + (f"?{urlencode(given, doseq=True)}" if given else "")


@functools.cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("shadowbench.service"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        shown=wording.shown,
        moment=lambda text: wording.moment(text) if text else wording.ABSENT,
        number=wording.number,
        count=wording.count,
        percent=wording.percent,
        milliseconds=wording.milliseconds,
        bytes=wording.byte_size,
        tone=_tone,
        mark=_mark,
        heading=_heading,
        measure=_measure,
        picture_title=_picture_title,
        verdict_tone=lambda verdict: page.verdict_tone(Verdict(verdict)),
        verdict_mark=lambda verdict: page.verdict_mark(Verdict(verdict)),
        zip=lambda first, second: list(zip(first, second, strict=True)),
    )
    environment.globals.update(
        docs_style=Markup(DOCS_STYLE),  # noqa: S704 - a file of this program
        style=Markup(STYLE),  # noqa: S704 - files of this program
        script=Markup(SCRIPT),  # noqa: S704
        meanings=OUTCOME_MEANINGS,
        version=shadowbench.__version__,
        address=address,
        site_title="shadowbench results",
        relative="",
    )
    return environment


def use_title(title: str) -> None:
    """Name the service on its pages."""
    _environment().globals["site_title"] = title


def _tone(outcome: str) -> str:
    return "is-failed" if Outcome(outcome).is_failure else f"is-{outcome}"


def _mark(outcome: str) -> str:
    return "\u2715" if Outcome(outcome).is_failure else "\u2713" if outcome == Outcome.OK else "\u2013"


def _picture_title(name: str) -> str:
    kind, _, rest = name.partition("-")
    return f"{'mask of ' if kind == 'mask' else ''}{rest.replace('-', ' ')}" if rest else name


def _heading(column: str) -> str:
    unit = header_unit(column)
    return f"{header_text(column)} [{unit}]" if unit and unit != "1" else header_text(column)


def _measure(value: Any, column: str) -> str:
    """A value without its unit, which the heading has."""
    if value is None:
        return wording.ABSENT
    if column.endswith("_percent"):
        return wording.percent(value).removesuffix(" %")
    if column.endswith("_ms"):
        return wording.milliseconds(value).removesuffix(" ms")
    return wording.count(value) if isinstance(value, int) else wording.number(value)

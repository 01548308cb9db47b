"""Answers to claims in the formats of tables: one line a claim, with its verdict and what decides it.

Statements are those of experiment files and evidence names cases, which come from anybody: whatever a format takes for
markup is escaped, and characters that are not printable are shown.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from shadowbench.errors import UsageError, did_you_mean
from shadowbench.tables.claims import ClaimAnswer, Finding, Verdict
from shadowbench.tables.columns import finite
from shadowbench.tables.plain_text import LONGEST_NOTE, plain, shortened

if TYPE_CHECKING:
    from rich.console import RenderableType

CLAIM_FORMATS = ("rich", "csv", "markdown", "latex", "json")

_STYLES = {Verdict.HOLDS: "green", Verdict.DOES_NOT_HOLD: "red", Verdict.UNDECIDED: "yellow"}
_HEADERS = ("experiment", "claim", "verdict", "statement", "source", "evidence")


def render_claims(answers: Sequence[ClaimAnswer], format: str) -> str | RenderableType:  # noqa: A002 - the option's name
    """Write answers in one format, as :func:`shadowbench.tables.render` writes tables.

    Raises:
        UsageError: There is no such format.
    """
    writers = {"rich": _as_rich, "csv": _as_csv, "markdown": _as_markdown, "latex": _as_latex, "json": _as_json}
    if format not in writers:
        hint = did_you_mean(format, CLAIM_FORMATS, noun="format")
        raise UsageError(f"no format of claims is called '{format}'; {hint}")
    return writers[format](answers)


def tally(answers: Sequence[ClaimAnswer]) -> str:
    """Return ``12 hold, 2 do not hold, 1 is undecided``, or ``no claims``."""
    counts = Counter(answer.verdict for answer in answers)
    words = {
        Verdict.HOLDS: ("holds", "hold"),
        Verdict.DOES_NOT_HOLD: ("does not hold", "do not hold"),
        Verdict.UNDECIDED: ("is undecided", "are undecided"),
    }
    parts = [f"{counts[verdict]} {words[verdict][counts[verdict] > 1]}" for verdict in Verdict if counts[verdict]]
    return ", ".join(parts) or "no claims"


def _as_rich(answers: Sequence[ClaimAnswer]) -> RenderableType:
    from rich import box
    from rich.console import Group
    from rich.table import Table as Grid
    from rich.text import Text

    parts: list[RenderableType] = []
    for experiment in dict.fromkeys(answer.experiment for answer in answers):
        grid = Grid(
            box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, header_style="", padding=(0, 1, 0, 0), leading=1
        )
        grid.add_column("verdict", no_wrap=True)
        grid.add_column("claim", overflow="fold", ratio=1)
        grid.add_column("evidence", overflow="fold", ratio=1)
        for answer in (answer for answer in answers if answer.experiment == experiment):
            style = _STYLES[answer.verdict]
            said = Text(_short(answer.statement)) + Text(
                "\n" + ": ".join(_short(text) for text in (answer.name, answer.source) if text), style="dim"
            )
            grid.add_row(Text(answer.verdict.value, style=style), said, Text(_short(answer.evidence)))
        parts += [Text(_short(experiment), style="bold"), grid]
    return Group(*parts, Text(tally(answers)))


def _short(text: str) -> str:
    return plain(shortened(text, LONGEST_NOTE))


def _fields(answer: ClaimAnswer) -> tuple[str, ...]:
    return (
        *(answer.experiment, answer.name, answer.verdict.value),
        *(answer.statement, answer.source, answer.evidence),
    )


def _as_csv(answers: Sequence[ClaimAnswer]) -> str:
    from shadowbench.tables.csv_text import lines_of

    keys = (" ".join(answer.case_keys) for answer in answers)
    return lines_of([(*_HEADERS, "case_keys"), *((*_fields(a), k) for a, k in zip(answers, keys, strict=True))])


def _as_markdown(answers: Sequence[ClaimAnswer]) -> str:
    from shadowbench.tables.markup import markdown_escaped as escaped

    parts = [f"{escaped(tally(answers))}\n"]
    for experiment in dict.fromkeys(answer.experiment for answer in answers):
        lines = [f"### {escaped(_short(experiment))}\n", "| verdict | claim | source | evidence |", "|:--|:--|:--|:--|"]
        for answer in (answer for answer in answers if answer.experiment == experiment):
            cells = (answer.verdict.value, answer.statement, answer.source, answer.evidence)
            lines.append("| " + " | ".join(escaped(_short(cell)) for cell in cells) + " |")
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def _as_latex(answers: Sequence[ClaimAnswer]) -> str:
    from shadowbench.tables.markup import latex_escaped as escaped

    parts = []
    for experiment in dict.fromkeys(answer.experiment for answer in answers):
        own = [answer for answer in answers if answer.experiment == experiment]
        parts += [
            "",
            r"\begin{table}[htbp]",
            r"\centering\small",
            rf"\caption{{Claims of {escaped(_short(experiment))}: {escaped(tally(own))}}}",
            r"\begin{tabular}{@{}lp{0.42\linewidth}p{0.38\linewidth}@{}}",
            r"\toprule",
            r"verdict & claim & evidence \\",
            r"\midrule",
            *(
                " & ".join(escaped(_short(cell)) for cell in (a.verdict.value, a.statement, a.evidence)) + r" \\"
                for a in own
            ),
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
        ]
    return "% needs \\usepackage{booktabs,textcomp}\n" + "\n".join(parts[1:]) + "\n"


def _as_json(answers: Sequence[ClaimAnswer]) -> str:
    """Return a list of objects with the claim's fields and ``findings``: every group of cases with its figure."""
    found = [
        dict(zip(("experiment", "name", "verdict", "statement", "source", "evidence"), _fields(answer), strict=True))
        | {"case_keys": list(answer.case_keys), "findings": [_finding(finding) for finding in answer.findings]}
        for answer in answers
    ]
    return json.dumps(found, indent=1, allow_nan=False) + "\n"


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "group": finding.group,
        "quantity": finding.quantity,
        "verdict": finding.verdict.value,
        "evidence": finding.evidence,
        "value": finite(finding.value),
        "low": finite(finding.low),
        "high": finite(finding.high),
        "case_keys": list(finding.case_keys),
    }

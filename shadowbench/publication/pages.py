"""The pages of published results, as Markdown: what was found, and for each experiment its tables, claims, pictures."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from shadowbench import tables
from shadowbench.experiment_groups import PAPERS
from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.publication.sheets import Sheet
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.claims import ClaimAnswer, Verdict
from shadowbench.tables.claims_text import tally
from shadowbench.tables.markup import as_markdown
from shadowbench.tables.markup import markdown_escaped as escaped

_COLOUR_WORDS = {
    "false_shadow": "light blue",
    "acne": "dark blue",
    "false_lit": "orange",
    "peter_panning": "vermilion",
    "classified": "pink",
}
_TO_BE_READ_AS = """\
Every picture and counter is the same wherever it is computed; times are this machine's, so compare them with each
other, not with yours. A claim that does not hold is a result like any other: its line says by how much."""

_COMMANDS = """\
```sh
shadowbench publish --to results        # measures everything anew (over an hour) and writes this folder
shadowbench publish RUN --to results    # writes it from a run that there is
shadowbench verify results              # computes {count} of the cases again and holds them to it
```"""

_WHAT_IS_HELD = """\
`verify` holds work counters, bytes kept and hard visibility exactly, filtered visibility to 1/255, and says which case
moved; continuous integration runs it. `rows.csv` beside each page has one line a case with every column; `run.json`
says when, where and with which versions it was measured."""

assert _COLOUR_WORDS.keys() == FAILURE_COLOURS.keys()


def front_page(run: RunRecord, rows: Sequence[ResultRow], answers: Sequence[ClaimAnswer], sample_count: int) -> str:
    """Return the page that a visitor reads first.

    Args:
        run: The run.
        rows: All its rows.
        answers: To the claims of all its experiments.
        sample_count: How many cases ``verify`` computes again.
    """
    counts = Counter(row.outcome.value for row in rows)
    outcomes = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
    measured = (
        f"What shadowbench finds: {len(rows)} cases of {len(run.experiments)} experiments, measured in one run on"
        f" {_machine(run)}{_duration(run)}. Outcomes: {outcomes}. Of what the papers claim, here"
        f" {escaped(tally(answers))}."
    )
    parts = [
        "# Results",
        measured,
        _TO_BE_READ_AS,
        _verdicts_by_paper(answers),
        "## What does not hold here",
        _claim_lines(answers, Verdict.DOES_NOT_HOLD),
        "## What stays undecided",
        "The intervals of the times lie on both sides.",
        _claim_lines(answers, Verdict.UNDECIDED),
        "## All experiments",
        _contents(run, rows, answers),
        "## Having it yourself",
        _COMMANDS.format(count=sample_count),
        _WHAT_IS_HELD,
        f"`bunny-biases.png`: the truth and three biases of one shadow map, above what fails ({_legend()}).",
    ]
    return "\n\n".join(parts) + "\n"


def experiment_page(
    run: RunRecord,
    definition: Mapping[str, Any],
    rows: Sequence[ResultRow],
    answers: Sequence[ClaimAnswer],
    sheets: Sequence[Sheet],
) -> str:
    """Return an experiment's page.

    Args:
        run: The run.
        definition: The experiment, as its record holds it.
        rows: The experiment's.
        answers: To its claims.
        sheets: Its pictures, which lie beside the page.
    """
    name = str(definition["name"])
    source = str(definition.get("source") or "")
    parts = [f"# {escaped(str(definition.get('title') or name))}"]
    parts += [f"After {escaped(source)}."] if source else []
    parts += [escaped(" ".join(str(definition.get("description") or "").split()))]
    parts += [f"`shadowbench run {name}` measures it; [all experiments](../README.md), [rows](rows.csv)."]
    parts += ["## Tables", as_markdown(tables.make(rows, run=run, experiment=name))]
    if answers:
        lines = ["| verdict | claim | source | evidence |", "|:--|:--|:--|:--|"]
        for answer in answers:
            cells = (answer.verdict.value, answer.statement, answer.source, answer.evidence)
            lines.append("| " + " | ".join(map(escaped, cells)) + " |")
        parts += [f"## Claims: {escaped(tally(answers))}", "\n".join(lines)]
    if sheets:
        parts += ["## Pictures", f"Failing receivers: {_legend()}."]
    for sheet in sheets:
        names = ", ".join(escaped(label) for label in sheet.labels)
        parts += [f"{escaped(sheet.view)}. From the left: the truth, {names}.", f"![Pictures]({sheet.name})"]
    return "\n\n".join(part for part in parts if part) + "\n"


def _legend() -> str:
    return ", ".join(f"{word} {name.replace('_', ' ')}" for name, word in _COLOUR_WORDS.items())


def _machine(run: RunRecord) -> str:
    found = run.environment
    memory = found.get("memory_gib", {}).get("total")
    size = f", {memory:.0f} GiB" if isinstance(memory, int | float) else ""
    return f"{found.get('cores', '?')} cores ({escaped(str(found.get('processor', 'unknown')))}{size})"


def _duration(run: RunRecord) -> str:
    if run.finished_at is None:
        return ""
    begin, end = dt.datetime.fromisoformat(run.created_at), dt.datetime.fromisoformat(run.finished_at)
    minutes = round((end - begin).total_seconds() / 60)
    return f" on {begin.date().isoformat()} in {minutes} minutes, with {escaped(run.code_version)}"


def _verdicts_by_paper(answers: Sequence[ClaimAnswer]) -> str:
    lines = ["| source | holds | does not hold | undecided |", "|:--|--:|--:|--:|"]
    for paper, title in PAPERS.items():
        own = Counter(answer.verdict for answer in answers if answer.experiment.startswith(f"{paper}-"))
        counts = " | ".join(str(own[verdict]) for verdict in Verdict)
        lines.append(f"| {escaped(title.removesuffix(': all experiments'))} | {counts} |")
    return "\n".join(lines)


def _claim_lines(answers: Sequence[ClaimAnswer], verdict: Verdict) -> str:
    lines = ["| claim | evidence |", "|:--|:--|"]
    for answer in answers:
        if answer.verdict is verdict:
            where = f"[{escaped(answer.source or answer.experiment)}]({answer.experiment}/README.md)"
            lines.append(f"| {escaped(answer.statement)} {where} | {escaped(answer.evidence)} |")
    return "\n".join(lines) if len(lines) > 2 else "None."


def _contents(run: RunRecord, rows: Sequence[ResultRow], answers: Sequence[ClaimAnswer]) -> str:
    lines = ["| experiment | what | cases | claims |", "|:--|:--|--:|:--|"]
    for definition in run.definitions:
        name = str(definition["name"])
        count = sum(row.experiment == name for row in rows)
        planned = definition.get("case_count")
        cases = str(count) if planned in (None, count) else f"{count} of {planned}"
        own = [answer for answer in answers if answer.experiment == name]
        title = escaped(str(definition.get("title") or name))
        lines.append(f"| [{escaped(name)}]({name}/README.md) | {title} | {cases} | {escaped(tally(own))} |")
    return "\n".join(lines)

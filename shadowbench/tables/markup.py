"""Tables as Markdown (GitHub's) and LaTeX (booktabs), with every name escaped so that it stays text."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence

from tabulate import tabulate

from shadowbench.tables.plain_text import plain, shortened
from shadowbench.tables.table import Table

_MARKDOWN_ACTIVE = re.compile(
    r"""[\\`*|~$#]                                  # code, emphasis, cells, strikethrough, formulas, headings
    | (?<![A-Za-z0-9])_ | _(?![A-Za-z0-9])         # emphasis, which underscores within a word do not make
    | \](?=[(\[:])                                 # links
    | :(?=[a-z0-9_+-]+:)                           # :name: of an emoji
    | ^[+=-] | (?<=^\d)[.)](?=\s) | (?<=^\d\d)[.)](?=\s)   # lists and underlined headings""",
    re.VERBOSE,
)
_MARKDOWN_ENTITIES: dict[str, str | int | None] = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}

_LATEX_ENTITIES: dict[str, str | int | None] = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\char34{}",
    "'": r"\textquotesingle{}",
    "`": r"\textasciigrave{}",
    "…": r"\ldots{}",
    "≠": r"$\neq$",
    "●": r"$\bullet$",
    "○": r"$\circ$",
}


def as_markdown(tables: Sequence[Table]) -> str:
    """Return the tables under headings, with their notes as lists."""
    parts = []
    for table in tables:
        headers, lines = _texts(table, markdown_escaped)
        sides = ["right" if table.is_numeric(column) else "left" for column in range(len(headers))]
        grid = tabulate(lines, headers, tablefmt="pipe", colalign=sides, disable_numparse=True)
        notes = "".join(f"- {markdown_escaped(note)}\n" for note in table.notes)
        parts.append(f"### {markdown_escaped(table.title)}\n\n{grid}\n" + (f"\n{notes}" if notes else ""))
    return "\n".join(parts)


def as_latex(tables: Sequence[Table]) -> str:
    """Return the tables as ``table`` floats for a document that uses the package ``booktabs``."""
    parts = []
    for table in tables:
        _, lines = _texts(table, latex_escaped)
        sides = "".join("r" if table.is_numeric(column) else "l" for column in range(len(table.headers)))
        grid = [
            r"\begin{table}[htbp]",
            r"\centering",
            rf"\caption{{{latex_escaped(table.title)}}}",
            rf"\begin{{tabular}}{{{sides}}}",
            r"\toprule",
            *_latex_headers(table),
            r"\midrule",
            *(_latex_line(line) for line in lines),
            r"\bottomrule",
            r"\end{tabular}",
            *(rf"\par{{\footnotesize {latex_escaped(note)}}}" for note in table.notes),
            r"\end{table}",
        ]
        parts.append("\n".join(grid) + "\n")
    return "% needs \\usepackage{booktabs,textcomp}\n" + "\n".join(parts)


def markdown_escaped(text: str) -> str:
    """Return printable ``text`` such that Markdown shows it as it is, in a cell, a heading or a list."""
    return _MARKDOWN_ACTIVE.sub(r"\\\g<0>", text).translate(str.maketrans(_MARKDOWN_ENTITIES))


def latex_escaped(text: str) -> str:
    """Return printable ``text`` such that LaTeX sets it as it is: no command, no ligature of dashes or commas."""
    escaped = re.sub(r"([-,])(?=\1)", r"\1{}", text.translate(str.maketrans(_LATEX_ENTITIES)))
    return re.sub(r"^[\[*]", r"{\g<0>}", escaped)  # else, opening a line, an argument of the line break before it


def _texts(table: Table, escaped: Callable[[str], str]) -> tuple[list[str], list[list[str]]]:
    headers = [escaped(header.line()) for header in table.headers]
    return headers, [[escaped(cell.text()) for cell in line] for line in table.body]


def _latex_headers(table: Table) -> list[str]:
    """Return the headings: where columns are grouped, a line of groups over theirs, and the rest below it."""
    if not any(header.group for header in table.headers):
        return [_latex_line([latex_escaped(header.line()) for header in table.headers])]
    cells, rules, column = [], [], 1
    for group, members in itertools.groupby(table.headers, key=lambda header: header.group):
        count = len(list(members))
        text = latex_escaped(plain(shortened(group)))
        cells += [rf"\multicolumn{{{count}}}{{c}}{{{text}}}"] if group else [""] * count
        rules += [rf"\cmidrule(lr){{{column}-{column + count - 1}}}"] if group else []
        column += count
    below = [" ".join(header.lines()[1:] if header.group else header.lines()) for header in table.headers]
    return [_latex_line(cells), "".join(rules), _latex_line([latex_escaped(text) for text in below])]


def _latex_line(cells: Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"

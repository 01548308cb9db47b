"""Markdown and LaTeX in which names are text, whatever is in them."""

from __future__ import annotations

import html
import re
from typing import Any

from markdown_it import MarkdownIt

from shadowbench import tables
from shadowbench.experiment import TableLayout
from shadowbench.rows import ResultRow
from shadowbench.tables.markup import latex_escaped, markdown_escaped
from shadowbench.tables.plain_text import plain, shortened

_INVERSE = {  # written from LaTeX's side: what each command sets
    r"\textbackslash": "\\",
    r"\textasciicircum": "^",
    r"\textasciitilde": "~",
    r"\textless": "<",
    r"\textgreater": ">",
    r"\textbar": "|",
    r"\textquotesingle": "'",
    r"\textasciigrave": "`",
    r"\char34": '"',
    r"\ldots": "…",
}


def _typeset(source: str) -> str:
    """Return what LaTeX sets for a source of plain text, as far as such a source may go; refuse anything else."""
    result = ""
    depth = 0
    while source:
        command = re.match(r"\\[a-z]+(?:34)?(?=\{\})", source)
        if command:
            result += _INVERSE[command[0]]
            source = source[len(command[0]) :]
            continue
        escaped = re.match(r"\\([{}$&#%_])", source)
        if escaped:
            result += escaped[1]
            source = source[2:]
            continue
        character, source = source[0], source[1:]
        if character == "{":
            depth += 1
        elif character == "}":
            depth -= 1
        else:
            assert character not in "\\$&#%_^~<>|\"'`", f"{character} is active"
            assert not (character in "-," and source.startswith(character)), "a ligature"
            result += character
        assert depth >= 0
    assert depth == 0
    return result


def _rendered(markdown: str) -> str:
    return MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(markdown)


def _cells(page: str) -> list[list[str]]:
    lines = re.findall(r"<tr>(.*?)</tr>", page, re.DOTALL)
    return [[html.unescape(cell) for cell in re.findall(r"<t[hd].*?>(.*?)</t[hd]>", line, re.DOTALL)] for line in lines]


def _shown(name: str) -> str:
    return plain(shortened(name)).strip()


def _squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


def test_markdown_is_a_heading_a_table_and_notes(make_row: Any) -> None:
    rows = [make_row(build_ms=1234.5), make_row(method="vsm", outcome="crash", reason="signal 11")]
    text = tables.render(tables.make(rows, {"quick": [TableLayout("Cost", ("method",), ("build_ms",))]}), "markdown")
    assert text == (
        "### Cost\n"
        "\n"
        "| method   |   build [ms] |\n"
        "|:---------|-------------:|\n"
        "| pcf      |         1234 |\n"
        "| vsm      |    crash [1] |\n"
        "\n"
        "- all cases: scene bunny, light sun, camera main, 64x48, device cpu, threads 2\n"
        "- [1] crash: signal 11\n"
    )


def test_hostile_names_are_text_in_markdown(hostile_rows: list[ResultRow], hostile: str) -> None:
    layouts = {"quick": [TableLayout(hostile, ("light", "method"), ("build_ms", f"stages.{hostile}x"))]}
    text = str(tables.render(tables.make(hostile_rows, layouts), "markdown"))
    page = _rendered(text)
    assert set(re.findall(r"</?([a-z0-9]+)", page)) <= {
        *("h3", "table", "thead", "tbody", "tr", "th", "td", "ul", "li"),
    }
    header, first, second, third = _cells(page)
    assert len(header) == len(first) == len(second) == len(third) == 4
    assert _squeezed(first[0]) == _squeezed(_shown(hostile))
    assert (first[2], second[2], third[2]) == ("1.25", "crash [1]", "-1.50")
    notes = [html.unescape(note) for note in re.findall(r"<li>(.*?)</li>", page, re.DOTALL)]
    reason = plain(shortened(f"[1] crash: {hostile or 'no reason given'}", 400))
    assert any(_squeezed(note) == _squeezed(reason) for note in notes)


def test_markdown_leaves_ordinary_names_readable() -> None:
    for name in ("shadow-map(slope_bias=1.5, kernel=3)", "Table 1 [ms]", "12.5", "a.b", "<0.01"):
        assert markdown_escaped(name) == name.replace("<", "&lt;")


def test_latex_is_a_booktabs_table(make_row: Any) -> None:
    rows = [make_row(failure_percent=0.001), make_row(method="a_b & c", outcome="crash", reason="50 % done")]
    layouts = {"quick": [TableLayout("Cost & failures", ("method",), ("failure_percent",))]}
    assert tables.render(tables.make(rows, layouts), "latex") == (
        "% needs \\usepackage{booktabs,textcomp}\n"
        "\\begin{table}[htbp]\n"
        "\\centering\n"
        "\\caption{Cost \\& failures}\n"
        "\\begin{tabular}{lr}\n"
        "\\toprule\n"
        "method & failure [\\%] \\\\\n"
        "\\midrule\n"
        "pcf & \\textless{}0.01 \\\\\n"
        "a\\_b \\& c & crash [1] \\\\\n"
        "\\bottomrule\n"
        "\\end{tabular}\n"
        "\\par{\\footnotesize all cases: scene bunny, light sun, camera main, 64x48, device cpu, threads 2}\n"
        "\\par{\\footnotesize {[}1] crash: 50 \\% done}\n"
        "\\end{table}\n"
    )


def test_latex_sets_groups_over_their_columns(make_row: Any) -> None:
    rows = [make_row(method_parameters={"kernel": k}, build_ms=1.0, shade_ms=2.0) for k in (3, 7)]
    layouts = {"quick": [TableLayout("T", ("method",), ("build_ms", "shade_ms"), "kernel")]}
    text = str(tables.render(tables.make(rows, layouts), "latex"))
    assert text.split("\\toprule\n")[1].split("\n")[:4] == [
        r" & \multicolumn{2}{c}{kernel=3} & \multicolumn{2}{c}{kernel=7} \\",
        r"\cmidrule(lr){2-3}\cmidrule(lr){4-5}",
        r"method & build [ms] & shade [ms] & build [ms] & shade [ms] \\",
        r"\midrule",
    ]


def test_hostile_names_are_text_in_latex(hostile_rows: list[ResultRow], hostile: str) -> None:
    layouts = {"quick": [TableLayout(hostile, ("light", "method"), ("build_ms", f"stages.{hostile}x"))]}
    lines = str(tables.render(tables.make(hostile_rows, layouts), "latex")).split("\n")
    caption = next(line for line in lines if line.startswith(r"\caption{"))
    assert _typeset(caption.removeprefix(r"\caption{").removesuffix("}")) == plain(shortened(hostile, 400))
    body = lines[lines.index(r"\midrule") + 1 : lines.index(r"\bottomrule")]
    assert len(body) == 3
    for line in body:
        cells = re.split(r"(?<!\\)&", line.removesuffix(r" \\"))
        assert len(cells) == 4
        texts = [_typeset(cell.strip()) for cell in cells]
        assert not line.startswith(("[", "*"))
    assert texts[2] == "-1.50"
    assert _typeset(latex_escaped(plain(hostile))) == plain(hostile)


def test_a_table_without_cases_is_still_a_table(make_run: Any) -> None:
    made = tables.make([], None, make_run(case_count=3))
    for format_ in ("markdown", "latex", "json", "csv", "csv-table"):
        text = tables.render(made, format_)
        assert isinstance(text, str)
        assert text.endswith("\n")

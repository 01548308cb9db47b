"""Paper-style tables from result rows: :func:`make` lays them out, :func:`render` writes them.

::

    layout.py     which columns a table has: from the experiment file, or chosen from the rows
    columns.py    a column's name -> its value in a row, its header and unit
    labels.py     short method and scene labels that stay unique
    table.py      Table, Header, Cell: what every format is written from
    printed.py    a source's printed numbers beside ours, and the ratio
    making.py     rows + layout -> Table
    verdicts.py   a case's times against those of its comparison's first case, judged over the table
    numbers.py    significant digits, percentages, bytes
    plain_text.py names that are safe to print
    terminal.py csv_text.py markup.py json_text.py    the formats
    quantities.py a number with its interval, and the ratio of two
    decisions.py  whether numbers are what a claim says
    claim_groups.py claim_tests.py claims.py claims_text.py    claims answered: a test's cases, one test, all of a run
    pareto.py pareto_tables.py    cost against quality: which methods no other beats on both, and as tables
    frames.py     a pandas DataFrame for notebooks
    matching.py comparing.py changed_times.py    two runs, case by case; comparison_text.py writes it

Reads rows and experiments only; imports no Warp and no plugin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, get_args

from shadowbench.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from rich.console import RenderableType

    from shadowbench.experiment import TableLayout
    from shadowbench.rows import ResultRow, RunRecord
    from shadowbench.tables.table import Table

Format = Literal["rich", "csv", "csv-table", "markdown", "latex", "json"]
"""``csv`` is tidy (every column of the result row, one line a case); ``csv-table`` has the table's own shape."""

FORMATS: tuple[str, ...] = get_args(Format)


def make(
    rows: Sequence[ResultRow],
    layouts: Mapping[str, Sequence[TableLayout]] | None = None,
    run: RunRecord | None = None,
    *,
    experiment: str | None = None,
) -> list[Table]:
    """Lay out tables, those of one experiment after those of the one before.

    Args:
        rows: Rows of one run, in the order the tables shall have; whatever their outcomes.
        layouts: Experiment -> its table layouts. ``None`` takes those that ``run.definitions`` holds (``tables``:
            each :class:`~shadowbench.experiment.TableLayout` as a mapping). An experiment without one gets the
            default layout.
        run: The run, for experiment titles, "n of m cases" and parameter defaults. Each of its experiments gets its
            tables, also one that has no row yet.
        experiment: Only this experiment's tables.

    Raises:
        UsageError: The run has no such experiment.
        ExperimentError: A layout's value is no column that rows can have.
    """
    from shadowbench.tables.making import make_tables

    return make_tables(rows, layouts, run, experiment)


def render(tables: Sequence[Table], format: Format) -> str | RenderableType:  # noqa: A002 - the option's name
    """Write tables in one format.

    Returns:
        For ``rich`` something that ``rich.console.Console.print`` prints, fitted to the console's width; text that
        ends with a line feed otherwise.

    Raises:
        UsageError: There is no such format.
    """
    if format == "rich":
        from shadowbench.tables.terminal import as_renderable

        return as_renderable(tables)
    if format == "csv":
        from shadowbench.tables.csv_text import as_tidy_csv

        return as_tidy_csv([row for table in tables for row in table.rows])
    if format == "csv-table":
        from shadowbench.tables.csv_text import as_csv_tables

        return as_csv_tables(tables)
    if format == "markdown":
        from shadowbench.tables.markup import as_markdown

        return as_markdown(tables)
    if format == "latex":
        from shadowbench.tables.markup import as_latex

        return as_latex(tables)
    if format == "json":
        from shadowbench.tables.json_text import as_json

        return as_json(tables)
    raise UsageError(f"no table format is called '{format}'; {did_you_mean(format, FORMATS, noun='format')}")

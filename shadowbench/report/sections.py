"""One part of the page for each experiment: what it is, what is claimed and found, its tables, its charts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shadowbench import tables
from shadowbench.report.chart import Chart
from shadowbench.report.downloads import Download, table_download
from shadowbench.report.growth import growth_plots
from shadowbench.report.pareto_plot import pareto_plot
from shadowbench.report.stage_bars import stage_bars, stage_styles
from shadowbench.report.views import SceneView, view_key
from shadowbench.rows import ResultRow, RunRecord
from shadowbench.tables.claims import ClaimAnswer
from shadowbench.tables.columns import header_text
from shadowbench.tables.layout import layouts_of
from shadowbench.tables.pareto import fronts
from shadowbench.tables.table import Table

MOST_CHARTS = 24
"""Charts of one experiment; the first of a kind come first."""

Names = dict[str, tuple[str, str]]
"""Case key -> the case's title and its anchor in the page."""


@dataclass(frozen=True)
class ExperimentPart:
    """An experiment's part of the page.

    Attributes:
        anchor: Its id.
        name, title, source, description: As its file says.
        names: Of its cases, and where they are.
        claims: With their verdicts.
        tables: Each with its download.
        charts: The first of each kind come first.
        more_charts: How many were left out.
    """

    anchor: str
    name: str
    title: str
    source: str
    description: str
    names: Names
    claims: list[ClaimAnswer]
    tables: list[tuple[Table, Download]]
    charts: list[Chart]
    more_charts: int


def names_of(views: Sequence[SceneView], experiment: str | None = None) -> Names:
    """Return each case's title and anchor; a case of several experiments has the anchor in ``experiment``."""
    found: Names = {}
    for view in views:
        for card in view.cards:
            if card.row.case_key not in found or card.row.experiment == experiment:
                found[card.row.case_key] = (card.title, card.anchor)
    return found


def experiment_parts(
    run: RunRecord, rows: Sequence[ResultRow], views: Sequence[SceneView], claims: Sequence[ClaimAnswer]
) -> list[ExperimentPart]:
    """Return the experiments of a run in the order they were asked for, those without a row yet included."""
    if not rows and not run.experiments:
        return []
    made = tables.make(rows, run=run)
    names = list(dict.fromkeys([*run.experiments, *(row.experiment for row in rows)]))
    parts = []
    for number, name in enumerate(names, 1):
        definition = next((d for d in run.definitions if d.get("name") == name), {})
        own = [row for row in rows if row.experiment == name]
        charts = _charts(run, name, own, views)
        parts.append(
            ExperimentPart(
                anchor=f"experiment-{number}",
                name=name,
                title=str(definition.get("title") or name),
                source=str(definition.get("source") or ""),
                description=str(definition.get("description") or "").strip(),
                names=names_of(views, name),
                claims=[claim for claim in claims if claim.experiment == name],
                tables=[(t, table_download(t, f"{number}-{k}")) for k, t in enumerate(_own(made, name), 1)],
                charts=charts[:MOST_CHARTS],
                more_charts=max(0, len(charts) - MOST_CHARTS),
            )
        )
    return parts


def _own(made: Sequence[Table], experiment: str) -> list[Table]:
    return [table for table in made if table.experiment == experiment]


def _charts(run: RunRecord, experiment: str, rows: list[ResultRow], views: Sequence[SceneView]) -> list[Chart]:
    names = names_of(views, experiment)
    anchors = {key: anchor for key, (_, anchor) in names.items()}
    charts: list[Chart] = []
    for layout in layouts_of(run).get(experiment, ()):
        for plot in growth_plots(run, layout, rows, anchors):
            if all((plot.title, plot.series) != (other.title, getattr(other, "series", ())) for other in charts):
                charts.append(plot)
    keys = {view_key(view.cards[0].row): view.title for view in views}
    by_view: dict[str, list[ResultRow]] = {}
    for row in rows:
        by_view.setdefault(keys[view_key(row)], []).append(row)
    styles = stage_styles(rows)
    bars = [stage_bars(title, group, names, styles) for title, group in by_view.items()]
    return [*charts, *(chart for chart in bars if chart is not None and len(rows) > 1)]


def pareto_plots(rows: Sequence[ResultRow], views: Sequence[SceneView]) -> list[Chart]:
    """Return the plots of cost against quality, one for each view and number of threads that has two cases."""
    names: Mapping[str, tuple[str, str]] = names_of(views)
    titles = {view_key(view.cards[0].row): view.title for view in views}
    found = fronts(rows)
    keys = [view_key(front.points[0].row) for front in found]
    plots = []
    for front, key in zip(found, keys, strict=True):
        beside = [other.setting for other, its in zip(found, keys, strict=True) if its == key]
        apart = [name for name in front.setting if len({str(setting.get(name)) for setting in beside}) > 1]
        title = ", ".join([titles[key], *(f"{header_text(name)}: {front.setting[name]}" for name in apart)])
        plots.append(pareto_plot(front, title, names))
    return [plot for plot in plots if plot is not None]


def all_charts(run: RunRecord, rows: Sequence[ResultRow], views: Sequence[SceneView]) -> list[Chart]:
    """Return every chart of the page, those that it leaves out included."""
    experiments = list(dict.fromkeys(row.experiment for row in rows))
    charts = [_charts(run, name, [row for row in rows if row.experiment == name], views) for name in experiments]
    return [*(chart for found in charts for chart in found), *pareto_plots(rows, views)]

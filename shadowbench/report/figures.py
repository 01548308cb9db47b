"""Figures for papers: the charts of a report as PDF and SVG, drawn by matplotlib.

The same rows give the same bytes: no time, no version of the program and no random identifier is in a file. Text stays
text (TrueType in PDF), so that a journal's tools can check and set it. Colours, markers and dashes are those of the
page's light scheme, told apart in grey too.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.errors import UsageError
from shadowbench.report.chart import CAMERA_STYLE, REST_STYLE, Bars, Chart, Plot, Series, are_ticks, scale_of, tick_text
from shadowbench.tables.plain_text import plain, shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("pdf", "svg")

COLOURS = ("#0072b2", "#c98a00", "#008a64", "#c44f00", "#b0568d", "#4a4fb5", "#7a6a00", "#6b7280")
"""Of the series, by style; Okabe and Ito's, darkened where they are too pale on white."""

_MARKERS = ("o", "s", "^", "D")
_DASHES: tuple[Any, ...] = ("solid", (0, (4, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)))
_PART_COLOURS = {CAMERA_STYLE: "#c4c8ce", REST_STYLE: "#e6e7ea"}
_HATCHES = ("", "", "", "", "///", "...", "xxx", "\\\\\\")
_WIDTH, _HEIGHT = 5.2, 3.4
"""Size of a plot [inches]: as wide as a column and a half, to be set at its own size."""

_LONGEST_TEXT = 60

_STYLE: Any = {
    "font.size": 8.0,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "legend.fontsize": 7.0,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "shadowbench",
    "path.simplify": False,
    "text.parse_math": False,  # a name's $ is a dollar
    "text.usetex": False,
}

_NO_TIMES: dict[str, dict[str, Any]] = {
    "pdf": {"Creator": "shadowbench", "Producer": None, "CreationDate": None},
    "svg": {"Creator": "shadowbench", "Date": None},
}


def write_figures(charts: Sequence[Chart], folder: Path) -> list[Path]:
    """Write every chart in every format and return the files, in order.

    Args:
        charts: What to draw; their titles become the files' names.
        folder: Where to; made if it is not there.

    Raises:
        UsageError: The folder cannot be written.
    """
    import matplotlib as mpl

    written = []
    with mpl.rc_context(_STYLE):
        for name, chart in zip(_file_names(charts), charts, strict=True):
            figure = _plot(chart) if isinstance(chart, Plot) else _bars(chart)
            for form in FORMATS:
                path = folder / f"{name}.{form}"
                try:
                    folder.mkdir(parents=True, exist_ok=True)
                    figure.savefig(path, format=form, bbox_inches="tight", metadata=_NO_TIMES[form])
                except OSError as error:
                    raise UsageError(f"--figures {folder}: {path.name} cannot be written: {error.strerror}") from error
                written.append(path)
    return written


def _file_names(charts: Sequence[Chart]) -> list[str]:
    """Return a name for each chart: its number, and its title as far as any file system takes it."""
    digits = max(2, len(str(len(charts))))
    names = []
    for number, chart in enumerate(charts, 1):
        ascii_title = unicodedata.normalize("NFKD", chart.title).encode("ascii", "ignore").decode("ascii").lower()
        slug = re.sub(r"[^a-z0-9]+", "-", ascii_title).strip("-")[:80].strip("-")
        names.append(f"{number:0{digits}}-{slug or 'chart'}")
    return names


def _figure(height: float) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height))
    return figure, figure.subplots()


def _text(text: str, length: int = _LONGEST_TEXT) -> str:
    return shortened(plain(text), length)


def _plot(plot: Plot) -> Figure:
    figure, axes = _figure(_HEIGHT)
    for series in plot.series:
        _draw(axes, series)
    points = plot.points
    if plot.x.is_log:
        _set_log(axes, "x", [v for p in points for v in (p.x, p.left, p.right)], sorted({p.x for p in points}))
    if plot.y.is_log:
        _set_log(axes, "y", [v for p in points for v in (p.y, p.low, p.high)])
    axes.set_xlabel(_text(plot.x.label))
    axes.set_ylabel(_text(plot.y.label))
    for point in (p for series in plot.series if not series.is_faint for p in series.points if p.name):
        place = (point.x, point.y)
        axes.annotate(_text(point.name, 40), place, xytext=(5, 3), textcoords="offset points", fontsize=6.0)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
    return figure


def _set_log(axes: Axes, which: str, values: list[float], own: Sequence[float] = ()) -> None:
    """Make an axis logarithmic, its marks those of the page; with a linear part for 0 where there is one."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    scale = scale_of(values, 1.0, is_log=True, zero_room=0.1)
    set_scale, set_limits, axis = (
        (axes.set_xscale, axes.set_xlim, axes.xaxis) if which == "x" else (axes.set_yscale, axes.set_ylim, axes.yaxis)
    )
    if scale.zero_room:
        set_scale("symlog", linthresh=scale.low, linscale=0.2)
        set_limits(-0.1 * scale.low, scale.high)
    else:
        set_scale("log")
        set_limits(scale.low, scale.high)
    axis.set_major_locator(FixedLocator(list(own) if are_ticks(own, scale, apart=0.05) else scale.ticks()))
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value)))
    axis.set_minor_locator(NullLocator())


def _draw(axes: Axes, series: Series) -> None:
    colour = COLOURS[series.style % len(COLOURS)]
    xs, ys = [p.x for p in series.points], [p.y for p in series.points]
    is_hollow = series.is_printed or series.is_faint
    axes.errorbar(
        xs,
        ys,
        xerr=_reach((p.x, p.left, p.right) for p in series.points),
        yerr=_reach((p.y, p.low, p.high) for p in series.points),
        label=_text(series.name),
        color=colour,
        ecolor=colour,
        elinewidth=0.8,
        marker=_MARKERS[series.style % len(_MARKERS)],
        markerfacecolor="white" if is_hollow else colour,
        linestyle=_line_style(series),
        linewidth=0.8 if series.is_printed else 1.3,
    )


def _reach(points: Iterable[tuple[float, float, float]]) -> list[list[float]]:
    """Return how far intervals reach below and above their values, as matplotlib takes it."""
    pairs = [(max(0.0, value - low), max(0.0, high - value)) for value, low, high in points]
    return [[below for below, _ in pairs], [above for _, above in pairs]]


def _line_style(series: Series) -> Any:
    if not series.is_line:
        return "none"
    return (0, (2, 2)) if series.is_printed else _DASHES[series.style % len(_DASHES)]


def _bars(chart: Bars) -> Figure:
    figure, axes = _figure(0.9 + 0.22 * len(chart.bars))
    places = range(len(chart.bars))
    begins = [0.0] * len(chart.bars)
    for number, (name, style) in enumerate(zip(chart.part_names, chart.part_styles, strict=True)):
        lengths = [bar.parts[number] for bar in chart.bars]
        if not any(lengths):
            continue
        colour = _PART_COLOURS.get(style, COLOURS[style % len(COLOURS)])
        hatch = "" if style < 0 else _HATCHES[style % len(_HATCHES)]
        axes.barh(places, lengths, left=begins, height=0.62, color=colour, hatch=hatch, label=_text(name), linewidth=0)
        begins = [begin + length for begin, length in zip(begins, lengths, strict=True)]
    for place, bar in zip(places, chart.bars, strict=True):
        if bar.low is not None and bar.high is not None:
            middle = (bar.low + bar.high) / 2.0
            axes.errorbar(
                [middle], [place], xerr=[(bar.high - bar.low) / 2.0], color="black", elinewidth=0.8, capsize=2
            )
    axes.set_yticks(places, [_text(bar.label, 44) for bar in chart.bars])
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel(_text(chart.axis.label))
    below = -0.5 / (0.9 + 0.22 * len(chart.bars)) - 0.06
    axes.legend(loc="upper center", bbox_to_anchor=(0.4, below), ncols=3)
    return figure

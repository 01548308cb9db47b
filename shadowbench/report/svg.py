"""Charts as SVG inside the page: no script draws them, so that they are there in print and for readers who hear it.

Everything is an element or a text node of a tree that is serialised at the end; no text is ever taken for markup.
Colours, dashes and fonts are classes of the page's style, which knows light from dark. A point or bar that belongs to a
case is a link to it; what it says when pointed at is its ``title``.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as ET

from markupsafe import Markup

from shadowbench.report import wording
from shadowbench.report.chart import (
    STYLE_COUNT,
    Axis,
    Bar,
    Bars,
    Chart,
    Plot,
    Point,
    Scale,
    Series,
    are_ticks,
    scale_of,
    tick_text,
)
from shadowbench.tables.plain_text import plain, shortened

WIDTH, PLOT_HEIGHT = 720, 400
_LEFT, _RIGHT, _TOP, _BOTTOM = 68.0, 16.0, 14.0, 50.0
_ZERO_ROOM = 26.0
_ROW, _BAR, _NAMES_WIDTH, _TOTALS_WIDTH = 26.0, 14.0, 254.0, 82.0
_CHARACTER = 7.2
"""Width of a letter of a label, about [pixels]."""

_LONGEST_NAME = 34


def drawn(chart: Chart) -> Markup:
    """Return a chart as an ``svg`` element, without its title and legend."""
    svg = _plot(chart) if isinstance(chart, Plot) else _bars(chart)
    return Markup(ET.tostring(svg, encoding="unicode"))  # noqa: S704 - a tree of elements and text


def legend(chart: Chart) -> list[tuple[Markup, str]]:
    """Return what the chart's signs mean: a small picture and its text each."""
    if isinstance(chart, Bars):
        pairs = zip(chart.part_styles, chart.part_names, strict=True)
        return [(_sign_of_part(style), wording.shown(name)) for style, name in pairs]
    measured = [series for series in chart.series if not series.is_printed]
    return [(_sign_of_series(series), wording.shown(series.name)) for series in measured]


def _root(width: float, height: float, chart: Chart) -> ET.Element:
    words = f"{chart.title}. {chart.summary}" if chart.summary else chart.title
    # a group, not an image: the links in it are to be reached
    attributes = {"viewBox": f"0 0 {width:.0f} {height:.0f}", "role": "group", "class": "chart"}
    return ET.Element("svg", attributes | {"aria-label": wording.shown(words)})


def _element(parent: ET.Element, tag: str, _class: str = "", **attributes: float | str) -> ET.Element:
    texts = {k.replace("_", "-"): v if isinstance(v, str) else f"{v:.1f}" for k, v in attributes.items()}
    return ET.SubElement(parent, tag, ({"class": _class} if _class else {}) | texts)


def _text(parent: ET.Element, text: str, x: float, y: float, _class: str, anchor: str = "start") -> ET.Element:
    element = _element(parent, "text", _class, x=x, y=y, text_anchor=anchor)
    element.text = text
    return element


def _linked(parent: ET.Element, anchor: str, told: str) -> ET.Element:
    """Return the element to draw a case's sign into: a link to it, or a plain group."""
    holder = _element(parent, "a", "mark", href=f"#{anchor}") if anchor else _element(parent, "g", "mark")
    if anchor:
        holder.set("aria-label", wording.shown(told))
    _element(holder, "title").text = wording.shown(told)
    return holder


# Plots


def _plot(plot: Plot) -> ET.Element:
    svg = _root(WIDTH, PLOT_HEIGHT, plot)
    points = plot.points
    across = scale_of(
        (v for p in points for v in (p.x, p.left, p.right)),
        WIDTH - _LEFT - _RIGHT,
        is_log=plot.x.is_log,
        zero_room=_ZERO_ROOM,
    )
    up = scale_of(
        (v for p in points for v in (p.y, p.low, p.high)),
        PLOT_HEIGHT - _TOP - _BOTTOM,
        is_log=plot.y.is_log,
        zero_room=_ZERO_ROOM,
    )
    _axes(svg, plot.x, plot.y, across, up, points)
    place = _Places(across, up)
    for series in sorted(plot.series, key=lambda s: (not s.is_faint, not s.is_printed)):
        _draw_series(svg, series, place)
    _name_points(svg, points, place)
    return svg


class _Places:
    """Where values stand in the picture."""

    def __init__(self, across: Scale, up: Scale) -> None:
        self._across, self._up = across, up

    def x(self, value: float) -> float:
        return _LEFT + self._across.at(value)

    def y(self, value: float) -> float:
        return PLOT_HEIGHT - _BOTTOM - self._up.at(value)


def _axes(svg: ET.Element, x: Axis, y: Axis, across: Scale, up: Scale, points: list[Point]) -> None:
    place, bottom, right = _Places(across, up), PLOT_HEIGHT - _BOTTOM, WIDTH - _RIGHT
    own = sorted({point.x for point in points})
    ticks = own if across.is_log and across.zero_room == 0.0 and are_ticks(own, across, apart=34.0) else across.ticks()
    for value in ticks:
        _element(svg, "line", "grid", x1=place.x(value), x2=place.x(value), y1=_TOP, y2=bottom)
        _text(svg, tick_text(value), place.x(value), bottom + 17, "tick", "middle")
    for value in up.ticks():
        _element(svg, "line", "grid", x1=_LEFT, x2=right, y1=place.y(value), y2=place.y(value))
        _text(svg, tick_text(value), _LEFT - 7, place.y(value) + 4, "tick", "end")
    _element(svg, "path", "axis", d=f"M{_LEFT:.0f} {_TOP:.0f}V{bottom:.0f}H{right:.0f}")
    _text(svg, plain(shortened(x.label)), (_LEFT + right) / 2, PLOT_HEIGHT - 10, "label", "middle")
    label = _text(svg, plain(shortened(y.label)), 0.0, 0.0, "label", "middle")
    label.set("transform", f"translate(14 {(_TOP + bottom) / 2:.0f}) rotate(-90)")


def _draw_series(svg: ET.Element, series: Series, place: _Places) -> None:
    group = _element(svg, "g", _series_class(series))
    if series.is_line and len(series.points) > 1:
        steps = " ".join(f"{place.x(p.x):.1f},{place.y(p.y):.1f}" for p in series.points)
        _element(group, "polyline", "line", points=steps)
    for point in series.points:
        x, y = place.x(point.x), place.y(point.y)
        holder = _linked(group, point.anchor, point.label)
        if point.high > point.low:
            _element(holder, "line", "whisker", x1=x, x2=x, y1=place.y(point.low), y2=place.y(point.high))
        if point.right > point.left:
            _element(holder, "line", "whisker", x1=place.x(point.left), x2=place.x(point.right), y1=y, y2=y)
        _marker(holder, series.style, x, y)


def _series_class(series: Series) -> str:
    extra = " printed" if series.is_printed else " faint" if series.is_faint else ""
    return f"series s{series.style % STYLE_COUNT}{extra}"


def _marker(parent: ET.Element, style: int, x: float, y: float) -> None:
    """Draw one of four signs: circle, square, triangle, diamond."""
    shape = style % 4
    if shape == 0:
        _element(parent, "circle", "dot", cx=x, cy=y, r=5.0)
    elif shape == 1:
        _element(parent, "rect", "dot", x=x - 4.5, y=y - 4.5, width=9.0, height=9.0)
    else:
        steps = [(0, -6), (5.6, 4.4), (-5.6, 4.4)] if shape == 2 else [(0, -6.4), (6.4, 0), (0, 6.4), (-6.4, 0)]
        _element(parent, "path", "dot", d="M" + "L".join(f"{x + dx:.1f} {y + dy:.1f}" for dx, dy in steps) + "Z")


def _name_points(svg: ET.Element, points: list[Point], place: _Places) -> None:
    """Write labels beside points where they cover no other sign; the others are told when pointed at."""
    taken = [(place.x(p.x) - 6, place.y(p.y) - 6, place.x(p.x) + 6, place.y(p.y) + 6) for p in points]
    for point in points:
        if not point.name:
            continue
        text = plain(shortened(point.name, _LONGEST_NAME))
        x, y, width = place.x(point.x), place.y(point.y), len(text) * _CHARACTER
        beside, above = [(x + 9, y - 6), (x - 9 - width, y - 6)], [(x - width / 2, y - 21), (x - width / 2, y + 9)]
        for left, top in above + beside if point.right > point.left else beside + above:
            box = (left, top, left + width, top + 12)
            inside = left >= _LEFT + 2 and box[2] <= WIDTH - 2 and top >= 2 and box[3] <= PLOT_HEIGHT - _BOTTOM
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                _text(svg, text, left, top + 10, "name").set("aria-hidden", "true")
                break


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


# Bars


def _bars(chart: Bars) -> ET.Element:
    height = _TOP + _ROW * len(chart.bars) + _BOTTOM - 6
    svg = _root(WIDTH, height, chart)
    reach = [v for bar in chart.bars for v in (bar.total, bar.high or 0.0) if math.isfinite(v)]
    across = scale_of(reach, WIDTH - _NAMES_WIDTH - _TOTALS_WIDTH, is_log=False)
    bottom = height - _BOTTOM + 6
    for value in across.ticks():
        x = _NAMES_WIDTH + across.at(value)
        _element(svg, "line", "grid", x1=x, x2=x, y1=_TOP, y2=bottom)
        _text(svg, tick_text(value), x, bottom + 17, "tick", "middle")
    middle = _NAMES_WIDTH + (WIDTH - _NAMES_WIDTH - _TOTALS_WIDTH) / 2
    _text(svg, chart.axis.label, middle, height - 8, "label", "middle")
    for number, bar in enumerate(chart.bars):
        _draw_bar(svg, chart, bar, _TOP + _ROW * number + (_ROW - _BAR) / 2, across)
    return svg


def _draw_bar(svg: ET.Element, chart: Bars, bar: Bar, y: float, across: Scale) -> None:
    parts = [
        f"{name} {wording.milliseconds(part)}"
        for name, part in zip(chart.part_names, bar.parts, strict=True)
        if part > 0.0
    ]
    holder = _linked(svg, bar.anchor, f"{bar.label}: {bar.text}; {', '.join(parts)}")
    _text(holder, plain(shortened(bar.label, _LONGEST_NAME)), _NAMES_WIDTH - 8, y + 11, "bar-name", "end")
    begin = 0.0
    for style, part in zip(chart.part_styles, bar.parts, strict=True):
        left, right = across.at(begin), across.at(begin + part)
        if right > left:
            _element(holder, "rect", _part_class(style), x=_NAMES_WIDTH + left, y=y, width=right - left, height=_BAR)
        begin += part
    end = begin
    if bar.low is not None and bar.high is not None:
        low, high = _NAMES_WIDTH + across.at(bar.low), _NAMES_WIDTH + across.at(bar.high)
        middle = y + _BAR / 2
        steps = f"M{low:.1f} {middle - 4:.1f}v8M{low:.1f} {middle:.1f}H{high:.1f}M{high:.1f} {middle - 4:.1f}v8"
        _element(holder, "path", "whisker", d=steps)
        end = max(end, bar.high)
    _text(holder, bar.text, _NAMES_WIDTH + across.at(end) + 7, y + 11, "tick")


def _part_class(style: int) -> str:
    return "part camera" if style == -2 else "part rest" if style == -1 else f"part s{style % STYLE_COUNT}"


# Legends


def _sign(_class: str) -> tuple[ET.Element, ET.Element]:
    svg = ET.Element("svg", {"viewBox": "0 0 28 14", "class": "sign", "aria-hidden": "true"})
    return svg, _element(svg, "g", _class)


def _sign_of_series(series: Series) -> Markup:
    svg, group = _sign(_series_class(series))
    if series.is_line:
        _element(group, "polyline", "line", points="1,7 27,7")
    _marker(group, series.style, 14.0, 7.0)
    return Markup(ET.tostring(svg, encoding="unicode"))  # noqa: S704 - a tree of elements and text


def _sign_of_part(style: int) -> Markup:
    svg, group = _sign("")
    _element(group, "rect", _part_class(style), x=8.0, y=1.0, width=12.0, height=12.0)
    return Markup(ET.tostring(svg, encoding="unicode"))  # noqa: S704 - a tree of elements and text

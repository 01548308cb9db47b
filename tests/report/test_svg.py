"""Charts in the page: well-formed, linked, and safe whatever their labels say."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

from shadowbench.report.chart import Axis, Bar, Bars, Plot, Point, Series
from shadowbench.report.svg import WIDTH, drawn, legend

HOSTILE = "</svg><script>alert(1)</script>\x1b\u202e&\"'"


def point(x: float, y: float, **fields: str) -> Point:
    return Point(x, y, y * 0.9, y * 1.1, x, x, **({"label": f"{x} {y}"} | fields))


def plot(*points: Point, **fields: object) -> Plot:
    series = Series("measured", 0, points)
    return replace(Plot("T", Axis("x", is_log=True), Axis("y", is_log=True), (series,)), **fields)


BARS = Bars(
    "T",
    Axis("time [ms]", is_log=False),
    ("camera pass", "fill", "not in any stage"),
    (-2, 0, -1),
    (Bar("a", (1.0, 3.0, 0.0), 3.5, 4.5, "4.00 ms", "view-1-case-1"),),
)


def parsed(chart: Plot | Bars) -> ET.Element:
    return ET.fromstring(drawn(chart))


def test_points_stand_where_their_values_are() -> None:
    svg = parsed(plot(point(1.0, 1.0), point(10.0, 10.0), point(100.0, 100.0)))
    places = [(float(dot.get("cx", "")), float(dot.get("cy", ""))) for dot in svg.iter("circle")]
    assert len(places) == 3
    assert abs((places[1][0] - places[0][0]) - (places[2][0] - places[1][0])) < 0.2  # logarithmic
    assert places[0][1] > places[1][1] > places[2][1]  # upwards
    assert all(0 < x < WIDTH for x, _ in places)


def test_a_point_of_a_case_is_a_link_that_says_what_it_is() -> None:
    svg = parsed(plot(point(1.0, 2.0, anchor="view-1-case-2", label="pcf: 2 ms"), point(2.0, 3.0)))
    (link,) = svg.iter("a")
    assert (link.get("href"), link.get("aria-label")) == ("#view-1-case-2", "pcf: 2 ms")
    assert link.findtext("title") == "pcf: 2 ms"


def test_labels_do_not_cover_each_other() -> None:
    crowd = [point(1.0 + k / 1000.0, 1.0 + k / 1000.0, name=f"a long name {k}") for k in range(30)]
    svg = parsed(plot(*crowd, point(50.0, 50.0, name="alone")))
    names = [text.text for text in svg.iter("text") if text.get("class") == "name"]
    assert "alone" in names
    assert len(names) < 10


def test_parts_of_a_bar_lie_end_to_end_with_their_lengths() -> None:
    parts = [r for r in parsed(BARS).iter("rect") if (r.get("class") or "").startswith("part")]
    camera, fill = ((float(r.get("x", "")), float(r.get("width", ""))) for r in parts)
    assert abs(camera[0] + camera[1] - fill[0]) < 0.11
    assert abs(fill[1] - 3.0 * camera[1]) < 0.3


def test_a_bar_says_its_parts_and_its_interval_is_drawn() -> None:
    svg = parsed(BARS)
    (link,) = svg.iter("a")
    assert link.get("aria-label") == "a: 4.00 ms; camera pass 1.00 ms, fill 3.00 ms"
    assert [path for path in svg.iter("path") if path.get("class") == "whisker"]


def test_hostile_labels_stay_text() -> None:
    charts = [
        plot(
            point(1.0, 1.0, label=HOSTILE, name=HOSTILE, anchor="view-1"), title=HOSTILE, x=Axis(HOSTILE, is_log=True)
        ),
        replace(BARS, title=HOSTILE, part_names=(HOSTILE,) * 3, bars=(replace(BARS.bars[0], label=HOSTILE),)),
    ]
    for chart in charts:
        assert "<script" not in drawn(chart)
        assert not set(drawn(chart)) & {"\x1b", "\u202e"}
        assert not list(parsed(chart).iter("script"))
        assert all("\u202e" not in text for _, text in legend(chart))


def test_the_legend_has_measured_series_and_parts_of_bars() -> None:
    both = plot(point(1.0, 1.0))
    both = replace(both, series=(*both.series, Series("theirs", 0, (point(1.0, 2.0),), is_printed=True)))
    assert [text for _, text in legend(both)] == ["measured"]
    assert [text for _, text in legend(BARS)] == list(BARS.part_names)
    assert all(ET.fromstring(sign).tag == "svg" for sign, _ in legend(BARS))

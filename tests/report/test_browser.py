"""The page in a browser, from disk and with the network off: it loads nothing, says no error, and every control works.

One browser and one page for all tests; each test puts back what it changed.
"""

from __future__ import annotations

import csv
import io
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, CDPSession, Page, sync_playwright
from stored_rows import png, some_row, some_run, with_masks, with_pictures

from shadowbench import report
from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.rows import RunRecord
from shadowbench.store import Store

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine")

HOSTILE = (
    "<script>document.title='owned'</script><img src=x onerror=\"document.title='owned'\">\x1b\u202ered" + "y" * 300
)
CASES = 12


@dataclass
class Opened:
    """The page, and what the browser said and asked for."""

    page: Page
    path: Path
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


def _run() -> RunRecord:
    layout = {"title": "Sweep", "index": ["resolution"], "columns": "method", "values": ["shade_ms"]}
    test = {"value": "shade_ms", "of": {"method": "pcf"}, "relation": "growing", "over": "resolution"}
    claim = {"name": "c", "statement": HOSTILE, "source": HOSTILE, "tests": [test]}
    definitions = [
        {"name": "quick", "title": "A quick look", "description": "Words.", "tables": [layout], "claims": [claim]},
        {"name": HOSTILE, "title": HOSTILE, "source": HOSTILE, "description": HOSTILE},
    ]
    return some_run(experiments=["quick", HOSTILE], definitions=definitions, case_count=CASES + 3)


def _fill(store: Store) -> None:
    own = {"picture-BSP over the samples": store.put_artifact(png(7), "png")}
    for number in range(CASES - 2):
        times = {"dynamic_frame_ms": 3.0 + number, "dynamic_frame_ms_low": 2.9, "dynamic_frame_ms_high": 13.2}
        row = some_row(
            "pcf" if number % 2 else "esm",
            method_parameters={"resolution": 256 << (number // 2)},
            stages={"depth map": 0.5, "look-up": 1.0},
            camera_ms=1.0,
            failure_percent=float(CASES - number),
            shade_ms=1.5 + number,
            **times,
        )
        row = with_masks(store, with_pictures(store, row), false_lit=(3, 4), acne=(20, 10))
        store.add_row(row.model_copy(update={"artifacts": row.artifacts | (own if number == 0 else {})}))
    store.add_row(some_row("broken", outcome="crash", reason="a fault", stderr_tail="the end", light="lamp"))
    names = dict.fromkeys(("method", "method_title", "scene", "light", "camera", "reason", "experiment"), HOSTILE)
    store.add_row(some_row(**names, outcome="error", stderr_tail=HOSTILE, warnings=[HOSTILE]))


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def opened(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    folder = tmp_path_factory.mktemp("browser")
    run = _run()
    with Store.open(folder / "results") as store:
        store.start_run(run)
        _fill(store)
        path = report.write(store, run, folder / "report.html")
    context = browser.new_context(viewport={"width": 1280, "height": 900}, offline=True, accept_downloads=True)
    context.set_default_timeout(10_000)
    found = Opened(context.new_page(), path)
    found.page.on("console", lambda message: found.complaints.append(message.text))
    found.page.on("pageerror", lambda error: found.complaints.append(str(error)))
    found.page.on("request", lambda request: found.requests.append(request.url))
    found.page.goto(path.as_uri())
    found.page.wait_for_selector("html[data-ready=yes]")
    yield found
    context.close()


@pytest.fixture
def page(opened: Opened) -> Iterator[Page]:
    yield opened.page
    opened.page.evaluate("document.getElementById('case').close()")
    assert opened.complaints == []


def _open_case(page: Page, anchor: str = "view-1-case-1") -> None:
    page.evaluate("id => openCase(id)", anchor)
    page.wait_for_selector("dialog[open]")


def _canvas(page: Page, selector: str) -> np.ndarray:
    """Return the pixels of a picture as the browser decodes it, RGBA."""
    found = page.evaluate(
        """async selector => {
            const image = document.querySelector(selector);
            await image.decode();
            const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
            const context = canvas.getContext("2d");
            context.drawImage(image, 0, 0);
            return [canvas.width, canvas.height, [...context.getImageData(0, 0, canvas.width, canvas.height).data]];
        }""",
        selector,
    )
    return np.array(found[2], np.uint8).reshape(found[1], found[0], 4)


def test_loading_asks_for_nothing_but_the_page_itself(opened: Opened, page: Page) -> None:
    assert [url for url in opened.requests if not url.startswith("data:")] == [opened.path.as_uri()]
    assert not page.evaluate("performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length")


def test_hostile_names_do_nothing(page: Page) -> None:
    assert page.title() != "owned"
    assert page.locator("img[src=x]").count() == 0
    assert "<script>document.title='owned'</script>" in page.locator("#main").inner_text()
    _open_case(page, page.evaluate("page.views.at(-1).cases[0].id"))
    assert "<script>document.title='owned'</script>" in page.locator("#case-reason").inner_text()
    assert page.title() != "owned"


@pytest.mark.parametrize("width", [1280, 390])
def test_nothing_is_wider_than_the_window(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    _open_case(page)
    assert page.evaluate("(d => d.scrollWidth <= d.clientWidth)(document.getElementById('case'))")
    page.set_viewport_size({"width": 1280, "height": 900})


def test_text_for_screen_readers_far_right_in_a_wide_table_does_not_widen_the_page(page: Page) -> None:
    page.evaluate(
        """() => {
            const probe = document.createElement("div");
            probe.className = "probe";
            Object.assign(probe.style, { width: "3000px", textAlign: "right" });
            probe.innerHTML = '<span class="unseen">value</span>';
            document.querySelector(".scroll").append(probe);
        }"""
    )
    fits = page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.evaluate("document.querySelector('.probe').remove()")
    assert fits


def test_a_heading_sorts_its_table_both_ways(page: Page) -> None:
    table = page.locator("table.sortable").first
    heading = table.locator("thead tr").last.locator("th").first
    shown = (
        "[...document.querySelector('table.sortable').tBodies[0].rows].map(row => Number(row.cells[0].dataset.value))"
    )
    heading.locator("button").focus()
    page.keyboard.press("Enter")
    assert heading.get_attribute("aria-sort") == "ascending"
    assert page.evaluate(shown) == sorted(page.evaluate(shown))
    page.keyboard.press("Enter")
    assert heading.get_attribute("aria-sort") == "descending"
    assert page.evaluate(shown) == sorted(page.evaluate(shown), reverse=True)


def test_the_gallery_is_searched_by_words(page: Page) -> None:
    page.fill("#find", "pcf 2048")
    assert page.locator("#found").inner_text() == f"1 of {CASES} cases"
    assert page.locator("#gallery .tile[data-words]:visible").count() == 1
    page.fill("#find", "crash")
    assert page.locator(".view:visible").count() == 1
    page.fill("#find", "")
    assert page.locator("#gallery .tile[data-words]:visible").count() == CASES


def test_pictures_are_put_in_where_they_are_seen_and_show_failures(page: Page) -> None:
    page.locator("#view-1-case-1").scroll_into_view_if_needed()
    page.wait_for_selector("#view-1-case-1 .frame img.mask")
    mask = _canvas(page, "#view-1-case-1 .frame img.mask")
    assert tuple(mask[3, 4]) == (*FAILURE_COLOURS["false_lit"], 255)
    assert tuple(mask[20, 10]) == (*FAILURE_COLOURS["acne"], 255)
    assert np.count_nonzero(mask[..., 3]) == 2


def test_classes_of_failures_are_switched_one_by_one(page: Page) -> None:
    page.locator("#view-1-case-1").scroll_into_view_if_needed()
    tools = page.locator("#gallery > .tools")
    tools.get_by_label("acne").uncheck()
    mask = _canvas(page, "#view-1-case-1 .frame img.mask")
    assert tuple(mask[20, 10]) == (*FAILURE_COLOURS["false_shadow"], 255)  # acne is false shadow
    tools.get_by_label("false shadow").uncheck()
    tools.get_by_label("false lit").uncheck()
    assert not _canvas(page, "#view-1-case-1 .frame img.mask")[..., 3].any()
    for name in ("acne", "false shadow", "false lit"):
        tools.get_by_label(name).check()
    assert np.count_nonzero(_canvas(page, "#view-1-case-1 .frame img.mask")[..., 3]) == 2


def test_other_layers_are_chosen_and_said_to_be_absent(page: Page) -> None:
    page.locator("#view-1-case-1").scroll_into_view_if_needed()
    choice = page.locator("#gallery > .tools select.layer")
    choice.select_option(label="BSP over the samples")
    frame = page.locator("#view-1-case-1 .frame")
    assert frame.locator("img").get_attribute("alt").endswith(": BSP over the samples")
    assert page.locator("#view-1-case-2 .frame").inner_text() == "no BSP over the samples"
    choice.select_option(value="result")
    assert frame.locator("img.mask").count() == 0
    choice.select_option(value="failures")
    assert frame.locator("img.mask").count() == 1


def test_the_reference_is_slid_in_by_keyboard_everywhere(page: Page) -> None:
    slider = page.locator("#gallery > .tools input.split")
    slider.focus()
    page.keyboard.press("End")
    assert page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--split')") == "100%"
    assert page.locator("#case input.split").input_value() == "100"
    page.keyboard.press("ArrowLeft")
    assert slider.input_value() == "99"
    assert (
        page.evaluate("getComputedStyle(document.querySelector('#view-1-case-1 .over')).clipPath")
        == "inset(0px 1% 0px 0px)"
    )
    page.keyboard.press("Home")
    assert not page.evaluate("document.documentElement.classList.contains('is-split')")


def _zoom(page: Page, selector: str) -> list[float]:
    """Return scale and shift of a picture as it is drawn."""
    return page.evaluate(
        """selector => {
            const matrix = new DOMMatrix(getComputedStyle(document.querySelector(selector)).transform);
            return [matrix.a, matrix.e, matrix.f];
        }""",
        selector,
    )


def test_all_pictures_of_a_view_zoom_and_pan_together(page: Page) -> None:
    pictures = [f"#view-1-case-{number} .frame > img" for number in (1, 2)]
    page.locator("#view-1-case-1").scroll_into_view_if_needed()
    page.locator("#view-1 .zoom button[data-zoom=in]").click()
    assert [_zoom(page, picture)[0] for picture in pictures] == [2.0, 2.0]
    page.locator("#view-1 .tiles").focus()
    before = _zoom(page, pictures[0])
    page.keyboard.press("ArrowRight")
    after = [_zoom(page, picture) for picture in pictures]
    assert after[0] == after[1]
    assert after[0][1] < before[1]
    for _ in range(40):
        page.keyboard.press("ArrowRight")
    width = page.evaluate("document.querySelector('#view-1-case-1 .frame').clientWidth")
    assert _zoom(page, pictures[0])[1] == pytest.approx(-width, abs=1.0)  # no farther than the picture reaches
    page.keyboard.press("0")
    assert _zoom(page, pictures[0]) == [1.0, 0.0, 0.0]


def test_dragging_pans_and_a_click_opens_the_case(page: Page) -> None:
    frame = page.locator("#view-1-case-2 .frame")
    frame.scroll_into_view_if_needed()
    page.locator("#view-1 .zoom button[data-zoom=in]").click()
    frame.scroll_into_view_if_needed()
    box: Any = frame.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = _zoom(page, "#view-1-case-1 .frame > img")
    page.mouse.move(*middle)
    page.mouse.down()
    page.mouse.move(middle[0] + 30, middle[1] + 20, steps=3)
    page.mouse.up()
    assert not page.locator("dialog[open]").count()
    after = _zoom(page, "#view-1-case-1 .frame > img")
    assert (after[1] - before[1], after[2] - before[2]) == pytest.approx((30.0, 20.0), abs=1.5)
    page.mouse.click(*middle)
    assert page.locator("#case-title").inner_text() == page.locator("#view-1-case-2 .open").inner_text()
    page.keyboard.press("Escape")
    page.locator("#view-1 .zoom button[data-zoom=all]").click()


_screens: dict[Page, CDPSession] = {}


def _touch(page: Page, kind: str, *points: tuple[float, float]) -> None:
    """Let fingers do something, all of them at once, as the browser's own touch screen would."""
    if page not in _screens:  # a session of its own for every touch would forget the fingers that are down
        _screens[page] = page.context.new_cdp_session(page)
    touched = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
    _screens[page].send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touched})


def _pinch(page: Page, middle: tuple[float, float], *apart: float, moved: tuple[float, float] = (0.0, 0.0)) -> None:
    """Put two fingers on both sides of a place, ``apart[0]`` away from each other, and move them steadily."""
    for number, distance in enumerate(apart):
        share = number / (len(apart) - 1)
        x, y = middle[0] + share * moved[0], middle[1] + share * moved[1]
        kind = "touchStart" if number == 0 else "touchMove"
        _touch(page, kind, (x - distance / 2, y), (x + distance / 2, y))
    _touch(page, "touchEnd")


@pytest.fixture
def phone(browser: Browser, opened: Opened) -> Iterator[Page]:
    """Return the page on a telephone's touch screen."""
    context = browser.new_context(viewport={"width": 390, "height": 844}, offline=True, has_touch=True, is_mobile=True)
    context.set_default_timeout(10_000)
    complaints: list[str] = []
    page = context.new_page()
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(opened.path.as_uri())
    page.wait_for_selector("html[data-ready=yes]")
    yield page
    context.close()
    assert complaints == []


def _middle(page: Page, selector: str) -> tuple[float, float]:
    box: Any = page.locator(selector).bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def test_two_fingers_zoom_and_move_all_pictures_of_a_view(phone: Page) -> None:
    pictures = [f"#view-1-case-{number} .frame > img" for number in (1, 2)]
    phone.locator("#view-1-case-1 .frame").scroll_into_view_if_needed()
    middle = _middle(phone, "#view-1-case-1 .frame")
    before = phone.evaluate("[scrollY, visualViewport.scale]")
    _pinch(phone, middle, 60.0, 90.0, 120.0)
    zoomed = [_zoom(phone, picture) for picture in pictures]
    assert zoomed[0] == zoomed[1]
    width, height = phone.evaluate(
        "(f => [f.clientWidth, f.clientHeight])(document.querySelector('#view-1-case-1 .frame'))"
    )
    # twice as large, and what was under the fingers' middle still is
    assert zoomed[0] == pytest.approx([2.0, -width / 2, -height / 2], abs=1.0)
    _pinch(phone, middle, 80.0, 80.0, 80.0, moved=(30.0, 20.0))
    assert _zoom(phone, pictures[0]) == pytest.approx([2.0, 30.0 - width / 2, 20.0 - height / 2], abs=1.0)
    _touch(phone, "touchStart", middle)
    _touch(phone, "touchMove", (middle[0] - 15.0, middle[1]))
    _touch(phone, "touchMove", (middle[0] - 30.0, middle[1] - 20.0))
    _touch(phone, "touchEnd")
    assert _zoom(phone, pictures[1]) == pytest.approx([2.0, -width / 2, -height / 2], abs=1.0)
    assert phone.evaluate("[scrollY, visualViewport.scale]") == before  # the page itself stayed where it was
    assert not phone.locator("dialog[open]").count()
    _pinch(phone, middle, 120.0, 60.0, 20.0)
    assert _zoom(phone, pictures[0]) == [1.0, 0.0, 0.0]


def test_one_finger_scrolls_the_page_over_a_whole_picture_and_a_tap_opens_the_case(phone: Page) -> None:
    phone.locator("#view-1-case-1 .frame").scroll_into_view_if_needed()
    middle = _middle(phone, "#view-1-case-1 .frame")
    before = phone.evaluate("scrollY")
    _touch(phone, "touchStart", middle)
    for step in range(1, 9):
        _touch(phone, "touchMove", (middle[0], middle[1] - 20.0 * step))
    _touch(phone, "touchEnd")
    phone.wait_for_function(f"scrollY > {before} + 50")
    assert not phone.locator("dialog[open]").count()
    phone.locator("#view-1-case-1 .frame").scroll_into_view_if_needed()
    phone.touchscreen.tap(*_middle(phone, "#view-1-case-1 .frame"))
    assert phone.locator("#case-title").inner_text() == phone.locator("#view-1-case-1 .open").text_content()
    stage = "#case-stage .frame"
    phone.locator(stage).scroll_into_view_if_needed()
    _pinch(phone, _middle(phone, stage), 40.0, 80.0, 120.0)
    assert _zoom(phone, f"{stage} > img")[0] == pytest.approx(3.0, rel=0.02)


def test_a_case_opens_by_keyboard_and_holds_everything(page: Page) -> None:
    page.locator("#view-1-case-1 .open").focus()
    page.keyboard.press("Enter")
    case = page.locator("#case")
    text = case.inner_text()
    for words in ("Times", "Stages", "Quality", "depth map", "shadowbench run --scene box-on-plane", "In full size"):
        assert words in text
    assert page.evaluate("document.activeElement.id") == "case-close"
    page.locator("#case-after").click()
    assert page.locator("#case-title").inner_text() == page.locator("#view-1-case-2 .open").text_content()
    page.locator("#case-stage").focus()
    page.keyboard.press("+")
    assert _zoom(page, "#case-stage .frame > img")[0] == 1.5
    page.keyboard.press("0")
    page.locator("#case-close").click()
    assert not page.locator("dialog[open]").count()


def test_a_case_that_failed_says_why(page: Page) -> None:
    page.get_by_role("button", name="broken", exact=True).click()
    assert page.locator("#case-reason").inner_text() == "a fault"
    assert "the end" in page.locator("#case-facts pre").inner_text()
    assert not page.locator("#case-stage").is_visible()


def test_a_point_of_cost_against_quality_opens_its_picture(page: Page) -> None:
    point = page.locator("#cost-and-quality a.mark").first
    anchor = (point.get_attribute("href") or "").removeprefix("#")
    point.locator(".dot").click()
    assert page.locator("#case-title").inner_text() == page.locator(f"#{anchor} .open").inner_text()
    assert page.locator("#case-stage .frame img").first.is_visible()


def test_the_command_of_a_case_is_copied_or_selected(page: Page) -> None:
    _open_case(page)
    page.locator("#case-copy").click()
    page.locator("#case-copied:not(:empty)").wait_for()
    assert page.locator("#case-copied").inner_text().startswith(("copied", "selected"))


def test_colours_are_chosen_and_stay_chosen(opened: Opened, page: Page) -> None:
    paper = "getComputedStyle(document.body).backgroundColor"
    seen = []
    for _ in range(3):
        page.locator("#theme").click()
        seen.append((page.locator("#theme").inner_text(), page.evaluate(paper)))
    assert [text for text, _ in seen] == ["Colours: light", "Colours: dark", "Colours: as the system"]
    assert seen[0][1] != seen[1][1]
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(paper) == seen[1][1]
    page.emulate_media(color_scheme="light")
    assert page.evaluate(paper) == seen[0][1]


def test_rows_and_tables_are_saved_as_files(page: Page, tmp_path: Path) -> None:
    for name, link in (
        ("rows", page.get_by_role("link", name="All rows as CSV")),
        ("table", page.locator("main .downloads a").first),
    ):
        with page.expect_download() as saving:
            link.click()
        saving.value.save_as(tmp_path / name)
        assert saving.value.suggested_filename.endswith(".csv")
    lines = list(csv.DictReader(io.StringIO((tmp_path / "rows").read_text(encoding="utf-8"))))
    assert len(lines) == CASES
    assert (tmp_path / "table").read_text(encoding="utf-8").startswith("resolution,")


def test_every_control_has_a_name_and_every_picture_a_text(page: Page) -> None:
    _open_case(page)
    unnamed = page.evaluate(
        """[...document.querySelectorAll("button, select, input, summary, [role=group], [role=region], a")].filter(e =>
            !(e.getAttribute("aria-label") || e.getAttribute("aria-labelledby") || e.textContent.trim() ||
              e.labels?.length)).map(e => e.outerHTML.slice(0, 120))"""
    )
    assert unnamed == []
    assert page.locator("img:not([alt])").count() == 0


def test_the_skip_link_leads_to_the_results(page: Page) -> None:
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
    page.locator(".skip-link").focus()
    assert page.locator(".skip-link").is_visible()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"


def test_printing_puts_every_picture_in(opened: Opened, page: Page, tmp_path: Path) -> None:
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("#view-1 .frame img[src]").count() > CASES
    assert not page.locator("nav").is_visible()
    page.emulate_media(media="screen")


def test_without_scripts_figures_and_charts_are_there(browser: Browser, opened: Opened) -> None:
    context = browser.new_context(java_script_enabled=False, offline=True)
    plain = context.new_page()
    plain.goto(opened.path.as_uri())
    assert "Scripts are switched off" in plain.locator("noscript").inner_text()
    assert plain.locator("svg.chart").count() > 2
    assert plain.locator("#view-1-case-1 .headline").is_visible()
    context.close()


def test_a_tables_line_opens_its_case_by_keyboard_and_by_a_click_anywhere(page: Page) -> None:
    line = page.locator("table.sortable tbody tr").nth(1)
    link = line.locator("a.case").first
    anchor = (link.get_attribute("href") or "").removeprefix("#")
    title = page.locator(f"#{anchor} .open").text_content()
    link.focus()
    page.keyboard.press("Enter")
    assert page.locator("#case-title").inner_text() == title
    page.keyboard.press("Escape")
    assert link.evaluate("element => element === document.activeElement")  # one goes on where one was
    link.locator("xpath=ancestor::td | ancestor::th").first.click(position={"x": 3, "y": 3})
    page.wait_for_selector("dialog[open]")
    assert page.locator("#case-title").inner_text() == title
    page.keyboard.press("Escape")
    line.locator("td:has(a.case)").last.click(position={"x": 3, "y": 3})
    page.wait_for_selector("dialog[open]")
    opened = page.locator("#case-title").inner_text()
    last = line.locator("a.case").last.get_attribute("href") or ""
    assert opened == page.locator(f"{last} .open").text_content()

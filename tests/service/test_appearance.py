"""How pages look in a browser: on a telephone and on a desk, light and dark, by touch and by keyboard.

Faults are computed from the page as laid out: what reaches out of the window, text that is too pale, pictures out of
shape, controls too small for a finger, a focus that nobody sees.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright
from service.live import Live, serving
from service.test_browser import BROWSER
from stored_rows import png, some_row, some_run, with_pictures

from shadowbench.store import Store

pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")]

FAULTS = Path(__file__).with_name("appearance.js").read_text(encoding="utf-8")

EXPERIMENTS = ["quick", *(f"someone-and-another-2008-figure-{number}" for number in range(12))]

LONG = "a technique whose parameters have long names and many of them"

PAGES = {
    "runs": "/runs",
    "runs found": "/runs?q=run-1&experiment=quick",
    "no run found": "/runs?q=nothing",
    "run": "/runs/run-1",
    "report": "/runs/run-1/report",
    "claims": "/runs/run-1/claims",
    "case": "/runs/run-1/cases/pcf-1",
    "failed case": "/runs/run-1/cases/esm-1",
    "experiments": "/experiments",
    "leaderboard": "/experiments/quick",
    "methods": "/methods",
    "history": "/methods/pcf",
    "machines": "/machines",
    "choosing": "/compare",
    "comparison": "/compare?a=run-0&b=run-3",
    "nowhere": "/nothing",
    "api": "/api/docs",
}


def _claim(name: str, relation: str) -> dict[str, object]:
    test = {"value": "failure_percent", "of": {"method": "pcf"}, "relation": relation, "over": "resolution"}
    return {"name": name, "statement": f"{LONG} is better", "source": "Someone 2008, section 3", "tests": [test]}


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("seen") / "results"
    definition = {"name": "quick", "title": "Quick", "claims": [_claim("a", "growing"), _claim("b", "falling")]}
    with Store.open(folder) as store:
        for number in range(4):
            own = {
                "run_id": f"run-{number}",
                "machine": f"A processor with a long name, {2 + number // 2} cores, 24 GiB, Linux x86_64",
                "code_version": f"0.1.{number // 2}+0123456789.changed",
            }
            run = some_run(**own, experiments=EXPERIMENTS, definitions=[definition], case_count=13)
            store.start_run(run)
            own |= {"measured_at": f"2026-01-0{number + 1}T00:00:00+00:00"}
            for place in range(10):
                parameters = {"resolution": 256 << place, "application": "volumes", "classification": "threshold"}
                row = some_row("pcf", **own, method_parameters=parameters, failure_percent=1.0 + number + place)
                row = with_pictures(store, row, (800, 600)) if place == 0 else row
                row = row.model_copy(update={"case_key": "pcf-1" if place == 0 else f"pcf-{place + 1}"})
                wide = {"picture-shadow map": store.put_artifact(png(1, size=(1000, 90)), "png")} if place == 0 else {}
                counters, stages = {"texels drawn into the map": 10**9 + number}, {"building of the map": 1.5}
                more = {"artifacts": row.artifacts | wide, "counters": counters, "stages": stages}
                store.add_row(row.model_copy(update=more))
            trouble = {"outcome": "crash", "reason": LONG, "stderr_tail": "x" * 400, "warnings": [LONG * 2]}
            store.add_row(some_row("esm", **own, **trouble, case_key="esm-1"))
            store.add_row(some_row("vsm", **own, outcome="skipped", reason=LONG, case_key="vsm-1"))
            store.add_row(some_row(f"only-{number}", **own, experiment=EXPERIMENTS[-1]))
    with serving(folder, "--rate", "0") as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
        opened = playwright.chromium.launch(executable_path=BROWSER, args=options)
        yield opened
        opened.close()


@pytest.fixture(
    scope="module",
    params=[(1280, "light"), (1280, "dark"), (390, "light"), (390, "dark")],
    ids=["desk, light", "desk, dark", "telephone, light", "telephone, dark"],
)
def window(browser: Browser, request: pytest.FixtureRequest) -> Iterator[BrowserContext]:
    """Windows of some width; narrow ones are touched."""
    width, scheme = request.param
    narrow = width < 600
    context = browser.new_context(
        viewport={"width": width, "height": 844}, color_scheme=scheme, is_mobile=narrow, has_touch=narrow
    )
    yield context
    context.close()


@pytest.fixture(scope="module")
def telephone(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    yield context.new_page()
    context.close()


@pytest.fixture(scope="module")
def desk(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1280, "height": 844})
    yield context.new_page()
    context.close()


def _open(page: Page, address: str) -> None:
    page.goto(address)
    if address.endswith("/api/docs"):
        page.wait_for_selector(".opblock")
    page.evaluate(
        """async () => {
            for (const image of document.images) image.loading = "eager";
            await Promise.all([...document.images].map((image) => image.decode()));
        }"""
    )


@pytest.mark.parametrize("name", PAGES)
def test_a_page_fits_its_window_and_can_be_read_and_asks_nobody_else(
    live: Live, window: BrowserContext, name: str
) -> None:
    page = window.new_page()
    requests: list[str] = []
    complaints: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    _open(page, live.address + PAGES[name])
    assert page.evaluate(FAULTS) == []
    assert [url for url in requests if not url.startswith((live.address, "data:"))] == []
    assert [text for text in complaints if "status of 404" not in text or name != "nowhere"] == []
    page.close()


@pytest.mark.parametrize("name", [name for name in PAGES if name not in ("report", "api")])
def test_controls_are_large_enough_for_a_finger(live: Live, telephone: Page, name: str) -> None:
    _open(telephone, live.address + PAGES[name])
    small = telephone.evaluate(
        """() => [...document.querySelectorAll("button, select, input, summary, nav a, .elsewhere a, .names a")]
            .filter((control) => control.checkVisibility())
            .map((control) => [control, control.getBoundingClientRect()])
            .filter(([, box]) => box.width && (box.height < 24 || box.width < 24))
            .map(([control, box]) => `${control.outerHTML.slice(0, 80)} ${box.width}x${box.height}`)"""
    )
    assert small == []


@pytest.mark.parametrize("name", [name for name in PAGES if name not in ("report", "api")])
def test_the_focus_is_seen_wherever_the_tabulator_leads(live: Live, desk: Page, name: str) -> None:
    _open(desk, live.address + PAGES[name])
    unseen = []
    for _ in range(40):
        desk.keyboard.press("Tab")
        found = desk.evaluate(
            """() => {
                const style = getComputedStyle(document.activeElement);
                const box = document.activeElement.getBoundingClientRect();
                const outlined = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 1;
                const at = document.activeElement;
                return [at === document.body, outlined && box.width > 0 && box.left >= 0, at.outerHTML.slice(0, 80)];
            }"""
        )
        if found[0]:
            break
        if not found[1]:
            unseen.append(found[2])
    assert unseen == []


def test_two_runs_are_chosen_from_all_that_there_are(live: Live, desk: Page) -> None:
    _open(desk, live.address + "/runs")
    desk.click("text=Compare any two runs")
    offered = desk.eval_on_selector_all("#known-runs option", "options => options.map((option) => option.value)")
    assert sorted(offered) == [f"run-{number}" for number in range(4)]
    desk.fill("[name=a]", "run-0")
    desk.fill("[name=b]", "run-3")
    desk.click("main button[type=submit]")
    assert desk.url == f"{live.address}/compare?a=run-0&b=run-3"
    assert desk.text_content("h1") == "From run-0 to run-3"
    desk.click("text=Swap A and B")
    assert desk.text_content("h1") == "From run-3 to run-0"
    desk.click("text=Choose other runs")
    assert desk.input_value("[name=a]") == "run-3"


def test_a_long_table_is_narrowed_by_words_and_its_first_column_stays(live: Live, telephone: Page) -> None:
    _open(telephone, live.address + "/runs/run-1")
    telephone.fill("#cases .filter", "esm")
    assert telephone.eval_on_selector_all("#all-cases tbody tr:not([hidden])", "rows => rows.length") == 1
    moved = telephone.evaluate(
        """() => {
            const heading = document.querySelector("#all-cases tbody tr:not([hidden]) th");
            const before = heading.getBoundingClientRect().left;
            heading.closest(".scroll").scrollLeft = 300;
            return [heading.closest(".scroll").scrollLeft, heading.getBoundingClientRect().left - before];
        }"""
    )
    assert moved[0] > 0
    assert abs(moved[1]) <= 2


def test_the_many_experiments_of_a_run_are_folded(live: Live, desk: Page) -> None:
    _open(desk, live.address + "/runs")
    folded = desk.locator("tbody tr").first.locator("details")
    assert folded.locator("summary").text_content() == f"{len(EXPERIMENTS)} experiments"
    link = folded.locator("a", has_text=EXPERIMENTS[-1])
    assert not link.is_visible()
    folded.locator("summary").click()
    assert link.get_attribute("href") == f"/experiments/{quote(EXPERIMENTS[-1])}"
    assert link.is_visible()

"""The page as a whole: well-formed, closed to the network, and safe whatever the rows say."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from stored_rows import png, some_row, with_masks, with_pictures

from shadowbench import report
from shadowbench.errors import UsageError
from shadowbench.pictures import FAILURE_COLOURS
from shadowbench.report.embedding import picture_budget
from shadowbench.report.page import LEGEND
from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus
from shadowbench.store import Store

Add = Callable[..., ResultRow]

HOSTILE = "<script>alert('x')</script>\"'&{{ 7*7 }}\x1b[31m\u202ered\x00"
VOID = {"meta", "img", "br", "link", "input", "hr"}


class Reader(HTMLParser):
    """Collects elements and text, and demands that every element is closed where it should be."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.scripts: list[str] = []
        self.json: dict[str, Any] = {}
        self.styles: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))  # <circle/>

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open, f"</{tag}> closes nothing"
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            attributes = self.elements[-1][1]
            if attributes.get("type") == "application/json":
                self.json[attributes["id"] or ""] = json.loads(data)
            else:
                self.scripts.append(data)
        elif self.open and self.open[-1] == "style":
            self.styles.append(data)
        else:
            self.text += data


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    return reader


def test_page_is_well_formed_with_every_outcome(store: Store, run: RunRecord, add: Add) -> None:
    for outcome in Outcome:
        add(f"method-{outcome.value}", outcome=outcome, reason=f"because of {outcome.value}", pictures=outcome == "ok")
    reader = read(report.html(store, run))
    for outcome in Outcome:
        assert f"method-{outcome.value}" in reader.text
        assert f"because of {outcome.value}" in reader.text
    identifiers = [attributes["id"] for _, attributes in reader.elements if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    linked = {a["href"] for tag, a in reader.elements if tag == "a" and "download" not in a}
    assert linked <= {f"#{identifier}" for identifier in identifiers}


def test_run_without_rows_has_a_page(store: Store, run: RunRecord) -> None:
    assert "No case has been measured" in read(report.html(store, run)).text


def test_page_loads_nothing(store: Store, run: RunRecord, add: Add) -> None:
    add(pictures=True)
    page = report.html(store, run)
    reader = read(page)
    for tag, attributes in reader.elements:
        for name in ("src", "href", "srcset", "data", "action", "poster", "xlink:href"):
            address = attributes.get(name) or ""
            is_download = "download" in attributes and address.startswith("data:")
            assert address == "" or address.startswith("#") or is_download, (tag, name)
    assert all(address.startswith("data:image/") for address in reader.json["page-pictures"].values())
    assert "http://" not in page
    assert "https://" not in page
    assert not re.search(r"url\(|@import", "".join(reader.styles))
    assert all("style" not in attributes for _, attributes in reader.elements)


def test_policy_admits_only_the_pages_own_style_and_script(store: Store, run: RunRecord, add: Add) -> None:
    add()
    reader = read(report.html(store, run))
    policy = next(a["content"] or "" for _, a in reader.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy
    for texts, directive in ((reader.scripts, "script-src"), (reader.styles, "style-src")):
        digest = base64.b64encode(hashlib.sha256("".join(texts).encode()).digest()).decode()
        assert f"{directive} 'sha256-{digest}'" in policy


def test_hostile_text_appears_as_text(store: Store, run: RunRecord, add: Add) -> None:
    names = dict.fromkeys(("method", "method_title", "scene", "light", "camera", "reason", "stderr_tail"), HOSTILE)
    add(**names, outcome="error", warnings=[HOSTILE], method_parameters={HOSTILE: HOSTILE}, self_hit=HOSTILE)
    add(counters={HOSTILE: 1}, stages={HOSTILE: 1.0}, kept={HOSTILE: 1}, scene_parameters={HOSTILE: HOSTILE})
    hostile_run = run.model_copy(
        update={"title": HOSTILE, "argv": [HOSTILE], "machine": HOSTILE, "environment": {HOSTILE: {HOSTILE: HOSTILE}}}
    )
    page = report.html(store, hostile_run)
    reader = read(page)
    assert len(reader.scripts) == 1
    assert [tag for tag, _ in reader.elements].count("script") == 3
    assert all("<" not in text for text in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', page))
    assert "alert('x')" in reader.text
    assert "{{ 7*7 }}" in reader.text
    for text in (page, json.dumps(reader.json, ensure_ascii=False)):
        assert not set(text) & {"\x1b", "\u202e", "\x00"}
    assert not {name for _, attributes in reader.elements for name in attributes if name.startswith("on")}


def test_very_long_reason_is_cut(store: Store, run: RunRecord, add: Add) -> None:
    add(outcome="error", reason="long " * 100_000, stderr_tail="line\n" * 100_000)
    assert len(report.html(store, run)) < 100_000


def test_size_is_bounded_for_many_noisy_pictures(store: Store, run: RunRecord, monkeypatch: pytest.MonkeyPatch) -> None:
    budget = 400_000
    monkeypatch.setattr("shadowbench.report.embedding.PICTURE_BYTES", budget)
    for _ in range(4):
        store.add_row(with_pictures(store, some_row(), size=(640, 480)))
    pictures = [len(address) for address in read(report.html(store, run)).json["page-pictures"].values()]
    assert len(pictures) == 5
    assert budget / 2 < sum(pictures) < 4 / 3 * budget + 1000


def test_reference_is_embedded_once_a_view(store: Store, run: RunRecord, add: Add) -> None:
    for method in ("pcf", "esm", "vsm"):
        add(method, pictures=True)
    add("pcf", pictures=True, experiment="another")
    content = read(report.html(store, run)).json
    (view,) = content["page-content"]["views"]
    assert len(content["page-pictures"]) == len({case["result"] for case in view["cases"]} | {view["reference"]}) == 5


def test_lost_picture_is_said_in_its_place(store: Store, run: RunRecord, add: Add) -> None:
    row = add(pictures=True)
    for name in row.artifacts.values():
        store.artifacts.path(name).write_bytes(b"")
    reader = read(report.html(store, run))
    assert reader.json["page-pictures"] == {}
    assert "No picture was kept" in reader.text
    assert "The picture is lost" in reader.text


def test_a_report_of_500_cases_and_40_methods_stays_within_15_megabytes(
    store: Store, run: RunRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    budget = 500_000
    monkeypatch.setattr("shadowbench.report.embedding.PICTURE_BYTES", budget)
    own = {"picture-depth map": store.put_artifact(png(1, size=(256, 256)), "png")}
    stages = {f"stage {number} of the method": 1.5 for number in range(8)}
    rows = [
        some_row(
            f"method-{number % 40}",
            scene=f"scene-{number // 40}",
            stages=stages,
            counters=dict.fromkeys((f"counter {k}" for k in range(8)), 123_456),
            camera_ms=1.0,
            warnings=["95 % interval wider than 5 %"],
            run_id=run.run_id,
        )
        for number in range(500)
    ]
    for row in rows:
        store.add_row(row.model_copy(update={"artifacts": own}))
    page = report.html(store, run)
    pictures = json.dumps(read(page).json["page-pictures"])
    monkeypatch.undo()
    allowed = 15_000_000 - 4 / 3 * picture_budget(500)  # what the real budget for pictures leaves
    assert len(page) - len(pictures) < allowed


def test_interrupted_run_says_what_is_missing(store: Store, run: RunRecord, add: Add) -> None:
    add()
    partial = run.model_copy(update={"status": RunStatus.INTERRUPTED, "case_count": 5})
    text = read(report.html(store, partial)).text
    assert "interrupted" in text
    assert "4 of 5 planned cases have not been measured" in text


def test_write_replaces_the_file_and_leaves_nothing_beside_it(store: Store, run: RunRecord, tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "page.html"
    report.write(store, run, path)
    assert report.write(store, run, path) == path
    assert path.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert [entry.name for entry in path.parent.iterdir()] == ["page.html"]


def test_pictures_in_full_size_lie_in_a_folder_beside_the_page(
    store: Store, run: RunRecord, add: Add, tmp_path: Path
) -> None:
    row = add(pictures=True)
    path = tmp_path / "a page #1.html"
    report.write(store, run, path)
    (view,) = read(path.read_text(encoding="utf-8")).json["page-content"]["views"]
    (case,) = view["cases"]
    assert [name for name, _ in case["files"]] == ["result", "failures"]
    assert case["files"][0][1] == "a%20page%20%231-pictures/view-1-case-1-result.png"
    folder = tmp_path / "a page #1-pictures"
    assert (folder / "view-1-case-1-result.png").read_bytes() == store.artifact(row.artifacts["result"])
    assert (folder / "view-1-reference.png").read_bytes() == store.artifact(row.artifacts["reference"])


def test_the_folder_keeps_what_others_put_there_and_loses_what_an_earlier_report_did(
    store: Store, run: RunRecord, add: Add, tmp_path: Path
) -> None:
    folder = tmp_path / "page-pictures"
    folder.mkdir()
    for name in ("view-9-case-9-result.png", "notes.txt"):
        (folder / name).write_text("old")
    add(pictures=True)
    report.write(store, run, tmp_path / "page.html")
    names = {entry.name for entry in folder.iterdir()}
    assert "notes.txt" in names
    assert "view-9-case-9-result.png" not in names
    assert "view-1-case-1-failures.png" in names


def test_a_pivots_groups_stand_once_above_their_columns(store: Store, run: RunRecord, add: Add) -> None:
    for resolution in (256, 512):
        add(method_parameters={"resolution": resolution})
    layout = {"title": "T", "index": ["method"], "columns": "resolution", "values": ["build_ms", "shade_ms"]}
    pivoted = run.model_copy(update={"definitions": [{"name": "quick", "tables": [layout]}]})
    page = report.html(store, pivoted)
    groups = [a["colspan"] for tag, a in read(page).elements if tag == "th" and a.get("scope") == "colgroup"]
    assert groups == ["2", "2"]
    assert page.count("resolution=512</th>") == 1


def _case_links(page: str) -> list[tuple[str | None, str | None]]:
    found = (a for tag, a in read(page).elements if tag == "a" and a.get("class") == "case")
    return [(a["href"], a.get("aria-label")) for a in found]


def test_a_line_of_a_table_links_to_its_case(store: Store, run: RunRecord, add: Add) -> None:
    add("pcf")
    add("esm", outcome=Outcome.CRASH, reason="a fault")
    page = report.html(store, run)
    assert _case_links(page) == [("#view-1-case-1", None), ("#view-1-case-2", None)]
    assert '<th scope="row" data-value="pcf"><a class="case" href="#view-1-case-1">pcf</a></th>' in page


def test_a_line_of_several_cases_links_to_each_by_its_first_value(store: Store, run: RunRecord, add: Add) -> None:
    for resolution in (256, 512):
        add(method_parameters={"resolution": resolution}, build_ms=None if resolution == 512 else 1.0)
    layout = {"title": "T", "index": ["method"], "columns": "resolution", "values": ["build_ms", "shade_ms"]}
    pivoted = run.model_copy(update={"definitions": [{"name": "quick", "tables": [layout]}]})
    links = _case_links(report.html(store, pivoted))
    assert [href for href, _ in links] == ["#view-1-case-1", "#view-1-case-2"]
    (_, first), (_, second) = links
    assert first is not None
    assert second is not None
    assert first.endswith(", pcf(resolution=256)")
    assert second == "1.50, pcf(resolution=512)"  # there is no build time to link


def test_claims_stand_with_their_experiment(store: Store, run: RunRecord, add: Add) -> None:
    add()
    test = {"value": "shade_ms", "of": {"method": "esm"}, "relation": "less than", "number": 1.0}
    claim = {"name": "c", "statement": "It is so <b>always</b>.", "source": "Someone 2001", "tests": [test]}
    claiming = run.model_copy(update={"definitions": [{"name": "quick", "title": "A look", "claims": [claim]}]})
    text = read(report.html(store, claiming)).text
    assert "It is so <b>always</b>." in text
    assert "undecided" in text


def test_a_stored_claim_that_cannot_be_read_costs_the_claims_only(store: Store, run: RunRecord, add: Add) -> None:
    add()
    claiming = run.model_copy(update={"definitions": [{"name": "quick", "claims": [{"name": "c"}]}]})
    text = read(report.html(store, claiming)).text
    assert "The claims cannot be answered" in text
    assert "pcf" in text


def test_masks_travel_once_as_palette_pictures(store: Store, run: RunRecord) -> None:
    store.add_row(with_masks(store, with_pictures(store, some_row()), false_lit=(3, 4), acne=(5, 6)))
    content = read(report.html(store, run)).json
    ((case,),) = [view["cases"] for view in content["page-content"]["views"]]
    assert content["page-pictures"][str(case["mask"])].startswith("data:image/png;base64,")


def test_unwritable_path_is_a_usage_error(store: Store, run: RunRecord, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        report.write(store, run, tmp_path)
    assert not [entry for entry in tmp_path.parent.iterdir() if str(os.getpid()) in entry.name]


def test_legend_explains_every_colour_of_the_pictures() -> None:
    assert {name for name, _, _ in LEGEND} == {name.replace("_", " ") for name in FAILURE_COLOURS}


def test_report_needs_no_warp() -> None:
    import subprocess
    import sys

    code = "import sys, shadowbench.report.page, shadowbench.report.summary; sys.exit('warp' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

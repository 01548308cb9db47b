"""Publishing a run and holding the code to it, and the results that this project publishes."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import once_a_session
import pytest
from PIL import Image

from shadowbench.cli import main
from shadowbench.errors import UsageError
from shadowbench.experiment import builtin_names
from shadowbench.inspection.opening import open_case
from shadowbench.publication.folder import read_rows, read_sample

PROJECT_RESULTS = Path(__file__).parents[2] / "results"


def _publish(folder: Path) -> None:
    results, to = folder / "store", folder / "pages"
    choices = ["--scene", "box-on-plane", "--size", "96x72", "--budget", "0.2", "--threads", "1"]
    methods = ["--method", "shadow-map:resolution=128", "--method", "vsm:resolution=128", "--method", "instanced"]
    assert main(["run", *choices, *methods, "--results", str(results), "--json"]) == 0
    assert main(["publish", "latest", "--results", str(results), "--to", str(to)]) == 0


@pytest.fixture(scope="module")
def published() -> Path:
    """A small run, published once a test session and only read."""
    return once_a_session.made("published", _publish) / "pages"


@pytest.fixture
def copy(published: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    import shutil

    return Path(shutil.copytree(published, tmp_path / "copy"))


def _verified(folder: Path, capfd: pytest.CaptureFixture[str]) -> tuple[int, list[str]]:
    capfd.readouterr()
    status = main(["verify", str(folder)])
    return status, [line for line in capfd.readouterr().out.splitlines() if line.startswith("moved")]


def _edit(folder: Path, method: str, column: str, change: Callable[[str], str]) -> None:
    (file,) = folder.glob("*/rows.csv")
    with file.open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    for line in lines:
        if line["method"] == method:
            line[column] = change(line[column])
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, lines[0].keys())
        writer.writeheader()
        writer.writerows(lines)


def _brighten(folder: Path, method: str, by: int) -> None:
    (row,) = (row for row in read_rows(folder) if row.method == method)
    file = folder / "visibility" / f"{row.case_key}.png"
    levels = np.asarray(Image.open(file)).astype(np.int16)
    dark = levels < 200
    assert dark.any()
    levels[dark] += by
    Image.fromarray(levels.astype(np.uint8)).save(file)


def test_what_was_just_published_verifies(published: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert _verified(published, capfd) == (0, [])
    assert len(read_sample(published)) == 3


def test_a_counter_that_moved_is_named_with_its_case(copy: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def one_more(text: str) -> str:
        counters = json.loads(text)
        name = next(iter(counters))
        return json.dumps(counters | {name: counters[name] + 1})

    _edit(copy, "vsm", "counters", one_more)
    status, moved = _verified(copy, capfd)
    assert status == 1
    assert len(moved) == 1
    assert "vsm(" in moved[0]
    assert re.search(r"counter '.+' is \d+, was \d+", moved[0])


def test_hard_visibility_is_held_to_the_bit(copy: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _edit(copy, "shadow-map", "visibility_digest", lambda text: text[::-1])
    status, moved = _verified(copy, capfd)
    assert status == 1
    assert [("shadow-map(" in line, "hard visibility has other bits" in line) for line in moved] == [(True, True)]


@pytest.mark.parametrize(("by", "is_refused"), [(1, False), (2, True)])
def test_filtered_visibility_is_held_to_one_level(
    copy: Path, capfd: pytest.CaptureFixture[str], by: int, is_refused: bool
) -> None:
    _edit(copy, "vsm", "visibility_digest", lambda text: text[::-1])
    _brighten(copy, "vsm", by)
    status, moved = _verified(copy, capfd)
    assert status == int(is_refused)
    assert any("differs by up to 2/255" in line for line in moved) is is_refused


def test_the_page_shows_tables_pictures_and_no_folder_of_this_machine(published: Path) -> None:
    (page,) = published.glob("*/README.md")
    text = page.read_text(encoding="utf-8")
    assert "## Tables" in text
    for picture in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        with Image.open(page.parent / picture) as image:
            assert image.width > image.height
    for file in (*published.rglob("*.md"), *published.rglob("*.csv"), *published.rglob("*.json")):
        assert str(published.parent) not in file.read_text(encoding="utf-8")


def test_nothing_but_published_pages_is_replaced(published: Path, tmp_path: Path) -> None:
    results = published.parent / "store"
    (tmp_path / "ad-hoc").mkdir()
    (tmp_path / "ad-hoc" / "thesis.tex").write_text("years of work", encoding="utf-8")
    assert main(["publish", "latest", "--results", str(results), "--to", str(tmp_path)]) == 2
    assert [file.name for file in tmp_path.rglob("*") if file.is_file()] == ["thesis.tex"]


def test_a_run_of_other_code_is_not_published(published: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = open_case

    def changed(*arguments: Any, **options: Any) -> Any:
        return replace(real(*arguments, **options), digest="other")

    monkeypatch.setattr("shadowbench.publication.holding.open_case", changed)
    results = published.parent / "store"
    assert main(["publish", "latest", "--results", str(results), "--to", str(tmp_path / "to")]) == 2


def test_without_a_run_every_experiment_is_measured_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "small.toml"
    file.write_text(
        'title = "S"\nbudget = 0.2\n[[comparison]]\nscene = "box-on-plane"\nmethod = "shadow-map"\nsize = "64x48"\n',
        encoding="utf-8",
    )
    monkeypatch.setattr(
        "shadowbench.experiment_groups.expanded", lambda names: [str(file)] if names == ("all",) else []
    )
    to = tmp_path / "pages"
    assert main(["publish", "--results", str(tmp_path / "store"), "--to", str(to)]) == 0
    assert [row.method for row in read_rows(to)] == ["shadow-map"]


def test_a_damaged_row_is_named_by_file_and_line(copy: Path) -> None:
    _edit(copy, "vsm", "counters", lambda _: "{")
    with pytest.raises(UsageError, match=r"rows\.csv, line 3: this is no row"):
        read_rows(copy)


def test_a_folder_without_results_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(tmp_path)]) == 2
    assert "holds no published results" in capfd.readouterr().err


def test_the_project_publishes_every_experiment_and_can_be_held_to_it() -> None:
    rows = read_rows(PROJECT_RESULTS)
    assert {row.experiment for row in rows} == set(builtin_names())
    by_key = {row.case_key: row for row in rows}
    sample = read_sample(PROJECT_RESULTS)
    assert {by_key[key].method for key in sample} >= {"afsm", "shadow-map", "pcf", "vsm", "csm", "esm", "instanced"}
    for key, levels in sample.items():
        assert levels.shape[:2] == (by_key[key].height, by_key[key].width)


def test_the_projects_pages_link_to_what_is_there() -> None:
    for page in PROJECT_RESULTS.rglob("README.md"):
        for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page}: {target}"


def test_the_published_run_was_measured_on_a_quiet_machine() -> None:
    rows: list[Any] = read_rows(PROJECT_RESULTS)
    assert max(row.environment.get("cores_used_by_others", 0.0) for row in rows) < 0.1

"""Pages, and the same as JSON and CSV: what they say, how they are found and kept."""

from __future__ import annotations

import csv
import html
import io
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from service.conftest import Maker, Service
from stored_rows import some_row, some_run

from shadowbench.service.site import write_site
from shadowbench.service.standings import LINES_A_PAGE

PATHS = (
    "/runs",
    "/runs/run-1",
    "/runs/run-1/cases/pcf-1",
    "/experiments",
    "/experiments/quick",
    "/methods",
    "/machines",
)
"""Pages of a filled service; each is there as JSON and CSV too."""


def test_the_service_and_its_command_import_no_warp(tmp_path: Path) -> None:
    program = (
        "import sys, pathlib; from shadowbench.service.app import create_app; from shadowbench.service.settings import"
        " Settings; create_app(Settings(results=pathlib.Path(sys.argv[1]))); import shadowbench.service.serving,"
        " shadowbench.service.site, shadowbench.service.client; print('warp' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout.split() == ["False"]


def test_help_imports_no_fastapi() -> None:
    program = (
        "import sys; from shadowbench.cli import main; main(['--help']);"
        "sys.exit(any(name in sys.modules for name in ('fastapi', 'uvicorn', 'jinja2', 'sqlalchemy')))"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("path", PATHS)
def test_every_page_is_there_as_json_and_csv_and_under_the_api(filled: Service, path: str) -> None:
    page = filled.client.get(path)
    assert page.status_code == 200
    assert page.headers["content-type"].startswith("text/html")
    assert page.text.count("<h1>") == 1
    assert f'href="{path}.json"' in page.text
    found = filled.client.get(path + ".json")
    assert found.headers["content-type"] == "application/json"
    lines = list(csv.reader(io.StringIO(filled.client.get(path + ".csv").text)))
    assert len({len(line) for line in lines}) == 1
    api = f"/api/v1{path}" + ("/leaderboard" if path == "/experiments/quick" else "")
    assert filled.client.get(api).json() == found.json()


def test_runs_are_listed_newest_first_and_found_by_their_facets(filled: Service) -> None:
    def found(**query: str) -> list[str]:
        return [run["run_id"] for run in filled.client.get("/runs.json", params=query).json()["runs"]]

    assert found() == ["run-2", "run-1", "run-0"]
    assert found(machine="beta") == ["run-1"]
    assert found(code_version="1.0") == ["run-1", "run-0"]
    assert found(experiment="quick", method="esm") == ["run-2", "run-1", "run-0"]
    assert found(method="vsm") == []
    assert found(q="rUn <1") == ["run-1"]
    assert found(q="BETA") == ["run-1"]
    assert found(status="complete", machine="alpha") == ["run-2", "run-0"]
    first = filled.client.get("/runs.json", params={"limit": 2}).json()
    assert (first["next"], first["total"]) == ("run-1", 3)
    second = filled.client.get("/runs.json", params={"limit": 2, "after": first["next"]}).json()
    assert [run["run_id"] for run in second["runs"]] == ["run-0"]
    assert second["next"] is None
    assert first["runs"][0]["outcomes"] == {"ok": 2}


def test_a_leaderboard_has_quality_by_version_and_times_of_one_machine(filled: Service) -> None:
    found = filled.client.get("/experiments/quick.json", params={"machine": "alpha"}).json()
    assert found["versions"] == ["1.1", "1.0"]
    assert found["machines"] == ["alpha", "beta"]
    assert [line["technique"]["label"] for line in found["lines"]] == ["esm", "pcf"]
    pcf = found["lines"][1]
    assert pcf["quality"]["1.1"]["failure_percent"] == 3.0
    assert pcf["quality"]["1.0"]["failure_percent"] == 2.0  # the newer of the two machines'
    assert [pcf["quality"][version]["machines"] for version in ("1.0", "1.1")] == [2, 1]
    assert pcf["quality"]["1.0"]["differs"] is False
    assert {time["machine"] for time in pcf["time"].values()} == {"alpha"}
    assert {time["run_id"] for time in pcf["time"].values()} == {"run-0", "run-2"}
    falling = filled.client.get("/experiments/quick.json", params={"sort": "technique", "version": "1.0"}).json()
    assert falling["versions"] == ["1.0"]


def test_a_leaderboard_begins_with_the_view_of_most_techniques(filled: Service) -> None:
    before = filled.client.get("/experiments/quick.json").json()
    rows = [some_row(f"m{i}", run_id="wide", case_key=f"{i}", scene="wide") for i in range(len(before["lines"]) + 1)]
    filled.put(some_run(run_id="wide"), rows)
    assert filled.client.get("/experiments/quick.json").json()["view"]["scene"] == "wide"
    chosen = {"view": before["view"]["key"]}
    assert filled.client.get("/experiments/quick.json", params=chosen).json()["view"] == before["view"]


def test_a_page_shows_the_first_techniques_of_many_and_leads_to_all(service: Service) -> None:
    rows = [some_row(f"m{i:03}", case_key=f"{i}", failure_percent=float(i)) for i in range(LINES_A_PAGE + 20)]
    service.put(some_run(), rows)
    page = service.client.get("/experiments/quick").text
    assert ("/methods/m099?" in page, "/methods/m100?" in page) == (True, False)
    assert "The first 100 of 120 techniques" in page
    (link,) = re.findall(r'href="([^"]*limit=[^"]*)"', page)
    whole = service.client.get(html.unescape(link)).text
    assert ("/methods/m119?" in whole, "The first" in whole) == (True, False)
    everything = service.client.get("/experiments/quick.json").json()
    assert len(everything["lines"]) == everything["line_count"] == LINES_A_PAGE + 20
    some = service.client.get("/experiments/quick.json?limit=3").json()
    assert [line["technique"]["method"] for line in some["lines"]] == ["m000", "m001", "m002"]
    assert service.client.get("/experiments/quick?limit=0").status_code == 422


def test_machines_whose_pixels_differ_are_marked(filled: Service) -> None:
    common = {"machine": "gamma", "code_version": "1.1", "measured_at": "2026-02-01T00:00:00+00:00"}
    run = some_run(run_id="odd", machine="gamma", code_version="1.1")
    filled.put(run, [some_row("pcf", run_id="odd", visibility_digest="other", **common)])
    found = filled.client.get("/experiments/quick.json").json()
    (pcf,) = (line for line in found["lines"] if line["technique"]["method"] == "pcf")
    assert pcf["quality"]["1.1"]["differs"] is True
    assert ">differ<" in filled.client.get("/experiments/quick").text


def test_a_later_measurement_takes_an_earlier_ones_place(filled: Service) -> None:
    run = some_run(run_id="again", machine="alpha", code_version="1.1")
    row = some_row(
        "pcf",
        run_id="again",
        machine="alpha",
        code_version="1.1",
        measured_at="2026-03-01T00:00:00+00:00",
        failure_percent=9.0,
    )
    filled.put(run, [row])
    found = filled.client.get("/experiments/quick.json").json()
    (pcf,) = (line for line in found["lines"] if line["technique"]["method"] == "pcf")
    assert pcf["quality"]["1.1"]["failure_percent"] == 9.0
    assert pcf["quality"]["1.1"]["machines"] == 1


def test_a_history_marks_where_a_methods_level_changed(service: Service) -> None:
    for number in range(24):
        when = f"2026-01-{number + 1:02d}T00:00:00+00:00"
        run = some_run(run_id=f"r{number}", created_at=when, machine="alpha")
        time = (10.0 if number < 13 else 15.0) + 0.01 * (number * 7 % 5)
        row = some_row("pcf", run_id=run.run_id, machine="alpha", measured_at=when, dynamic_frame_ms=time)
        service.put(run, [row])
    found = service.client.get("/methods/pcf.json").json()
    assert len(found["points"]) == 24
    assert [change["run_id"] for change in found["changes"]] == ["r13"]
    assert found["changes"][0]["ratio"] == pytest.approx(1.5, rel=0.01)
    steady = service.client.get("/methods/pcf.json", params={"measure": "failure_percent"}).json()
    assert steady["changes"] == []
    page = service.client.get("/methods/pcf").text
    assert page.count("<circle") == 24
    assert page.count('class="change"') == 1


def test_two_runs_are_compared_case_by_case(service: Service) -> None:
    for run_id, failures, digest in (("a", 10, "x"), ("b", 12, "y")):
        row = some_row("pcf", run_id=run_id, case_key="same", failure_count=failures, visibility_digest=digest)
        service.put(some_run(run_id=run_id), [row, some_row("esm", run_id=run_id, case_key="e", visibility_digest="z")])
    found = service.client.get("/compare.json?a=a&b=b").json()
    changed = {case["method"]: case["changed"] for case in found["cases"]}
    assert "pixels" in changed["pcf"]
    assert "pixels" not in changed["esm"]
    page = service.client.get("/compare?a=a&b=b")
    assert page.status_code == 200
    assert service.client.get("/compare.json?a=a&b=missing").status_code == 404
    assert service.client.get("/compare.json?a=a").status_code == 422


def test_who_has_a_page_already_is_told_so(filled: Service) -> None:
    first = filled.client.get("/experiments/quick")
    tag = {"If-None-Match": first.headers["etag"]}
    again = filled.client.get("/experiments/quick", headers=tag)
    assert (again.status_code, again.content) == (304, b"")
    filled.put(some_run(run_id="new", machine="new"), [some_row("vsm", run_id="new", machine="new")])
    assert filled.client.get("/experiments/quick", headers=tag).status_code == 200


def test_answers_are_made_once_while_nothing_changes(filled: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    from shadowbench.service import answers

    made: list[str] = []
    real = answers.machines

    def counting(*arguments: Any) -> Any:
        made.append("machines")
        return real(*arguments)

    monkeypatch.setattr(answers, "machines", counting)
    for _ in range(3):
        filled.client.get("/machines")
    assert len(made) == 1
    filled.put(some_run(run_id="other"), [])
    filled.client.get("/machines")
    assert len(made) == 2


def test_what_is_made_of_one_run_outlives_changes_of_others(filled: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    from shadowbench.service import answers

    made: list[str] = []
    for name in ("run", "claims", "case", "compare"):
        real = getattr(answers, name)
        monkeypatch.setattr(answers, name, lambda *given, real=real, name=name: made.append(name) or real(*given))

    def ask() -> list[str]:
        made.clear()
        for path in ("/runs/run-1", "/runs/run-1/claims", "/runs/run-1/cases/pcf-1", "/compare?a=run-0&b=run-1"):
            assert filled.client.get(path).status_code == 200
        return list(made)

    assert ask() == ["run", "claims", "case", "compare"]
    assert ask() == []
    filled.put(some_run(run_id="other"), [some_row(run_id="other")])
    assert ask() == []
    row = some_row("pcf", run_id="run-1", case_key="pcf-1", failure_percent=77.5)
    assert filled.put(some_run(run_id="run-1"), [row]).json()["kept"] == "replaced"
    assert ask() == ["run", "claims", "case", "compare"]
    assert "77.5" in filled.client.get("/runs/run-1/cases/pcf-1").text


def test_answers_are_packed_for_who_can_unpack_them(filled: Service) -> None:
    packed = filled.client.get("/runs", headers={"Accept-Encoding": "gzip"})
    assert packed.headers["content-encoding"] == "gzip"
    plain = filled.client.get("/runs", headers={"Accept-Encoding": "identity"})
    assert "content-encoding" not in plain.headers
    assert packed.text == plain.text


def test_what_is_not_there_is_a_page_or_a_problem(filled: Service) -> None:
    for path in ("/runs/none", "/experiments/none", "/methods/none", "/runs/run-1/cases/none", "/nowhere"):
        page = filled.client.get(path, headers={"Accept": "text/html"})
        assert (page.status_code, page.headers["content-type"][:9]) == (404, "text/html")
        problem = filled.client.get(path)
        assert problem.headers["content-type"] == "application/problem+json"
        assert problem.json()["status"] == 404
    for path in ("/experiments/quick.json?sort=nothing", "/methods/pcf.json?measure=x", "/runs.json?limit=0"):
        assert filled.client.get(path).status_code == 422
    assert filled.client.get("/experiments/quick.json?view=none").status_code == 404


def test_a_problem_on_a_page_is_in_words_and_leads_on(filled: Service) -> None:
    page = filled.client.get("/nowhere", headers={"Accept": "text/html"}).text
    assert "there is nothing at this address" in page
    assert '<a href="/runs">' in page
    assert filled.client.get("/favicon.ico").headers["content-type"] == "image/svg+xml"


def test_a_comparison_asks_for_the_runs_that_it_was_not_told(filled: Service) -> None:
    page = filled.client.get("/compare?a=run-0")
    assert page.status_code == 200
    assert 'name="a" value="run-0"' in page.text
    assert '<option value="run-2">' in page.text
    assert filled.client.get("/compare.json?a=run-0").status_code == 422


def test_what_changed_comes_first_in_a_comparison(service: Service) -> None:
    for run_id, failures in (("a", 10), ("b", 12)):
        same = some_row("esm", run_id=run_id, case_key="e", visibility_digest="z")
        other = some_row("pcf", run_id=run_id, case_key="p", failure_count=failures, visibility_digest=run_id)
        service.put(some_run(run_id=run_id), [some_row(f"only-{run_id}", run_id=run_id), same, other])
    lines = service.client.get("/compare?a=a&b=b").text.partition('id="compared"')[2].split("<tr>")[2:]
    assert [line.partition('<th scope="row">')[2].split()[0] for line in lines] == ["pcf", "esm", "only-a", "only-b"]


def test_a_run_of_many_experiments_is_called_by_their_number_and_leads_to_each(service: Service) -> None:
    names = [f"experiment-{number}" for number in range(6)]
    service.put(some_run(experiments=names), [some_row(experiment=names[0])])
    page = service.client.get(f"/runs/{some_run().run_id}").text
    assert "<h1>6 experiments</h1>" in page
    assert all(f'href="/experiments/{name}"' in page for name in names)


def test_a_case_is_called_by_what_is_not_its_methods_default(service: Service) -> None:
    defaults = {"pcf": {"resolution": 512, "kernel": 3}}
    row = some_row("pcf", case_key="c", method_parameters={"resolution": 512, "kernel": 7})
    service.put(some_run(method_defaults=defaults), [row])
    assert "<h1>pcf(kernel=7)</h1>" in service.client.get(f"/runs/{row.run_id}/cases/c").text


def test_a_run_in_progress_is_shown_as_such(make_service: Maker) -> None:
    service = make_service()
    service.store.start_run(some_run(status="running", finished_at=None, case_count=5))
    service.store.add_row(some_row())
    (run,) = service.client.get("/runs.json").json()["runs"]
    assert (run["status"], run["case_count"], run["is_uploaded"]) == ("running", 5, False)


def test_counters_for_prometheus_name_routes_and_not_what_was_asked(filled: Service) -> None:
    filled.client.get("/runs/run-1")
    filled.client.get("/secret-name")
    text = filled.client.get("/metrics").text
    assert 'shadowbench_requests_total{method="GET",route="/runs/{run_id}",status="200"} 1.0' in text
    assert 'shadowbench_uploads_total{kept="created"} 3.0' in text
    assert "shadowbench_uploaded_rows_total 6.0" in text
    assert "secret-name" not in text


def test_every_request_is_one_line_of_json_without_the_token(filled: Service, caplog: pytest.LogCaptureFixture) -> None:
    from shadowbench.service.telemetry import JsonLines

    caplog.set_level("INFO", "shadowbench.service")
    filled.client.get("/runs.json?q=secret", headers=filled.as_())
    (record,) = (record for record in caplog.records if record.getMessage() == "request")
    said = json.loads(JsonLines().format(record))
    assert (said["method"], said["path"], said["status"]) == ("GET", "/runs.json", 200)
    assert said["token"]
    assert "secret" not in json.dumps(said)
    assert filled.tokens["upload"] not in json.dumps(said)


def test_the_site_as_files_has_every_page_and_no_dead_link(filled: Service, tmp_path: Path) -> None:
    import re

    folder = tmp_path / "site"
    count = write_site(filled.store, folder, "Our results")
    assert count == len([path for path in folder.rglob("*") if path.is_file()])
    for page in folder.rglob("*.html"):
        text = page.read_text()
        for link in re.findall(r'(?:href|src)="([^"#]+)"', text):
            if not link.startswith(("http:", "https:", "data:")):
                assert (page.parent / link).resolve().is_file(), (page, link)
    assert "Our results" in (folder / "runs.html").read_text()
    assert "<form" not in (folder / "experiments" / "quick.html").read_text()
    (folder / "runs" / "old.html").write_text("left over")
    names = json.loads((folder / ".shadowbench-site.json").read_text())
    (folder / ".shadowbench-site.json").write_text(json.dumps([*names, "runs/old.html"]))
    write_site(filled.store, folder, "Our results")
    assert not (folder / "runs" / "old.html").exists()


def test_a_site_is_not_written_over_something_else(filled: Service, tmp_path: Path) -> None:
    from shadowbench.errors import UsageError

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(UsageError, match="is not empty"):
        write_site(filled.store, tmp_path / "mine", "x")

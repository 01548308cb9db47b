"""Pages in a real browser: their script runs, nothing breaks the content policy, the API's page needs no network."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from service.live import Live, serving
from stored_rows import some_row, some_run, with_pictures

from shadowbench.store import Store

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")]

PATHS = (
    *("/runs", "/runs/run-1", "/runs/run-1/cases/case-1", "/runs/run-1/report", "/experiments", "/experiments/quick"),
    *("/methods", "/methods/pcf", "/machines", "/compare?a=run-0&b=run-1", "/nothing", "/api/docs"),
)


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("browsed") / "results"
    with Store.open(folder) as store:
        for number in range(2):
            run = some_run(run_id=f"run-{number}", machine="<b>alpha</b>", code_version=f"1.{number}")
            store.start_run(run)
            common = {"run_id": run.run_id, "machine": run.machine, "code_version": run.code_version}
            row = some_row("pcf", **common, measured_at=f"2026-01-0{number + 1}T00:00:00+00:00", stages={"a": 1.0})
            store.add_row(with_pictures(store, row).model_copy(update={"case_key": f"case-{number}"}))
            store.add_row(some_row("esm", **common, outcome="crash", reason="<script>document.title='x'</script>"))
    with serving(folder, "--rate", "0") as running:
        yield running


def browsed(address: str, profile: Path, *options: str) -> tuple[str, str]:
    """Open a page; return what became of it and what the browser complains of."""
    assert BROWSER is not None
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"]
    command += [f"--user-data-dir={profile}", "--enable-logging=stderr", "--v=0", "--virtual-time-budget=8000"]
    command += ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", *options, address]
    environment = os.environ | {"HOME": str(profile)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True, env=environment)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return done.stdout, "\n".join(console)


@pytest.mark.parametrize("path", PATHS)
def test_a_page_runs_its_own_script_and_nothing_else(live: Live, path: str, tmp_path: Path) -> None:
    dom, console = browsed(live.address + path, tmp_path, "--dump-dom")
    complaints = [line for line in console.splitlines() if "status of 404" not in line]
    assert complaints == []
    assert "<title>x</title>" not in dom
    if path == "/api/docs":
        assert dom.count('class="opblock ') >= 20
    else:
        assert re.search(r"<html[^>]*scripted", dom)
    if path == "/runs":
        assert "<b>alpha" not in dom


def test_a_case_shows_its_pictures(live: Live, tmp_path: Path) -> None:
    dom, _ = browsed(f"{live.address}/runs/run-1/cases/case-1", tmp_path, "--dump-dom")
    assert len(re.findall(r'src="(/artifacts/[^"]+)"', dom)) == 3

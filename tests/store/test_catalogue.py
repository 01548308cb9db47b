"""Lists over many runs: found by an index, the newest standing for the others, and known to be current."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from typing import Any

import pytest
from stored_rows import some_row, some_run

from shadowbench.rows import Outcome, ResultRow
from shadowbench.store import Store
from shadowbench.store.catalogue import Catalogue, RunFilter
from shadowbench.store.uploads import Uploader, put_run


@pytest.fixture
def catalogue(store: Store) -> Iterator[Catalogue]:
    """Four runs on two machines, of two views and two techniques; the last one measured here."""
    for number in range(4):
        run = some_run(
            run_id=f"r{number}",
            machine="ab"[number % 2],
            code_version=f"{number // 2}",
            created_at=f"2026-01-0{number + 1}T00:00:00+00:00",
            experiments=["quick"],
            title="50 % of_it" if number == 1 else "",
        )
        rows = [
            some_row(
                method,
                run_id=run.run_id,
                case_key=f"{scene}-{method}",
                scene=scene,
                machine=run.machine,
                code_version=run.code_version,
                measured_at=run.created_at,
                failure_percent=float(number),
            )
            for scene in ("bunny", "fence")
            for method in ("esm", "pcf")
        ]
        rows.append(
            some_row("csm", run_id=run.run_id, outcome="crash", case_key="x", scene="bunny", experiment="other")
        )
        if number < 3:
            put_run(store, run, rows, Uploader("token"))
        else:
            store.start_run(run)
            for row in rows:
                store.add_row(row)
    opened = Catalogue(store)
    yield opened
    opened.close()


def test_runs_are_found_by_each_facet_and_page_by_page(catalogue: Catalogue) -> None:
    def found(limit: int = 9, after: str = "", **wanted: str) -> list[str]:
        return [run.run_id for run in catalogue.runs(RunFilter(**wanted), limit=limit, after=after)]

    assert found() == ["r3", "r2", "r1", "r0"]
    assert found(machine="a", code_version="1") == ["r2"]
    assert found(experiment="other", method="pcf") == ["r3", "r2", "r1", "r0"]
    assert found(method="vsm") == []
    assert found(search="% OF_") == ["r1"]
    assert found(search="5__") == []
    assert found(2) == ["r3", "r2"]
    assert found(2, after="r2") == ["r1", "r0"]
    assert found(2, after="missing") == []
    assert catalogue.count_runs(RunFilter(machine="a")) == 2
    newest, uploaded = catalogue.runs(RunFilter(), limit=2)
    assert newest.outcomes == {Outcome.OK: 4, Outcome.CRASH: 1}
    assert (newest.token_id, uploaded.token_id) == (None, "token")


def test_lists_hop_from_value_to_value(catalogue: Catalogue) -> None:
    assert catalogue.facets() == {
        "machine": ["a", "b"],
        "code_version": ["0", "1"],
        "experiment": ["quick"],
        "method": ["csm", "esm", "pcf"],
    }
    views = catalogue.views("quick")
    assert [view.fields["scene"] for view in views] == ["bunny", "fence"]
    assert catalogue.views("missing") == []
    assert catalogue.experiments_of("csm") == ["other"]
    assert catalogue.views_of("pcf", "quick") == views
    assert [m["machine"] for m in catalogue.machines()] == ["b", "a"]
    assert sorted(t["method"] for t in catalogue.techniques("quick", views[0].view_key).values()) == ["esm", "pcf"]


def test_the_newest_row_stands_for_technique_machine_and_version(catalogue: Catalogue, store: Store) -> None:
    view = catalogue.views("quick")[0].view_key
    found = [row for machine in "ab" for row in catalogue.time_standings("quick", view, machine, ["0", "1"])]
    assert sorted((row.machine, row.code_version, row.run_id) for row in found) == sorted(
        [("a", "0", "r0"), ("b", "0", "r1"), ("a", "1", "r2"), ("b", "1", "r3")] * 2
    )
    later = some_run(run_id="later", machine="a", code_version="0")
    for case_key, moment in (("old", "2020-01-01T00:00:00+00:00"), ("new", "2027-01-01T00:00:00+00:00")):
        row = some_row("pcf", run_id="later", case_key=case_key, scene="bunny", machine="a", code_version="0")
        put = row.model_copy(update={"measured_at": moment})
        store.start_run(later)
        store.add_row(put)
    found = catalogue.time_standings("quick", view, "a", ["0"])
    assert {row.case_key for row in found} == {"new", "bunny-esm"}
    assert {place[:2] for place in catalogue.places("quick", view)} == {(m, v) for m in "ab" for v in "01"}


def test_quality_is_of_the_newest_measured_row_of_any_machine(store: Store) -> None:
    generator = random.Random(5)
    rows = [
        some_row(
            generator.choice(("pcf", "esm", "vsm")),
            run_id="all",
            case_key=str(number),
            machine=generator.choice("abc"),
            code_version=generator.choice("123"),
            measured_at=f"2026-01-0{generator.randint(1, 3)}T00:00:00+00:00",
            outcome=generator.choice(("ok", "crash")),
            visibility_digest=generator.choice(("", "x", "x", "y")),
        )
        for number in range(60)
    ]
    put_run(store, some_run(run_id="all"), rows, Uploader("anna"))
    catalogue = Catalogue(store)
    (view,) = catalogue.views("quick")
    titles = {key: fields["method"] for key, fields in catalogue.techniques("quick", view.view_key).items()}
    found = {
        (titles[row.technique_key], row.code_version): (row.case_key, row.machines, row.differs)
        for row in catalogue.quality_standings("quick", view.view_key, ["1", "2"])
    }
    expected = {}
    for name in itertools.product(("pcf", "esm", "vsm"), "12"):
        of_machine: dict[str, ResultRow] = {}
        for row in rows:  # of each machine the newest, the last one of a moment
            earlier = of_machine.get(row.machine)
            if (row.method, row.code_version) == name and (earlier is None or row.measured_at >= earlier.measured_at):
                of_machine[row.machine] = row
        if of_machine:
            stands = sorted(of_machine.values(), key=lambda row: int(row.case_key))
            newest = max(stands, key=lambda row: (row.outcome == Outcome.OK, row.measured_at))
            digests = {row.visibility_digest for row in stands} - {""}
            expected[name] = (newest.case_key, len(stands), len(digests) > 1)
    assert found == expected
    assert {differs for _, _, differs in found.values()} == {False, True}
    catalogue.close()


def test_a_history_is_in_the_order_of_time(catalogue: Catalogue) -> None:
    view = catalogue.views("quick")[0].view_key
    rows = catalogue.history("pcf", "quick", view, ("run_id", "failure_percent"))
    assert [tuple(row) for row in rows] == [(f"r{n}", float(n)) for n in range(4)]


def test_the_version_stays_while_nothing_changes_and_no_longer(catalogue: Catalogue, store: Store) -> None:
    before = catalogue.version()
    catalogue.runs(RunFilter(), limit=5)
    store.rows("r0")
    assert catalogue.version() == before
    seen = {before}
    changes: list[Any] = [
        lambda: put_run(store, some_run(run_id="n"), [], Uploader("t")),
        lambda: store.add_row(some_row("pcf", run_id="r3", case_key="bunny-pcf")),
        lambda: store.finish_run("r3", some_run().status),
    ]
    for change in changes:
        change()
        seen.add(catalogue.version())
        assert catalogue.version() in seen
    assert len(seen) == 4


@pytest.mark.parametrize("database", ["postgresql"], indirect=True)
def test_the_version_is_told_again_after_the_server_ended_its_connections(catalogue: Catalogue, store: Store) -> None:
    before = catalogue.version()
    with store.engine.connect() as connection:
        others = "FROM pg_stat_activity WHERE datname = current_database() AND pid <> pg_backend_pid()"
        ended = connection.exec_driver_sql(f"SELECT pg_terminate_backend(pid) {others}").scalars().all()
    assert True in ended
    assert catalogue.version() == before

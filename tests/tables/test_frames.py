"""``load_results``: a DataFrame in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shadowbench.errors import StoreError
from shadowbench.rows import LONG_FIELDS, ResultRow
from shadowbench.store import DATABASE_NAME, Store
from shadowbench.tables.frames import load_results


@pytest.fixture
def folder(tmp_path: Path, make_row: Any, make_run: Any) -> Path:
    with Store.open(tmp_path / "results") as store:
        store.start_run(make_run(run_id="old", created_at="2025-01-01T00:00:00+00:00"))
        store.add_row(make_row(run_id="old", method="vsm"))
        store.start_run(make_run())
        store.add_row(
            make_row(
                triangles=1000,
                build_ms=1.5,
                false_lit_count=3,
                method_parameters={"resolution": 512, "kernel": 3},
                scene_parameters={"seed": 1},
                stages={"clear": 0.5},
                counters={"texels": 2**60 + 1},
                kept={"map": 4},
                samples={"build": [1.0, 2.0], "shade": [3.0]},
                round_processes=[0, 1],
                artifacts={"mask": "file.png"},
            )
        )
        store.add_row(make_row(method="ray-traced", outcome="crash", reason="signal 11"))
    return tmp_path / "results"


def test_a_frame_has_one_line_a_case_whatever_its_outcome(folder: Path) -> None:
    frame = load_results(folder)
    assert list(frame["method"]) == ["pcf", "ray-traced"]
    assert list(frame["outcome"]) == ["ok", "crash"]
    assert frame.loc[0, "build_ms"] == 1.5
    assert frame.loc[0, "method.resolution"] == 512
    assert frame.loc[0, "scene.seed"] == 1
    assert frame.loc[0, "stages.clear"] == 0.5
    assert frame.loc[0, "counters.texels"] == 2**60 + 1
    assert frame.loc[0, "artifacts.mask"] == "file.png"


def test_parameters_that_some_cases_lack_keep_their_kind(tmp_path: Path, make_row: Any, make_run: Any) -> None:
    with Store.open(tmp_path / "results") as store:
        store.start_run(make_run())
        store.add_row(make_row(method_parameters={"kernel": 3, "bias": 0.5, "log": True, "filter": "box", "mixed": 1}))
        store.add_row(make_row(method="vsm", method_parameters={"mixed": 0.5}))
    frame = load_results(tmp_path / "results")
    kinds = {name: str(frame[f"method.{name}"].dtype) for name in ("kernel", "bias", "log", "mixed")}
    assert kinds == {"kernel": "Int64", "bias": "float64", "log": "boolean", "mixed": "float64"}
    assert frame["method.kernel"].tolist() == [3, pd.NA]
    assert frame.loc[0, "method.filter"] == "box"


def test_every_column_of_a_row_is_there_and_has_one_type(folder: Path) -> None:
    frame = load_results(folder)
    spread = {*LONG_FIELDS, "method_parameters", "scene_parameters"}
    assert set(ResultRow.model_fields) - spread <= set(frame.columns)
    assert str(frame["build_ms"].dtype) == "float64"
    assert {str(frame[name].dtype) for name in ("triangles", "false_lit_count", "counters.texels")} == {"Int64"}


def test_what_does_not_apply_is_missing_and_never_zero(folder: Path) -> None:
    frame = load_results(folder)
    for name in ("build_ms", "false_lit_count", "method.kernel", "counters.texels"):
        assert pd.isna(frame.loc[1, name])
    assert frame["rmse"].isna().all()


def test_runs_are_chosen_by_id_or_all(folder: Path) -> None:
    assert list(load_results(folder, "old")["method"]) == ["vsm"]
    assert list(load_results(folder, None)["run_id"]) == ["run-1", "run-1", "old"]
    assert len(load_results(folder / DATABASE_NAME)) == 2
    assert len(load_results(str(folder))) == 2


def test_long_tables_have_one_line_a_value(folder: Path) -> None:
    samples = load_results(folder, table="samples")
    assert samples[["method", "name", "round", "value", "unit"]].to_numpy().tolist() == [
        ["pcf", "build", 0, 1.0, "ms"],
        ["pcf", "build", 1, 2.0, "ms"],
        ["pcf", "shade", 0, 3.0, "ms"],
    ]
    assert samples["process"].tolist() == [0, 1, 0]
    counters = load_results(folder, table="counters")
    assert list(counters.columns) == ["run_id", "experiment", "case_key", "scene", "method", "name", "value", "unit"]
    assert counters["value"].tolist() == [2**60 + 1]


def test_a_run_without_rows_is_an_empty_frame_with_its_columns(folder: Path, make_run: Any) -> None:
    with Store.open(folder) as store:
        store.start_run(make_run(run_id="empty", created_at="2030-01-01T00:00:00+00:00"))
    frame = load_results(folder)
    assert len(frame) == 0
    assert "build_ms" in frame.columns
    assert len(load_results(folder, table="stages")) == 0


def test_what_is_not_there_is_one_line(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="holds no results"):
        load_results(tmp_path / "nowhere")
    with pytest.raises(StoreError, match="no run in"):
        load_results(folder, "zzz")
    with pytest.raises(StoreError, match=r"no table 'sample'; did you mean 'samples'\?"):
        load_results(folder, table="sample")

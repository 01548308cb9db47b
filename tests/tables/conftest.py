"""Rows to make tables of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from shadowbench.rows import ResultRow, RunRecord, RunStatus

HOSTILE_NAMES = [
    "=cmd|' /C calc'!A0",
    "+1+1",
    "-2+3",
    "@SUM(A1)",
    "\t=1+1",
    " =1+1",
    "<script>alert(1)</script> & &amp;",
    "a|b||c",
    "line\nbreak\r\nand\vmore\x85\u2028end",
    "\x1b[31mred\x1b[0m \x9b31m \x07\x00",
    "\u202eright to left\u202c \u200bzero width",
    "lone \udc80 surrogate",
    r"\textbf{x} $x^2$ 100% #1 a_b ~ {} \\ [1] \input{/etc/passwd} % comment",
    "**bold** _it_ `code` ~~s~~ [l](http://x) ![i](x) # h :tada: $m$ \\",
    "[bold red]rich[/bold red] [/] [link=x]y[/link] :smile:",
    "--- === *** ''quoted'' \"q\" ``ticks'' ,,low''",
    "1. list",
    "日本語のとても長い名前",
    "x" * 5000,
    "",
    " ",
    "[*]",
    "--flag",
]


@pytest.fixture(params=HOSTILE_NAMES, ids=range(len(HOSTILE_NAMES)))
def hostile(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def make_row() -> Callable[..., ResultRow]:
    count = 0

    def make(**fields: Any) -> ResultRow:
        nonlocal count
        count += 1
        given = {
            "run_id": "run-1",
            "experiment": "quick",
            "case_key": f"case{count:08}",
            "quality_key": "quality",
            "scene": "bunny",
            "method": "pcf",
            "light": "sun",
            "camera": "main",
            "width": 64,
            "height": 48,
            "device": "cpu",
            "threads": 2,
            "outcome": "ok",
        }
        return ResultRow.model_validate(given | fields)

    return make


@pytest.fixture
def make_run() -> Callable[..., RunRecord]:
    def make(**fields: Any) -> RunRecord:
        given = {
            "run_id": "run-1",
            "created_at": "2026-01-01T00:00:00+00:00",
            "experiments": ["quick"],
            "status": RunStatus.COMPLETE,
        }
        return RunRecord.model_validate(given | fields)

    return make


@pytest.fixture
def hostile_rows(make_row: Callable[..., ResultRow], hostile: str) -> list[ResultRow]:
    """A hostile name in every place that a plugin, a user or an error can write to."""
    return [
        make_row(
            scene=hostile,
            method=hostile,
            light=hostile,
            camera=hostile,
            method_parameters={"p": hostile, hostile: 1},
            scene_parameters={"triangles": 1, hostile: hostile},
            warnings=[hostile],
            build_ms=1.25,
            stages={hostile: 2.5},
        ),
        make_row(scene=hostile, method=hostile, method_parameters={"p": "other"}, outcome="crash", reason=hostile),
        make_row(scene=hostile, method="second", build_ms=-1.5, stages={hostile: 3.5}),
    ]

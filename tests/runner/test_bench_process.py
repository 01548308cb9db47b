"""What a worker's machine holds against the plan, and what it sends."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from multiprocessing import Pipe
from typing import Any

import pytest
from stored_rows import some_run

from shadowbench.errors import ClusterError, PluginError
from shadowbench.rows import Outcome, ResultRow
from shadowbench.runner.cases import Case, Obstacle, RunOptions, View
from shadowbench.runner.cluster.bench_process import Sender, _hold_to_plan, _resolved_here
from shadowbench.runner.cluster.fingerprint import difference, fingerprint
from shadowbench.runner.cluster.jobs import Ending, Job, packed, unpacked
from shadowbench.runner.row_making import ended_row

VIEW = View("tiny", {}, "key", "content", 2, "sun", "above", 8, 8)
CASE = Case("ad-hoc", 0, VIEW, "half", "Half", {"n": 1}, True, "cpu", 1, "quality", "timing", {"lib": "1"})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"quality_key": "other"}, "method 'half' is not what the plan was made with"),
        ({"quality_key": "other", "view": replace(VIEW, content="other")}, "scene 'tiny' is not what"),
    ],
)
def test_a_case_with_another_key_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ClusterError, match=message):
        _hold_to_plan([CASE], [replace(CASE, **changes)])


@pytest.mark.parametrize(
    "changes",
    [
        {"case_key": "another machine's"},
        {"quality_key": "of another renderer", "libraries": {"lib": "2"}},
        {"quality_key": "", "obstacle": Obstacle(Outcome.SKIPPED, "not installed here")},
    ],
)
def test_another_machine_another_peers_library_and_a_missing_one_are_no_contradiction(changes: dict[str, Any]) -> None:
    _hold_to_plan([CASE], [replace(CASE, **changes)])


def test_a_row_travels_with_its_pictures_and_rounds_are_told_of_rarely() -> None:
    job = Job("job", some_run(), RunOptions(), (CASE,), None, 1.0)
    here, there = Pipe()
    sender = Sender(job, there)
    sender.index_of = {CASE.case_key: 0}
    name = sender.put_artifact(b"picture", "png")
    row = ended_row(CASE, job.record, Outcome.OK, "").model_copy(update={"artifacts": {"result": name}})
    sender.add_row(row)
    for number in range(100):
        sender.case_started(CASE, f"round {number}")
    sender.case_started(replace(CASE, case_key="the baseline's"), "load")
    there.close()
    message = here.recv()
    assert ResultRow.model_validate_json(message["row"]) == row
    assert message["pictures"] == {name: b"picture"}
    assert here.poll(), "the first round is told of"
    assert here.recv()["text"] == "round 0"
    rounds = 0
    with suppress(EOFError):
        while here.recv():
            rounds += 1
    assert rounds < 10


def test_a_job_and_its_ending_come_out_as_they_went_in() -> None:
    job = Job("job", some_run(), RunOptions(), (CASE,), CASE, 1.0)
    assert unpacked(packed(job)) == job
    ending = Ending("died", "why")
    assert Ending.from_wire(ending.to_wire()) == ending


def test_a_fingerprint_names_what_differs_and_what_is_missing() -> None:
    ours = fingerprint(["pcf"], ["bunny"])
    assert all(ours.values())
    assert difference(ours, fingerprint(["pcf"], ["bunny"])) is None
    theirs = ours | {"method 'pcf'": "", "numpy": "1.0", "scene 'bunny'": "another"}
    assert difference(ours, theirs) == (
        f"lacks method 'pcf' and has other versions of numpy (1.0, here {ours['numpy']}), scene 'bunny'"
    )
    assert difference(ours, theirs | {"something more": "1", "scene 'bunny'": ours["scene 'bunny'"]}) is not None


def test_a_process_killed_while_cases_are_resolved_is_no_reason_to_refuse_them(monkeypatch: pytest.MonkeyPatch) -> None:
    answers: list[Any] = [PluginError("plugins cannot be loaded: the worker ended by SIGKILL"), [CASE]]

    def resolve(*arguments: Any) -> list[Case]:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr("shadowbench.runner.cluster.bench_process.resolve_again", resolve)
    assert _resolved_here(None, RunOptions(), [CASE]) == [CASE]  # type: ignore[arg-type]
    answers += [PluginError("no method is called 'half'")] * 2
    with pytest.raises(PluginError, match="no method"):
        _resolved_here(None, RunOptions(), [CASE])  # type: ignore[arg-type]

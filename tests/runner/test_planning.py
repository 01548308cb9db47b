"""Plans: what is resolved, what is the user's mistake, and what becomes an outcome."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from small_runs import PLUGIN_FILES, PLUGINS, planned

from shadowbench import experiment
from shadowbench.errors import ParameterError, PluginError, SceneError, ShadowbenchError, UsageError
from shadowbench.rows import Outcome
from shadowbench.runner import planning
from shadowbench.runner.pool import Pool, Worker

pytestmark = pytest.mark.usefixtures("lasting_workers")


def test_a_plan_has_all_parameters_lights_and_keys(tmp_path: Path) -> None:
    plan = planned(
        tmp_path, "formula:shift=0/0.5", "good", scenes=("tiny:ground=2/3",), lights=["lamp"], threads=(1, 2)
    )
    assert len(plan.comparisons) == 4, "two scenes, each with one thread and with two"
    assert [len(cases) for cases in plan.comparisons] == [3, 3, 3, 3]
    first = plan.cases[0]
    assert (first.method, first.method_parameters) == ("formula", {"shift": 0.0})
    assert plan.cases[2].method_parameters == {"level": 1}, "defaults are filled in"
    assert plan.method_defaults == {"formula": {"shift": 0.0}, "good": {"level": 1}}
    assert (first.view.scene_parameters, first.view.light, first.view.camera) == ({"ground": 2.0}, "lamp", "above")
    assert (first.view.triangles, first.view.width, first.view.height) == (4, 48, 32)
    keys = [case.case_key for case in plan.cases]
    assert len(set(keys)) == 12
    one_thread, two_threads = plan.comparisons[0][0], plan.comparisons[1][0]
    assert (one_thread.threads, two_threads.threads) == (1, 2)
    assert one_thread.quality_key == two_threads.quality_key, "pixels do not depend on threads"
    again = planned(
        tmp_path, "formula:shift=0/0.5", "good", scenes=("tiny:ground=2/3",), lights=["lamp"], threads=(1, 2)
    )
    assert [case.case_key for case in again.cases] == keys
    assert again.plan_key == plan.plan_key


def test_equal_cases_are_measured_once_and_written_values_do_not_matter(tmp_path: Path) -> None:
    plan = planned(tmp_path, "good:level=2", "good:level=1/2", "good", "formula:shift=0.50", "formula:shift=5e-1")
    configurations = [(case.method, case.method_parameters) for case in plan.cases]
    assert configurations == [("good", {"level": 2}), ("good", {"level": 1}), ("formula", {"shift": 0.5})]


def test_editing_a_plugin_changes_the_keys_of_its_own_methods_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copies = tuple(tmp_path / file.name for file in PLUGIN_FILES)
    for file, copy in zip(PLUGIN_FILES, copies, strict=True):
        shutil.copy(file, copy)

    def quality_keys() -> dict[str, str]:
        plan = planned(tmp_path / "results", "formula", "good", "pcf", plugin_files=copies)
        return {case.method: case.quality_key for case in plan.cases}

    before = quality_keys()
    copies[1].write_text(copies[1].read_text() + "# edited\n")
    after = quality_keys()
    assert {method for method in before if after[method] != before[method]} == {"good"}
    monkeypatch.setenv("IMAGINED_VERSION", "2")  # what the method says its library is
    newer = quality_keys()
    assert {method for method in before if newer[method] != after[method]} == {"good"}


def test_another_warp_is_another_result_of_everything(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = planned(tmp_path, "formula", "good").cases
    ask = Worker.ask

    def ask_a_newer_one(worker: Worker, call: str, arguments: dict[str, Any], timeout_s: float) -> Any:
        answer = ask(worker, call, arguments, timeout_s)
        return answer | {"warp": "99.0"} if call == "describe_device" else answer

    monkeypatch.setattr(Worker, "ask", ask_a_newer_one)
    after = planned(tmp_path, "formula", "good").cases
    assert not {case.quality_key for case in after} & {case.quality_key for case in before}


def test_a_file_beside_a_plugin_belongs_to_the_keys_of_its_methods_only(tmp_path: Path) -> None:
    plugin, helper = tmp_path / "dim.py", tmp_path / "dim_level.py"
    plugin.write_text(
        "import dim_level\nfrom shadowbench.method import Method\nclass Dim(Method):\n    name = title = 'dim'\n"
        "    def build(self, *_): pass\n    def shade(self, receivers, visibility, _): visibility.fill_(dim_level.X)\n"
    )
    helper.write_text("X = 0.5\n")
    files = (*PLUGIN_FILES, plugin)
    before = planned(tmp_path / "results", "dim", "good", plugin_files=files).cases
    helper.write_text("X = 0.25\n")
    after = planned(tmp_path / "results", "dim", "good", plugin_files=files).cases
    changed = [new.method for old, new in zip(before, after, strict=True) if new.quality_key != old.quality_key]
    assert changed == ["dim"]


def test_no_method_means_every_method(tmp_path: Path) -> None:
    methods = {case.method for case in planned(tmp_path).cases}
    assert {"formula", "good", "ray-traced", "shadow-map", "pcf", "embree"} <= methods


def test_a_method_that_does_not_apply_is_planned_as_skipped(tmp_path: Path) -> None:
    plan = planned(tmp_path, "unavailable", "cuda-only", "good")
    obstacles = [case.obstacle for case in plan.cases]
    assert obstacles[0] is not None
    assert obstacles[1] is not None
    assert (obstacles[0].outcome, obstacles[0].reason) == (Outcome.SKIPPED, "needs a library that nobody has")
    assert (obstacles[1].outcome, obstacles[1].reason) == (Outcome.SKIPPED, "runs on cuda, not on cpu")
    assert obstacles[2] is None


@pytest.fixture(scope="module")
def shared_pool() -> Iterator[None]:
    """One pool for many plans, each of which would start a worker of its own."""
    with ExitStack() as opened, pytest.MonkeyPatch.context() as patch:

        @cache
        def pool_of(plugin_files: tuple[Path, ...], memory_limit: int) -> Pool:
            return opened.enter_context(Pool(plugin_files, memory_limit))

        patch.setattr(planning, "Pool", lambda *arguments: nullcontext(pool_of(*arguments)))
        yield


@pytest.mark.usefixtures("shared_pool")
@pytest.mark.parametrize(
    ("error", "message", "asked"),
    [
        (PluginError, "no method is called 'goood'; did you mean 'good'?", {"methods": ["goood"]}),
        (PluginError, "no scene is called 'tinny'; did you mean 'tiny'?", {"scenes": ("tinny",)}),
        (ParameterError, "has no parameter 'levle'; did you mean 'level'?", {"methods": ["good:levle=3"]}),
        (ParameterError, "parameter 'level' = '300'", {"methods": ["good:level=3/300"]}),
        (ParameterError, "scene 'tiny' has no parameter 'grnd'", {"scenes": ("tiny:grnd=1",)}),
        (SceneError, "scene 'tiny' has no light 'lampp'; did you mean 'lamp'?", {"lights": ["lampp"]}),
        (SceneError, "absent.ply", {"scenes": ("absent.ply",)}),
        (UsageError, "there is no device 'gpu7'; this machine has: cpu", {"device": "gpu7"}),
        (UsageError, "the plan has 20001 cases", {"methods": ["good:level=" + "/".join(["1"] * 20_001)]}),
        (PluginError, "gone.py does not exist", {"plugin_files": (Path("gone.py"),)}),
        (PluginError, r"has_a_typo.py:6 cannot be imported: Synt", {"plugin_files": (PLUGINS / "has_a_typo.py",)}),
        (PluginError, "ended by SIGABRT", {"plugin_files": (PLUGINS / "crashes_on_import.py",)}),
    ],
)
def test_a_mistake_ends_the_planning_in_one_line(
    tmp_path: Path, error: type[ShadowbenchError], message: str, asked: dict[str, Any]
) -> None:
    methods = asked.pop("methods", ["good"])
    with pytest.raises(error, match=message) as caught:
        planned(tmp_path, *methods, **asked)
    assert "\n" not in str(caught.value)


def test_two_experiments_of_one_name_are_refused(tmp_path: Path) -> None:
    one = experiment.from_options(scenes=["tiny"])
    with pytest.raises(UsageError, match="two experiments are called 'ad-hoc'"):
        planning.plan([one, one], planning.RunOptions(results=tmp_path))


def test_a_scene_that_fails_becomes_the_outcome_of_its_cases(tmp_path: Path) -> None:
    files = (*PLUGIN_FILES, PLUGINS / "scenes_gone_wrong.py")
    plan = planned(
        tmp_path, "good", scenes=("crashing", "raising", "endless", "tiny"), plugin_files=files, timeout_s=2.0
    )
    reasons = [(case.obstacle.outcome, case.obstacle.reason) if case.obstacle else None for case in plan.cases]
    assert reasons == [
        (Outcome.ERROR, "scene 'crashing': the worker ended by SIGABRT during place scene"),
        (Outcome.ERROR, "scene 'raising': KeyError: 'lost'"),
        (Outcome.ERROR, "scene 'endless': no end of place scene within 2 s"),
        None,
    ]
    with pytest.raises(SceneError, match="there is nothing to see"):
        planned(tmp_path, "good", scenes=("refusing",), plugin_files=files)


def test_a_mesh_files_key_is_its_content(tmp_path: Path) -> None:
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for name, content in (("one.obj", triangle), ("same.obj", triangle), ("other.obj", triangle.replace("1", "2", 1))):
        (tmp_path / name).write_text(content)
    scenes = tuple(str(tmp_path / name) for name in ("one.obj", "same.obj", "other.obj"))
    plan = planned(tmp_path / "results", "good", scenes=scenes)
    one, same, other = plan.cases
    assert one.view.scene == "one.obj"
    assert one.view.content == same.view.content != other.view.content
    (tmp_path / "one.obj").write_text(triangle.replace("1", "3", 1))
    (changed, *_) = planned(tmp_path / "results", "good", scenes=scenes).cases
    assert changed.case_key != one.case_key


def test_planning_and_running_never_import_warp_or_numpy_in_the_parent(tmp_path: Path) -> None:
    check = f"""
import sys
from pathlib import Path
from shadowbench import experiment, runner
files = tuple(Path(f) for f in {[str(f) for f in PLUGIN_FILES]!r})
options = runner.RunOptions(results=Path({str(tmp_path)!r}), plugin_files=files)
plan = runner.plan([experiment.from_options(methods=["good"], scenes=["tiny"], sizes=["8x8"])], options)
assert len(plan.cases) == 1
heavy = {{"warp", "numpy", "shadowbench.method", "shadowbench.scenes"}} & set(sys.modules)
sys.exit(str(heavy) if heavy else 0)
"""
    subprocess.run([sys.executable, "-c", check], check=True)

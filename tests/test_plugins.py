"""Finding plugins: built-ins, a real third-party package, and single files; and what is wrong with some."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from shadowbench.errors import PluginError
from shadowbench.plugins import Registry

PLUGINS = Path(__file__).parent / "plugins"
THIRD_PARTY = PLUGINS / "third_party_package"
METHOD = "from shadowbench.method import Method\nclass A(Method):\n"


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the third-party package installed in it by pip, as its author's users would."""
    source, target = tmp_path_factory.mktemp("source") / "package", tmp_path_factory.mktemp("installed")
    shutil.copytree(THIRD_PARTY, source)
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    subprocess.run([*pip, "--disable-pip-version-check", "--target", str(target), str(source)], check=True)
    return target


def test_built_ins_are_found_the_way_third_parties_are() -> None:
    registry = Registry()
    for name in ("embree", "pcf", "ray-traced", "shadow-map"):
        assert registry.method(name).name == name
    for name in ("box-on-plane", "bunny", "mesh-file", "random-triangles", "sphere-on-plane"):
        assert registry.scene(name).name == name


def test_nothing_is_imported_by_looking() -> None:
    check = (
        "import sys; from shadowbench.plugins import Registry; Registry().names('method');"
        "sys.exit('warp' in sys.modules or 'shadowbench.methods' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", check], check=True)


def test_an_installed_package_adds_its_method_and_scene(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(installed))
    registry = Registry()
    assert {"umbra", "umbra-broken", "pcf"} <= set(registry.names("method"))
    assert registry.method("umbra").title == "Shadow below a height"
    assert registry.scene("umbra-step").title == "Two floors"
    assert next(e.origin for e in registry.entries("method") if e.name == "umbra") == "umbra-methods"


def test_a_broken_plugin_stays_in_the_list_and_takes_nothing_down(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(installed))
    registry = Registry()
    assert "umbra-broken" in registry.names("method")
    with pytest.raises(PluginError, match=r"cannot be imported: ModuleNotFoundError.*a_library_that_nobody_has"):
        registry.method("umbra-broken")
    assert registry.method("pcf").name == "pcf"


RUN = """
import json, sys
from pathlib import Path
from shadowbench import experiment, runner
from shadowbench.store import Store
options = runner.RunOptions(results=Path(sys.argv[1]), threads=(1,), min_rounds=2, max_rounds=2)
asked = experiment.from_options(
    methods=["umbra:height=0.5/-1", "umbra-broken", "ray-traced"], scenes=["umbra-step"], sizes=["48x32"])
with Store.open(options.results) as store:
    record = runner.run(runner.plan([asked], options), store)
    for row in store.rows(record.run_id):
        print(row.model_dump_json())
"""


def test_an_installed_package_is_measured_like_a_built_in(installed: Path, tmp_path: Path) -> None:
    path = os.pathsep.join([str(installed), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", RUN, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": path},
        check=True,
        capture_output=True,
        text=True,
    )
    broken, right, wrong, traced = (json.loads(line) for line in done.stdout.splitlines())
    assert broken["outcome"] == "error"
    assert "a_library_that_nobody_has" in broken["reason"]
    assert [row["outcome"] for row in (right, wrong, traced)] == ["ok"] * 3
    # the lower floor lies wholly in the upper one's shadow, and the upper one is lit
    assert right["failure_count"] == 0
    assert right["counters"]["look-ups"] == right["receivers"]
    assert wrong["false_lit_count"] > 0
    assert wrong["false_shadow_count"] == 0
    assert traced["failure_count"] == 0


def test_a_file_adds_its_public_plugins() -> None:
    registry = Registry((PLUGINS / "tiny_scene.py", PLUGINS / "misbehaving.py"))
    assert registry.scene("tiny").title == "A square over a ground"
    assert registry.method("good").title == "Lit, but"
    assert "good" in registry.names("method")
    assert not [name for name in registry.names("method") if name.startswith("_")]


def test_an_edited_file_is_another_module(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text((PLUGINS / "tiny_scene.py").read_text())
    before = Registry((file,)).method("formula").__module__
    assert Registry((file,)).method("formula").__module__ == before
    file.write_text(file.read_text() + "# edited\n")
    assert Registry((file,)).method("formula").__module__ != before


def test_two_plugins_of_one_name_are_refused_with_both_origins(tmp_path: Path) -> None:
    copy = tmp_path / "copy.py"
    shutil.copy(PLUGINS / "tiny_scene.py", copy)
    with pytest.raises(
        PluginError, match=r"two methods are called 'formula': one from .*tiny_scene\.py, one from .*copy"
    ):
        Registry((PLUGINS / "tiny_scene.py", copy))
    own = tmp_path / "own.py"
    own.write_text((PLUGINS / "tiny_scene.py").read_text().replace('"formula"', '"pcf"'))
    with pytest.raises(PluginError, match=r"two methods are called 'pcf': one from shadowbench, one from .*own\.py"):
        Registry((own,))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "does not exist"),
        ("x = (", r"bad.py:1 cannot be imported: SyntaxError"),
        ("import os\n1 / 0", r"bad.py:2 cannot be imported: ZeroDivisionError: division by zero"),
        ("x = 1", "no public subclass of shadowbench.method.Method or shadowbench.scene.ScenePlugin"),
        (f"{METHOD}    name = 'a'\n    title = 'A'", "does not define build, shade"),
        (f"{METHOD}    pass", "class A has no class attribute 'name'"),
    ],
)
def test_a_file_that_is_no_plugin_is_refused_in_one_line(tmp_path: Path, content: str | None, message: str) -> None:
    file = tmp_path / "bad.py"
    if content is not None:
        file.write_text(content)
    with pytest.raises(PluginError, match=message) as caught:
        Registry((file,))
    assert "\n" not in str(caught.value)


def test_a_directory_is_no_plugin_file(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match="is a directory"):
        Registry((tmp_path,))


def test_an_unknown_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(PluginError, match=r"no method is called 'shadow-mop'; did you mean 'shadow-map'\?"):
        Registry().method("shadow-mop")


def test_an_installed_plugin_whose_name_is_taken_is_listed_as_broken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    information = tmp_path / "rival-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: rival\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[shadowbench.methods]\npcf = rival:Pcf\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    registry = Registry()
    assert registry.method("pcf").__module__ == "shadowbench.methods.pcf"
    assert "pcf@rival" in registry.names("method")
    with pytest.raises(PluginError, match="two methods are called 'pcf': one from shadowbench, one from rival"):
        registry.method("pcf@rival")

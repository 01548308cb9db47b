"""Keys change with what a result depends on, and with nothing else."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from builders import box_over_ground

from shadowbench import identity, imported_code

PACKAGE = {
    "__init__.py": "",
    "method.py": "from . import kernels\nfrom outer_thing import x\nimport shadowbench.light_space\n",
    "kernels.py": "from .deep.maths import f\n",
    "deep/__init__.py": "Y = 1\n",
    "deep/maths.py": (
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from ..types_only import T\n"
        "def f(): import {name}.lazily\n"
    ),
    "types_only.py": "T = int\n",
    "lazily.py": "",
    "unrelated.py": "from . import kernels\n",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, Path]:
    """A package of a plugin, on the path and not imported."""
    name = f"plugin_{tmp_path.name.replace('-', '_')}"
    folder = tmp_path / name
    for file, content in PACKAGE.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content.format(name=name))
    monkeypatch.syspath_prepend(str(tmp_path))
    return name, folder


def _edit(file: Path) -> None:
    file.write_text(file.read_text() + "# edited\n")


@pytest.mark.parametrize(
    "file", ["method.py", "kernels.py", "deep/__init__.py", "deep/maths.py", "lazily.py", "__init__.py"]
)
def test_editing_any_module_that_runs_changes_the_digest(package: tuple[str, Path], file: str) -> None:
    name, folder = package
    before = identity.code_digest(f"{name}.method")
    _edit(folder / file)
    assert identity.code_digest(f"{name}.method") != before


@pytest.mark.parametrize("file", ["unrelated.py", "types_only.py"])
def test_editing_a_module_that_does_not_run_changes_nothing(package: tuple[str, Path], file: str) -> None:
    name, folder = package
    before = identity.code_digest(f"{name}.method")
    _edit(folder / file)
    assert identity.code_digest(f"{name}.method") == before


def test_shadowbench_counts_and_other_peoples_libraries_do_not(package: tuple[str, Path]) -> None:
    name, _ = package
    found = imported_code.imported_files(f"{name}.method")
    assert "shadowbench.light_space" in found
    assert "shadowbench.world" in found, "what it imports in turn"
    assert "outer_thing" not in found
    assert "numpy" not in found
    assert name not in sys.modules, "nothing is imported to find out"


def test_an_absent_module_is_told() -> None:
    with pytest.raises(ModuleNotFoundError):
        identity.code_digest("shadowbench.methods.nothing")


def test_a_built_in_method_depends_on_its_kernels_and_not_on_the_harness_or_other_methods() -> None:
    found = set(imported_code.imported_files("shadowbench.methods.pcf"))
    assert {"shadowbench.methods.pcf", "shadowbench.methods.pcf.kernels", "shadowbench.device.launch"} <= found
    assert not {m for m in found if m.startswith(("shadowbench.runner", "shadowbench.store", "shadowbench.metrics"))}
    assert not {m for m in found if m.startswith("shadowbench.methods.") and "pcf" not in m}
    assert "shadowbench" not in found, "a new version number alone changes no result"


def test_digests_are_taken_without_importing_warp() -> None:
    check = (
        "import sys; from shadowbench import identity; identity.code_digest('shadowbench.camera_pass');"
        "identity.machine(); identity.environment();"
        "sys.exit('warp' in sys.modules or 'numpy' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", check], check=True)


def test_a_key_does_not_depend_on_the_order_of_names() -> None:
    assert identity.key_of({"a": 1, "b": [2, 3]}) == identity.key_of({"b": [2, 3], "a": 1})
    assert identity.key_of({"a": 1, "b": [2, 3]}) != identity.key_of({"a": 1, "b": [3, 2]})
    assert identity.key_of({"a": 1}) != identity.key_of({"a": "1"})


CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "one bit": lambda a: np.where(np.arange(len(a)) == 3, np.nextafter(a, np.float32(9)), a),
    "the type": lambda a: a.astype(np.float64),
    "the shape": lambda a: a.reshape(2, -1),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_content_digest_sees(change: str) -> None:
    array = np.arange(10, dtype=np.float32)
    assert identity.content_digest([array]) == identity.content_digest([array.copy()])
    assert identity.content_digest([array]) != identity.content_digest([CHANGES[change](array)])


def test_a_worlds_digest_sees_geometry_and_lights_but_not_what_was_computed_from_it() -> None:
    world, same, lifted = box_over_ground(), box_over_ground(), box_over_ground(lift=0.5)
    before = identity.content_digest(world)
    assert world.casters.triangle_count == world.triangle_count
    assert identity.content_digest(world) == before == identity.content_digest(same)
    assert identity.content_digest(lifted) != before
    fewer_lights = box_over_ground(lights={"sun": world.lights["sun"]})
    assert identity.content_digest(fewer_lights) != before


def test_machine_and_environment_name_what_results_depend_on() -> None:
    assert identity.machine() == identity.machine()
    assert "core" in identity.machine()
    found = identity.environment()
    assert found["libraries"]["numpy"] == np.__version__
    assert identity.available_cores() >= 1
    assert identity.code_version().startswith("0.")


def _git(folder: Path, *arguments: str) -> None:
    names = ("-c", "user.name=n", "-c", "user.email=e@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", "-C", str(folder), *names, *arguments], check=True, capture_output=True)


def test_a_plugin_file_is_known_by_its_digest_and_in_a_checkout_by_its_commit(tmp_path: Path) -> None:
    file = tmp_path / "plugin.py"
    file.write_text("x = 1\n", encoding="utf-8")
    loose = identity.plugin_origin(file)
    assert loose == {"digest": identity.file_digest(file)}
    _git(tmp_path, "init", "-q")
    assert identity.plugin_origin(file) == loose, "in a checkout, but not tracked"
    _git(tmp_path, "add", "plugin.py")
    _git(tmp_path, "commit", "-qm", "first")
    clean = identity.plugin_origin(file)
    assert clean == loose | {"commit": clean["commit"], "changed": False}
    assert len(clean["commit"]) == 10
    file.write_text("x = 2\n", encoding="utf-8")
    changed = identity.plugin_origin(file)
    assert changed["changed"] is True
    assert changed["commit"] == clean["commit"]
    assert changed["digest"] != clean["digest"]
    assert identity.plugin_origin(tmp_path / "gone.py") == {}


def test_the_environment_says_how_the_machine_is_set() -> None:
    found = identity.environment()
    assert {"python", "system", "processor", "cores", "available_cores", "affinity", "load_average"} <= found.keys()
    assert found["memory_gib"]["total"] >= found["memory_gib"]["available"] > 0.0
    assert len(found["affinity"]) == found["available_cores"]

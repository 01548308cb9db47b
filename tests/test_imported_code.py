"""What counts as a module's code: checked against what Python really imports, and by editing copies of the program."""

from __future__ import annotations

import fnmatch
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from itertools import chain
from pathlib import Path

import pytest

from shadowbench import identity, imported_code
from shadowbench.errors import PluginError
from shadowbench.plugins import Registry

ROOT = Path(__file__).parent.parent

Write = Callable[[dict[str, str]], None]

METHOD = """
import {helper}
from shadowbench.method import Method
class Dim(Method):
    name, title = "dim", "Dim"
    def build(self, casters, light, view, changes, trace): pass
    def shade(self, receivers, visibility, trace): visibility.fill_({helper}.LEVEL)
"""


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Return a function that writes files into a folder on the path."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(files: dict[str, str]) -> None:
        for name, content in files.items():
            file = tmp_path / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(content)

    return write


def _digest_after(module: str, file: Path, edit: str = "\n# edited\n") -> tuple[str, str]:
    """Return a module's digest before and after something is added to a file."""
    before = identity.code_digest(module)
    file.write_text(file.read_text() + edit)
    return before, identity.code_digest(module)


@pytest.mark.parametrize(
    "line",
    [
        "import importlib; k = importlib.import_module('{package}.kernels')",
        "from importlib import import_module; k = import_module('.kernels', __package__)",
        "k = __import__('{package}.kernels')",
        "import importlib; name = input(); k = importlib.import_module(f'{{__package__}}.{{name}}')",
        "def later():\n    from . import kernels",
        "from .kernels import *",
        "from {package} import kernels as k",
        "try:\n    from .kernels import fast\nexcept ImportError:\n    fast = None",
    ],
)
def test_every_way_to_import_counts(tmp_path: Path, write: Write, line: str) -> None:
    package = f"ways_{abs(hash(line))}"
    write({
        f"{package}/__init__.py": "",
        f"{package}/method.py": line.format(package=package),
        f"{package}/kernels.py": "fast = 1\n",
    })  # fmt: skip
    before, after = _digest_after(f"{package}.method", tmp_path / package / "kernels.py")
    assert before != after


def test_a_name_from_a_package_further_up_is_found(tmp_path: Path, write: Write) -> None:
    write({
        "upward/__init__.py": "",
        "upward/shared.py": "",
        "upward/other.py": "",
        "upward/deep/__init__.py": "",
        "upward/deep/method.py": "import importlib\nfrom .. import shared\n"
        "importlib.import_module('..other', 'upward.deep')\n",
    })  # fmt: skip
    assert {"upward.shared", "upward.other"} <= set(imported_code.imported_files("upward.deep.method"))


def test_a_package_that_starts_itself_uses_its_main_module_and_all_that_may_be_asked_of_it() -> None:
    found = set(imported_code.imported_files("shadowbench.scenes.mesh_file"))
    formats = {f"shadowbench.scenes.formats.{name}" for name in ("__main__", "vtk", "usd", "ply", "isolated")}
    assert formats <= found


def test_a_data_file_counts_where_it_is_named(tmp_path: Path, write: Write) -> None:
    write({
        "painted/__init__.py": "A = Path(__file__).parent / 'shaders' / 'blur.frag'\nB = files().joinpath('t.csv')",
        "painted/shaders/blur.frag": "void main() {}",
        "painted/shaders/unused.frag": "void main() {}",
        "painted/t.csv": "1,2",
        "painted/README.md": "Words.",
    })  # fmt: skip
    for name, matters in (("shaders/blur.frag", True), ("t.csv", True), ("shaders/unused.frag", False)):
        before, after = _digest_after("painted", tmp_path / "painted" / name, " ")
        assert (before != after) is matters, name
    before, after = _digest_after("painted", tmp_path / "painted" / "README.md", "More words.")
    assert before == after


def test_modules_of_the_same_distribution_count_and_others_do_not(tmp_path: Path, write: Write) -> None:
    write({
        "soft_shadow.py": "import soft_shadow_kernels\nimport somebody_elses\n",
        "soft_shadow_kernels.py": "",
        "somebody_elses.py": "",
        "soft-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: soft\nVersion: 1.0\n",
        "soft-1.0.dist-info/top_level.txt": "soft_shadow\nsoft_shadow_kernels\n",
    })  # fmt: skip
    assert set(imported_code.imported_files("soft_shadow")) == {"soft_shadow", "soft_shadow_kernels"}
    before, after = _digest_after("soft_shadow", tmp_path / "soft_shadow_kernels.py")
    assert before != after


def test_a_plugin_file_may_import_the_files_beside_it_and_they_count(tmp_path: Path) -> None:
    plugin, helper = tmp_path / "dim.py", tmp_path / "dim_level.py"
    plugin.write_text(METHOD.format(helper="dim_level"))
    helper.write_text("import json, numpy\nLEVEL = 0.5\n")
    (tmp_path / "unrelated.py").write_text("")
    module = Registry((plugin,)).method("dim").__module__
    assert {"dim_level", module} <= set(imported_code.imported_files(module))
    assert not {"json", "numpy", "unrelated"} & set(imported_code.imported_files(module))
    before, after = _digest_after(module, helper)
    assert before != after
    before, after = _digest_after(module, tmp_path / "unrelated.py")
    assert before == after


def test_a_file_beside_a_plugin_that_would_not_be_imported_is_told(tmp_path: Path) -> None:
    plugin = tmp_path / "dim.py"
    plugin.write_text(METHOD.format(helper="colorsys"))
    (tmp_path / "colorsys.py").write_text("LEVEL = 0.5\n")
    with pytest.raises(PluginError, match=r"imports 'colorsys', which is .*colorsys\.py and not .*; rename the file"):
        Registry((plugin,))


REALLY_IMPORTED = """
import json, os, sys, numpy, pydantic, warp
modules = json.loads(sys.argv[1])
for module in modules:
    if os.fork() == 0:
        before = set(sys.modules)
        __import__(module)
        new = sorted(name for name in set(sys.modules) - before if name.startswith("shadowbench."))
        os.write(1, (json.dumps([module, new]) + "\\n").encode())
        os._exit(0)
    os.wait()
"""


def _plugin_modules() -> list[str]:
    registry = Registry()
    kinds = ("method", "scene")
    return sorted({entry.load().__module__ for kind in kinds for entry in registry.entries(kind)})  # type: ignore[arg-type]


@pytest.mark.slow
def test_whatever_python_imports_for_a_built_in_plugin_is_found() -> None:
    modules = [*_plugin_modules(), "shadowbench.camera_pass", "shadowbench.filtered_reference", "shadowbench.world"]
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", REALLY_IMPORTED, json.dumps(modules)], capture_output=True, check=True
    )
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [module for module, _ in lines] == modules
    for module, imported in lines:
        assert set(imported) <= set(imported_code.imported_files(module)), module


EDIT = """
import json, sys
from pathlib import Path
from shadowbench import identity
root = Path(sys.argv[1])
assert Path(identity.__file__).is_relative_to(root)
def digests():
    return {module: identity.code_digest(module) for module in json.loads(sys.argv[2])}
before = digests()
for name in json.loads(sys.argv[3]):
    file = root / name
    content = file.read_bytes()
    file.write_bytes(content + b"\\n# edited\\n")
    after = digests()
    file.write_bytes(content)
    print(json.dumps(sorted(module for module in before if after[module] != before[module])))
assert digests() == before
"""

EDITED = {
    "methods/pcf/kernels.py": {"methods.pcf"},
    "methods/pcf/__init__.py": {"methods.pcf"},
    "methods/opengl/look_up.py": {"methods.opengl.*"},
    "scenes/hair_ball.py": {"scenes.hair_ball"},
    "scenes/formats/vtk.py": {"scenes.mesh_file", "scenes.bunny"},  # any reader may be asked for by name
    "shadowbench/experiment.py": set[str](),
    "shadowbench/runner/block.py": set[str](),
    "shadowbench/tables/making.py": set[str](),
    "shadowbench/metrics.py": set[str](),
    "shadowbench/experiments/quick.toml": set[str](),
    "shadowbench/__init__.py": set[str](),
}
"""Edited files, and patterns of the modules whose digests must change; those of other modules must not."""


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """The program's source, copied to where its modules are found without a package map."""
    for source, target in (("shadowbench", ""), ("methods", "methods"), ("scenes", "scenes")):
        shutil.copytree(
            ROOT / source,
            tmp_path / "shadowbench" / target,
            ignore=shutil.ignore_patterns("__pycache__", "static", "templates"),
            dirs_exist_ok=True,
        )
    return tmp_path


def _changed(root: Path, modules: list[str], edited: list[str]) -> list[set[str]]:
    """Return for each file in turn the modules whose digest another content of it changes."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", EDIT, str(root), json.dumps(modules), json.dumps(edited)],
        capture_output=True,
        check=False,
        text=True,
        env=os.environ | {"PYTHONPATH": str(root)},
    )
    assert done.returncode == 0, done.stderr
    return [set(json.loads(line)) for line in done.stdout.splitlines()]


def test_editing_a_file_changes_exactly_what_uses_it(copied: Path) -> None:
    modules = [*_plugin_modules(), "shadowbench.camera_pass", "shadowbench.filtered_reference"]
    places = [name if name.startswith("shadowbench/") else f"shadowbench/{name}" for name in EDITED]
    for changed, (name, patterns) in zip(_changed(copied, modules, places), EDITED.items(), strict=True):
        expected = [fnmatch.filter(modules, f"shadowbench.{pattern}") for pattern in patterns]
        assert changed == set(chain(*expected)), name


def test_editing_shared_device_code_changes_all_that_use_it_and_the_ground_truth(copied: Path) -> None:
    modules = [*_plugin_modules(), "shadowbench.camera_pass", "shadowbench.filtered_reference"]
    shared = ["shadowbench/device/launch.py", "shadowbench/device/visibility.py", "shadowbench/world.py"]
    launch, visibility, world = _changed(copied, modules, shared)
    methods = {module for module in modules if module.startswith("shadowbench.methods.")}
    truth = {"shadowbench.camera_pass", "shadowbench.filtered_reference"}
    assert launch == methods | truth
    assert world == methods | truth
    assert "shadowbench.filtered_reference" in visibility
    assert "shadowbench.methods.ray_traced" in visibility
    assert "shadowbench.methods.no_shadows" not in visibility

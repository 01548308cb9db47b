"""What is installed: the package list against the disk, the built wheel, and the two set-up commands."""

import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def _packages_on_disk() -> set[str]:
    found = set()
    for top, prefix in (
        ("shadowbench", "shadowbench"),
        ("methods", "shadowbench.methods"),
        ("scenes", "shadowbench.scenes"),
    ):
        for init in (ROOT / top).rglob("__init__.py"):
            below = init.parent.relative_to(ROOT / top).parts
            found.add(".".join((prefix, *below)))
    return found


def test_every_package_on_disk_is_listed_in_pyproject() -> None:
    assert set(PYPROJECT["tool"]["setuptools"]["packages"]) == _packages_on_disk()


def test_every_python_folder_is_a_package() -> None:
    for top in ("shadowbench", "methods", "scenes"):
        for module in (ROOT / top).rglob("*.py"):
            assert (module.parent / "__init__.py").exists(), module


def test_entry_points_name_classes_that_exist() -> None:
    points = [p for p in distribution("shadowbench").entry_points if p.group.startswith("shadowbench.")]
    declared = PYPROJECT["project"]["entry-points"]
    assert {p.name for p in points} == {name for group in declared.values() for name in group}
    for point in points:
        assert point.load().name == point.name


@pytest.mark.slow
def test_the_wheel_holds_every_module_and_data_file(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-q", "-w", str(tmp_path)]
    subprocess.run([*command, str(ROOT)], check=True, cwd=tmp_path, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    expected = set()
    for top, prefix in (
        ("shadowbench", "shadowbench"),
        ("methods", "shadowbench/methods"),
        ("scenes", "shadowbench/scenes"),
    ):
        for path in (ROOT / top).rglob("*"):
            if path.is_file() and path.suffix not in (".pyc", ".so"):
                expected.add(f"{prefix}/{path.relative_to(ROOT / top).as_posix()}")
    assert expected <= names
    assert not [n for n in names if n.startswith(("methods/", "scenes/", "tests/"))]


def test_constraints_pin_every_direct_dependency_exactly() -> None:
    pinned = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            name, version = line.split("==")
            pinned[name.lower().replace("_", "-")] = version
    project = PYPROJECT["project"]
    requirements = [
        *project["dependencies"],
        *(r for group in project["optional-dependencies"].values() for r in group),
    ]
    for requirement in requirements:
        name = requirement.split(">")[0].split("[")[0].lower()
        assert name == "shadowbench" or name in pinned, name


def _set_up_commands() -> dict[str, str]:
    found = re.findall(r"<!-- set-up: (\w+) -->\n```sh\n(.+)\n```", (ROOT / "README.md").read_text())
    return dict(found)


def test_the_readme_has_two_set_up_commands_of_one_line() -> None:
    commands = _set_up_commands()
    assert set(commands) == {"run", "tests"}
    assert commands["run"].endswith("shadowbench run")
    assert commands["tests"].endswith("pytest")
    for command in commands.values():
        assert "-c constraints.txt" in command


def test_extras_that_the_readme_installs_exist() -> None:
    for command in _set_up_commands().values():
        (extra,) = re.findall(r"\.\[(\w+)\]", command)
        assert extra in PYPROJECT["project"]["optional-dependencies"]

"""The direction of dependency between the rooms, read from the imports."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

ROOMS: dict[str, set[str]] = {
    # model: what a scene, a view and a parameter are
    "errors": set(),
    "parameters": {"errors"},
    "scene": {"errors"},
    "per_device": set(),
    "placed_instances": {"scene", "device", "per_device"},
    "world": {"device", "errors", "per_device", "placed_instances", "scene"},
    "light_space": {"errors", "scene", "world"},
    "light_space_kernel": set(),
    "receivers": {"scene", "device", "per_device"},
    # device code: knows frames and lights, never a method
    "device": {
        "errors",
        "scene",
        "per_device",
        "placed_instances",
        "world",
        "light_space",
        "light_space_kernel",
        "receivers",
    },
    "account": set(),
    "map_account": {"account", "device", "receivers"},
    "ray_account": {"account", "device", "light_space", "receivers", "scene", "world"},
    "method": {"account", "device", "errors", "light_space", "light_space_kernel", "receivers", "scene", "world"},
    "motion": {"light_space", "method", "scene", "world"},
    "depth_map_method": {
        "account",
        "device",
        "light_picture",
        "light_space",
        "map_account",
        "method",
        "parameters",
        "receivers",
        "scene",
        "world",
    },
    "light_picture": set(),
    "irregular_method": {"account", "device", "light_picture", "method", "ray_account", "receivers", "scene", "world"},
    "filtered_map_method": {
        "account",
        "depth_map_method",
        "device",
        "light_space",
        "map_account",
        "method",
        "parameters",
        "receivers",
        "scene",
        "world",
    },
    "camera_pass": {"errors", "scene", "world", "light_space", "receivers", "device"},
    "reference": {"errors", "scene", "world", "light_space", "receivers", "device"},
    "filtered_reference": {
        *("scene", "world", "light_space", "light_space_kernel", "receivers", "reference", "device"),
    },
    "likeness": {"receivers"},
    "metrics": {"receivers", "reference", "filtered_reference", "likeness", "world"},
    "pictures": {"receivers", "reference", "filtered_reference", "scene", "world"},
    "plugins": {"errors", "method", "scene", "imported_code"},
    "methods": {
        "account",
        "depth_map_method",
        "device",
        "errors",
        "filtered_map_method",
        "irregular_method",
        "light_picture",
        "light_space",
        "map_account",
        "method",
        "parameters",
        "ray_account",
        "receivers",
        "scene",
        "world",
    },
    "scenes": {"errors", "parameters", "scene"},
    "contract": {
        "account",
        "camera_pass",
        "choices",
        "device",
        "errors",
        "light_space",
        "method",
        "motion",
        "parameters",
        "receivers",
        "scene",
        "world",
    },
    # results: read without Warp
    "rows": {"choices"},
    "choices": {"errors"},
    "statistics": set(),
    "machine_state": set(),
    "toml_lines": set(),
    "toml_values": {"errors", "rows", "choices"},
    "claim": {"errors"},
    "claim_file": {"errors", "claim", "toml_values"},
    "experiment_file": {"choices", "claim_file", "errors", "rows", "toml_lines", "toml_values"},
    "experiment": {"errors", "rows", "choices", "claim", "experiment_file"},
    "experiment_groups": {"errors", "experiment"},
    "experiments": set(),
    "imported_code": set(),
    "identity": {"errors", "imported_code", "machine_state", "plugins", "rows"},
    "runner": {
        *(
            "errors",
            "parameters",
            "plugins",
            "choices",
            "experiment",
            "identity",
            "method",
            "motion",
            "scene",
            "world",
            "light_space",
        ),
        *("receivers", "camera_pass", "reference", "metrics", "pictures", "contract", "device", "rows", "store"),
        *("light_space_kernel", "filtered_reference", "imported_code", "statistics", "machine_state"),
    },
    "store": {"errors", "rows", "experiment"},
    "tables": {"choices", "claim", "errors", "experiment", "metrics", "rows", "statistics", "store"},
    "report": {"choices", "errors", "experiment", "metrics", "pictures", "rows", "statistics", "store", "tables"},
    "inspection": {
        "account",
        "choices",
        "depth_map_method",
        "device",
        "errors",
        "experiment",
        "filtered_reference",
        "identity",
        "light_space",
        "light_space_kernel",
        "method",
        "metrics",
        "parameters",
        "pictures",
        "plugins",
        "receivers",
        "reference",
        "rows",
        "runner",
        "scene",
        "store",
        "world",
    },
    "publication": {"errors", "experiment_groups", "inspection", "pictures", "rows", "store", "tables"},
    "service": {"errors", "experiment", "report", "rows", "store", "tables"},
    "cli": {"*"},
}
"""Each room and the rooms it may import from. Extending this list is a decision: write down why in CONTRIBUTING.md."""

WITHOUT_WARP = (
    "rows",
    "experiment",
    "statistics",
    "store",
    "tables",
    "report",
    "service",
    "cli",
    "errors",
    "scene",
    "parameters",
)


def _room_of(path: Path) -> str:
    relative = path.relative_to(ROOT)
    if relative.parts[0] in ("methods", "scenes"):
        return relative.parts[0]
    return relative.parts[1].removesuffix(".py")


def _sources() -> list[Path]:
    return sorted(p for top in ("shadowbench", "methods", "scenes") for p in (ROOT / top).rglob("*.py"))


def _imported_modules(path: Path, *, at_import_time: bool) -> set[str]:
    """Names of modules a file imports; with ``at_import_time`` only those at its top level, not for typing."""
    tree = ast.parse(path.read_text())
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                found.update(alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom) and child.module:
                found.add(child.module)
                if child.module == "shadowbench":
                    found.update(f"shadowbench.{alias.name}" for alias in child.names)
            elif at_import_time and (
                isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
                or (isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test))
            ):
                continue
            visit(child)

    visit(tree)
    return found


def _rooms(modules: set[str]) -> set[str]:
    return {m.split(".")[1] for m in modules if m.startswith("shadowbench.")}


@pytest.mark.parametrize("path", _sources(), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_imports_only_from_rooms_below_it(path: Path) -> None:
    room = _room_of(path)
    if room in ("__init__", "__main__"):
        return
    allowed = ROOMS[room]
    imported = _rooms(_imported_modules(path, at_import_time=False))
    # measures and pictures name the reference for type checkers only
    forbidden = set() if "*" in allowed else imported - allowed - {room}
    assert not forbidden, f"{room} may not import from {sorted(forbidden)}"


@pytest.mark.parametrize("package", ["methods"])
def test_methods_do_not_import_each_other(package: str) -> None:
    for path in (ROOT / package).rglob("*.py"):
        own = path.relative_to(ROOT).parts[1]
        for module in _imported_modules(path, at_import_time=False):
            if module.startswith("shadowbench.methods."):
                assert module.split(".")[2] == own, f"{path} imports {module}"


@pytest.mark.parametrize("room", WITHOUT_WARP)
def test_reading_tabling_and_serving_start_without_warp(room: str) -> None:
    for path in _sources():
        if _room_of(path) != room:
            continue
        imported = _imported_modules(path, at_import_time=True)
        heavy = {m for m in imported if m.split(".")[0] == "warp"}
        heavy |= imported & {"shadowbench.method", "shadowbench.device", "shadowbench.reference"}
        assert not heavy, f"{path} imports {sorted(heavy)} at start"


def test_no_room_is_missing_from_the_plan() -> None:
    rooms = {_room_of(p) for p in _sources()} - {"__init__", "__main__"}
    assert rooms <= set(ROOMS)

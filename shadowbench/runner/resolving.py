"""Names and parameters, as written, against the plugins that exist: the worker's part of making a plan.

Everything returned is a JSON value, since the runner itself never imports a plugin.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined, to_jsonable_python

from shadowbench.choices import Choice
from shadowbench.errors import UsageError
from shadowbench.identity import code_digest, file_digest, key_of, library_version
from shadowbench.parameters import parse_parameters

if TYPE_CHECKING:
    from shadowbench.plugins import Registry

MESH_FILE = "mesh-file"
"""The scene that a mesh file's path stands for; its parameter ``path`` takes it."""


_SCENE_LIBRARIES = ("numpy", "warp-lang", "pyvista", "vtk", "usd-core")
"""What scenes are made with, and read from; the scanned bunny is a file of Warp's."""


def describe_device(device: str) -> dict[str, Any]:
    """Return what a plan needs to know about a Warp device and about the code that every case uses.

    Raises:
        UsageError: There is no such device.
    """
    import warp as wp

    from shadowbench.metrics import METRIC_VERSION

    try:
        found = wp.get_device(device)
    except Exception:  # noqa: BLE001 - Warp raises several kinds
        known = ", ".join(str(d) for d in wp.get_devices())
        raise UsageError(f"there is no device '{device}'; this machine has: {known}") from None
    return {
        "kind": "cuda" if found.is_cuda else "cpu",
        "truth": key_of([code_digest(f"shadowbench.{name}") for name in ("camera_pass", "filtered_reference")]),
        "measures": key_of([METRIC_VERSION, library_version("scipy"), library_version("flip-evaluator")]),
        "warp": library_version("warp-lang") or "",
        "settings": {
            "device": f"{found.alias} ({found.name})",
            "mode": str(wp.config.mode),
            "cpu_compiler_flags": str(wp.config.cpu_compiler_flags or "Warp's own"),
            "optimization_level": str(wp.config.optimization_level or "Warp's own"),
        },
    }


def describe_method(registry: Registry, name: str) -> dict[str, Any]:
    """Return what a plan needs to know about a method.

    Raises:
        PluginError: There is no such method, or it cannot be loaded.
    """
    method = registry.method(name)
    unavailable = method.available()
    fields = method.Parameters.model_fields
    all_defaults = {name: info.get_default(call_default_factory=True) for name, info in fields.items()}
    defaults = {name: value for name, value in all_defaults.items() if value is not PydanticUndefined}
    return {
        "defaults": to_jsonable_python(defaults),
        "title": method.title,
        "devices": sorted(method.devices),
        "deterministic": method.deterministic,
        "code": code_digest(method.__module__),
        "libraries": method.library_versions() if unavailable is None else {},
        "unavailable": unavailable,
    }


def resolve_parameters(plugin: type[Any], owner: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return all parameters with the defaults filled in, as JSON values.

    Raises:
        ParameterError: An unknown name or a value out of range.
    """
    return parse_parameters(plugin.Parameters, values, owner=owner).model_dump(mode="json")


def resolve_scene(registry: Registry, name: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return a scene's plugin, what to call it, its parameters, and the key of the world it will give.

    Args:
        registry: The plugins.
        name: A scene's name or a mesh file's path.
        values: Its parameters as written.

    Raises:
        PluginError: There is no such scene, or it cannot be loaded.
        ParameterError: An unknown name or a value out of range.
    """
    shown = name
    if Choice(name).is_mesh_file:
        name, values, shown = MESH_FILE, values | {"path": name}, Path(name).name
    plugin = registry.scene(name)
    parameters = parse_parameters(plugin.Parameters, values, owner=f"scene '{shown}'")
    files = _files_of(parameters)
    portable = {key: value for key, value in parameters.model_dump(mode="json").items() if key not in files}
    code = [code_digest(plugin.__module__), code_digest("shadowbench.world"), *map(library_version, _SCENE_LIBRARIES)]
    content = {key: _digest_or_nothing(path) for key, path in files.items()}
    return {
        "plugin": name,
        "name": shown,
        "parameters": parameters.model_dump(mode="json"),
        "portable_parameters": portable,
        "key": key_of([name, portable, content, code]),
    }


def _files_of(parameters: BaseModel) -> dict[str, Path]:
    """Parameters that are paths: the files' content counts, not where they lie."""
    values = {name: getattr(parameters, name) for name in type(parameters).model_fields}
    return {name: value for name, value in values.items() if isinstance(value, Path)}


def _digest_or_nothing(path: Path) -> str:
    try:
        return file_digest(path.expanduser())
    except OSError:
        return ""  # making the scene will say what is wrong with it

"""What cases share, made once and kept in the cache: placed worlds, receivers, and ground truth.

Runs in a worker. A scene is made when the plan is (its lights and cameras must be known); receivers and reference of a
view are made before the first case that needs them (a reference only where quality is not known from an earlier run),
and the reference is filtered after the last round, for each kernel
that a method told. Each is keyed by what it is made of: contents, code, and the Warp that compiles its kernels.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.device.launch import Context
from shadowbench.identity import code_digest, content_digest, key_of, library_version
from shadowbench.light_space_kernel import LightSpaceKernel
from shadowbench.parameters import parse_parameters
from shadowbench.runner.cache import Cache, CacheMissError
from shadowbench.world import World, place

if TYPE_CHECKING:
    from shadowbench.plugins import Registry
    from shadowbench.receivers import Receivers
    from shadowbench.reference import Reference


def place_scene(registry: Registry, folder: Path, scene: dict[str, Any]) -> dict[str, Any]:
    """Make and place a scene unless the cache has it.

    Args:
        registry: The plugins.
        folder: Of the cache.
        scene: As :func:`shadowbench.runner.resolving.resolve_scene` returns it.

    Returns:
        The world's content digest, its number of triangles, the names of its lights and cameras, its notes.

    Raises:
        SceneError: The scene cannot be made or placed.
    """
    cache, name = Cache(folder), world_name(scene["key"])
    described = folder / f"{name}.json"
    if cache.has(name) and described.exists():
        known: dict[str, Any] = json.loads(described.read_text(encoding="utf-8"))
        return known
    plugin = registry.scene(scene["plugin"])
    owner = f"scene '{scene['name']}'"
    world = place(plugin().make(parse_parameters(plugin.Parameters, scene["parameters"], owner=owner)))
    cache.store(name, world)
    description = {
        "content": content_digest(world),
        "triangles": world.triangle_count,
        "lights": list(world.lights),
        "cameras": list(world.cameras),
        "notes": list(world.notes),
    }
    temporary = described.with_suffix(".writing")
    temporary.write_text(json.dumps(description), encoding="utf-8")
    temporary.replace(described)
    return description


def world_name(key: str) -> str:
    """Return the cache name of the world with a key."""
    return f"world-{key}"


def prepare(folder: Path, view: dict[str, Any], threads: int, *, with_reference: bool) -> dict[str, Any]:
    """Render the receivers of a view and compute their ground truth unless the cache has them.

    Args:
        folder: Of the cache.
        view: A :class:`shadowbench.runner.cases.View` as a dictionary.
        threads: To compute with; the result is the same for any number.
        with_reference: Whether the ground truth is needed.

    Returns:
        The cache names of ``world``, ``receivers`` and, if it is needed, ``reference``.

    Raises:
        SceneError: The camera sees nothing.
        CacheMissError: The world was removed since the plan was made.
    """
    from shadowbench.camera_pass import render
    from shadowbench.reference import hard_reference

    cache, context = Cache(folder), Context("cpu", threads)
    world_entry = world_name(view["world_key"])
    world: World = cache.open(world_entry)
    camera, light = world.cameras[view["camera"]], world.lights[view["light"]]
    picture = {name: view[name] for name in ("width", "height", "pixel_samples", "layers")}
    receivers_key = key_of(
        [view["content"], content_digest(camera), picture, code_digest("shadowbench.camera_pass"), _warp_version()],
    )
    receivers_entry = f"receivers-{receivers_key}"
    reference_key = key_of([receivers_key, content_digest(light), code_digest("shadowbench.reference")])
    reference_entry = f"reference-{reference_key}"
    try:
        receivers: Receivers = cache.open(receivers_entry)
    except CacheMissError:
        receivers = render(
            world,
            camera,
            view["width"],
            view["height"],
            context,
            samples=view["pixel_samples"],
            layers=view["layers"],
        )
        cache.store(receivers_entry, receivers)
    entries = {"world": world_entry, "receivers": receivers_entry}
    if not with_reference:
        return entries
    if not cache.has(reference_entry):
        reference: Reference = hard_reference(world, receivers, light, context)
        cache.store(reference_entry, reference)
    return entries | {"reference": reference_entry}


def prepare_filtered(folder: Path, entries: dict[str, str], light: str, kernel: dict[str, Any], threads: int) -> str:
    """Filter the ground truth of a view with a kernel unless the cache has it.

    Args:
        folder: Of the cache.
        entries: As :func:`prepare` returns them.
        light: The view's, a name in the world.
        kernel: A :class:`shadowbench.light_space_kernel.LightSpaceKernel` as a dictionary.
        threads: To compute with; the result is the same for any number.

    Returns:
        The name of the cache's entry.

    Raises:
        CacheMissError: What the view is made of was removed meanwhile.
    """
    from shadowbench.filtered_reference import POINT_COUNT, filtered_reference

    cache = Cache(folder)
    made_of = [entries["reference"], kernel, POINT_COUNT, code_digest("shadowbench.filtered_reference")]
    entry = f"filtered-{key_of(made_of)}"
    if not cache.has(entry):
        world: World = cache.open(entries["world"])
        receivers: Receivers = cache.open(entries["receivers"])
        reference: Reference = cache.open(entries["reference"])
        filtered = filtered_reference(
            world, receivers, world.lights[light], reference, LightSpaceKernel(**kernel), Context("cpu", threads)
        )
        cache.store(entry, filtered)
    return entry


def _warp_version() -> str:
    """Return the version of Warp, which compiles the kernels that everything but the world comes from."""
    return library_version("warp-lang") or ""

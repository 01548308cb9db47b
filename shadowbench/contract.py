"""The contract of plugins as checks that run: one suite for built-ins, the tests, and plugin authors.

:func:`check_method` and :func:`check_scene` try a plugin on a small world and return what it breaks, one line each.
``shadowbench check`` prints them; the test-suite runs them over every plugin found.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from pydantic import BaseModel, ValidationError

from shadowbench.camera_pass import render
from shadowbench.choices import EVERYTHING, MOVING
from shadowbench.errors import ShadowbenchError
from shadowbench.method import Context, LightSpaceKernel, Method, Trace
from shadowbench.motion import Moment, everything_changed, moment_before
from shadowbench.parameters import describe_parameters
from shadowbench.receivers import Receivers
from shadowbench.scene import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Mesh,
    PointLight,
    RectangularLight,
    Scene,
    ScenePlugin,
    SpotLight,
)
from shadowbench.world import World, place

WIDTH, HEIGHT = 96, 72
"""Size of the trial picture [pixels]."""


def trial_world() -> World:
    """Return a unit box standing on a ground, under each kind of light."""
    ground = np.array([(-3, 0, -3), (-3, 0, 3), (3, 0, 3), (3, 0, -3)], np.float32)
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (0.0, 1.0) for z in (-0.5, 0.5)], np.float32)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
    lights: dict[str, Light] = {
        "directional": DirectionalLight((0.4, 1.0, 0.3)),
        "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 30.0),
        "point": PointLight((0.9, 1.4, 0.7)),
        "area": RectangularLight((1.0, 3.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    }
    return place(
        Scene(
            meshes=(
                Mesh("ground", ground, np.array([(0, 1, 2), (0, 2, 3)], np.int32)),
                Mesh("box", corners, np.array(triangles, np.int32)),
            ),
            instances=(Instance(1), Instance(0)),  # what moves is the first
            lights=lights,
            cameras={"front": Camera((1.5, 2.5, 4.0), (0.0, 0.4, 0.0))},
        )
    )


def check_method(cls: type[Method], parameters: BaseModel | None = None) -> list[str]:
    """Try a method under every kind of light, on one thread and two.

    Args:
        cls: The method.
        parameters: Its parameters; the defaults if not given.

    Returns:
        One line for each breach, empty if there is none.
    """
    breaches = list(_declaration_breaches(cls.name, cls))
    if cls.available() is not None:
        return breaches
    try:
        chosen = cls.Parameters() if parameters is None else parameters
    except ValidationError:
        return [*breaches, "its Parameters cannot be made from defaults, so it cannot be tried"]
    world = trial_world()
    receivers = render(world, world.cameras["front"], WIDTH, HEIGHT, Context())
    for name, light in world.lights.items():
        reason = cls(chosen, Context()).supports(world, light)
        if reason is not None:
            if not (isinstance(reason, str) and reason.strip()):
                breaches.append(f"{name} light: supports() must return None or a reason")
            continue
        try:
            breaches += [f"{name} light: {b}" for b in _result_breaches(cls, chosen, world, light, receivers)]
        except Exception as error:  # noqa: BLE001 - a plugin may raise anything
            breaches.append(f"{name} light: {type(error).__name__}: {error}")
    return breaches


def _declaration_breaches(name: str, cls: type[Any]) -> Iterator[str]:
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name):
        yield f"its name '{name}' is not lower case words joined by hyphens"
    if not (cls.__doc__ or "").strip():
        yield "its class has no docstring"
    for described in describe_parameters(cls.Parameters):
        if not described["help"]:
            yield f"parameter '{described['name']}' has no help"
    config = cls.Parameters.model_config
    if not config.get("frozen") or config.get("extra") != "forbid":
        yield "its Parameters must be frozen and refuse unknown names (derive from ParameterModel)"


def _result_breaches(
    cls: type[Method], parameters: BaseModel, world: World, light: Light, receivers: Receivers
) -> Iterator[str]:
    first, trace, breaches = _run(cls, parameters, world, light, receivers, threads=1)
    yield from breaches
    if first.dtype != np.float32 or first.shape not in ((receivers.count,), (receivers.count, 3)):
        yield f"visibility is {first.dtype} of shape {first.shape}"
        return
    yield from visibility_breaches(first, receivers)
    for counter in trace.counters.keys() - cls.counters.keys():
        yield f"counter '{counter}' is not described in the class attribute 'counters'"
    if not trace.stages:
        yield "no stage was timed; wrap the work in trace.stage(...)"
    if cls.deterministic:
        yield from _repeat_breaches(cls, parameters, world, light, receivers, first, trace)


def _repeat_breaches(
    cls: type[Method],
    parameters: BaseModel,
    world: World,
    light: Light,
    receivers: Receivers,
    first: NDArray[np.float32],
    trace: Trace,
) -> Iterator[str]:
    """Yield what differs from the first result: again, on two threads, or from the frame before."""
    for what, threads in (("a second run", 1), ("two threads", 2)):
        other, other_trace, _ = _run(cls, parameters, world, light, receivers, threads=threads)
        if not np.array_equal(first, other, equal_nan=True):
            yield f"{what} changes {int((first != other).sum())} receivers"
        if trace.counters != other_trace.counters:
            yield f"{what} changes the counters from {trace.counters} to {other_trace.counters}"
        if trace.bytes_by_name() != other_trace.bytes_by_name():
            yield f"{what} changes the bytes kept from {trace.bytes_by_name()} to {other_trace.bytes_by_name()}"
    for moving in MOVING:
        after, _, _ = _run(cls, parameters, world, light, receivers, threads=1, moving=moving)
        if not np.array_equal(first, after, equal_nan=True):
            differs = int((first != after).reshape(receivers.count, -1).any(axis=1).sum())
            yield f"{differs} receivers are not what a first build gives, when what moved since another is: {moving}"


def visibility_breaches(visibility: NDArray[np.float32], receivers: Receivers) -> Iterator[str]:
    """Yield what is wrong with a result: unwritten or NaN, or out of range.

    Args:
        visibility: Shape [n] or [n, 3].
        receivers: Only valid ones are looked at.
    """
    channels = visibility.reshape(receivers.count, -1)
    unset = receivers.valid & np.isnan(channels).any(axis=1)
    if unset.any():
        yield f"{int(unset.sum())} of {int(receivers.valid.sum())} valid receivers are NaN or were not written"
    outside = receivers.valid & ~unset & ((channels < 0.0) | (channels > 1.0)).any(axis=1)
    if outside.any():
        worst = channels[outside].reshape(-1)[np.abs(channels[outside].reshape(-1) - 0.5).argmax()]
        yield f"{int(outside.sum())} valid receivers are outside [0, 1], for instance {float(worst):g}"


def filter_breaches(kernel: Any, on_map: Any, receivers: Receivers) -> Iterator[str]:
    """Yield what is wrong with what a method tells of its filter.

    Args:
        kernel: What :meth:`~shadowbench.method.Method.kernel` returned.
        on_map: What :meth:`~shadowbench.method.Method.exact_on_map` returned.
        receivers: Both were asked about these.
    """
    if not (kernel is None or isinstance(kernel, LightSpaceKernel)):
        yield f"kernel() returns a {type(kernel).__name__}, not a LightSpaceKernel or None"
    if not (on_map is None or np.shape(on_map) == (receivers.count,)):
        yield f"exact_on_map() has shape {np.shape(on_map)}, not one value for each of {receivers.count} receivers"


def _run(
    cls: type[Method],
    parameters: BaseModel,
    world: World,
    light: Light,
    receivers: Receivers,
    *,
    threads: int,
    moving: str = EVERYTHING,
) -> tuple[NDArray[np.float32], Trace, list[str]]:
    context = Context(threads=threads)
    method = cls(parameters, context)
    trace = Trace(context)
    now = Moment(world, light, world.cameras["front"])
    before, changes = moment_before(now, moving)
    visibility = wp.full(receivers.count, np.nan, dtype=wp.float32, device=context.device)
    try:
        if before is not now:
            view = before.view(WIDTH, HEIGHT)
            method.build(before.world.casters, before.light, view, everything_changed(before.world), Trace(context))
        method.build(world.casters, light, now.view(WIDTH, HEIGHT), changes, trace)
        method.shade(receivers, visibility, trace)
        method.explain(receivers, trace)
        breaches = filter_breaches(method.kernel(receivers), method.exact_on_map(receivers), receivers)
        return visibility.numpy().copy(), trace, list(breaches)
    finally:
        method.close()


def check_scene(cls: type[ScenePlugin], parameters: BaseModel | None = None) -> list[str]:
    """Try a scene: it can be made, comes out the same twice, and every camera sees it.

    Args:
        cls: The scene plugin.
        parameters: Its parameters; the defaults if not given. A scene that needs some (a file) is only looked at.
    """
    breaches = list(_declaration_breaches(cls.name, cls))
    try:
        chosen = cls.Parameters() if parameters is None else parameters
    except ValidationError:
        return breaches
    make: Callable[[], World] = lambda: place(cls().make(chosen))  # noqa: E731
    try:
        world, again = make(), make()
    except ShadowbenchError as error:
        return [*breaches, f"it cannot be made: {error}"]
    breaches += [
        f"it comes out different the second time ({attribute})"
        for attribute, one, other in (
            ("vertices", [m.vertices for m in world.meshes], [m.vertices for m in again.meshes]),
            ("triangles", [m.triangles for m in world.meshes], [m.triangles for m in again.meshes]),
        )
        if len(one) != len(other) or not all(map(np.array_equal, one, other))
    ]
    if world.authored != again.authored:
        breaches.append("it comes out different the second time (instances)")
    if (world.lights, world.cameras) != (again.lights, again.cameras):
        breaches.append("its lights or cameras come out different the second time")
    for name, camera in world.cameras.items():
        try:
            render(world, camera, WIDTH, HEIGHT, Context())
        except ShadowbenchError as error:
            breaches.append(f"camera '{name}': {error}")
    return breaches

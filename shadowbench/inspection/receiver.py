"""Everything about one receiver of a case, as plain values that the command line prints and JSON holds."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from shadowbench.account import Account, json_value, plain
from shadowbench.errors import UsageError
from shadowbench.filtered_reference import filtered_reference
from shadowbench.inspection.opening import OpenCase, OpenView, plugin_errors
from shadowbench.inspection.verdicts import Finding, reasons
from shadowbench.light_space import cube_face_of, light_frames
from shadowbench.pictures import towards
from shadowbench.reference import Reference
from shadowbench.scene import PointLight, RectangularLight


@dataclass(frozen=True)
class Surface:
    """A triangle of the world.

    Attributes:
        instance: Number in the scene.
        triangle: Number within its mesh.
        mesh: The mesh's name.
    """

    instance: int
    triangle: int
    mesh: str


@dataclass(frozen=True)
class LightSpacePlace:
    """A point as the light's maps see it: face, window coordinates in [0, 1], linear depth."""

    face: int
    u: float
    v: float
    depth: float


@dataclass(frozen=True)
class Blocker:
    """What truly hides a receiver first.

    Attributes:
        surface: Its triangle.
        distance: From the receiver along the ray to the light [scene units].
        light_space: Where the ray crosses it.
    """

    surface: Surface
    distance: float
    light_space: LightSpacePlace | None


@dataclass(frozen=True)
class ReceiverReport:
    """Everything about one receiver.

    Attributes:
        index: Its number.
        samples: Receivers of its pixel, and which of them this is (``sample``).
        position: In the world, after recentring; ``world_origin`` is what was subtracted [scene units].
        normal: Turned to the camera.
        cosine: Of the angle between the normal and the light.
        surface: Its triangle.
        light_space: Where it is for the light; ``None`` for an area light.
        truth: Hard reference.
        filtered_truth: Of a filtering method, the truth filtered with its kernel.
        blocker: ``None`` where nothing blocks.
        visibility: The method's.
        classes: Masks that it is in.
        reasons: In words.
        account: The method's own, ``None`` where it tells nothing.
    """

    index: int
    sample: int
    samples: int
    position: tuple[float, ...]
    world_origin: tuple[float, ...]
    normal: tuple[float, ...]
    cosine: float
    surface: Surface
    light_space: LightSpacePlace | None
    truth: tuple[float, ...]
    filtered_truth: tuple[float, ...] | None
    is_turned_away: bool
    is_in_field: bool
    blocker: Blocker | None
    visibility: tuple[float, ...]
    classes: tuple[str, ...]
    reasons: tuple[str, ...]
    account: Account | None

    def as_json(self) -> dict[str, Any]:
        """Return the report as JSON values."""
        found: dict[str, Any] = json_value(asdict(self))
        return found


def receiver_at(seen: OpenView, x: int, y: int, sample: int = 0) -> int | None:
    """Return the number of a pixel's receiver, or ``None`` if the pixel has none.

    Args:
        seen: The view.
        x, y: The pixel, from the upper left corner.
        sample: Which of the pixel's receivers.

    Raises:
        UsageError: The pixel is not in the picture, or has fewer receivers.
    """
    receivers = seen.receivers
    if not (0 <= x < receivers.width and 0 <= y < receivers.height):
        raise UsageError(f"--pixel {x},{y}: the picture has pixels 0,0 to {receivers.width - 1},{receivers.height - 1}")
    pixel = y * receivers.width + x
    first, end = (int(receivers.first_of_pixel[p]) for p in (pixel, pixel + 1))
    if first == end:
        return None
    if not 0 <= sample < end - first:
        raise UsageError(f"--sample {sample}: pixel {x},{y} has receivers 0 to {end - first - 1}")
    return first + sample


def nearest_pixel(seen: OpenView, x: int, y: int) -> tuple[int, int]:
    """Return the pixel nearest to another that has a receiver."""
    receivers = seen.receivers
    row, column = np.divmod(receivers.pixel.astype(np.int64), receivers.width)
    nearest = int(np.argmin((row - y) ** 2 + (column - x) ** 2))
    return int(column[nearest]), int(row[nearest])


def report_on(case: OpenCase, index: int) -> ReceiverReport:
    """Return everything about one receiver of a case."""
    seen = case.seen
    receivers, reference = seen.receivers, seen.reference
    pixel = int(receivers.pixel[index])
    first, end = (int(receivers.first_of_pixel[p]) for p in (pixel, pixel + 1))
    masks = case.measured.masks | case.trace.masks
    classes = tuple(name for name, mask in masks.items() if mask[index])
    position = receivers.position[index].astype(np.float64)
    to_light = towards(seen.light, receivers.position[[index]])[0]
    finding = Finding(
        is_valid=bool(receivers.valid[index]),
        is_in_field=bool(reference.in_field[index]),
        is_turned_away=bool(reference.turned_away[index]),
        classes=frozenset(classes),
        truth=_channels(reference.visibility[index]),
        result=_channels(case.visibility[index]),
        blocker_distance=float(reference.blocker_distance[index]),
        diagonal=seen.world.diagonal(),
    )
    account = None
    if case.method is not None and finding.is_valid and finding.is_in_field:
        with plugin_errors(f"method '{case.row.method}': account()"):
            account = case.method.account(receivers, index)
    return ReceiverReport(
        index=index,
        sample=index - first,
        samples=end - first,
        position=plain(position),
        world_origin=seen.world.origin,
        normal=plain(receivers.normal[index]),
        cosine=float(receivers.normal[index].astype(np.float64) @ to_light),
        surface=_surface(seen, int(receivers.triangle[index])),
        light_space=_in_light_space(seen, position),
        truth=finding.truth,
        filtered_truth=_filtered_truth(case, index),
        is_turned_away=finding.is_turned_away,
        is_in_field=finding.is_in_field,
        blocker=_blocker(seen, index, position + float(reference.blocker_distance[index]) * to_light),
        visibility=finding.result,
        classes=classes,
        reasons=tuple(reasons(finding)),
        account=account,
    )


def _channels(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in np.atleast_1d(values))


def _surface(seen: OpenView, triangle: int) -> Surface:
    """Return the name (instance, triangle) of a triangle of the world."""
    world = seen.world
    instance = int(world.instance_of(np.array([triangle]))[0])
    mesh = world.meshes[world.instances[instance].mesh].name
    return Surface(instance, triangle - int(world.first_triangle[instance]), mesh)


def _in_light_space(seen: OpenView, position: Any) -> LightSpacePlace | None:
    if isinstance(seen.light, RectangularLight) or not np.isfinite(position).all():
        return None
    face = 0
    if isinstance(seen.light, PointLight):
        face = int(cube_face_of(np.asarray(position)[None] - np.asarray(seen.light.position))[0])
    u, v, depth, _ = light_frames(seen.light, seen.world)[face].project(np.asarray(position)[None])[0]
    return LightSpacePlace(face, float(u), float(v), float(depth))


def _blocker(seen: OpenView, index: int, crossing: Any) -> Blocker | None:
    triangle = int(seen.reference.blocker[index])
    if triangle < 0:
        return None
    distance = float(seen.reference.blocker_distance[index])
    return Blocker(_surface(seen, triangle), distance, _in_light_space(seen, crossing))


def _filtered_truth(case: OpenCase, index: int) -> tuple[float, ...] | None:
    """Return the truth of one receiver filtered with the method's kernel; the same bits as of the whole picture."""
    kernel = None if case.method is None else case.method.kernel(case.seen.receivers)
    if kernel is None:
        return None
    seen, reference, one = case.seen, case.seen.reference, slice(index, index + 1)
    alone = Reference(
        reference.visibility[one],
        reference.turned_away[one],
        reference.in_field[one],
        reference.blocker[one],
        reference.blocker_distance[one],
    )
    receiver = seen.receivers.only(index)
    return _channels(filtered_reference(seen.world, receiver, seen.light, alone, kernel, case.context).visibility[0])

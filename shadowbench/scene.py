"""The scene model, and the interface of a scene plugin.

What an author writes down: meshes, instances of them, lights, cameras. Nothing here knows Warp, and nothing
is rounded or moved yet; :mod:`shadowbench.world` places a scene for the kernels. Lengths are in the scene's own
unit, angles in degrees, the world is right-handed with y up.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from shadowbench.errors import SceneError

Vector = tuple[float, float, float]
"""A point or direction (x, y, z)."""

OPAQUE: Vector = (0.0, 0.0, 0.0)
"""The transmittance of an ordinary caster."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in its own space.

    Attributes:
        name: What reports call it.
        vertices: Positions, float32 or float64, shape [vertex_count, 3].
        triangles: Vertex indices, int32, shape [triangle_count, 3]; counter-clockwise seen from outside.
        version: Raised by whoever changes the mesh, so that a method's ``build()`` can tell.

    Raises:
        SceneError: No triangles, a wrong shape, an index out of range, or a coordinate that is not finite.
    """

    name: str
    vertices: NDArray[np.floating]
    triangles: NDArray[np.int32]
    version: int = 0

    def __post_init__(self) -> None:
        vertices, triangles = np.asarray(self.vertices), np.asarray(self.triangles)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or vertices.dtype not in (np.float32, np.float64):
            raise SceneError(f"mesh '{self.name}': vertices must be float32 or float64 of shape [n, 3]")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
            raise SceneError(f"mesh '{self.name}': triangles must be integers of shape [n, 3]")
        if len(triangles) == 0:
            raise SceneError(f"mesh '{self.name}' has no triangles")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            wrong = triangles.min() if triangles.min() < 0 else triangles.max()
            raise SceneError(
                f"mesh '{self.name}': a triangle names vertex {int(wrong)}, "
                f"but there are {len(vertices)} vertices (0 to {len(vertices) - 1})"
            )
        finite = np.isfinite(vertices).all(axis=1)
        if not finite.all():
            raise SceneError(f"mesh '{self.name}': vertex {int(np.argmin(finite))} is not finite")
        object.__setattr__(self, "vertices", np.ascontiguousarray(vertices))
        object.__setattr__(self, "triangles", np.ascontiguousarray(triangles, dtype=np.int32))

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)


@dataclass(frozen=True)
class Rotation:
    """A rotation kept as it was written: axis (need not be unit) and angle [degrees], right-hand rule."""

    axis: Vector = (0.0, 1.0, 0.0)
    angle: float = 0.0

    def matrix(self) -> NDArray[np.float64]:
        """Return the 3x3 rotation matrix (Rodrigues)."""
        x, y, z = self.axis
        # written out: from Python 3.12 on, sum() carries along what rounding loses
        length = math.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            raise SceneError(f"a rotation's axis must not be zero: {self.axis}")
        x, y, z = x / length, y / length, z / length
        cosine, sine = cosine_sine(self.angle)
        k = 1.0 - cosine
        return np.array(
            [
                [cosine + x * x * k, x * y * k - z * sine, x * z * k + y * sine],
                [y * x * k + z * sine, cosine + y * y * k, y * z * k - x * sine],
                [z * x * k - y * sine, z * y * k + x * sine, cosine + z * z * k],
            ]
        )


def cosine_sine(degrees: float | NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return cosine and sine of angles [degrees], of their shape, the same bits on every machine.

    Quarter turns are exact, so that a rotation by 90 degrees maps a box onto a box. Elsewhere the Taylor series, whose
    sums and products IEEE 754 rounds in one way only, stay within 2^-52 of the truth; libraries differ in last bits.
    """
    quarter = np.floor(np.asarray(degrees, np.float64) / 90.0 + 0.5)
    angle = (degrees - 90.0 * quarter) * (math.pi / 180.0)
    squared = angle * angle
    cosine, sine = np.ones_like(squared), np.ones_like(squared)
    for n in range(18, 0, -2):  # beyond, terms are below 2^-58 for the eighth of a turn that is left
        cosine = 1.0 - squared / (n * (n - 1)) * cosine
        sine = 1.0 - squared / (n * (n + 1)) * sine
    sine = angle * sine
    odd, minus = quarter % 2.0 == 1.0, np.where(quarter % 4.0 >= 2.0, -1.0, 1.0)
    return minus * np.where(odd, -sine, cosine), minus * np.where(odd, cosine, sine)


@dataclass(frozen=True)
class Instance:
    """One placement of a mesh: scaled, then rotated, then translated.

    Attributes:
        mesh: Index into :attr:`Scene.meshes`.
        translation: [scene units].
        scale: Along the mesh's own axes; none may be 0.
        rotation: Kept as axis and angle, since per-object maps snap the angle.
        transmittance: RGB light let through, 0 opaque ... 1 clear.
        casts: Whether it casts shadows.
        receives: Whether shadows on it are asked for and scored.
        albedo: RGB for pictures only.
        version: Raised by whoever moves the instance.
    """

    mesh: int
    translation: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    rotation: Rotation = field(default_factory=Rotation)
    transmittance: Vector = OPAQUE
    casts: bool = True
    receives: bool = True
    albedo: Vector = (0.75, 0.75, 0.75)
    version: int = 0

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s != 0.0 for s in self.scale):
            raise SceneError(f"an instance's scale must be finite and not 0: {self.scale}")
        if not all(0.0 <= t <= 1.0 for t in self.transmittance):
            raise SceneError(f"a transmittance lies in [0, 1]: {self.transmittance}")

    @property
    def is_placed_as_modelled(self) -> bool:
        """Whether world space is the mesh's own space (then vertices keep their bits)."""
        return self.translation == (0.0, 0.0, 0.0) and self.scale == (1.0, 1.0, 1.0) and self.rotation.angle == 0.0

    def matrix(self) -> NDArray[np.float64]:
        """Return world-from-mesh, shape [3, 4]."""
        return np.column_stack([self.rotation.matrix() * np.array(self.scale), np.array(self.translation)])


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light. ``direction`` points *towards* the light; its length does not matter."""

    direction: Vector

    def __post_init__(self) -> None:
        _require_direction("a directional light's direction", self.direction)


@dataclass(frozen=True)
class SpotLight:
    """A cone of light.

    Attributes:
        position: [scene units].
        direction: Along the beam, *away* from the light.
        angle: Full opening angle of the cone [degrees], in (0, 170].
        near: Distance of the near plane [scene units]; nothing nearer casts. ``None`` fits it.
    """

    position: Vector
    direction: Vector
    angle: float = 60.0
    near: float | None = None

    def __post_init__(self) -> None:
        _require_direction("a spot light's direction", self.direction)
        if not 0.0 < self.angle <= 170.0:
            raise SceneError(f"a spot light's angle lies in (0, 170] degrees: {self.angle}")
        _require_near(self.near)


@dataclass(frozen=True)
class PointLight:
    """Light from one point in all directions (six faces in map-based methods).

    Attributes:
        position: [scene units].
        near: Distance of each face's near plane [scene units]. ``None`` fits it.
    """

    position: Vector
    near: float | None = None

    def __post_init__(self) -> None:
        _require_near(self.near)


@dataclass(frozen=True)
class RectangularLight:
    """An area light: the rectangle ``corner + s edge_u + t edge_v``, s and t in [0, 1]."""

    corner: Vector
    edge_u: Vector
    edge_v: Vector

    def __post_init__(self) -> None:
        if not np.linalg.norm(np.cross(self.edge_u, self.edge_v)) > 0.0:
            raise SceneError("a rectangular light's edges must span an area")


Light = DirectionalLight | SpotLight | PointLight | RectangularLight


def _require_direction(what: str, direction: Vector) -> None:
    length = math.sqrt(sum(c * c for c in direction))
    if not (math.isfinite(length) and length > 0.0):
        raise SceneError(f"{what} must be finite and not zero: {direction}")


def _require_near(near: float | None) -> None:
    if near is not None and not (math.isfinite(near) and near > 0.0):
        raise SceneError(f"a light's near distance must be positive: {near}")


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        eye: Position [scene units].
        target: The point in the picture's centre.
        up: Upwards in the picture; must not be parallel to the view.
        vertical_angle: Field of view from bottom to top [degrees], in (0, 170].
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    vertical_angle: float = 40.0

    def __post_init__(self) -> None:
        view = np.subtract(self.target, self.eye)
        if not np.linalg.norm(np.cross(view, self.up)) > 1e-12 * np.linalg.norm(view) * np.linalg.norm(self.up):
            raise SceneError("a camera's view must have a length and not be parallel to its up direction")
        if not 0.0 < self.vertical_angle <= 170.0:
            raise SceneError(f"a camera's vertical angle lies in (0, 170] degrees: {self.vertical_angle}")


@dataclass(frozen=True)
class Scene:
    """Meshes, their instances, named lights and cameras. The first of each is the default.

    Raises:
        SceneError: No instance, light or camera, or an instance of a mesh that is not there.
    """

    meshes: tuple[Mesh, ...]
    instances: tuple[Instance, ...]
    lights: dict[str, Light]
    cameras: dict[str, Camera]
    notes: tuple[str, ...] = ()
    """Warnings for the user, e.g. about degenerate triangles in a file."""

    def __post_init__(self) -> None:
        for what, those in (("instance", self.instances), ("light", self.lights), ("camera", self.cameras)):
            if not those:
                raise SceneError(f"the scene has no {what}")
        for instance in self.instances:
            if not 0 <= instance.mesh < len(self.meshes):
                raise SceneError(f"an instance names mesh {instance.mesh}, but there are {len(self.meshes)}")

    @property
    def triangle_count(self) -> int:
        """Triangles over all instances."""
        return sum(self.meshes[i.mesh].triangle_count for i in self.instances)


class NoParameters(BaseModel):
    """For plugins that have none."""

    model_config = {"frozen": True, "extra": "forbid"}


class ScenePlugin(ABC):
    """A scene that can be asked for by name.

    ``make`` must give the same scene for the same parameters on every machine: seeded NumPy generators, no BLAS.
    """

    name: ClassVar[str]
    """What the command line and the tables call it, e.g. ``random-triangles``."""
    title: ClassVar[str]
    source: ClassVar[str] = ""
    """The paper or model it comes from."""
    Parameters: ClassVar[type[BaseModel]] = NoParameters

    @abstractmethod
    def make(self, parameters: BaseModel) -> Scene:
        """Build the scene."""

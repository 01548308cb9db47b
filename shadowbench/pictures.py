"""Pictures of a result: the shaded view, the reference beside it, and which receivers fail.

NumPy and Pillow only. Shading is the same for every technique (Lambert under one light, a sky, a tone curve), so that
two pictures of a scene differ in nothing but their shadows. Failure colours are from the palette of Okabe and Ito,
told apart by readers with any kind of colour vision.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.receivers import Receivers
from shadowbench.scene import DirectionalLight, Light, PointLight, RectangularLight, SpotLight

if TYPE_CHECKING:
    from shadowbench.filtered_reference import FilteredReference
    from shadowbench.reference import Reference
    from shadowbench.world import World

FAILURE_COLOURS: dict[str, tuple[int, int, int]] = {
    "classified": (204, 121, 167),
    "false_lit": (230, 159, 0),
    "false_shadow": (86, 180, 233),
    "peter_panning": (213, 94, 0),
    "acne": (0, 114, 178),
}
"""Later ones are painted over earlier ones: peter-panning is false lit, acne is false shadow, and what a
method suspects stays below what fails."""

_HEAT = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)], np.float64)
"""Numbers from small to large: five colours of matplotlib's viridis, read alike with any kind of colour vision."""

ERROR_COLOURS: tuple[tuple[int, int, int], ...] = ((0, 114, 178), (247, 247, 247), (213, 94, 0))
"""Too dark, right, too lit, from the same palette."""

UNSCORED_GREY = 190

_SKY = np.array([0.15, 0.19, 0.26])
_BOUNCE = np.array([0.12, 0.11, 0.09])
_SUN = np.array([1.16, 1.05, 0.86])
_BACKGROUND = np.array([[0.36, 0.52, 0.74], [0.78, 0.85, 0.92]])
"""Colours in linear light: the sky above, what the ground throws back, the light; and the backdrop, top and bottom."""

Image8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]


def shaded(world: World, light: Light, receivers: Receivers, visibility: NDArray[np.float32]) -> Image8:
    """Return the picture that a visibility gives, 8-bit sRGB, shape [height, width, 3]."""
    normal = receivers.normal.astype(np.float64)
    albedo = np.array([i.albedo for i in world.instances])[receivers.instance]
    facing = np.clip((normal * towards(light, receivers.position)).sum(axis=1), 0.0, None)[:, None]
    upward = (0.5 + 0.5 * normal[:, 1])[:, None]
    lit = np.where(receivers.valid[:, None], visibility.reshape(len(receivers), -1), 1.0)
    radiance = albedo * (upward * _SKY + (1.0 - upward) * _BOUNCE + facing * lit * _SUN)
    image = receivers.picture(radiance)
    open_sky = 1.0 - receivers.picture(np.ones(len(receivers)))
    down = np.linspace(0.0, 1.0, receivers.height)[:, None, None]
    image += open_sky[..., None] * (_BACKGROUND[0] * (1.0 - down) + _BACKGROUND[1] * down)
    return to_srgb(image)


def towards(light: Light, positions: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the unit direction from each position [n, 3] to the light (to its centre, for an area light)."""
    match light:
        case DirectionalLight():
            offset = np.broadcast_to(np.asarray(light.direction), positions.shape)
        case SpotLight() | PointLight():
            offset = np.asarray(light.position) - positions.astype(np.float64)
        case RectangularLight():
            centre = np.asarray(light.corner) + 0.5 * (np.asarray(light.edge_u) + np.asarray(light.edge_v))
            offset = centre - positions.astype(np.float64)
    length = np.sqrt((offset * offset).sum(axis=1, keepdims=True))
    direction: NDArray[np.float64] = offset / np.maximum(length, 1e-300)
    return direction


def to_srgb(linear: NDArray[np.float64]) -> Image8:
    """Return linear radiance as 8-bit sRGB; a shoulder from a half on keeps bright surfaces from clipping."""
    shoulder = 0.5 + 0.5 * (1.0 - np.exp(-(linear - 0.5) / 0.5))
    toned = np.where(linear > 0.5, shoulder, np.clip(linear, 0.0, None))
    encoded = np.where(toned <= 0.0031308, 12.92 * toned, 1.055 * toned ** (1.0 / 2.4) - 0.055)
    return (encoded * 255.0 + 0.5).astype(np.uint8)


def failure_picture(base: Image8, receivers: Receivers, masks: dict[str, Mask]) -> Image8:
    """Return the shaded picture in faded grey with the failing receivers painted on it."""
    image = _faded(base)
    flat = image.reshape(-1, 3)
    for name, colour in FAILURE_COLOURS.items():
        if name in masks:
            flat[receivers.pixel[masks[name]]] = colour
    return image.astype(np.uint8)


def _faded(base: Image8) -> NDArray[np.float64]:
    grey = base.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    return np.repeat((110.0 + 0.5 * grey)[..., None], 3, axis=2)


def error_picture(receivers: Receivers, scored: Mask, error: NDArray[np.floating]) -> Image8:
    """Return signed errors on a diverging scale: white for none, blue for too dark, orange for too lit.

    The colour's strength is the root of the error, so that a hundredth can be seen beside the whole.

    Args:
        receivers: Where the receivers are in the picture.
        scored: Which have an error; other pixels are grey.
        error: In [-1, 1], shape [n], or [n, 3] of which the largest channel is shown.
    """
    channels = np.where(scored[:, None], error.reshape(len(receivers), -1), 0.0)
    worst = np.take_along_axis(channels, np.abs(channels).argmax(axis=1)[:, None], axis=1)[:, 0]
    signed = receivers.picture(worst)
    share = receivers.picture(scored)[..., None]
    strength = np.sqrt(np.abs(signed).clip(0.0, 1.0))[..., None]
    dark, right, lit = (np.array(colour, dtype=np.float64) for colour in ERROR_COLOURS)
    image = right + strength * (np.where(signed[..., None] < 0.0, dark, lit) - right)
    return (share * image + (1.0 - share) * UNSCORED_GREY + 0.5).astype(np.uint8)


def mask_picture(receivers: Receivers, mask: Mask) -> bytes:
    """Return a mask as a 1-bit PNG, white where any receiver of the pixel is in it."""
    image = np.zeros(receivers.width * receivers.height, dtype=bool)
    image[receivers.pixel[mask]] = True
    return _encoded(Image.fromarray(image.reshape(receivers.height, receivers.width)))


def heat_picture(base: Image8, receivers: Receivers, values: NDArray[Any]) -> Image8:
    """Return the shaded picture in faded grey with numbers painted on it, the darkest blue 1, yellow the largest.

    A pixel of several receivers shows the largest number among them; 0 is not painted.
    """
    largest = np.zeros(receivers.width * receivers.height)
    np.maximum.at(largest, receivers.pixel, values.astype(np.float64))
    share = (largest - 1.0) / max(float(largest.max()) - 1.0, 1.0)
    steps = np.linspace(0.0, 1.0, len(_HEAT))
    painted = np.stack([np.interp(share, steps, _HEAT[:, channel]) for channel in range(3)], axis=1)
    return np.where(
        (largest > 0.0).reshape(base.shape[:2])[..., None], painted.reshape(base.shape), _faded(base)
    ).astype(np.uint8)


def case_pictures(
    world: World,
    light: Light,
    receivers: Receivers,
    reference: Reference,
    visibility: NDArray[np.float32],
    masks: dict[str, Mask],
    numbers: dict[str, NDArray[Any]] | None = None,
    *,
    filtered: FilteredReference | None = None,
) -> dict[str, bytes]:
    """Return a case's pictures as PNG by name.

    ``result``, ``reference``, ``failures``, one ``mask-…`` a measure, and one ``picture-…`` for each of the
    ``numbers`` that a method reports per receiver; of a filtering method also ``filtered-reference``, and its error
    against that, ``error``.
    """
    result = shaded(world, light, receivers, visibility)
    exact = shaded(world, light, receivers, reference.visibility)
    pictures = {
        "result": png(result),
        "reference": png(exact),
        "failures": png(failure_picture(exact, receivers, masks)),
    }
    if filtered is not None:
        scored = receivers.valid & reference.in_field & ~reference.turned_away
        pictures["filtered-reference"] = png(shaded(world, light, receivers, filtered.visibility))
        pictures["error"] = png(error_picture(receivers, scored, visibility - filtered.visibility))
    for name, mask in masks.items():
        pictures[f"mask-{name.replace('_', '-')}"] = mask_picture(receivers, mask)
    for name, values in (numbers or {}).items():
        pictures[f"picture-{name}"] = png(heat_picture(exact, receivers, values))
    return pictures


def png(image: Image8) -> bytes:
    """Return a picture as a PNG file's bytes."""
    return _encoded(Image.fromarray(image))


def _encoded(image: Image.Image) -> bytes:
    file = io.BytesIO()
    image.save(file, format="PNG", optimize=False)
    return file.getvalue()

"""How like a visibility is to the one it should be: measures of degree, beside the counts of ``shadowbench.metrics``.

All are over *scored* receivers. SSIM and FLIP see pictures: of visibility itself, without the scene's colours, and the
same in both pictures wherever nothing is scored (the sky is lit, the rest is as in the reference); their means are over
the pixels that hold a scored receiver, so that empty picture does not improve them. NumPy, SciPy and FLIP's own
library, which are imported when first asked.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.receivers import Receivers

SSIM_SIGMA = 1.5
"""Standard deviation of SSIM's window [pixels]; 11 wide (Wang et al. 2004, section III-B)."""

_SSIM_TRUNCATE = 3.5
_SSIM_CONSTANTS = (0.01**2, 0.03**2)

PIXELS_PER_DEGREE = 67.0
"""FLIP's viewing condition: its own default, a 4K display 0.7 m wide seen from 0.7 m."""

Floats = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]


def likeness(receivers: Receivers, scored: Mask, reference: Floats, visibility: Floats) -> dict[str, float | None]:
    """Return ``rmse``, ``ssim``, ``flip``, ``leak_mean`` and ``leak_p99``; ``None`` where nothing is scored.

    Args:
        receivers: Where the receivers are in the picture.
        scored: Which count, shape [n].
        reference: What the visibility should be, shape [n] or [n, 3].
        visibility: A method's result, shape [n] or [n, 3]; may be anything where not scored.
    """
    names = ("rmse", "ssim", "flip", "leak_mean", "leak_p99")
    if not scored.any():
        return dict.fromkeys(names)
    should, shown = _channels(reference), _channels(visibility)
    shown = np.where(scored[:, None], shown, should)
    pictures = [_picture(receivers, np.broadcast_to(values, shown.shape)) for values in (should, shown)]
    seen = np.zeros(receivers.width * receivers.height, dtype=bool)
    seen[receivers.pixel[scored]] = True
    seen_image = seen.reshape(receivers.height, receivers.width)
    found = {
        "rmse": root_mean_square(visibility, reference, scored),
        "ssim": float(structural_similarity(*pictures)[seen_image].mean()),
        "flip": float(flip_difference(*pictures)[seen_image].mean(dtype=np.float64)),
    }
    return dict.fromkeys(names) | found | _leaks(scored, reference, visibility)


def root_mean_square(visibility: Floats, reference: Floats, among: Mask) -> float | None:
    """Return the root mean square difference over the receivers in ``among`` and their channels."""
    if not among.any():
        return None
    error = _channels(visibility[among]) - _channels(reference[among])
    return float(np.sqrt(np.mean(error * error)))


def structural_similarity(first: Floats, second: Floats) -> NDArray[np.float64]:
    """Return SSIM of two pictures with values in [0, 1] at every pixel, the mean over channels.

    Wang, Bovik, Sheikh & Simoncelli 2004, "Image quality assessment", equations 13 to 16: statistics under a Gauss
    window, pictures mirrored at their borders.

    Args:
        first, second: Shape [height, width, channels].

    Returns:
        Shape [height, width].
    """
    from scipy.ndimage import gaussian_filter

    def mean(values: Floats) -> NDArray[np.float64]:
        sigma = (SSIM_SIGMA, SSIM_SIGMA, 0.0)
        return np.asarray(gaussian_filter(values, sigma, truncate=_SSIM_TRUNCATE, mode="reflect"))

    a, b = first.astype(np.float64), second.astype(np.float64)
    mean_a, mean_b = mean(a), mean(b)
    variance_a, variance_b = mean(a * a) - mean_a**2, mean(b * b) - mean_b**2
    covariance = mean(a * b) - mean_a * mean_b
    c1, c2 = _SSIM_CONSTANTS
    luminance = (2.0 * mean_a * mean_b + c1) / (mean_a**2 + mean_b**2 + c1)
    structure = (2.0 * covariance + c2) / (variance_a + variance_b + c2)
    return np.asarray((luminance * structure).mean(axis=2))


def flip_difference(reference: Floats, shown: Floats) -> NDArray[np.float32]:
    """Return the LDR-FLIP difference of two pictures at every pixel: 0 for none, 1 for the largest.

    Andersson et al. 2020, "FLIP: a difference evaluator for alternating images", by its authors' library. Visibility is
    taken for linear light: what a white surface would send under this light alone.

    Args:
        reference, shown: Shape [height, width, channels], values in [0, 1]; one channel is grey.

    Returns:
        Shape [height, width].
    """
    import flip_evaluator

    images = [np.repeat(image, 3 // image.shape[2], axis=2).astype(np.float32) for image in (reference, shown)]
    difference, _, _ = flip_evaluator.evaluate(
        *(np.ascontiguousarray(image) for image in images),
        "LDR",
        inputsRGB=False,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": PIXELS_PER_DEGREE},
    )
    return np.asarray(difference, dtype=np.float32).reshape(reference.shape[:2])


def _picture(receivers: Receivers, values: Floats) -> NDArray[np.float64]:
    """Return values [n, channels] as a picture, shape [height, width, channels]; its sky is lit."""
    return receivers.picture(values, background=1.0).clip(0.0, 1.0)


def _leaks(scored: Mask, reference: Floats, visibility: Floats) -> dict[str, float]:
    """Return what is seen of the light, in the brightest channel, where there should be none."""
    dark = scored & (_channels(reference).max(axis=1) == 0.0)
    if not dark.any():
        return {}
    leaked = _channels(visibility[dark]).max(axis=1)
    return {"leak_mean": float(leaked.mean()), "leak_p99": float(np.percentile(leaked, 99.0))}


def _channels(values: Floats) -> NDArray[np.float64]:
    return values.reshape(len(values), -1).astype(np.float64)

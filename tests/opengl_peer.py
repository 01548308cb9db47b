"""Asking the OpenGL peer: skipping where there is none, and reading back what it keeps on its device."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shadowbench.device.launch import Context
from shadowbench.methods.opengl.exponential import OpenglExponential
from shadowbench.methods.opengl.peer import OpenglMethod
from shadowbench.methods.opengl.probe import probe
from shadowbench.methods.opengl.shadow_map import OpenglShadowMap
from shadowbench.methods.opengl.variance import OpenglVariance

METHODS = {cls.name: cls for cls in (OpenglShadowMap, OpenglExponential, OpenglVariance)}

needs_opengl = pytest.mark.skipif(bool(probe().reason), reason=probe().reason or "there is an OpenGL")


def opengl(name: str, **values: Any) -> Any:
    """Return a method of the peer, ``name`` without its prefix, with the parameters in ``values``."""
    cls = METHODS[f"opengl-{name}"]
    return cls(cls.Parameters(**values), Context())


def maps_of(method: OpenglMethod, level: int = 0) -> NDArray[np.float32]:
    """Return a level of the maps of a method that was built, shape [face, row, column] or [face, row, column, 2]."""
    assert method._device is not None
    with method._device:
        textures, _ = method.sampled()
        read = [np.frombuffer(texture.read(level=level), np.float32) for texture in textures]
    size = max(1, textures[0].width >> level)
    shape = (len(read), size, size) if textures[0].components == 1 else (len(read), size, size, 2)
    return np.stack(read).reshape(shape)

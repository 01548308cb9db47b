"""The occluders: counts, contacts, and that shadows' edges do run over rims with the plane far behind."""

from __future__ import annotations

import numpy as np
import pytest
from scene_geometry import assert_lights_are_usable, corners_of, digest, lowest, made, shares_seen, smallest_area

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.reference import hard_reference
from shadowbench.scenes.occluders_on_plane import SLAB_TOP, OccludersOnPlane
from shadowbench.world import World, place


@pytest.fixture(scope="module")
def world() -> World:
    return place(made(OccludersOnPlane))


def test_the_scene_has_the_stated_number_of_triangles(world: World) -> None:
    assert world.triangle_count == 8946
    assert "8,946 triangles" in (__import__(OccludersOnPlane.__module__, fromlist=["x"]).__doc__ or "")
    assert digest(made(OccludersOnPlane)) == digest(made(OccludersOnPlane))
    assert smallest_area(world) > 1e-6


def test_everything_stands_on_the_plane_or_on_what_carries_it(world: World) -> None:
    low = {name: values[0] for name, values in lowest(world).items()}
    for name in ("slab", "grating", "box", "ring", "steps"):
        assert low[name] == pytest.approx(0.0, abs=1e-6), name
    assert -0.001 < low["needle"] <= 0.0
    assert low["ball"] == pytest.approx(SLAB_TOP, abs=1e-6)
    assert low["upper box"] == pytest.approx(0.64, abs=1e-6)


def test_the_ring_touches_the_box_it_leans_on(world: World) -> None:
    box, ring = (corners_of(world, name).reshape(-1, 3) for name in ("box", "ring"))
    front = np.array([np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])
    assert (ring @ front).min() == pytest.approx((box @ front).max(), abs=1e-6)
    at = ring[(ring @ front).argmin()]
    assert at[1] < box[:, 1].max(), "below the box's upper edge"


def test_shadows_edges_run_over_the_slabs_rim(world: World) -> None:
    """Light and shadow within a few texels of the rim, and depths behind it beyond the receiver's."""
    context = Context(threads=2)
    receivers = render(world, world.cameras["overview"], 400, 400, context)
    reference = hard_reference(world, receivers, world.lights["sun"], context)
    slab = corners_of(world, "slab").reshape(-1, 3)
    x, y, z = receivers.position.T
    at_rim = (np.abs(y - SLAB_TOP) < 1e-4) & ((slab[:, 2].max() - z < 0.05) | (slab[:, 0].max() - x < 0.05))
    at_rim &= receivers.instance == [world.meshes[i.mesh].name for i in world.instances].index("slab")
    visibility = reference.visibility[at_rim]
    assert at_rim.sum() > 200
    assert 0.2 < visibility.mean() < 0.8


def test_everything_casts_and_receives(world: World) -> None:
    assert all(instance.casts and instance.receives for instance in world.instances)
    assert world.casters.is_opaque


def test_lights_come_from_above(world: World) -> None:
    assert_lights_are_usable(world)


@pytest.mark.parametrize("camera", ["overview", "rim", "top"])
def test_cameras_see_light_and_shadow(world: World, camera: str) -> None:
    share, lit, shadowed = shares_seen(world, camera)
    assert share > 0.6
    assert lit > 0.4
    assert shadowed > 0.1

"""The ray tracer: equal to the ground truth under its own rule, an ordinary tracer under the other."""

from dataclasses import replace

import numpy as np
import pytest
from builders import square
from surfaces import receivers_at, scattered_receivers, soup, world_of
from tracing import contexts, shaded

from shadowbench.device.launch import Context
from shadowbench.errors import ParameterError
from shadowbench.methods.ray_traced import RayTraced, RayTracedParameters
from shadowbench.parameters import parse_parameters
from shadowbench.reference import hard_reference
from shadowbench.scene import DirectionalLight, PointLight, RectangularLight, SpotLight

CONTEXT = Context()

LIGHTS = {
    "directional": DirectionalLight((0.4, 1.0, 0.3)),
    "spot": SpotLight((1.5, 4.0, 1.0), (-1.5, -4.0, -1.0), 30.0),
    "point": PointLight((1.5, 4.0, 1.0)),
    "point within": PointLight((0.2, 0.6, 0.1)),
    "near plane": PointLight((0.2, 0.9, 0.1), near=0.3),
}


def exact(context=CONTEXT):
    return RayTraced(RayTracedParameters(), context)


def ordinary(offset=1e-5, context=CONTEXT):
    return RayTraced(RayTracedParameters(self_hit="offset", offset=offset), context)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("threads", [1, 2])
def test_from_the_surface_it_equals_the_reference_on_every_receiver(light, threads):
    rng = np.random.default_rng(1)
    world = world_of(soup(1500, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng, on_edges=0.3)
    context = Context(threads=threads)
    found, _ = shaded(exact(context), world, world.lights[light], receivers)
    truth = hard_reference(world, receivers, world.lights[light], CONTEXT)
    np.testing.assert_array_equal(found, truth.visibility)
    assert 0.1 < found.mean() < 0.9


@pytest.mark.parametrize("light", ["directional", "spot", "point within"])
def test_from_an_offset_it_gives_the_same_bits_for_one_and_two_threads(light):
    rng = np.random.default_rng(2)
    world = world_of(soup(1500, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng)
    one, two = (shaded(ordinary(context=c), world, world.lights[light], receivers)[0] for c in contexts())
    np.testing.assert_array_equal(one, two)


def test_a_small_offset_differs_little_from_the_truth_and_a_large_one_much():
    rng = np.random.default_rng(3)
    world = world_of(soup(1500, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 20_000, rng)
    light = world.lights["directional"]
    truth = hard_reference(world, receivers, light, CONTEXT)
    facing = ~truth.turned_away
    wrong = [
        int((shaded(ordinary(offset), world, light, receivers)[0] != truth.visibility)[facing].sum())
        for offset in (1e-6, 1e-4, 1e-2)
    ]
    assert wrong[0] < wrong[1] < wrong[2]
    assert wrong[0] < 20
    assert wrong[2] > 500


def test_a_gap_narrower_than_the_offset_is_leapt():
    lights = {"sun": DirectionalLight((0.0, 1.0, 0.0))}
    world = world_of(square(3.0), square(1.0, 0.01), lights=lights)
    receivers = receivers_at(world, np.array([0]), np.array([[0.5, 0.0, 0.5]]))
    light, diagonal = world.lights["sun"], world.diagonal()
    assert shaded(exact(), world, light, receivers)[0][0] == 0.0
    assert shaded(ordinary(0.009 / diagonal), world, light, receivers)[0][0] == 0.0
    assert shaded(ordinary(0.011 / diagonal), world, light, receivers)[0][0] == 1.0


def test_receivers_that_ask_for_nothing_get_no_ray():
    rng = np.random.default_rng(4)
    world = world_of(soup(300, rng), lights=LIGHTS)
    everything = scattered_receivers(world, 4000, rng)
    some = replace(everything, valid=rng.random(4000) < 0.5)
    for method in (exact(), ordinary()):
        for light in ("directional", "spot"):
            placed = world.lights[light]
            in_field = hard_reference(world, everything, placed, CONTEXT).in_field
            found, trace = shaded(method, world, placed, some)
            full, _ = shaded(method, world, placed, everything)
            np.testing.assert_array_equal(found[some.valid], full[some.valid])
            assert trace.counters == {"rays": int((some.valid & in_field).sum())}
            assert not np.isnan(found).any()


def test_the_tree_is_built_again_only_where_casters_moved():
    rng = np.random.default_rng(5)
    world = world_of(soup(300, rng), lights=LIGHTS)
    other = world_of(soup(300, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 3000, rng)
    light = world.lights["directional"]
    method = exact()
    first, trace = shaded(method, world, light, receivers)
    assert list(trace.stages) == ["BVH construction", "field of view", "shadow rays"]
    assert set(trace.bytes_by_name()) == {"BVH boxes", "BVH triangles"}
    moved_light, _ = shaded(method, world, world.lights["point"], receivers, instances=frozenset())
    np.testing.assert_array_equal(moved_light, shaded(exact(), world, world.lights["point"], receivers)[0])
    elsewhere = scattered_receivers(other, 3000, rng)
    moved_casters, _ = shaded(method, other, light, elsewhere)
    np.testing.assert_array_equal(moved_casters, shaded(exact(), other, light, elsewhere)[0])
    again, _ = shaded(method, world, light, receivers)
    np.testing.assert_array_equal(again, first)


def test_where_nothing_casts_everything_turned_to_the_light_is_lit():
    world = world_of(square(1.0), lights={"sun": DirectionalLight((0.0, 1.0, 0.0))}, casts=(False,))
    receivers = receivers_at(world, np.array([0, 1]), np.array([[0.5, 0.0, 0.5], [0.3, 0.3, 0.4]]))
    for method in (exact(), ordinary()):
        assert (shaded(method, world, world.lights["sun"], receivers)[0] == 1.0).all()


def test_it_says_what_it_cannot_do():
    panel = RectangularLight((0.0, 2.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    world = world_of(square(1.0), lights={"panel": panel})
    assert "area light" in (exact().supports(world, panel) or "")
    glass = world_of(square(1.0), lights=LIGHTS, transmittance=(0.5, 0.5, 0.5))
    assert exact().supports(glass, glass.lights["point"]) is None
    offset = RayTraced(RayTraced.Parameters(self_hit="offset"), Context())
    assert "opaque" in (offset.supports(glass, glass.lights["point"]) or "")
    assert exact().supports(world_of(square(1.0), lights=LIGHTS), LIGHTS["spot"]) is None


def test_the_row_names_the_rule():
    assert exact().self_hit_rule() == "plane"
    assert ordinary(1e-4).self_hit_rule() == "offset:0.0001"
    with pytest.raises(ParameterError, match="self_hit"):
        parse_parameters(RayTracedParameters, {"self_hit": "epsilon"}, owner="method 'ray-traced'")
    with pytest.raises(ParameterError, match="offset"):
        parse_parameters(RayTracedParameters, {"offset": -1.0}, owner="method 'ray-traced'")


@pytest.mark.slow
def test_an_independent_float64_locator_agrees_on_offset_rays():
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

    from shadowbench.device.rays import OffsetRays

    rng = np.random.default_rng(6)
    world = world_of(soup(3000, rng), lights=LIGHTS)
    receivers = scattered_receivers(world, 4000, rng)
    points, cells, mesh = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    points.SetData(numpy_to_vtk(world.vertices.astype(np.float64), deep=True))
    offsets = np.arange(0, 3 * len(world.triangles) + 1, 3)
    cells.SetData(
        numpy_to_vtkIdTypeArray(offsets.astype(np.int64), deep=True),
        numpy_to_vtkIdTypeArray(world.triangles.ravel().astype(np.int64), deep=True),
    )
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(mesh)
    locator.BuildLocator()
    for name in ("directional", "point within"):
        light = world.lights[name]
        found, _ = shaded(ordinary(), world, light, receivers)
        rays = OffsetRays(receivers, light, 1e-5 * world.diagonal(), CONTEXT)
        origin, towards = (a.numpy().astype(np.float64) for a in (rays.origin, rays.towards))
        end = origin + towards * np.minimum(rays.reach.numpy().astype(np.float64), 10.0)[:, None]
        t, sub, cell = vtk.mutable(0.0), vtk.mutable(0), vtk.mutable(0)
        x, parametric = [0.0] * 3, [0.0] * 3
        hit = [
            locator.IntersectWithLine(a, b, 0.0, t, x, parametric, sub, cell)
            for a, b in zip(origin.tolist(), end.tolist(), strict=True)
        ]
        np.testing.assert_array_equal(found == 0.0, np.array(hit, dtype=bool))

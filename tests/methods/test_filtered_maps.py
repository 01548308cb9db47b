"""What holds for every technique that filters its map beforehand."""

import numpy as np
import pytest
from builders import LIGHTS, box_over_ground
from hypothesis import given, settings
from hypothesis import strategies as st
from layers import RECEIVERS, layered
from running import REGISTRY, run_method
from tracing import shaded

from shadowbench.camera_pass import render
from shadowbench.contract import visibility_breaches
from shadowbench.device.filter_weights import gauss_sigma
from shadowbench.errors import ParameterError
from shadowbench.method import Context, LightSpaceKernel
from shadowbench.parameters import parse_parameters

BOX = box_over_ground()
ON_BOX = render(BOX, BOX.cameras["front"], 40, 30, Context())
METHODS = ["csm", "esm", "vsm"]

_SHARED = {
    "resolution": st.integers(1, 70),
    "bias": st.floats(0.0, 1.0),
    "kernel": st.sampled_from([0, 1, 3, 5, 7, 33, 63]),
    "filtering": st.sampled_from(["nearest", "bilinear", "trilinear", "anisotropic"]),
    "anisotropy": st.integers(1, 16),
    "slope_bias": st.floats(0.0, 64.0),
}
_OWN = {
    "esm": {
        "c": st.floats(1e-30, 87.0),
        "classification": st.sampled_from(["none", "threshold", "z-max"]),
        "epsilon": st.floats(1e-4, 1e6),
        "offset": st.floats(0.0, 1.0),
        "fallback_source": st.sampled_from(["stored", "unblurred"]),
        "log_space": st.booleans(),
    },
    "vsm": {
        "minimum_variance": st.floats(0.0, 1.0),
        "bleeding_reduction": st.floats(0.0, 0.99),
        "slope_term": st.booleans(),
    },
    "csm": {
        "terms": st.integers(1, 32),
        "basis": st.sampled_from(["8-bit", "float"]),
        "offset": st.floats(0.0, 1.0),
        "attenuation": st.floats(0.0, 100.0),
    },
}


@pytest.mark.parametrize("name", METHODS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_no_valid_parameters_give_a_nan_an_infinity_or_a_value_out_of_range(name, data):
    values = data.draw(st.fixed_dictionaries(_SHARED | _OWN[name]))
    light = data.draw(st.sampled_from(sorted(LIGHTS)))
    visibility, trace = run_method(name, BOX, ON_BOX, light=light, **values)
    assert not list(visibility_breaches(visibility, ON_BOX))
    for kept in trace.kept.values():
        assert np.isfinite(kept.numpy().astype(np.float64)).all()


@settings(max_examples=30, deadline=None)
@given(c=st.floats(87.0, 10_000.0), kernel=st.sampled_from([0, 5]), classification=st.sampled_from(["none", "z-max"]))
def test_no_steepness_in_log_space_gives_a_nan_or_an_infinity(c, kernel, classification):
    values = {"c": c, "kernel": kernel, "classification": classification, "resolution": 33}
    visibility, trace = run_method("esm", BOX, ON_BOX, light="lamp", log_space=True, **values)
    assert not list(visibility_breaches(visibility, ON_BOX))
    kept = trace.kept["logarithmic map"].numpy()
    assert np.isfinite(kept).all()


@pytest.mark.parametrize("filtering", ["nearest", "bilinear", "trilinear", "anisotropic"])
@pytest.mark.parametrize("kernel", [0, 7])
@pytest.mark.parametrize("name", METHODS)
def test_a_plane_with_nothing_over_it_is_lit(name, kernel, filtering):
    world = layered((0.0, 1.9))
    visibility, _ = run_method(name, world, RECEIVERS, kernel=kernel, filtering=filtering, resolution=100)
    np.testing.assert_allclose(visibility, 1.0, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "expected"), [("vsm", {"moment map": 44_739_240}), ("csm", {"basis images": 178_956_960})]
)
def test_memory_of_2048_texels_is_the_papers_to_the_byte(name, expected):
    _, trace = run_method(name, BOX, ON_BOX, resolution=2048, threads=2)
    assert trace.bytes_by_name() == expected
    assert trace.counters["chain texels"] == 5_592_405


@pytest.mark.parametrize("name", METHODS)
def test_building_again_gives_the_same_map_in_the_same_memory(name):
    cls = REGISTRY.method(name)
    method = cls(cls.Parameters(resolution=64), Context())
    first, trace = shaded(method, BOX, BOX.lights["lamp"], ON_BOX)
    kept = {k: v.numpy().copy() for k, v in trace.kept.items()}
    again, trace_again = shaded(method, BOX, BOX.lights["lamp"], ON_BOX)
    np.testing.assert_array_equal(first, again)
    for k, v in trace_again.kept.items():
        np.testing.assert_array_equal(v.numpy(), kept[k])
        assert v.ptr == trace.kept[k].ptr
    assert trace.counters == trace_again.counters


@pytest.mark.parametrize("name", METHODS)
def test_the_windows_footprint_is_told_to_the_filtered_reference(name):
    cls = REGISTRY.method(name)

    def kernel(**values):
        return cls(cls.Parameters(**values), Context()).kernel(ON_BOX)

    assert kernel(kernel=7) == LightSpaceKernel("gauss", 7.0, 1024, gauss_sigma(7))
    assert kernel(kernel=7, filtering="nearest", resolution=512) == LightSpaceKernel("gauss", 7.0, 512, gauss_sigma(7))
    assert kernel(kernel=0) == kernel(kernel=1) == LightSpaceKernel("bilinear", 2.0, 1024)
    assert kernel(kernel=0, filtering="nearest") is None


@pytest.mark.parametrize("name", METHODS)
def test_a_window_without_a_centre_is_refused(name):
    with pytest.raises(ParameterError, match=r"parameter 'kernel' = '4'.* odd, or 0 for none"):
        parse_parameters(REGISTRY.method(name).Parameters, {"kernel": "4"}, owner=f"method '{name}'")


@pytest.mark.parametrize("name", METHODS)
def test_a_chain_is_made_only_where_it_is_looked_up(name):
    stages = {f: run_method(name, BOX, ON_BOX, filtering=f, resolution=64)[1].stages for f in ("bilinear", "trilinear")}
    assert "mip chain" not in stages["bilinear"]
    assert "mip chain" in stages["trilinear"]

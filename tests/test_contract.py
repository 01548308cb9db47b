"""Every method and every scene found, held to the contract; and the contract itself, tried on plugins that break it."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from pydantic import BaseModel, ConfigDict

from shadowbench.contract import check_method, check_scene, trial_world
from shadowbench.method import Method, Trace
from shadowbench.parameters import ParameterModel, parameter
from shadowbench.plugins import Registry
from shadowbench.receivers import Receivers
from shadowbench.scene import Scene, ScenePlugin

REGISTRY = Registry()


def _small_maps(cls: type[Method]) -> dict[str, int]:
    """Return parameters for a method that draws maps: their size does not matter to the contract, but to its time."""
    return {"resolution": 128} if "resolution" in cls.Parameters.model_fields else {}


@pytest.mark.parametrize("name", REGISTRY.names("method"))
def test_a_method_keeps_the_contract(name: str) -> None:
    cls = REGISTRY.method(name)
    if (reason := cls.available()) is not None:
        pytest.skip(reason)
    assert check_method(cls, cls.Parameters(**_small_maps(cls))) == []


@pytest.mark.parametrize("name", REGISTRY.names("method"))
def test_a_methods_parameters_can_be_made_from_defaults(name: str) -> None:
    assert isinstance(REGISTRY.method(name).Parameters(), BaseModel)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("shadow-map", {"receiver_plane": True, "slope_bias": 0.0}),
        ("shadow-map", {"normal_offset": 2.0, "resolution": 37}),
        ("pcf", {"filter": "bilinear"}),
        ("pcf", {"filter": "gauss", "kernel": 7}),
        ("pcf", {"filter": "box", "kernel": 8, "receiver_plane": True}),
        ("pcf", {"footprint": "pixel", "kernel": 6, "normal_offset": 1.0}),
        ("ray-traced", {"self_hit": "offset"}),
        ("instanced", {"candidates": "z-fail", "skip_other_test": True, "resolution": 37}),
        ("instanced", {"sizing": "importance"}),
        ("instanced", {"application": "all-maps", "slope_bias": 0.0}),
        ("csm", {"basis": "float", "terms": 7, "attenuation": 1.0, "kernel": 0, "resolution": 200}),
        ("esm", {"classification": "z-max", "filtering": "anisotropic", "resolution": 300}),
        ("esm", {"log_space": True, "c": 500.0, "kernel": 3, "resolution": 200}),
        ("esm", {"classification": "none", "filtering": "nearest", "kernel": 0}),
        ("vsm", {"slope_term": True, "bleeding_reduction": 0.2, "filtering": "bilinear", "resolution": 333}),
    ],
)
def test_a_method_keeps_the_contract_with_other_parameters(name: str, values: dict[str, Any]) -> None:
    cls = REGISTRY.method(name)
    assert check_method(cls, cls.Parameters(**_small_maps(cls) | values)) == []


@pytest.mark.parametrize("name", REGISTRY.names("scene"))
def test_a_scene_keeps_the_contract(name: str) -> None:
    assert check_scene(REGISTRY.scene(name)) == []


class _Trial(Method):
    """A method with one thing wrong at a time."""

    name = "trial"
    title = "Trial"
    calls = 0

    def build(self, casters: Any, light: Any, view: Any, changes: Any, trace: Trace) -> None:
        with trace.stage("nothing"):
            pass

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.fill_(0.0)


class _Nan(_Trial):
    """Leaves a receiver unwritten."""

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.numpy()[1:] = 0.0


class _OutOfRange(_Trial):
    """Writes 2."""

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.numpy()[:] = np.where(np.arange(receivers.count) == 5, 2.0, 0.0)


class _Unsteady(_Trial):
    """Changes between runs."""

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.fill_(0.0)
        type(self).calls += 1
        visibility.numpy()[0] = float(self.calls % 2)


class _ByThread(_Trial):
    """Counts threads."""

    counters = {"work": "depends on threads"}  # noqa: RUF012

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.fill_(0.0)
        trace.count("work", self.context.threads)


class _Stale(_Trial):
    """Keeps what it saw first."""

    seen: Any = None

    def build(self, casters: Any, light: Any, view: Any, changes: Any, trace: Trace) -> None:
        super().build(casters, light, view, changes, trace)
        if self.seen is None:
            self.seen = sum(hash((i.translation, i.rotation)) for i in casters.instances), hash(light), view.camera.eye

    def shade(self, receivers: Receivers, visibility: wp.array, trace: Trace) -> None:
        visibility.fill_(float(hash(self.seen) % 4096) / 4096.0)


class _Raises(_Trial):
    """Raises."""

    def build(self, casters: Any, light: Any, view: Any, changes: Any, trace: Trace) -> None:
        raise RuntimeError("nothing works")


class _Undeclared(_Trial):
    """Takes anything."""

    class Parameters(ParameterModel):
        model_config = ConfigDict(extra="allow")
        size: int = parameter(1, unit="1", help="")


@pytest.mark.parametrize(
    ("cls", "words"),
    [
        (_Nan, "not written"),
        (_OutOfRange, "outside [0, 1], for instance 2"),
        (_Unsteady, "a second run changes 1 receivers"),
        (_ByThread, "two threads changes the counters"),
        (_Stale, "when what moved since another is: object"),
        (_Stale, "when what moved since another is: light"),
        (_Stale, "when what moved since another is: camera"),
        (_Raises, "RuntimeError: nothing works"),
        (_Undeclared, "parameter 'size' has no help"),
        (_Undeclared, "refuse unknown names"),
    ],
)
def test_a_breach_is_named(cls: type[Method], words: str) -> None:
    assert any(words in breach for breach in check_method(cls)), check_method(cls)


def test_a_method_that_keeps_the_contract_has_no_breach() -> None:
    assert check_method(_Trial) == []


class _Drifting(ScenePlugin):
    """A scene that is never the same."""

    name = "drifting"
    title = "Drifting"
    made = 0

    def make(self, parameters: Any) -> Scene:
        world = trial_world()
        type(self).made += 1
        mesh = world.meshes[1]
        moved = type(mesh)("box", mesh.vertices + np.float32(self.made), mesh.triangles)
        return Scene((world.meshes[0], moved), world.instances, dict(world.lights), dict(world.cameras))


def test_a_scene_that_changes_is_named() -> None:
    assert "it comes out different the second time (vertices)" in check_scene(_Drifting)

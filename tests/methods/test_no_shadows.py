"""Without shadows every receiver is lit, and exactly what is in shadow is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from builders import LIGHTS, box_over_ground
from running import run_method

from shadowbench.camera_pass import render
from shadowbench.device.launch import Context
from shadowbench.metrics import measure
from shadowbench.reference import hard_reference


@pytest.mark.parametrize("light", sorted(LIGHTS))
def test_what_lies_in_shadow_fails_and_nothing_else(light):
    world = box_over_ground()
    receivers = render(world, world.cameras["front"], 160, 120, Context(threads=2))
    visibility, trace = run_method("no-shadows", world, receivers, light=light)
    assert (visibility == 1.0).all()
    truth = hard_reference(world, receivers, world.lights[light], Context(threads=2))
    found = measure(world, receivers, truth, np.where(truth.in_field, visibility, 0.0), trace.masks).columns
    scored = receivers.valid & truth.in_field & ~truth.turned_away
    assert found["false_lit_count"] == found["failure_count"] == (scored & (truth.visibility == 0.0)).sum() > 20
    assert found["false_shadow_count"] == 0


def test_nothing_is_built_counted_or_kept():
    world = box_over_ground()
    receivers = render(world, world.cameras["front"], 32, 24, Context())
    _, trace = run_method("no-shadows", world, receivers)
    assert trace.counters == {}
    assert trace.bytes_by_name() == {}
    assert list(trace.stages) == ["fill"]

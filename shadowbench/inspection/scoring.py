"""Measuring a visibility that was made elsewhere: the measures, masks and pictures of any technique's, and a row.

The row has an outcome and no times. Its method is what the user calls it, marked as external; it is kept in a run of
its own or beside the case that it is compared with.
"""

from __future__ import annotations

import datetime as dt
import math
import secrets
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.device.launch import Context
from shadowbench.filtered_reference import FilteredReference, filtered_reference
from shadowbench.identity import available_cores, code_version, environment, key_of, machine, visibility_digest
from shadowbench.inspection import kept_visibility
from shadowbench.inspection.opening import OpenView
from shadowbench.light_space_kernel import LightSpaceKernel
from shadowbench.metrics import METRIC_VERSION, measure, measure_likeness
from shadowbench.parameters import parse_parameters
from shadowbench.pictures import case_pictures
from shadowbench.rows import Outcome, ResultRow, RunRecord, RunStatus

if TYPE_CHECKING:
    from shadowbench.plugins import Registry
    from shadowbench.store import Store

EXPERIMENT = "external"
"""Experiment of a run of its own."""

_NOWHERE = "external"
"""Device of a result that was made elsewhere."""


def kernel_of_case(registry: Registry, row: ResultRow, seen: OpenView) -> LightSpaceKernel | None:
    """Return the filter of a case's technique, which its own result is measured by; ``None`` for a hard test."""
    if row.method_title.endswith("(external)"):
        return None
    cls = registry.method(row.method)
    if cls.available() is not None:
        return None
    parameters = parse_parameters(cls.Parameters, row.method_parameters, owner=f"method '{row.method}'")
    method = cls(parameters, Context())
    try:
        return method.kernel(seen.receivers)
    finally:
        method.close()


def score(
    store: Store,
    seen: OpenView,
    visibility: NDArray[np.float32],
    name: str,
    *,
    source: str,
    kernel: LightSpaceKernel | None = None,
    beside: ResultRow | None = None,
    argv: tuple[str, ...] = (),
) -> ResultRow:
    """Measure a visibility and keep its row.

    Args:
        store: The open results folder.
        seen: The view that it is of.
        visibility: Of every receiver, shape [n] or [n, 3].
        name: What the user calls what made it.
        source: The file it comes from.
        kernel: The filter of the truth that likeness is measured against; ``None`` for the hard truth.
        beside: Put the row into this row's run and experiment instead of a new run.
        argv: The command line, for the record.
    """
    world, receivers, reference = seen.world, seen.receivers, seen.reference
    visibility = visibility.copy()
    visibility[~reference.in_field] = 0.0  # as the harness does
    aim: FilteredReference | None = None
    if kernel is not None:
        context = Context(threads=available_cores())
        aim = filtered_reference(world, receivers, seen.light, reference, kernel, context)
    found = measure(world, receivers, reference, visibility, {})
    columns = found.columns | measure_likeness(receivers, reference, visibility, filtered=aim)
    pictures = case_pictures(world, seen.light, receivers, reference, visibility, found.masks, {}, filtered=aim)
    digest = visibility_digest(visibility, receivers.valid)
    pictures[kept_visibility.ARTIFACT] = kept_visibility.written(visibility)
    run = _own_run(name, seen, argv) if beside is None else _with_one_more(store, beside.run_id)
    store.start_run(run)
    view = seen.view
    of_view = [view.content, view.light, view.camera, view.width, view.height, view.pixel_samples, view.layers]
    row = ResultRow(
        run_id=run.run_id,
        experiment=EXPERIMENT if beside is None else beside.experiment,
        comparison="" if beside is None else beside.comparison,
        case_key=key_of([_NOWHERE, name, of_view]),
        quality_key=key_of([_NOWHERE, name, of_view, digest, METRIC_VERSION]),
        scene=view.scene,
        scene_parameters=view.scene_parameters,
        triangles=view.triangles,
        method=name,
        method_title=f"{name} (external)",
        light=view.light,
        camera=view.camera,
        width=view.width,
        height=view.height,
        pixel_samples=view.pixel_samples,
        layers=view.layers,
        device=_NOWHERE,
        threads=1,
        outcome=Outcome.OK,
        warnings=[*view.notes, f"made elsewhere, read from {source}: no times, no memory"],
        visibility_digest=digest,
        machine=run.machine,
        environment=run.environment,
        code_version=run.code_version,
        measured_at=_now(),
        artifacts={picture: store.put_artifact(content, ".png") for picture, content in pictures.items()},
        **{column: _plain(value) for column, value in columns.items()},
    )
    store.add_row(row)
    if beside is None:
        store.finish_run(run.run_id, RunStatus.COMPLETE)
    return row


def _own_run(name: str, seen: OpenView, argv: tuple[str, ...]) -> RunRecord:
    stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%d-%H%M%S")
    return RunRecord(
        run_id=f"{stamp}-{secrets.token_hex(2)}",
        plan_key=key_of([_NOWHERE, name, {key: str(value) for key, value in asdict(seen.view).items()}]),
        title=f"{name} (external)",
        experiments=[EXPERIMENT],
        argv=list(argv),
        created_at=_now(),
        case_count=1,
        machine=machine(),
        environment=environment(),
        code_version=code_version(),
    )


def _with_one_more(store: Store, run_id: str) -> RunRecord:
    record = store.find_run(run_id)
    return record.model_copy(update={"case_count": record.case_count + 1})


def _now() -> str:
    return dt.datetime.now(dt.UTC).isoformat(timespec="seconds")


def _plain(value: Any) -> Any:
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value

"""Experiments: what a run is asked for, as names and values exactly as they were written.

An experiment is a TOML file (the built-in ones lie in ``shadowbench/experiments``) or is made from the command line's
options. This module only parses: which scene, method, light or parameter exists is for the runner to find out. In a
file every key of a ``[[comparison]]`` takes one value or a list, and a list sweeps::

    title = "Maps of two sizes"

    [[comparison]]                      # cases of one comparison are timed in the same rounds
    scene = "random-triangles:triangles=1000/10000"
    light = ["sun", "lamp"]
    size = "640x480"
    pixel_samples = 4                   # each with its own shadow; layers = 8 sees through translucent surfaces
    moving = "object"                   # between two frames; "everything" unless said, also "light" or "camera"
    method = ["ray-traced", {name = "shadow-map", resolution = [512, 2048]}]

    [[table]]
    title = "Cost and failures"
    index = ["method", "resolution"]
    values = ["static_frame_ms", "failure_percent"]
    where = {light = "sun"}             # only these cases

    [[table.printed]]                   # what the source prints, to stand beside ours with the ratio
    where = {method = "shadow-map", resolution = [512, 2048]}
    values = {static_frame_ms = [3.5, 7.1]}

    [[claim]]                           # what is claimed, and the tests that would make it true: shadowbench.claim
    name = "size-costs"
    statement = "A larger map makes a frame slower."
    test = {value = "dynamic_frame_ms", of = {method = "shadow-map"}, is = "growing", over = "resolution"}

Reading, tabling and serving use this module, so it must never import Warp or a plugin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from shadowbench.choices import (
    EVERYTHING,
    Choice,
    choice_of_text,
    layer_count_of,
    moving_of,
    pixel_sample_count_of,
    size_of,
    thread_count_of,
)
from shadowbench.claim import Claim
from shadowbench.errors import ExperimentError, UsageError, did_you_mean
from shadowbench.experiment_file import ComparisonTable, LayoutTable, read

__all__ = [
    "Choice",
    "Comparison",
    "Experiment",
    "Printed",
    "TableLayout",
    "builtin_names",
    "from_options",
    "load",
    "parse",
    "parse_choice",
    "parse_size",
    "with_options",
]

DEFAULT_SCENE = "random-triangles"
DEFAULT_SIZE = (1024, 768)

Scalar = str | int | float | bool

T = TypeVar("T")


@dataclass(frozen=True)
class Comparison:
    """Every combination of scene, light, camera, size and threads, each with all the methods.

    Attributes:
        methods: Empty for every method that is found.
        lights, cameras: Names; ``None`` for a scene's first.
        sizes: Width and height of the picture [pixels].
        pixel_samples: Samples of every pixel, each shadowed by itself.
        layers: Most surfaces that a sample sees through translucent ones.
        moving: What moves between two frames, of :data:`shadowbench.choices.MOVING`.
        threads: Empty for as many as the run's options say.
    """

    scenes: tuple[Choice, ...]
    methods: tuple[Choice, ...] = ()
    lights: tuple[str | None, ...] = (None,)
    cameras: tuple[str | None, ...] = (None,)
    sizes: tuple[tuple[int, int], ...] = (DEFAULT_SIZE,)
    pixel_samples: tuple[int, ...] = (1,)
    layers: tuple[int, ...] = (1,)
    moving: tuple[str, ...] = (EVERYTHING,)
    threads: tuple[int, ...] = ()


@dataclass(frozen=True)
class Printed:
    """What a source prints for some cases.

    Attributes:
        where: Row columns or parameter names, and the values that a case has in all of them.
        values: Numbers by the names of the layout's values, in the units of ours.
    """

    where: dict[str, Scalar]
    values: dict[str, float]


@dataclass(frozen=True)
class TableLayout:
    """How a table of results is laid out.

    Attributes:
        title: Heading.
        index: Row columns or parameter names that name a line.
        values: Row columns shown; ``stages.NAME``, ``counters.NAME`` and ``kept.NAME`` show one long value.
        columns: A row column or parameter whose values become columns, or ``None``.
        where: Only cases with these values, by row column or parameter name.
        printed: The source's values, which stand beside the measured ones with the ratio of the two.
    """

    title: str
    index: tuple[str, ...]
    values: tuple[str, ...]
    columns: str | None = None
    where: dict[str, Scalar] = field(default_factory=dict)
    printed: tuple[Printed, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """A named set of comparisons and the tables made of them.

    Attributes:
        name: What the command line calls it.
        title, source, description: For people; ``source`` is the paper and table.
        comparisons: What is measured.
        tables: What is printed; empty for the default table.
        claims: What is claimed of the results, to be answered from the rows.
        budget_s: Time that the rounds of one comparison may take, or ``None`` for the run's option [s].
        text: The TOML text it was read from, empty if it was made from options.
    """

    name: str
    title: str
    comparisons: tuple[Comparison, ...]
    source: str = ""
    description: str = ""
    tables: tuple[TableLayout, ...] = ()
    claims: tuple[Claim, ...] = ()
    budget_s: float | None = None
    text: str = ""


def builtin_names() -> list[str]:
    """Return the names of the experiments that come with shadowbench."""
    folder = resources.files("shadowbench.experiments")
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def load(name_or_path: str | Path) -> Experiment:
    """Return a built-in experiment by name, or read a TOML file.

    Raises:
        ExperimentError: There is no such experiment, or the file is wrong; names file and line.
    """
    name, path = str(name_or_path), Path(name_or_path)
    if name in builtin_names():
        source = resources.files("shadowbench.experiments").joinpath(f"{name}.toml")
        return parse(source.read_text(encoding="utf-8"), name=name, file=f"{name}.toml")
    if not path.exists():
        if path.suffix == ".toml" or len(path.parts) > 1:
            raise ExperimentError(f"experiment file {path} does not exist")
        hint = did_you_mean(name, builtin_names(), noun="experiment")
        raise ExperimentError(f"no experiment is called '{name}'; {hint}")
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ExperimentError(f"experiment file {path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ExperimentError(f"experiment file {path} cannot be read: it is not UTF-8 text") from None
    return parse(text, name=path.stem, file=str(path), folder=path.parent)


def parse(text: str, *, name: str, file: str = "", folder: Path | None = None) -> Experiment:
    """Return the experiment that a TOML text describes.

    Args:
        text: The file's content.
        name: What to call it where the text does not say.
        file: For messages.
        folder: What paths of mesh files are relative to; the working directory if not given.

    Raises:
        ExperimentError: Names file and line.
    """
    parsed = read(text, file or name)
    return Experiment(
        name=parsed.name or name,
        title=parsed.title,
        source=parsed.source,
        description=parsed.description,
        comparisons=tuple(_comparison(c, folder) for c in parsed.comparison),
        tables=tuple(_layout(t) for t in parsed.table),
        claims=tuple(c.claim() for c in parsed.claim),
        budget_s=parsed.budget,
        text=text,
    )


def _comparison(table: ComparisonTable, folder: Path | None) -> Comparison:
    given = {
        "methods": table.method,
        "lights": table.light,
        "cameras": table.camera,
        "sizes": table.size,
        "pixel_samples": table.pixel_samples,
        "layers": table.layers,
        "moving": table.moving,
        "threads": table.threads,
    }
    scenes = (replace(s, name=str((folder or Path()) / s.name)) if s.is_mesh_file else s for s in table.scene)
    changes: dict[str, Any] = {name: tuple(values) for name, values in given.items() if values is not None}
    return Comparison(tuple(scenes), **changes)


def _layout(table: LayoutTable) -> TableLayout:
    printed = (Printed(where, values) for each in table.printed for where, values in each.cases())
    return TableLayout(
        table.title, tuple(table.index), tuple(table.values), table.columns, dict(table.where), tuple(printed)
    )


def from_options(**options: Any) -> Experiment:
    """Return the experiment of a command line that names none: every method on one scene, unless some are given.

    Args:
        options: As for :func:`with_options`.

    Raises:
        UsageError: An option's text is wrong.
    """
    return with_options(Experiment("ad-hoc", "Ad hoc", (Comparison((Choice(DEFAULT_SCENE),)),)), **options)


def with_options(
    experiment: Experiment,
    *,
    methods: Sequence[str] = (),
    scenes: Sequence[str] = (),
    lights: Sequence[str] = (),
    cameras: Sequence[str] = (),
    sizes: Sequence[str] = (),
    pixel_samples: Sequence[int] = (),
    layers: Sequence[int] = (),
    moving: Sequence[str] = (),
    threads: Sequence[int] = (),
) -> Experiment:
    """Return an experiment in which each option given replaces what every comparison says.

    Raises:
        UsageError: An option's text is wrong.
    """
    given = {
        "methods": _each(choice_of_text, methods),
        "scenes": _each(choice_of_text, scenes),
        "lights": tuple(lights),
        "cameras": tuple(cameras),
        "sizes": _each(size_of, sizes),
        "pixel_samples": _each(pixel_sample_count_of, pixel_samples),
        "layers": _each(layer_count_of, layers),
        "moving": _each(moving_of, moving),
        "threads": _each(thread_count_of, threads),
    }
    changes: dict[str, Any] = {name: values for name, values in given.items() if values}
    comparisons = [replace(c, **changes) for c in experiment.comparisons]
    unique = tuple(c for i, c in enumerate(comparisons) if c not in comparisons[:i])
    return replace(experiment, comparisons=unique)


def parse_choice(text: str) -> Choice:
    """Return the choice that ``NAME[:key=v,key=v/v/v]`` names; quotes keep a ``/`` or ``,`` in a value.

    Raises:
        UsageError: The text is not of that form.
    """
    return _each(choice_of_text, [text])[0]


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height of ``WIDTHxHEIGHT`` [pixels].

    Raises:
        UsageError: The text is not of that form, or the size is impossible.
    """
    return _each(size_of, [text])[0]


def _each(convert: Callable[[Any], T], values: Sequence[Any]) -> tuple[T, ...]:
    try:
        return tuple(convert(value) for value in values)
    except ValueError as error:
        raise UsageError(str(error)) from None

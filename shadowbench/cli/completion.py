"""What the shell completes: names of methods, scenes, experiments and runs.

Completing must be quick and must never fail: names come from the installed packages' entry points without importing
any plugin, and whatever goes wrong completes to nothing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal


def methods(incomplete: str) -> list[str]:
    """Complete a method's name."""
    return _offered(lambda: _plugins("method"), incomplete)


def scenes(incomplete: str) -> list[str]:
    """Complete a scene's name; mesh files are the shell's own business once a path has begun."""
    return _offered(lambda: _plugins("scene"), incomplete)


def experiments(incomplete: str) -> list[str]:
    """Complete an experiment's name or a TOML file."""
    return _offered(lambda: [*_experiments(), *_toml_files(incomplete)], incomplete)


def anything(incomplete: str) -> list[str]:
    """Complete what ``show`` can show."""
    return _offered(lambda: [*_plugins("method"), *_plugins("scene"), *_experiments(), *_topics()], incomplete)


def runs(incomplete: str) -> list[str]:
    """Complete a run's id in the results folder that would be used."""
    return _offered(_runs, incomplete)


def formats(incomplete: str) -> list[str]:
    """Complete a table's format."""
    return _offered(_formats, incomplete)


def claim_formats(incomplete: str) -> list[str]:
    """Complete a format of claims."""
    return _offered(_claim_formats, incomplete)


def claim_failures(incomplete: str) -> list[str]:
    """Complete what ``claims --fail-on`` takes."""
    return _offered(_claim_failures, incomplete)


def comparison_formats(incomplete: str) -> list[str]:
    """Complete a comparison's format."""
    return _offered(_comparison_formats, incomplete)


def change_kinds(incomplete: str) -> list[str]:
    """Complete what ``compare --fail-on`` can name."""
    return _offered(_change_kinds, incomplete)


def costs(incomplete: str) -> list[str]:
    """Complete a column that can be a cost."""
    return _offered(_costs, incomplete)


def qualities(incomplete: str) -> list[str]:
    """Complete a column that can be a quality."""
    return _offered(_qualities, incomplete)


def what_to_list(incomplete: str) -> list[str]:
    """Complete what ``list`` can list."""
    return _offered(_lists, incomplete)


def movings(incomplete: str) -> list[str]:
    """Complete what moves between two frames."""
    return _offered(_movings, incomplete)


def _offered(names: Callable[[], Iterable[str]], incomplete: str) -> list[str]:
    try:
        return [name for name in names() if name.startswith(incomplete)]
    except Exception:  # noqa: BLE001 - a message would be printed over what is being typed
        return []


def _plugins(kind: Literal["method", "scene"]) -> list[str]:
    from shadowbench.plugins import Registry

    return Registry().names(kind)


def _experiments() -> list[str]:
    from shadowbench.experiment import builtin_names
    from shadowbench.experiment_groups import groups

    return [*builtin_names(), *groups()]


def _toml_files(incomplete: str) -> list[str]:
    folder, slash, _ = incomplete.rpartition("/")
    return sorted(f"{folder}{slash}{path.name}" for path in Path(folder + slash or ".").glob("*.toml"))


def _runs() -> list[str]:
    from shadowbench.cli.options import DEFAULT_RESULTS
    from shadowbench.store import Store

    folder = Path(os.environ.get("SHADOWBENCH_RESULTS") or DEFAULT_RESULTS)
    with Store.open(folder, create=False) as store:
        return ["latest", *(run.run_id for run in store.runs())]


def _formats() -> Iterable[str]:
    from shadowbench.tables import FORMATS

    return FORMATS


def _movings() -> Iterable[str]:
    from shadowbench.choices import MOVING

    return MOVING


def _comparison_formats() -> Iterable[str]:
    from shadowbench.tables.comparison_text import COMPARISON_FORMATS

    return COMPARISON_FORMATS


def _change_kinds() -> Iterable[str]:
    from shadowbench.tables.comparing import Kind

    return Kind


def _lists() -> Iterable[str]:
    from shadowbench.cli.listing import WHAT

    return WHAT


def _claim_formats() -> Iterable[str]:
    from shadowbench.tables.claims_text import CLAIM_FORMATS

    return CLAIM_FORMATS


def _claim_failures() -> Iterable[str]:
    from shadowbench.cli.claims import FAILURES

    return FAILURES


def _costs() -> Iterable[str]:
    from shadowbench.tables.pareto import COSTS

    return COSTS


def _qualities() -> Iterable[str]:
    from shadowbench.tables.pareto import QUALITIES

    return QUALITIES


def _topics() -> Iterable[str]:
    from shadowbench.cli.listing import TOPICS

    return TOPICS

"""What the shell completes: names of methods, scenes, experiments, runs and cases.

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
    return _offered(lambda: [*_plugins("method"), *_plugins("scene"), *_experiments()], incomplete)


def runs(incomplete: str) -> list[str]:
    """Complete a run's id in the results folder that would be used."""
    return _offered(_runs, incomplete)


def cases(incomplete: str) -> list[str]:
    """Complete a case's key in the results folder that would be used."""
    return _offered(_cases, incomplete)


def formats(incomplete: str) -> list[str]:
    """Complete a table's format."""
    return _offered(_formats, incomplete)


def what_to_list(incomplete: str) -> list[str]:
    """Complete what ``list`` can list."""
    return _offered(_lists, incomplete)


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

    return builtin_names()


def _toml_files(incomplete: str) -> list[str]:
    folder, slash, _ = incomplete.rpartition("/")
    return sorted(f"{folder}{slash}{path.name}" for path in Path(folder + slash or ".").glob("*.toml"))


def _runs() -> list[str]:
    from shadowbench.cli.options import DEFAULT_RESULTS
    from shadowbench.store import Store

    folder = Path(os.environ.get("SHADOWBENCH_RESULTS") or DEFAULT_RESULTS)
    with Store.open(folder, create=False) as store:
        return ["latest", *(run.run_id for run in store.runs())]


def _cases() -> list[str]:
    from shadowbench.cli.options import DEFAULT_RESULTS
    from shadowbench.store import Store

    folder = Path(os.environ.get("SHADOWBENCH_RESULTS") or DEFAULT_RESULTS)
    with Store.open(folder, create=False) as store:
        return sorted({key for run in store.runs() for key in store.finished_case_keys(run.run_id)})


def _formats() -> Iterable[str]:
    from shadowbench.tables import FORMATS

    return FORMATS


def _lists() -> Iterable[str]:
    from shadowbench.cli.listing import WHAT

    return WHAT

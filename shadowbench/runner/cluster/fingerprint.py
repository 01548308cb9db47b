"""What a worker must have in common with the client before it may measure: code, plugins, libraries.

Digests of source files, found by reading and not by importing, so that asking takes a moment and runs no plugin. The
keys of the cases, which the measuring process computes for itself, are the second and finer check.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib.metadata import entry_points

from shadowbench.identity import code_digest, library_version

_LIBRARIES = ("warp-lang", "numpy", "scipy", "flip-evaluator", "pydantic")
_RUNNER = ("shadowbench.runner.cluster.bench_process", "shadowbench.runner.worker", "shadowbench.runner.case_host")

Fingerprint = dict[str, str]
"""What it is the digest or version of -> that; empty for what is not there."""


def fingerprint(methods: Iterable[str], scenes: Iterable[str]) -> Fingerprint:
    """Return this machine's fingerprint.

    Args:
        methods, scenes: Names of the plugins that a plan uses; those that come with a file are left out.
    """
    found = {"the runner's code": "+".join(map(_code, _RUNNER))}
    found |= {name: library_version(name) or "" for name in _LIBRARIES}
    for kind, names in (("method", methods), ("scene", scenes)):
        installed = {point.name: point.value for point in entry_points(group=f"shadowbench.{kind}s")}
        found |= {f"{kind} '{name}'": _code(installed.get(name, "").partition(":")[0]) for name in names}
    return found


def installed_names(kind: str) -> set[str]:
    """Return the names of the plugins of a kind that are installed, those in files not counted."""
    return {point.name for point in entry_points(group=f"shadowbench.{kind}s")}


def difference(ours: Mapping[str, str], theirs: Mapping[str, str]) -> str | None:
    """Return what a worker lacks or has otherwise, as the end of a sentence; ``None`` if all agrees."""
    missing = [name for name, value in ours.items() if value and not theirs.get(name)]
    other = [name for name, value in ours.items() if value and theirs.get(name) not in (value, "", None)]
    parts = [f"lacks {', '.join(missing)}"] if missing else []
    if other:
        parts.append("has other versions of " + ", ".join(_versions(name, ours[name], theirs[name]) for name in other))
    return " and ".join(parts) or None


def _versions(name: str, ours: str, theirs: str) -> str:
    return f"{name} ({theirs}, here {ours})" if name in _LIBRARIES else name


def _code(module: str) -> str:
    try:
        return code_digest(module) if module else ""
    except ModuleNotFoundError:
        return ""

"""The exceptions a user can meet; anything else that reaches a user is a bug.

::

    ShadowbenchError            message for one line of a terminal; exit status 2
    ├── UsageError              an option or argument that cannot be used
    ├── ExperimentError         an experiment file: names the file and the line
    ├── SceneError              a mesh file or a scene that cannot be built
    │   └── ParameterError      a scene's or method's parameter (also a PluginError)
    ├── PluginError             a plugin that cannot be found, imported or used
    │   └── ParameterError
    ├── StoreError              a results folder that cannot be read or written
    │   └── StorageFullError    there is no room left where it lies
    ├── ClusterError            a cluster that cannot be reached or used
    └── InvalidResultError      a method broke its contract (outcome *invalid*)

A message says what was wrong, where, and what would be right. :func:`did_you_mean` writes the last part.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class ShadowbenchError(Exception):
    """Base of every error that is shown to the user as one line."""


class UsageError(ShadowbenchError):
    """An option or argument of the command line that cannot be used."""


class ExperimentError(ShadowbenchError):
    """An experiment file that cannot be read as one."""

    def __init__(self, message: str, *, file: str | None = None, line: int | None = None) -> None:
        where = "" if file is None else file + (f":{line}" if line is not None else "") + ": "
        super().__init__(where + message)
        self.file = file
        self.line = line


class SceneError(ShadowbenchError):
    """A mesh file or scene from which no picture can be made."""


class PluginError(ShadowbenchError):
    """A method or scene plugin that cannot be found, imported or used."""


class ParameterError(SceneError, PluginError):
    """A parameter with an unknown name or a value outside its range."""


class StoreError(ShadowbenchError):
    """A results folder that cannot be read or written."""


class StorageFullError(StoreError):
    """There is no room left where results are kept; what was kept before is intact."""


class ClusterError(ShadowbenchError):
    """A cluster that cannot be reached, refuses the work, or went away."""


class InvalidResultError(ShadowbenchError):
    """A method's result breaks the contract of :class:`shadowbench.method.Method`."""


def did_you_mean(given: str, known: Iterable[str], *, noun: str = "") -> str:
    """Return the end of an error message: the nearest known name, or the list of them.

    Args:
        given: What the user wrote.
        known: The names that would have been right.
        noun: What the names are called ("method", "scene"), for the list.
    """
    names = sorted(set(known))
    nearest = difflib.get_close_matches(given, names, n=1, cutoff=0.5)
    if nearest:
        return f"did you mean '{nearest[0]}'?"
    if not names:
        return f"there are no {noun or 'name'}s to choose from"
    listed = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"known {noun + 's' if noun else 'names'}: {listed}"

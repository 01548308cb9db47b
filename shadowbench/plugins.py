"""Finding methods and scenes: built-ins, installed plugins, and single files.

All three go the same way: a name and a way to load a class. Built-ins are this package's own entry points. A plugin
that cannot be loaded stays in the list with its error and takes nothing else down. ``--plugin FILE.py`` adds the
file's public :class:`~shadowbench.method.Method` and :class:`~shadowbench.scene.ScenePlugin` subclasses; it may import
the files beside it.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

from shadowbench.errors import PluginError, did_you_mean
from shadowbench.imported_code import imports_of, source_of

if TYPE_CHECKING:
    from shadowbench.method import Method
    from shadowbench.scene import ScenePlugin

Kind = Literal["method", "scene"]

_GROUPS: dict[Kind, str] = {"method": "shadowbench.methods", "scene": "shadowbench.scenes"}


@dataclass(frozen=True)
class Entry:
    """A plugin that was found, loaded or not.

    Attributes:
        kind: ``method`` or ``scene``.
        name: What the user types.
        origin: Where it comes from: a distribution's name or a file.
        load: Returns the class.

    ``load`` raises :class:`PluginError` if the plugin cannot be imported or is not what it should be.
    """

    kind: Kind
    name: str
    origin: str
    load: Callable[[], type[Any]]


class Registry:
    """All plugins of this process, by kind and name."""

    def __init__(self, files: tuple[Path, ...] = ()) -> None:
        """Find installed plugins and those in ``files``; nothing installed is imported yet.

        An installed plugin with a name that another one has (built-ins come first) is listed as broken under
        ``name@distribution``.

        Raises:
            PluginError: A file cannot be read or holds no plugin, or one of its names is taken.
        """
        self._entries: dict[tuple[Kind, str], Entry] = {}
        for kind, group in _GROUPS.items():
            for point in sorted(entry_points(group=group), key=lambda p: (not _is_own(p), p.name, _origin(p))):
                entry = Entry(kind, point.name, _origin(point), _entry_point_loader(kind, point))
                known = self._entries.setdefault((kind, entry.name), entry)
                if known.origin != entry.origin:  # else the same distribution, seen twice on the path
                    clash = _clashing(entry, known)
                    self._entries[kind, clash.name] = clash
        for file in files:
            for entry in _file_entries(file):
                known = self._entries.setdefault((entry.kind, entry.name), entry)
                if known is not entry:
                    raise PluginError(_two_of_one_name(entry, known))

    def entries(self, kind: Kind) -> Iterator[Entry]:
        """Yield the entries of a kind, by name."""
        for key in sorted(self._entries):
            if key[0] == kind:
                yield self._entries[key]

    def names(self, kind: Kind) -> list[str]:
        """Return all names of a kind."""
        return [entry.name for entry in self.entries(kind)]

    def method(self, name: str) -> type[Method]:
        """Return a method's class.

        Raises:
            PluginError: No method has this name, or it cannot be loaded.
        """
        return self._find("method", name).load()

    def scene(self, name: str) -> type[ScenePlugin]:
        """Return a scene plugin's class.

        Raises:
            PluginError: No scene has this name, or it cannot be loaded.
        """
        return self._find("scene", name).load()

    def _find(self, kind: Kind, name: str) -> Entry:
        entry = self._entries.get((kind, name))
        if entry is None:
            raise PluginError(f"no {kind} is called '{name}'; {did_you_mean(name, self.names(kind), noun=kind)}")
        return entry


def _two_of_one_name(entry: Entry, known: Entry) -> str:
    return f"two {entry.kind}s are called '{entry.name}': one from {known.origin}, one from {entry.origin}"


def _clashing(entry: Entry, known: Entry) -> Entry:
    """Return an entry that says why an installed plugin is not used."""

    def load() -> type[Any]:
        raise PluginError(f"{_two_of_one_name(entry, known)}; the first is used")

    return Entry(entry.kind, f"{entry.name}@{entry.origin}", entry.origin, load)


def _is_own(point: EntryPoint) -> bool:
    return _origin(point) == "shadowbench"


def _origin(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "unknown distribution"


def _base_of(kind: Kind) -> type[Any]:
    if kind == "method":
        from shadowbench.method import Method  # lazily: this imports Warp

        return Method
    from shadowbench.scene import ScenePlugin

    return ScenePlugin


def _entry_point_loader(kind: Kind, point: EntryPoint) -> Callable[[], type[Any]]:
    def load() -> type[Any]:
        try:
            loaded = point.load()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise PluginError(f"{kind} '{point.name}' from {_origin(point)} cannot be imported: {reason}") from error
        return _checked(kind, point.name, loaded, _origin(point))

    return load


def _checked(kind: Kind, name: str, loaded: Any, origin: str) -> type[Any]:
    base = _base_of(kind)
    if not (isinstance(loaded, type) and issubclass(loaded, base)):
        raise PluginError(f"{kind} '{name}' from {origin} is not a subclass of {base.__module__}.{base.__name__}")
    missing = sorted(getattr(loaded, "__abstractmethods__", ()))
    if missing:
        raise PluginError(f"{kind} '{name}' from {origin} does not define {', '.join(missing)}()")
    for attribute in ("name", "title"):
        if not isinstance(getattr(loaded, attribute, None), str):
            raise PluginError(f"{kind} '{name}' from {origin} has no class attribute '{attribute}'")
    own_name: str = loaded.name  # type: ignore[attr-defined]  # the base class is not known to be one of two here
    if own_name != name:
        raise PluginError(f"{kind} '{name}' from {origin} calls itself '{own_name}'; the two names must agree")
    return loaded


def _file_entries(file: Path) -> list[Entry]:
    """Load a plugin file and return an entry for each of its public plugin classes."""
    module = _load_file(file)
    entries = []
    for kind in _GROUPS:
        base = _base_of(kind)
        for attribute, value in vars(module).items():
            own = isinstance(value, type) and issubclass(value, base) and value.__module__ == module.__name__
            if own and not attribute.startswith("_"):
                name = getattr(value, "name", None)
                if not isinstance(name, str):
                    raise PluginError(f"{file}: class {attribute} has no class attribute 'name'")
                cls = _checked(kind, name, value, str(file))
                entries.append(Entry(kind, name, str(file), lambda cls=cls: cls))  # type: ignore[misc]
    if not entries:
        raise PluginError(f"{file}: no public subclass of shadowbench.method.Method or shadowbench.scene.ScenePlugin")
    return entries


def _load_file(file: Path) -> ModuleType:
    if not file.is_file():
        what = "is a directory" if file.is_dir() else "does not exist"
        raise PluginError(f"plugin file {file} {what}")
    # the content is in the name, so that an edited file is another module, for Warp's kernel modules as well
    digest = hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    name = f"shadowbench_plugin_{file.stem.replace('-', '_')}_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    _make_importable(file)
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise PluginError(f"plugin file {file} is not a Python file (its name must end in .py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        line = _line_in(error, file)
        raise PluginError(f"plugin file {file}{line} cannot be imported: {reason}") from error
    return module


def _make_importable(file: Path) -> None:
    """Let a plugin file import the files beside it; its folder comes last, so that they shadow nothing installed.

    Raises:
        PluginError: Something else has the name of a file beside it, and would be imported instead.
    """
    folder = file.absolute().parent
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    for name in dict.fromkeys(name.partition(".")[0] for name in imports_of(file, "")):
        beside = folder / f"{name}.py"
        if beside.is_file() and (found := source_of(name)) != beside:
            raise PluginError(
                f"plugin file {file} imports '{name}', which is {found or 'built in'} and not {beside}; rename the file"
            )


def _line_in(error: Exception, file: Path) -> str:
    """Return ``:line`` of the innermost frame that lies in ``file``."""
    if isinstance(error, SyntaxError) and error.lineno is not None:
        return f":{error.lineno}"
    lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(file)]
    return f":{lines[-1]}" if lines else ""

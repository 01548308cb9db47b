"""The files that a module's code consists of, found by reading import statements, never by running them.

What counts as a module's own code: shadowbench, the module's own top-level package, the other modules of the
distribution that it is installed with and, for a plugin file, the files beside it. Of each file these count as used:

* ``import`` and ``from ... import``, relative ones too, wherever they stand but under ``if TYPE_CHECKING:``;
* ``importlib.import_module("...")``, ``__import__`` and ``runpy.run_module`` with a name in quotes; with a computed
  name every module of the same package, since it may be any of them;
* ``__main__`` of a package that mentions ``__package__``: it is about to start itself;
* a data file beside the module, or in a folder beside it, that the module names in quotes (``"blur.glsl"``).

What a plugin takes from other people's distributions is theirs to number: a method names their versions in
:meth:`shadowbench.method.Method.library_versions`. Nothing here imports Warp or a plugin.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.metadata import packages_distributions
from pathlib import Path

_IMPORTING_CALLS = frozenset({"import_module", "__import__", "run_module"})
_FILE_NAME = re.compile(r"[\w.-]+(/[\w.-]+)*\.(?!py$)[A-Za-z0-9]{1,8}")
_FOLDER_NAME = re.compile(r"[\w.-]+(/[\w.-]+)*/?")


def imported_files(module: str) -> dict[str, Path]:
    """Return the source file of a module and of every module of its own code that it imports, directly or not.

    ``shadowbench/__init__.py``, which holds the version, is left out.

    Raises:
        ModuleNotFoundError: There is no such module.
    """
    own_names, own_folder = _own_code(module)
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if not name or name in found or name == "shadowbench":
            continue
        top = name.partition(".")[0]
        if top not in own_names and (own_folder is None or not _lies_in(own_folder, top)):
            continue
        file = source_of(name)
        if file is None:
            if name == module:
                raise ModuleNotFoundError(f"there is no module {name}", name=name)
            continue
        found[name] = file
        package = name if file.name == "__init__.py" else name.rpartition(".")[0]
        waiting += imports_of(file, package)
        waiting += [name.rpartition(".")[0]]  # importing a module runs its packages' __init__
    return dict(sorted(found.items()))


def data_files(module: str, file: Path) -> dict[str, Path]:
    """Return the data files that a module names in quotes, by ``module:name``."""
    names, folders = _quoted(file, file.stat().st_mtime_ns)
    found = {}
    for folder in ("", *folders):
        for name in names:
            path = file.parent / folder / name
            if path.is_file():
                found[f"{module}:{folder.strip('/')}/{name}"] = path
    return found


def imports_of(file: Path, package: str) -> tuple[str, ...]:
    """Return the names that a source file may import; ``from a import b`` gives both ``a`` and ``a.b``.

    Args:
        file: The source file.
        package: The package that it is in, or is; empty for a file that is in none.
    """
    return _imports_of(file, file.stat().st_mtime_ns, package)


def source_of(module: str) -> Path | None:
    """Return the file that importing a module would run; ``None`` for one that is absent or not Python."""
    spec = _spec_of(module)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin)


def _own_code(module: str) -> tuple[set[str], Path | None]:
    """Return the top-level modules that count as a module's own and, for a plugin file, the folder that does."""
    top = module.partition(".")[0]
    own = {"shadowbench", top}
    if top == "shadowbench":
        return own, None
    if _found(top, None) is None and (file := source_of(top)) is not None:
        return own, file.parent
    distributions = packages_distributions()
    its = set(distributions.get(top, ()))
    return own | {name for name, owners in distributions.items() if its.intersection(owners)}, None


def _lies_in(folder: Path, top: str) -> bool:
    return (folder / f"{top}.py").is_file() or (folder / top / "__init__.py").is_file()


def _spec_of(module: str) -> ModuleSpec | None:
    """Find a module as an import would, without importing its packages (:func:`importlib.util.find_spec` does)."""
    package, _, _ = module.rpartition(".")
    if not package:
        known = sys.modules.get(module)  # a plugin file is known by no finder
        return _found(module, None) if known is None or known.__spec__ is None else known.__spec__
    parent = _spec_of(package)
    if parent is None or parent.submodule_search_locations is None:
        return None
    return _found(module, list(parent.submodule_search_locations))


def _found(module: str, path: list[str] | None) -> ModuleSpec | None:
    for finder in sys.meta_path:
        spec = finder.find_spec(module, path)
        if spec is not None:
            return spec
    return None


@cache
def _tree_of(file: Path, _modified: int) -> ast.AST | None:
    try:
        return ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return None


@cache
def _imports_of(file: Path, modified: int, package: str) -> tuple[str, ...]:
    tree = _tree_of(file, modified)
    names: list[str] = []
    for node in () if tree is None else _running_nodes(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            source = _absolute("." * node.level + (node.module or ""), package)
            names += [source, *(f"{source}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Call) and _called(node) in _IMPORTING_CALLS:
            name = node.args[0] if node.args else None
            if isinstance(name, ast.Constant) and isinstance(name.value, str):
                names.append(_absolute(name.value, package))
            else:
                names += _beside(file, package)
        elif isinstance(node, ast.Name) and node.id == "__package__" and package:
            names.append(f"{package}.__main__")
    return tuple(dict.fromkeys(names))


def _absolute(name: str, package: str) -> str:
    """Return the full name of a module; each leading dot after the first is a package further up."""
    inner = name.lstrip(".")
    level = len(name) - len(inner)
    if not level:
        return inner
    parents = package.split(".")
    return ".".join(part for part in (*parents[: len(parents) - level + 1], inner) if part)


def _called(call: ast.Call) -> str:
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _beside(file: Path, package: str) -> list[str]:
    """Return all modules of a file's package."""
    stems = [path.stem for path in file.parent.glob("*.py") if path.stem != "__init__"]
    stems += [path.parent.name for path in file.parent.glob("*/__init__.py")]
    return [f"{package}.{stem}" if package else stem for stem in sorted(stems)]


@cache
def _quoted(file: Path, modified: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what stands in quotes in a file and could name a data file, and what could name a folder beside it."""
    tree = _tree_of(file, modified)
    texts = dict.fromkeys(
        node.value
        for node in (() if tree is None else _running_nodes(tree))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < 200
    )
    names = tuple(text for text in texts if _FILE_NAME.fullmatch(text))
    folders = tuple(t for t in texts if names and _FOLDER_NAME.fullmatch(t) and (file.parent / t).is_dir())
    return names, folders


def _running_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING"):
            waiting += node.orelse
        else:
            waiting += ast.iter_child_nodes(node)

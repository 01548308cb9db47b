"""``shadowbench check``: hold plugins to the contract that the built-ins must pass."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from shadowbench.cli.console import plain, put
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.errors import PluginError


def check(
    plugin: Annotated[
        str, typer.Argument(metavar="PLUGIN", help="A file with methods or scenes, or the name of one that is found.")
    ],
) -> int:
    """Try a method or scene and say which rules it breaks."""
    import warp as wp

    from shadowbench.contract import check_method, check_scene
    from shadowbench.plugins import Registry

    wp.config.log_level = wp.LOG_ERROR  # what Warp says about kernel caches is not about the plugin

    is_file = plugin.endswith(".py") or Path(plugin).is_file()
    registry = Registry((Path(plugin),) if is_file else ())
    entries = [e for kind in ("method", "scene") for e in registry.entries(kind)]
    chosen = [e for e in entries if (e.origin == str(Path(plugin)) if is_file else e.name == plugin)]
    if not chosen:
        registry.method(plugin)  # says which name would have been right
    failed = False
    for entry in chosen:
        try:
            breaches = (check_method if entry.kind == "method" else check_scene)(entry.load())
        except PluginError as error:
            breaches = [str(error)]
        failed |= bool(breaches)
        verdict = "breaks the contract:" if breaches else "keeps the contract"
        put(plain(f"{entry.kind} {entry.name} {verdict}"))
        for breach in breaches:
            put(plain(f"  {breach}"))
    return ExitStatus.CASES_FAILED if failed else ExitStatus.OK

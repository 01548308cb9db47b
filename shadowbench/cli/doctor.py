"""``shadowbench doctor``: whether this machine has what shadowbench needs, and what to do where it has not."""

from __future__ import annotations

import typer

from shadowbench.cli.console import plain, put
from shadowbench.cli.exit_status import ExitStatus
from shadowbench.cli.options import DEFAULT_RESULTS, ResultsOption

_STYLES = {"ok": "green", "warn": "yellow", "fail": "bold red"}


def doctor(results: ResultsOption = DEFAULT_RESULTS) -> None:
    """Look at what this machine has and lacks."""
    from rich.table import Table

    from shadowbench.cli.machine_checks import State, all_checks

    listed = Table(box=None, pad_edge=False, show_header=False)
    listed.add_column(no_wrap=True)
    listed.add_column(no_wrap=True)
    listed.add_column(overflow="fold")
    found = list(all_checks(results))
    for check in found:
        words = plain(check.found)
        if check.remedy:
            words.append(plain(f"\n-> {check.remedy}", _STYLES[check.state]))
        listed.add_row(plain(check.state, _STYLES[check.state]), plain(check.name), words)
    put(listed)
    failed = sum(check.state is State.FAIL for check in found)
    warned = sum(check.state is State.WARN for check in found)
    if failed:
        print(f"{failed} of {len(found)} checks failed: shadowbench will not work here before that is mended")
        raise typer.Exit(ExitStatus.CASES_FAILED)
    warnings = "" if not warned else "; 1 warning" if warned == 1 else f"; {warned} warnings"
    print(f"shadowbench can run here{warnings}")

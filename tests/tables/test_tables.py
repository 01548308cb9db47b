"""The two functions that everybody calls."""

from __future__ import annotations

import subprocess
import sys

import pytest

from shadowbench import tables
from shadowbench.errors import UsageError


def test_a_format_that_does_not_exist_is_one_line() -> None:
    with pytest.raises(UsageError, match=r"no table format is called 'latx'; did you mean 'latex'\?"):
        tables.render([], "latx")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", tables.FORMATS)
def test_every_format_can_write_no_tables(name: str) -> None:
    tables.render([], name)  # type: ignore[arg-type]


def test_tables_need_neither_warp_nor_a_plugin_nor_pandas() -> None:
    program = (
        "import sys; from shadowbench import tables; from shadowbench.tables import making, markup, terminal\n"
        "print([m for m in ('warp', 'pandas', 'sqlalchemy', 'shadowbench.method', 'shadowbench.scene') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == "[]"

"""How tests are run, and databases for tests of the store and of what stands on it."""

from __future__ import annotations

import itertools
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import postgresql_server
import pytest

from shadowbench.store import DATABASE_NAME, Store

DATABASES = ("sqlite", "postgresql")

_numbers = itertools.count()


def pytest_configure() -> None:
    """Take signals as a program in the foreground does, even where the tests were started in the background.

    A shell without job control has what it starts with ``&`` ignore SIGINT, and nohup SIGHUP; all children inherit it.
    """
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return two processes a core: the longest tests mostly wait for processes of their own."""
    return 2 * len(os.sched_getaffinity(0))


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Callable[[], str]]:
    """Return a function that makes a database on a server of this session and returns its address."""
    with postgresql_server.running() as address:
        from sqlalchemy import create_engine

        Store.open(Path(), database=address.format("postgres")).close()
        # what is copied for each test: the schema, made once
        engine = create_engine(
            address.format("template1").replace("postgresql://", "postgresql+psycopg://"), isolation_level="AUTOCOMMIT"
        )

        def make() -> str:
            name = f"test{next(_numbers)}"
            with engine.connect() as connection:
                connection.exec_driver_sql(f"CREATE DATABASE {name} TEMPLATE postgres")
            return address.format(name)

        yield make
        engine.dispose()


@pytest.fixture(scope="session")
def made_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an empty results database, to be copied where many tests need one: making it takes a while."""
    folder = tmp_path_factory.mktemp("made")
    Store.open(folder).close()
    return folder / DATABASE_NAME


@pytest.fixture(params=DATABASES)
def database(request: pytest.FixtureRequest) -> str | None:
    """Return the address of an empty database for a store; ``None`` lets it have its own file."""
    return None if request.param == "sqlite" else request.getfixturevalue("postgresql")()


@pytest.fixture(scope="module", params=DATABASES)
def lasting_database(request: pytest.FixtureRequest) -> str | None:
    """Return the same for all tests of a module."""
    return None if request.param == "sqlite" else request.getfixturevalue("postgresql")()

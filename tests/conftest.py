"""How tests are run, and databases for tests of the store and of what stands on it."""

from __future__ import annotations

import itertools
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import once_a_session
import postgresql_server
import pytest
from lasting_workers import end_idle_workers, lasting_workers

from shadowbench.store import DATABASE_NAME, Store

DATABASES = ("sqlite", "postgresql")

_numbers = itertools.count()


def pytest_configure(config: pytest.Config) -> None:
    """Take signals as a program in the foreground does, even where the tests were started in the background.

    A shell without job control has what it starts with ``&`` ignore SIGINT, and nohup SIGHUP; all children inherit it.
    """
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)
    if _starts_the_others(config):
        once_a_session.begin()


def pytest_unconfigure(config: pytest.Config) -> None:
    """End what was kept for other tests: each process its workers, the one that started the others what all shared."""
    end_idle_workers()
    if _starts_the_others(config):
        once_a_session.end()


def _starts_the_others(config: pytest.Config) -> bool:
    return not hasattr(config, "workerinput")


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Return two processes a core: the longest tests mostly wait for processes of their own."""
    return 2 * len(os.sched_getaffinity(0))


@pytest.fixture(name="lasting_workers", scope="module")
def _lasting_workers() -> Iterator[None]:
    """Have the runs of a module use the same worker processes, one after the other."""
    with lasting_workers():
        yield


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Callable[[], str]]:
    """Return a function that makes a database on a server of this process and returns its address.

    Not one for the whole session: a catalogue's version counts the transactions of a server, whosever they are.
    """
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
def made_database() -> Path:
    """Return an empty results database, to be copied where many tests need one: making it takes a while."""
    return once_a_session.made("database", lambda folder: Store.open(folder).close()) / DATABASE_NAME


@pytest.fixture(params=DATABASES)
def database(request: pytest.FixtureRequest) -> str | None:
    """Return the address of an empty database for a store; ``None`` lets it have its own file."""
    return None if request.param == "sqlite" else request.getfixturevalue("postgresql")()


@pytest.fixture(scope="module", params=DATABASES)
def lasting_database(request: pytest.FixtureRequest) -> str | None:
    """Return the same for all tests of a module."""
    return None if request.param == "sqlite" else request.getfixturevalue("postgresql")()

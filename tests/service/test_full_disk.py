"""A disk that is really full: uploads are refused with 507, what was kept stays, reading goes on, and room heals all.

Results lie on a small file system in memory, and so does PostgreSQL's database; both are filled to the last byte.
Mounting takes root and its capabilities: where it is not permitted these tests are skipped.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest
from service.conftest import Maker, Service
from sqlalchemy import make_url
from stored_rows import png, some_row, some_run

from shadowbench.rows import ResultRow

pytestmark = pytest.mark.slow

LARGE = png(5, size=(400, 400))
"""A picture of some hundred KiB."""


@contextmanager
def mounted(folder: Path, mebibytes: int) -> Iterator[Path]:
    """A file system of this size at ``folder``."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={mebibytes}m", "none", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("file systems cannot be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


@contextmanager
def full(*folders: Path) -> Iterator[None]:
    """The file systems of these folders have not a byte left."""
    try:
        for folder in folders:
            with (folder / "filler").open("wb", buffering=0) as filler:
                for size in (2**16, 2**12, 1):
                    with suppress(OSError):  # there is no room
                        while filler.write(bytes(size)):
                            pass
        yield
    finally:
        for folder in folders:
            (folder / "filler").unlink(missing_ok=True)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """The results folder, on a file system of its own."""
    (tmp_path / "results").mkdir()
    with mounted(tmp_path / "results", 4) as folder:
        yield folder


@pytest.fixture(params=["sqlite", "postgresql"])
def disks(request: pytest.FixtureRequest, disk: Path) -> Iterator[tuple[str | None, tuple[Path, ...]]]:
    """The database's address, and all folders where an upload leaves something."""
    if request.param == "sqlite":
        yield None, (disk,)
        return
    import psycopg

    address = request.getfixturevalue("postgresql")()
    name = make_url(address).database
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="shadowbench-tablespace-"))
        stack.callback(shutil.rmtree, folder)
        stack.enter_context(mounted(folder, 32))
        space = folder / "space"
        space.mkdir()
        if os.geteuid() == 0:
            folder.chmod(0o755)
            shutil.chown(space, "postgres", "postgres")
        server = stack.enter_context(psycopg.connect(address.replace(f"/{name}?", "/template1?"), autocommit=True))
        server.execute(f"CREATE TABLESPACE small_{name} LOCATION '{space}'")
        server.execute(f"ALTER DATABASE {name} SET TABLESPACE small_{name}")
        yield address, (disk, folder)
        server.execute(f"DROP DATABASE {name} WITH (FORCE)")
        server.execute(f"DROP TABLESPACE small_{name}")


@pytest.fixture
def database(disks: tuple[str | None, tuple[Path, ...]]) -> str | None:
    return disks[0]


@pytest.fixture
def fill(disks: tuple[str | None, tuple[Path, ...]]) -> Callable[[], object]:
    return lambda: full(*disks[1])


@pytest.fixture
def service(make_service: Maker) -> Service:
    return make_service()


def many_rows(run_id: str) -> list[ResultRow]:
    """Rows that take some MiB."""
    samples = {"build": [1.5] * 40, "shade": [2.5] * 40}
    return [some_row(f"m{number}", run_id=run_id, samples=samples) for number in range(300)]


def files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "filler")


def test_uploads_are_refused_and_leave_nothing_and_pass_when_there_is_room(fill, service: Service, disk: Path) -> None:
    first, rows = some_run(run_id="first", case_count=1), [some_row(run_id="first", case_key="c")]
    second = some_run(run_id="second", case_count=300)
    large = many_rows("second")
    assert service.put(first, rows).status_code == 201
    assert service.put_picture(png(1)).status_code == 201
    before = [path for path in files(disk) if path.suffix == ".png"]
    with fill():
        for refused in (service.put_picture(LARGE), service.put(second, large), service.put(second, large)):
            assert refused.status_code == 507, refused.text
            assert refused.headers["content-type"] == "application/problem+json"
            assert str(disk) not in refused.text
        assert [path for path in files(disk) if path.suffix == ".png" or ".png." in path.name] == before
        # nothing of it is seen, and reading and repeating go on, with a token or without
        for headers in ({}, service.as_()):
            found = service.client.get("/runs.json", headers=headers)
            assert [run["run_id"] for run in found.json()["runs"]] == ["first"]
        assert service.client.get("/runs/first/cases/c").status_code == 200
        assert service.client.get("/runs/second.json").status_code == 404
        assert service.put(first, rows).json()["kept"] == "unchanged"
        assert service.client.get("/healthz").status_code == 200
    assert service.put_picture(LARGE).status_code == 201
    assert service.put(second, large).status_code == 201
    assert service.store.rows("first") == rows
    assert service.store.rows("second") == large
    assert len(files(disk)) >= 2
    with service.store.engine.connect() as connection:
        if service.settings.database is None:
            assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
        subjects = set(connection.exec_driver_sql("SELECT subject FROM audit").scalars())
    assert {"first", "second"} | {
        f"{hashlib.sha256(content).hexdigest()}.png" for content in (png(1), LARGE)
    } <= subjects


def test_a_token_reads_while_the_disk_is_full_although_its_use_cannot_be_noted(fill, make_service: Maker) -> None:
    service = make_service(open_reading=False)
    headers = service.as_("read")
    with fill():
        assert service.client.get("/runs.json", headers=headers).status_code == 200
    assert service.client.get("/runs.json", headers=headers).status_code == 200


def test_a_backup_that_finds_no_room_leaves_no_file(fill, service: Service, disk: Path) -> None:
    from shadowbench.errors import StorageFullError
    from shadowbench.store.backup import backup

    assert service.put_picture(LARGE).status_code == 201
    before = files(disk)
    with fill(), pytest.raises(StorageFullError):
        backup(service.store, disk / "backup.zip")
    assert files(disk) == before
    assert not [path for path in disk.iterdir() if "backup" in path.name]

"""Runs on real dask workers on this machine: the same rows as a local run, whoever dies meanwhile."""

from __future__ import annotations

import datetime as dt
import ipaddress
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from clusters import BENCH, CASE, LocalCluster, running_below
from small_runs import Recorder, carry_out, planned

from shadowbench.cli import main
from shadowbench.errors import ClusterError, UsageError
from shadowbench.rows import Outcome, ResultRow, RunStatus
from shadowbench.runner.cases import ClusterAccess
from shadowbench.runner.cluster.access import checked_access
from shadowbench.store import Store

pytestmark = pytest.mark.usefixtures("lasting_workers")

SCENES = ("tiny:ground=2", "tiny:ground=3", "tiny:ground=4")
METHODS = ("formula", "good:level=1", "unavailable")

MEASURED_BY_MACHINE = {
    *("run_id", "comparison", "measured_at", "rounds", "warnings", "samples", "stages", "compile_ms", "environment"),
    *("peak_rss_bytes", "baseline_case", "processes", "ended_by", "warm_up_frames", "build_repeats", "shade_repeats"),
    *("round_processes", "outlier_rounds"),
}
"""What differs between two runs beside the times."""


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalCluster]:
    with LocalCluster(tmp_path_factory.mktemp("cluster")) as opened:
        opened.worker()
        opened.worker()
        yield opened


def quality_of(row: ResultRow) -> dict[str, Any]:
    """Return all of a row that must be the same wherever it was measured."""
    values = row.model_dump(exclude=MEASURED_BY_MACHINE)
    return {name: value for name, value in values.items() if "_ms" not in name and not name.startswith("seconds")}


def by_case(rows: list[ResultRow]) -> dict[str, dict[str, Any]]:
    found = {row.case_key: quality_of(row) for row in rows}
    assert len(found) == len(rows), "none doubled"
    return found


class Doer(Recorder):
    """An observer that does something when a row is there, or when a case has come to a phase."""

    def __init__(self, at: int | tuple[str, str], act: Any) -> None:
        super().__init__()
        self._at, self._act = at, act

    def _do(self) -> None:
        act, self._act = self._act, None
        if act is not None:
            act()

    def row_finished(self, row: ResultRow) -> None:
        super().row_finished(row)
        if len(self.rows) == self._at:
            self._do()

    def case_started(self, case: Any, phase: str) -> None:
        super().case_started(case, phase)
        if (case.method, phase) == self._at:
            self._do()


def test_two_workers_a_third_joining_late_and_one_killed_give_the_rows_of_a_local_run(
    cluster: LocalCluster, tmp_path: Path
) -> None:
    doomed = cluster.worker()
    third: list[Any] = []

    def change_hands() -> None:
        third.append(cluster.worker())
        doomed.kill()

    plan = planned(tmp_path / "cluster", *METHODS, scenes=SCENES, cluster=cluster.access)
    spread = carry_out(plan, Doer(4, change_hands))
    assert spread.record.status is RunStatus.COMPLETE
    local = carry_out(planned(tmp_path / "local", *METHODS, scenes=SCENES))
    assert by_case(spread.rows) == by_case(local.rows)
    assert len(spread.rows) == 9
    with Store.open(tmp_path / "cluster", create=False) as store:
        for row in spread.rows:
            for name in row.artifacts.values():
                assert store.artifact(name).startswith(b"\x89PNG")
    third[0].kill()


def test_a_cases_environment_is_its_own_and_not_the_workers(cluster: LocalCluster, tmp_path: Path) -> None:
    ended = carry_out(planned(tmp_path, "tells-its-threads", threads=(1,), cluster=cluster.access))
    assert ended.row("tells-its-threads").counters["threads for libraries"] == 1


def test_interrupting_the_client_ends_the_cases_and_leaves_the_workers_usable(
    cluster: LocalCluster, tmp_path: Path
) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    cluster.end_idle_processes()
    slow = planned(tmp_path, "slow:seconds=50", cluster=cluster.access)
    ended = carry_out(slow, Doer(("slow", "warm up"), interrupt))
    assert ended.record.status is RunStatus.INTERRUPTED
    assert ended.rows == []
    for process in cluster.workers:
        psutil.wait_procs([*running_below(process, CASE), *running_below(process, BENCH)], timeout=30)
        assert running_below(process, CASE) == []
    again = carry_out(planned(tmp_path / "again", "formula", cluster=cluster.access))
    assert again.row("formula").outcome is Outcome.OK


CLIENT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from small_runs import Recorder, carry_out, planned
from shadowbench.runner.cases import ClusterAccess

class Teller(Recorder):
    def case_started(self, case, phase): print("phase", case.method, phase, flush=True)
    def row_finished(self, row): print("row", row.case_key, flush=True)

access = ClusterAccess(sys.argv[3]) if sys.argv[3] != "here" else None
carry_out(planned(Path(sys.argv[2]), *sys.argv[4:], cluster=access), Teller())
"""


def test_killing_the_client_ends_the_cases_and_a_local_run_completes_the_rest(
    cluster: LocalCluster, tmp_path: Path
) -> None:
    cluster.end_idle_processes()
    tests = str(Path(__file__).parent.parent)
    methods = ("unavailable", "formula", "slow:seconds=0.4")
    command = [sys.executable, "-c", CLIENT, tests, str(tmp_path), cluster.address, *methods]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout is not None
        told = set()
        for line in client.stdout:
            told.add(line.strip())
            if line.startswith("phase") and "round" in line:  # of which some only are told
                client.kill()
                break
    for process in cluster.workers:
        psutil.wait_procs(running_below(process, CASE), timeout=30)
        assert running_below(process, CASE) == []
    resumed = carry_out(planned(tmp_path, *methods))
    assert resumed.record.status is RunStatus.COMPLETE
    assert sorted(row.method for row in resumed.rows) == ["formula", "slow", "unavailable"]
    kept = {row.case_key for row in resumed.rows} - {row.case_key for row in resumed.seen.rows}
    assert {line.split()[1] for line in told if line.startswith("row")} <= kept


@pytest.mark.slow
def test_what_goes_wrong_on_a_worker_is_its_own_outcome(cluster: LocalCluster, tmp_path: Path) -> None:
    expected = {
        "raises": (Outcome.ERROR, "ValueError: no tree could be built"),
        "segfaults": (Outcome.CRASH, "the worker ended by SIGSEGV during shade"),
        "starts-a-process": (Outcome.TIMEOUT, "no end of shade within 5 s"),
        "allocates": (Outcome.OUT_OF_MEMORY, "of memory during shade; its limit is 0.59 GiB"),
        "nan": (Outcome.INVALID, "valid receivers are NaN"),
        "kills-its-parent": (Outcome.CRASH, "its worker died 2 times while it was measured alone"),
        "unsupporting": (Outcome.SKIPPED, "it likes no light"),
        "formula": (Outcome.OK, ""),
        "good": (Outcome.OK, ""),
    }
    carry_out(planned(tmp_path / "first", "formula", cluster=cluster.access))  # prepares without a time limit
    options = {"timeout_s": 5.0, "memory_limit_bytes": 600 << 20, "cluster": cluster.access}
    ended = carry_out(planned(tmp_path, *expected, **options))
    assert ended.record.status is RunStatus.COMPLETE
    for method, (outcome, reason) in expected.items():
        assert ended.row(method).outcome is outcome, method
        assert reason in ended.row(method).reason
    assert all(process.poll() is None for process in cluster.workers), "no worker fell with its measuring process"


def test_a_scheduler_that_goes_away_ends_the_run_with_what_is_finished(tmp_path: Path) -> None:
    with LocalCluster(tmp_path / "cluster") as cluster:
        cluster.worker()
        plan = planned(tmp_path, "unavailable", "slow:seconds=50", cluster=cluster.access)
        with pytest.raises(ClusterError, match=r"the scheduler at tcp://127.0.0.1:\d+ went away; what is finished is"):
            carry_out(plan, Doer(("slow", "warm up"), cluster.scheduler.kill))
        (worker,) = cluster.workers
        assert worker.wait(60) == 2, "the worker ends by itself"
        assert worker.stderr is not None
        assert "went away" in worker.stderr.read()
    with Store.open(tmp_path, create=False) as store:
        (record,) = store.runs()
        assert record.status is RunStatus.FAILED
        assert record.status.is_resumable
        assert [row.method for row in store.rows(record.run_id)] == ["unavailable"]


STRANGER = """
import sys
from shadowbench.runner.cluster import fingerprint
known = fingerprint.library_version
fingerprint.library_version = lambda name: "0.0.1" if name == "warp-lang" else known(name)
from shadowbench.cli import main
sys.exit(main(sys.argv[1:]))
"""


def test_a_worker_with_another_warp_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    with LocalCluster(tmp_path / "cluster") as cluster:
        cluster.worker(sys.executable, "-c", STRANGER)
        plan = planned(tmp_path, "formula", cluster=cluster.access)
        with pytest.raises(ClusterError, match=r"may measure this: .* has other versions of warp-lang \(0\.0\.1, here"):
            carry_out(plan)


def certificates(folder: Path) -> tuple[Path, Path, Path]:
    """Make an authority, and a certificate that it signed."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    folder.mkdir()
    now = dt.datetime.now(dt.UTC)
    own_key, signed_key = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))

    def name(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])

    def builder(subject: str, key: ec.EllipticCurvePrivateKey) -> x509.CertificateBuilder:
        return (
            x509.CertificateBuilder()
            .subject_name(name(subject))
            .issuer_name(name("a group's authority"))
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - dt.timedelta(days=1))
            .not_valid_after(now + dt.timedelta(days=1))
        )

    authority = builder("a group's authority", own_key).add_extension(
        x509.BasicConstraints(ca=True, path_length=None), critical=True
    )
    address = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    signed = builder("a machine", signed_key).add_extension(address, critical=False)
    pem = serialization.Encoding.PEM
    ca, cert, key = folder / "ca.pem", folder / "cert.pem", folder / "key.pem"
    ca.write_bytes(authority.sign(own_key, hashes.SHA256()).public_bytes(pem))
    cert.write_bytes(signed.sign(own_key, hashes.SHA256()).public_bytes(pem))
    private = serialization.PrivateFormat.PKCS8
    key.write_bytes(signed_key.private_bytes(pem, private, serialization.NoEncryption()))
    return ca, cert, key


def test_over_tls_only_those_with_a_certificate_of_the_authority_take_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with LocalCluster(tmp_path / "cluster", certificates(tmp_path / "ours")) as cluster:
        assert cluster.address.startswith("tls://")
        cluster.worker()
        assert carry_out(planned(tmp_path, "formula", cluster=cluster.access)).row("formula").outcome is Outcome.OK
        monkeypatch.setattr("shadowbench.runner.cluster.handing.CONNECT_TIMEOUT_S", 1.0)
        plain = ClusterAccess(cluster.address.replace("tls://", "tcp://"))
        foreign = ClusterAccess(cluster.address, *certificates(tmp_path / "theirs"))
        for access in (plain, foreign):
            with pytest.raises(ClusterError, match=r"no scheduler answers at .* both sides must agree on TLS"):
                carry_out(planned(tmp_path / "other", "formula", cluster=access))


@pytest.mark.parametrize(
    ("access", "message"),
    [
        (ClusterAccess("somewhere"), "'somewhere' is no scheduler's address; it should look like tcp://127.0.0.1:8786"),
        (ClusterAccess("http://host:80"), "'http://host:80' is no scheduler's address"),
        (ClusterAccess("host:99999"), "'host:99999' is no scheduler's address"),
        (ClusterAccess("host:1", Path(__file__)), "--tls-cert is missing"),
        (ClusterAccess("host:1", Path("absent.pem")), "--tls-ca absent.pem: there is no such file"),
        (ClusterAccess("tcp://host:1", Path(__file__)), "certificates are given, but tcp://host:1 is not tls://"),
    ],
)
def test_an_address_that_cannot_be_one_is_refused(access: ClusterAccess, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        checked_access(access)
    assert message in str(caught.value)


def test_an_address_without_a_protocol_means_tcp_or_with_certificates_tls() -> None:
    here = Path(__file__)
    assert checked_access(ClusterAccess("host:1")).address == "tcp://host:1"
    assert checked_access(ClusterAccess("host:1", here, here, here)).address == "tls://host:1"


def test_files_that_are_no_certificates_are_the_users_to_mend(tmp_path: Path) -> None:
    here = Path(__file__)
    with pytest.raises(UsageError, match="the TLS files cannot be used"):
        carry_out(planned(tmp_path, "unavailable", cluster=ClusterAccess("tls://127.0.0.1:1", here, here, here)))


def test_nobody_answering_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shadowbench.runner.cluster.handing.CONNECT_TIMEOUT_S", 0.5)
    with pytest.raises(ClusterError, match=r"no scheduler answers at tcp://127.0.0.1:1 within 0.5 s; `shadowbench sch"):
        carry_out(planned(tmp_path, "unavailable", cluster=ClusterAccess("127.0.0.1:1")))


@pytest.mark.parametrize("arguments", [["run", "--cluster", "127.0.0.1:1"], ["worker", "127.0.0.1:1"], ["scheduler"]])
def test_without_the_extra_one_line_says_what_to_install(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(arguments) == 2
    line = "shadowbench: error: a cluster needs dask.distributed: pip install 'shadowbench[cluster]'\n"
    assert capfd.readouterr().err == line


def test_a_dry_run_connects_to_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ["--scene", "box-on-plane", "--method", "no-shadows", "--size", "8x8"]
    assert main(["run", *options, "--cluster", "127.0.0.1:1", "--dry-run"]) == 0
    assert "nothing was measured" in capfd.readouterr().out

"""How often an address may ask, whichever process it asks, and whatever has become of the table."""

from __future__ import annotations

import http.client
import json
import struct
import subprocess
import sys
import threading
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from service.live import Live, serving

from shadowbench.service.buckets import Buckets, network_of


class Clock:
    """A clock that is set."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


def test_a_bucket_fills_again_with_time(clock: Clock) -> None:
    buckets = Buckets(2.0, 2.0, clock=clock)
    assert [buckets.wait("a") for _ in range(2)] == [0.0, 0.0]
    assert buckets.wait("a") == pytest.approx(0.5)
    assert buckets.wait("b") == 0.0
    clock.now += 0.5
    assert buckets.wait("a") == 0.0
    assert buckets.wait("a") > 0.0
    clock.now += 1000.0
    assert [buckets.wait("a") > 0.0 for _ in range(3)] == [False, False, True]


def test_looking_takes_nothing(clock: Clock) -> None:
    buckets = Buckets(1.0, 1.0, clock=clock)
    assert [buckets.wait("a", take=0.0) for _ in range(3)] == [0.0, 0.0, 0.0]
    assert buckets.wait("a") == 0.0
    assert buckets.wait("a", take=0.0) == pytest.approx(1.0)


def test_all_that_share_a_table_take_from_the_same_buckets(tmp_path: Path, clock: Clock) -> None:
    first, second = (Buckets(1.0, 4.0, tmp_path / "table", clock) for _ in range(2))
    assert [each.wait("a") > 0.0 for each in (first, second, second, first, second, first)] == [False] * 4 + [True] * 2
    assert first.wait("b") == 0.0
    second.close()
    clock.now += 1.0
    assert Buckets(1.0, 4.0, tmp_path / "table", clock).wait("a") == 0.0  # a worker that took another's place
    assert first.wait("a") == pytest.approx(1.0)


def test_nothing_is_given_twice_when_many_ask_at_once(tmp_path: Path) -> None:
    """Two processes, four threads in each; 1000 may pass of 2000 that ask."""
    program = (
        "import pathlib, sys, threading; from shadowbench.service.buckets import Buckets\n"
        "buckets = Buckets(1e-9, 1000.0, pathlib.Path(sys.argv[1])); granted = []\n"
        "def ask():\n"
        "    granted.append(sum(buckets.wait('a') == 0.0 for _ in range(250)))\n"
        "threads = [threading.Thread(target=ask) for _ in range(4)]\n"
        "[thread.start() for thread in threads]; [thread.join() for thread in threads]; print(sum(granted))"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "table")]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert sum(int(process.communicate(timeout=60)[0]) for process in running) == 1000


def test_many_addresses_leave_one_that_is_out_of_luck_where_it_is(clock: Clock) -> None:
    buckets = Buckets(1e-6, 10.0, clock=clock)
    for _ in range(10):
        buckets.wait("guesser")
    for number in range(20_000):  # more than the table has places
        buckets.wait(f"10.0.{number // 256}.{number % 256}")
    assert buckets.wait("guesser") > 0.0


@pytest.mark.parametrize("level", [float("nan"), float("inf"), -1e300, 1e300])
def test_a_bucket_that_was_written_by_halves_is_bounded(tmp_path: Path, clock: Clock, level: float) -> None:
    buckets = Buckets(1.0, 2.0, tmp_path / "table", clock)
    buckets.wait("a")
    content = bytearray((tmp_path / "table").read_bytes())
    (place,) = (at for at in range(32, len(content), 32) if any(content[at : at + 16]))
    struct.pack_into("d", content, place + 16, level)
    (tmp_path / "table").write_bytes(content)
    found = Buckets(1.0, 2.0, tmp_path / "table", clock)
    assert 0.0 <= found.wait("a") <= 1.0
    assert [found.wait("a") > 0.0 for _ in range(3)][-1]


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        ("10.0.0.1", "10.0.0.2", False),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8:0:1::1", "2001:db8:0:2::1", False),
        ("::ffff:10.0.0.1", "10.0.0.1", True),
        ("testclient", "", False),
    ],
)
def test_an_ipv6_network_counts_as_one_address(one: str, other: str, is_same: bool) -> None:
    assert (network_of(one) == network_of(other)) is is_same


def connections_to_each_process(live: Live) -> list[http.client.HTTPConnection]:
    """Return a kept connection to each of two worker processes; the log says whose each is."""
    port = int(live.address.rpartition(":")[2])
    found: dict[int, http.client.HTTPConnection] = {}
    for number in range(200):
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        other = threading.Thread(target=_ask_once, args=(port, "/healthz"))
        other.start()
        _ask(connection, f"/api/docs/{number}")
        other.join()
        said: list[dict[str, object]] = []
        while not said:
            lines = live.log.read_text().splitlines(keepends=True)
            said = [json.loads(line) for line in lines if f'"/api/docs/{number}"' in line and line.endswith("\n")]
        if found.setdefault(int(str(said[0]["process"])), connection) is not connection:
            connection.close()
        if len(found) == 2:
            break
    return list(found.values())


def _ask_once(port: int, path: str) -> None:
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=60)) as connection:
        _ask(connection, path)


def _ask(connection: http.client.HTTPConnection, path: str, **headers: str) -> int:
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    answer.read()
    return answer.status


@pytest.mark.slow
def test_two_workers_count_an_addresss_requests_and_guesses_together(tmp_path: Path) -> None:
    with serving(tmp_path / "results", "--workers", "2", "--private", "--rate", "0.001") as live, ExitStack() as stack:
        both = [stack.enter_context(closing(each)) for each in connections_to_each_process(live)]
        assert len(both) == 2
        guess = {"Authorization": f"Bearer sb_{'0' * 12}_{'A' * 43}"}
        guesses = [_ask(both[number % 2], "/runs.json", **guess) for number in range(14)]
        assert guesses.count(401) in (10, 11)  # one more may flow in meanwhile
        assert set(guesses[:10]) == {401}
        assert guesses[-1] == 429
        asked = [_ask(both[number % 2], "/runs.json") for number in range(400)]
        assert asked[-2:] == [429, 429]
        assert asked[0] == 401
        assert _ask(both[0], "/healthz") == _ask(both[1], "/healthz") == 200

"""A run on a cluster survives whatever is killed."""

from pathlib import Path

import pytest
from benchmarks.cluster_kills import SCENES, killed_run


@pytest.mark.slow
@pytest.mark.usefixtures("lasting_workers")
def test_killed_at_random_moments_it_loses_and_doubles_nothing(tmp_path: Path) -> None:
    counts = killed_run(tmp_path, kills=3, seed=7, scenes=SCENES[:2])
    assert counts.wrong == []
    assert sum(counts.kills.values()) == 3

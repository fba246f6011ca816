"""A batch on a Dask cluster of its own, one of whose workers is killed, gives the files of a batch on one machine."""

import os
import signal
from pathlib import Path
from typing import Any

import distributed
import pytest

from lutforge.apply.batch import apply_batch
from lutforge.apply.grade import LutRecipe
from lutforge.apply.job import JOURNAL
from tests.cases.pictures import write_cube, write_picture


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != JOURNAL}


@pytest.mark.slow
def test_a_killed_worker_changes_nothing(tmp_path: Path) -> None:
    cube = write_cube(tmp_path / "look.cube")
    pictures = [tmp_path / f"{seed}.tif" for seed in range(16)]
    for seed, path in enumerate(pictures):
        write_picture(path, (300, 400), "uint16", seed=seed)
    (tmp_path / "zero.png").touch()
    here = apply_batch(LutRecipe(cube), pictures, tmp_path / "here")
    local_cluster: Any = distributed.LocalCluster
    with local_cluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        killed: list[int] = []

        def watch(what: str, share: float) -> None:
            if share >= 3 / 17 and not killed:
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        there = apply_batch(
            LutRecipe(cube),
            [*pictures, tmp_path / "zero.png"],
            tmp_path / "there",
            progress=watch,
            scheduler=cluster.scheduler_address,
        )
        assert killed
        again = apply_batch(
            LutRecipe(cube), pictures, tmp_path / "there", scheduler=cluster.scheduler_address, resume=True
        )
    assert [failure.reason for failure in there.failed] == [f"{tmp_path / 'zero.png'}: the file is empty"]
    assert [done.source for done in there.done] == [done.source for done in here.done] == pictures
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
    assert (len(again.done), len(again.skipped)) == (0, 16)

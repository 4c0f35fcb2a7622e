"""`read` and `benchmark` with `--cluster`: a real scheduler, two workers, one of them lost in the middle."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.front_doors import save_height_map
from tests.support.run_tables import csv_rows

pytest.importorskip("distributed")
from tests.support.cluster_process import ClusterProcess, cluster_process, environment
from tests.support.waiting import wait_until

PARTS = 8
WAIT_S = 120.0


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A manifest of parts by URL and by name, one of which is not there."""
    folder = tmp_path_factory.mktemp("lot")
    stamped = save_height_map(folder / "stamped.npz", "K7").read_bytes()
    with (folder / "lot.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(("part", "height_map", "format"))
        for number in range(PARTS):
            path = folder / f"part-{number:02d}.npz"
            path.write_bytes(stamped)
            table.writerow((path.stem, path.as_uri() if number % 2 else path.name, "A9"))
        table.writerow(("gone", (folder / "gone.npz").as_uri(), "A9"))
    return folder


def run(cluster: ClusterProcess, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline", *arguments, "--cluster", cluster.address],
        cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(),
    )  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def nowhere(parts: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[subprocess.Popen[str]]:
    """A run whose scheduler is not there: it looks for it while the other test is at work."""
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline", "read", str(parts / "part-00.npz"), "--cluster", "tcp://127.0.0.1:9"],
        cwd=tmp_path_factory.mktemp("nowhere"), text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env=environment(),
    )  # fmt: skip
    yield process
    process.kill()
    process.wait()


def test_a_worker_lost_in_the_middle_costs_no_part(parts: Path, tmp_path: Path) -> None:
    (logs := tmp_path / "logs").mkdir()
    with cluster_process(logs) as cluster:
        arguments = ("--font", "gothic", "--height-mm", "4", "--out", "rows.jsonl")
        process = run(cluster, tmp_path, "read", str(parts / "lot.csv"), *arguments)
        rows_path = tmp_path / "rows.jsonl"
        wait_until(lambda: rows_path.exists() and rows_path.read_bytes().count(b"\n") > 2, process)
        cluster.lose(cluster.workers[0])
        told, error = process.communicate(timeout=WAIT_S)
        assert process.returncode == 1, error + cluster.told()  # the part that is not there
    rows = [json.loads(line) for line in rows_path.read_text().splitlines()]
    assert [row["part"] for row in rows] == [*(f"part-{k:02d}" for k in range(PARTS)), "gone"]
    assert [row["part"] for row in rows if row["error"]] == ["gone"], rows
    assert "gone.npz: is not there" in rows[-1]["error"]
    (text,) = {row["text"] for row in rows[:-1]}
    assert len(text) == 2
    assert f"{PARTS + 1} parts" in told
    assert [bad["part"] for bad in csv_rows(tmp_path / "rows.quarantine.csv")] == ["gone"]


def test_no_scheduler_is_one_line(nowhere: subprocess.Popen[str]) -> None:
    _, error = nowhere.communicate(timeout=WAIT_S)
    assert nowhere.returncode == 1
    assert error.count("\n") == 1
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in error

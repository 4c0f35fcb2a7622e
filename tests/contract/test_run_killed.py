"""`kill -9` in the middle of a night's run: the same command goes on, reads no part again and loses none."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
import sqlalchemy as sa

from tests.contract.front_doors import children, is_alive, save_height_map, start_process

PARTS = 7
WAIT_S = 90.0
READ = ("read", "parts", "--font", "gothic", "--format", "A9", "--height-mm", "4")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of parts, one of them bad."""
    folder = tmp_path_factory.mktemp("night") / "parts"
    folder.mkdir()
    stamped = save_height_map(folder / "part-00.npz", "K7").read_bytes()
    for number in range(1, PARTS):
        (folder / f"part-{number:02d}.npz").write_bytes(stamped)
    (folder / "part-05.npz").write_bytes(b"rubbish")
    return folder


def started(parts: Path, folder: Path, out: str, *, jobs: int = 1) -> subprocess.Popen[str]:
    if not (folder / "parts").exists():
        (folder / "parts").symlink_to(parts)
    return start_process(*READ, "--jobs", str(jobs), "--out", out, cwd=folder)


def lines(path: Path) -> list[bytes]:
    """Whole lines of a table that is being written."""
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def killed_after(process: subprocess.Popen[str], table: Path, rows: int) -> None:
    until = time.monotonic() + WAIT_S
    while len([line for line in lines(table) if line.endswith(b"\n")]) < rows:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    workers = children(process.pid)
    process.kill()
    process.communicate()
    while any(is_alive(pid) for pid in workers):  # they end with the run, however it ends
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_killed_run_goes_on_where_it_ended(parts: Path, tmp_path: Path) -> None:
    # once, and as a table of lines; tests/pipeline/runs/test_journal.py has other kinds, and kills again and again
    out = "rows.csv"
    killed_after(started(parts, tmp_path, out), tmp_path / out, 3)
    kept = [(str(row["part"]), float(str(row["seconds"]))) for row in read_table(tmp_path / out)]
    assert len(kept) >= 2
    before = dict(kept)
    assert len(before) == len(kept)
    process = started(parts, tmp_path, out)
    told, error = process.communicate(timeout=WAIT_S)
    assert process.returncode == 1, error  # the bad part
    assert f"continuing an interrupted run: {len(before)} parts are read already" in told
    assert f"{PARTS} parts" in told
    rows_of = read_table(tmp_path / out)
    assert [str(row["part"]) for row in rows_of] == [f"part-{k:02d}" for k in range(PARTS)]
    assert [row["part"] for row in rows_of if row["error"]] == ["part-05"]
    assert {str(row["text"]) for row in rows_of if not row["error"]} == {rows_of[0]["text"]}
    # not one was read again: the time it took is that of the first reading
    seconds = {str(row["part"]): float(str(row["seconds"])) for row in rows_of}
    assert {part: seconds[part] for part in before} == before
    with (tmp_path / "rows.quarantine.csv").open(newline="") as stream:
        (bad,) = csv.DictReader(stream)
    assert bad["part"] == "part-05"
    assert Path(bad["height_map"]).name == "part-05.npz"
    assert not [p.name for p in tmp_path.iterdir() if p.name.endswith((".unfinished", ".rows.jsonl"))]


def test_a_killed_run_into_a_store_goes_on(parts: Path, tmp_path: Path) -> None:
    out = "sqlite:///parts.db"
    process = started(parts, tmp_path, out)
    until = time.monotonic() + WAIT_S
    while not (tables := list(tmp_path.glob("tactile-marks-*.jsonl"))):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    killed_after(process, tables[0], 3)
    kept = stored(tmp_path / "parts.db")
    assert 2 <= len(kept) < PARTS
    process = started(parts, tmp_path, out)
    _, error = process.communicate(timeout=WAIT_S)
    assert process.returncode == 1, error
    after = stored(tmp_path / "parts.db")
    assert sorted(name for name, _ in after) == [f"part-{k:02d}" for k in range(PARTS) if k != 5]
    assert set(kept) <= set(after)
    assert not list(tmp_path.glob("tactile-marks-*.jsonl*"))


def test_a_killed_worker_costs_no_part(parts: Path, tmp_path: Path) -> None:
    process = started(parts, tmp_path, "rows.csv", jobs=2)
    until = time.monotonic() + WAIT_S
    while len(lines(tmp_path / "rows.csv")) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.01)
    workers = [
        pid for pid in children(process.pid) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    _, error = process.communicate(timeout=WAIT_S)
    assert process.returncode == 1, error
    rows = read_table(tmp_path / "rows.csv")
    assert [row["part"] for row in rows] == [f"part-{k:02d}" for k in range(PARTS)]
    assert [row["part"] for row in rows if row["error"]] == ["part-05"]


def test_a_second_run_on_the_same_table_is_refused(parts: Path, tmp_path: Path) -> None:
    process = started(parts, tmp_path, "rows.csv")
    until = time.monotonic() + WAIT_S
    while not lines(tmp_path / "rows.csv"):
        assert time.monotonic() < until
        time.sleep(0.01)
    process.send_signal(signal.SIGSTOP)  # or it might be done before the second one looks
    _, error = started(parts, tmp_path, "rows.csv").communicate(timeout=WAIT_S)
    assert "rows.csv" in error
    assert "another run" in error
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGCONT)
    _, error = process.communicate(timeout=WAIT_S)
    assert process.returncode == 130, error
    assert "run the same command again" in error


def stored(path: Path) -> list[tuple[str, str]]:
    engine = sa.create_engine(f"sqlite:///{path}")
    with engine.connect() as connection:
        return [
            tuple(row) for row in connection.execute(sa.text("select record ->> '$.name', id from parts"))
        ]


def read_table(path: Path) -> list[dict[str, object]]:
    """The whole rows of a table that may be being written."""
    whole = b"".join(line for line in lines(path) if line.endswith(b"\n"))
    return list(csv.DictReader(whole.decode().splitlines()))

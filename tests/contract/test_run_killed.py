"""`kill -9` in the middle of a night's run: the same command goes on, reads no part again and loses none."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
from pathlib import Path

import pytest

from tests.contract.front_doors import main, save_height_map, start_process
from tests.support.run_tables import csv_rows
from tests.support.waiting import PATIENCE_S, children, is_alive, wait_until

PARTS = 8
BAD = "part-06"
READ = ("read", "parts", "--font", "gothic", "--format", "A9", "--height-mm", "4")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of parts, one of them bad."""
    folder = tmp_path_factory.mktemp("night") / "parts"
    folder.mkdir()
    stamped = save_height_map(folder / "part-00.npz", "K7").read_bytes()
    for number in range(1, PARTS):
        (folder / f"part-{number:02d}.npz").write_bytes(stamped)
    (folder / f"{BAD}.npz").write_bytes(b"rubbish")
    return folder


def started(parts: Path, folder: Path, out: str, *, jobs: int = 1) -> subprocess.Popen[str]:
    if not (folder / "parts").exists():
        (folder / "parts").symlink_to(parts)
    return start_process(*READ, "--jobs", str(jobs), "--out", out, cwd=folder)


def lines(path: Path) -> list[bytes]:
    """Whole lines of a table that is being written."""
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def wait_for_lines(process: subprocess.Popen[str], table: Path, count: int) -> None:
    wait_until(lambda: sum(line.endswith(b"\n") for line in lines(table)) >= count, process)


def killed_after(process: subprocess.Popen[str], table: Path, count: int) -> None:
    wait_for_lines(process, table, count)
    workers = children(process.pid)
    process.kill()
    process.communicate()
    wait_until(lambda: not any(is_alive(pid) for pid in workers), why="for workers to end with the run")


def test_a_run_that_is_broken_off_killed_and_loses_a_worker_reads_every_part_once(
    parts: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # as a table of lines; tests/pipeline/runs/test_journal.py has other kinds, tests/faults runs into a store
    table = tmp_path / "rows.csv"
    first = started(parts, tmp_path, table.name)
    wait_for_lines(first, table, 1)
    first.send_signal(signal.SIGSTOP)  # or it might be done before the second one looks
    monkeypatch.chdir(tmp_path)
    assert main([*READ, "--jobs", "1", "--out", table.name]) == 1
    error = capsys.readouterr().err
    assert "rows.csv" in error
    assert "another run" in error
    first.send_signal(signal.SIGINT)
    first.send_signal(signal.SIGCONT)
    _, error = first.communicate(timeout=PATIENCE_S)
    assert first.returncode == 130, error
    assert "run the same command again" in error

    killed_after(started(parts, tmp_path, table.name), table, 3)
    kept = [(str(row["part"]), float(str(row["seconds"]))) for row in read_table(table)]
    assert len(kept) >= 2
    before = dict(kept)
    assert len(before) == len(kept)

    process = started(parts, tmp_path, table.name, jobs=2)
    wait_for_lines(process, table, len(kept) + 2)  # with the head and a row of its own
    workers = [
        pid for pid in children(process.pid) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    told, error = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1, error  # the bad part
    assert f"continuing an interrupted run: {len(before)} parts are read already" in told
    assert f"{PARTS} parts" in told
    rows_of = read_table(table)
    assert [str(row["part"]) for row in rows_of] == [f"part-{k:02d}" for k in range(PARTS)]
    assert [row["part"] for row in rows_of if row["error"]] == [BAD]
    assert {str(row["text"]) for row in rows_of if not row["error"]} == {rows_of[0]["text"]}
    # not one was read again: the time it took is that of the first reading
    seconds = {str(row["part"]): float(str(row["seconds"])) for row in rows_of}
    assert {part: seconds[part] for part in before} == before
    (bad,) = csv_rows(tmp_path / "rows.quarantine.csv")
    assert bad["part"] == BAD
    assert Path(bad["height_map"]).name == f"{BAD}.npz"
    assert not [p.name for p in tmp_path.iterdir() if p.name.endswith((".unfinished", ".rows.jsonl"))]


def read_table(path: Path) -> list[dict[str, object]]:
    """The whole rows of a table that may be being written."""
    whole = b"".join(line for line in lines(path) if line.endswith(b"\n"))
    return list(csv.DictReader(whole.decode("utf-8-sig").splitlines()))

"""Bad files through `read_order` in a process with bounded memory: a problem or a reading each, and nothing else."""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

from tests.support import bad_files

MOST_MEMORY = 3 << 30
MOST_SECONDS = 120.0
"""For one file, on a busy machine: as long as a service may let a worker try. Most take milliseconds."""
LEAST_FILES = 40


def outcomes(pipe: Any) -> None:
    """Read every file; send (name, outcome, seconds), and at the end what memory it took."""
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
    from glyphs.errors import FileError
    from pipeline.common.settings import ReadSettings
    from pipeline.formats.kinds import is_photo, is_scan
    from pipeline.formats.touch_file import Limits
    from pipeline.reading.part_orders import PartOrder, read_order

    settings = ReadSettings(font=("gothic",), height_mm=5.0)
    with tempfile.TemporaryDirectory() as place:
        for number, (name, data) in enumerate(bad_files.bad_files()):
            folder = Path(place) / str(number)
            folder.mkdir()
            path = folder / "upload"
            path.write_bytes(data)
            sent: dict[str, Any] = (
                {"photos": (path,)}
                if is_photo(Path(name))
                else {"scan" if is_scan(Path(name)) else "height_map": path}
            )
            started = time.monotonic()
            try:
                done = read_order(PartOrder(folder, **sent, names={path: name}), settings, Limits())
                said = f"read {done.readings[-1].decision}"
            except FileError as problem:
                said = f"problem {problem}"
            except BaseException as error:
                said = f"fault {error!r}"
            pipe.send((name, said, time.monotonic() - started, place))
    pipe.send(None)


@pytest.fixture(scope="module")
def seen() -> dict[str, tuple[str, float, str]]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=outcomes, args=(theirs,))
    process.start()
    theirs.close()
    found: dict[str, tuple[str, float, str]] = {}
    last = "none"
    try:
        while (message := ours.recv()) is not None:
            last, said, seconds, place = message
            assert last not in found, "names are unique"
            found[last] = (said, seconds, place)
    except EOFError:
        pytest.fail(f"the process has ended at the file after {last}")
    finally:
        process.join(10.0)
        process.kill()
    return found


def test_every_bad_file_is_a_problem_or_a_reading(seen: dict[str, tuple[str, float, str]]) -> None:
    assert len(seen) >= LEAST_FILES
    assert {n: s for n, (s, _, _) in seen.items() if not s.startswith(("read ", "problem "))} == {}


def test_no_bad_file_keeps_a_worker_busy(seen: dict[str, tuple[str, float, str]]) -> None:
    assert {n: t for n, (_, t, _) in seen.items() if t > MOST_SECONDS} == {}


def test_problems_name_the_file_and_no_folder(seen: dict[str, tuple[str, float, str]]) -> None:
    told = {n: (s, place) for n, (s, _, place) in seen.items() if s.startswith("problem ")}
    assert {n: s for n, (s, place) in told.items() if not s.startswith(f"problem {n}: ")} == {}
    assert {n: s for n, (s, place) in told.items() if place in s} == {}


@pytest.mark.parametrize(
    "name",
    ["linked-external.h5", "linked-virtual.h5", "linked-storage.h5", "linked-soft.h5", "linked.datx"],
)
def test_files_of_the_server_are_not_read_through_links(
    seen: dict[str, tuple[str, float, str]], name: str
) -> None:
    said = seen[name][0]
    assert said.startswith("problem ")
    assert "another file" in said


@pytest.mark.parametrize(
    "name",
    [
        "bomb-12000x12000.png",
        "declared-2e9.png",
        "declared-65000x65000.jpg",
        "declared-huge.tif",
        "bomb.npz",
        "declared-1e12.npz",
        "declared-1e10.x3p",
        "declared.sdf",
        "declared.h5",
    ],
)
def test_what_is_too_large_is_told_by_its_limit(seen: dict[str, tuple[str, float, str]], name: str) -> None:
    assert "over the limit" in seen[name][0]


def test_pickles_are_not_opened(seen: dict[str, tuple[str, float, str]]) -> None:
    assert "is of type object" in seen["pickle.npz"][0]

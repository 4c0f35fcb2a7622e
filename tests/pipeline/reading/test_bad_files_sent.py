"""Bad files through `read_sent` with bounded memory, and maps with few heights: a problem or a reading each."""

from __future__ import annotations

import contextlib
import io
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs import stamp
from glyphs.errors import FileError, MarksError
from pipeline.common.settings import Limits, ReadSettings
from pipeline.formats.find_parts import with_file
from pipeline.formats.kinds import file_kind
from pipeline.formats.part_files import PartFiles
from pipeline.formats.touch_file import read_part_map
from pipeline.reading.part_job import PartJob, read_sent
from pipeline.workers.pool import WorkPool
from recognition import Reader
from recognition.decide.evidence import Evidence
from tests.support import bad_files

MOST_MEMORY_MB = 3 << 10
MOST_SECONDS = 120.0
"""For one file, on a busy machine: as long as a service may let a worker try. Most take milliseconds."""
LEAST_FILES = 40


def read_file(place: str, named: tuple[str, bytes]) -> str:
    """Outcome of a file, in a worker: a decision or a problem."""
    name, data = named
    folder = Path(tempfile.mkdtemp(dir=place))
    path = folder / f"upload{Path(name).suffix.lower()}"
    path.write_bytes(data)
    kind = file_kind(Path(name).suffix) or "height_map"
    sent = with_file(PartFiles("part"), kind, str(path))
    settings = ReadSettings(
        font=("gothic",),
        format=("A9",),
        height_mm=5.0,
        experts=("network",),
        orientation="upright",
        rows="top-first",
    )
    try:
        done = read_sent(PartJob(sent, settings, limits=Limits(), folder=folder, names={str(path): name}))
    except FileError as problem:
        return f"problem {problem}"
    return f"read {done.readings[-1].decision}"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(tmp_path_factory.mktemp("bad"))


@pytest.fixture(scope="module")
def seen(place: str) -> dict[str, str]:
    """Every file by name; what was raised, or what became of the worker, where there is no outcome."""
    with WorkPool(1, memory_mb=MOST_MEMORY_MB, timeout_s=MOST_SECONDS) as pool:
        outcomes = list(pool.calls(read_file, place, bad_files.bad_files()))
    return {outcome.task[0]: outcome.result or f"fault {outcome.error!r}" for outcome in outcomes}


def test_every_bad_file_is_soon_a_problem_or_a_reading(seen: dict[str, str]) -> None:
    assert len(seen) >= LEAST_FILES
    assert {name: said for name, said in seen.items() if not said.startswith(("read ", "problem "))} == {}


def test_problems_name_the_file_and_no_folder(seen: dict[str, str], place: str) -> None:
    told = {name: said for name, said in seen.items() if said.startswith("problem ")}
    assert {
        n: said for n, said in told.items() if not said.startswith(f"problem {n}: ") or place in said
    } == {}
    assert not [said for said in told.values() if "\n" in said]
    # and what to do about it; of a recording's numbers that is for whoever wrote them
    assert not [said for name, said in told.items() if not name.endswith(".h5") and "; " not in said]


SAYS = {
    "is empty": "empty.png empty.npz empty.x3p empty.sdf empty.sur empty.h5",
    "is damaged": "truncated.npz picture.npz no-head.npz truncated.x3p npz.x3p text.sdf truncated.sdf head-only.sdf"
    " declared.sdf claims.mat magic-only.sur noise.opd noise.plu magic-only.h5",
    "has no z_mm": "no-heights.npz nothing.npz",
    "has no pitch_mm": "no-pitch.npz",
    "as the distance of its samples": "pitch-nan.npz pitch-nought.npz pitch-negative.npz",
    "samples lie 10 mm apart": "coarse.npz",
    "pitch_mm has shape (2,)": "pitch-list.npz",
    "preload_mm is 1e+300": "preload-huge.h5",
    "is of type": "pitch-string.npz complex.npz strings.npz bools.npz",
    "z_mm is of type object": "pickle.npz",  # and was not opened
    "has no finite height": "nan-only.npz beyond-floats.npz nan-only.x3p",
    "its heights have shape": "flat.npz cube.npz no-samples.npz declared-negative.npz",
    "holds a profile; measure a surface": "one-row.sdf one-row.npz",
    "is shorter than it declares": "declared-short.npz",
    "npy version": "version-9.npz",
    "no format that is read": "script.py",
    "pieces": "chunks.png segments.jpg blocks.gif strips.tif entries.tif",
    "text PGM": "comments.pgm",
    "long comments": "comments-in-head.pgm",
    "ends too soon": "counted.pcd counted-down.pcd",
    "over each other": "groups.obj solids.stl",
    "more lines than it declares": "lines.ply",
    "its head does not end": "properties.ply",
    "more members than a height map": "members.npz",
    "unpacks to": "members.x3p",
    "its head does not fit its heights": "declared.tmd",
    "8,388,608 chunks": "small-chunks.h5",
    "another file": "linked-external.h5 linked-virtual.h5 linked-storage.h5 linked-soft.h5 linked.datx",
    "over the limit": "bomb-12000x12000.png declared-2e9.png declared-65000x65000.jpg declared-huge.tif bomb.npz"
    " declared-1e12.npz declared-1e10.x3p declared.h5 declared.nms",
}


@pytest.mark.parametrize("words", SAYS)
def test_a_problem_says_what_is_wrong(seen: dict[str, str], words: str) -> None:
    names = SAYS[words].split()
    assert {name: seen[name] for name in names if words not in seen[name]} == {}


PART = stamp("K4", fonts="gothic", height_mm=5, seed=1).height_map
ROWS, COLS = PART.shape
READER = Reader(fonts=("gothic",), height_mm=5)
Known = NDArray[np.bool_]


@st.composite
def known_samples(draw: st.DrawFn) -> Known:
    """Stripes, a diagonal, scattered points or a block: the samples that have a height."""
    known = np.zeros((ROWS, COLS), dtype=np.bool_)
    shape = draw(st.sampled_from(["stripes", "diagonal", "points", "block"]))
    place = st.integers(0, min(ROWS, COLS) - 1)
    if shape == "stripes":
        row_step, col_step = (
            draw(st.sampled_from([1, 2, 3, 7, 50, ROWS])),
            draw(st.sampled_from([1, 2, 5, COLS])),
        )
        known[
            draw(st.integers(0, row_step - 1)) :: row_step, draw(st.integers(0, col_step - 1)) :: col_step
        ] = True
    elif shape == "diagonal":
        rise, shift = draw(st.sampled_from([-1, 1])), draw(place)
        for k in range(min(ROWS, COLS) - shift):
            known[::rise][k, k + shift] = True
    elif shape == "points":
        places = st.tuples(st.integers(0, ROWS - 1), st.integers(0, COLS - 1))
        for row, col in draw(st.lists(places, min_size=1, max_size=60)):
            known[row, col] = True
    else:
        top, left, height, width = (draw(place) for _ in range(4))
        known[top : top + height + 1, left : left + width + 1] = True
    return known


def npz(known: Known, path: Path, *, flat: bool = False) -> Path:
    stream = io.BytesIO()
    z = np.where(known, 0.0 if flat else PART.z_mm, np.nan).astype(np.float32)
    np.savez(stream, z_mm=z, pitch_mm=PART.pitch_mm)
    path.write_bytes(stream.getvalue())
    return path


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(known=known_samples(), flat=st.booleans())
def test_a_map_of_any_gaps_is_read_or_refused_in_words(known: Known, flat: bool, tmp_path: Path) -> None:
    with contextlib.suppress(MarksError):
        top = read_part_map(npz(known, tmp_path / "a.npz", flat=flat))
        reading = READER.decide(Evidence.of(READER.feel(top)))
        assert 0.0 <= reading.confidence <= 1.0


ONE_ROW, ONE_COLUMN, DIAGONAL, FOUR = (np.zeros((ROWS, COLS), dtype=np.bool_) for _ in range(4))
ONE_ROW[ROWS // 2] = ONE_COLUMN[:, 7] = True
np.fill_diagonal(DIAGONAL, True)
FOUR[[0, 9, 50, -1], [0, 9, 20, -1]] = True


@pytest.mark.parametrize(
    ("known", "why"),
    [
        (FOUR, "only 4 heights are known; measure the surface again"),
        (ONE_ROW, "on one line, as a profile; measure a surface"),
        (ONE_COLUMN, "on one line"),
        (DIAGONAL, "on one line"),
    ],
)
def test_heights_that_show_no_surface_are_refused(known: Known, why: str, tmp_path: Path) -> None:
    with pytest.raises(MarksError, match=why):
        READER.feel(read_part_map(npz(known, tmp_path / "a.npz")))

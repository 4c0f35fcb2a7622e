"""Height maps with few heights, or with heights in lines: each is read, or refused in words."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from glyphs import stamp
from glyphs.errors import MarksError
from pipeline.formats.touch_file import read_part_map
from pipeline.reading.part_reader import surface_of
from recognition import Reader
from recognition.decide.evidence import Evidence

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
        reading = READER.decide(Evidence.of(READER.feel(surface_of(top))))
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
        READER.feel(surface_of(read_part_map(npz(known, tmp_path / "a.npz"))))

"""Real coins: raised letters of 1 to 2 mm, of a font that nobody has a file of."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from recognition.reader import Reader
from recognition.reader_settings import ReaderSettings
from recognition.reading import Decision, ReadingFlag

ROOT = Path(__file__).parents[2]
OWN = ROOT / "tests" / "data"
SHARED = ROOT.parent / "shared" / "data" / "height_maps"
FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"


@pytest.mark.parametrize(
    ("strip", "font"),
    [
        (OWN / "penny_LIBERTY.npz", "gothic"),
        (OWN / "penny_LIBERTY.npz", str(FONTS / "DejaVuSans.ttf")),
        (OWN / "penny_1997.npz", "gothic"),
        (SHARED / "dime_ONE_DIME.npz", "gothic"),
    ],
    ids=["LIBERTY", "LIBERTY by a TTF", "1997", "ONE DIME"],
)
def test_a_coin_is_read_for_review(strip: Path, font: str) -> None:
    if not strip.is_file():
        pytest.skip(f"{strip} is not here: the team's shared data, not in the repository")
    with np.load(strip) as data:
        relief, text = HeightMap(data["z_mm"], float(data["pitch_mm"])), str(data["text"])
    reading = Reader(ReaderSettings(fonts=(font,))).read(relief)
    assert reading.text == text
    assert reading.raised
    # the font is not the coin's own: never accepted unseen
    assert reading.decision is Decision.REVIEW
    assert ReadingFlag.FOREIGN_SHAPES in reading.flags
    assert 0.6 < reading.height_mm < 2.2

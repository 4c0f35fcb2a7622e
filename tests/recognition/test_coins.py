"""Real coins: raised letters and figures of 1 to 4 mm, of fonts that nobody has a file of, and no format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from recognition.decide.decision import Decision
from recognition.decide.reading import Reading
from recognition.reader import Reader

ROOT = Path(__file__).parents[2]
OWN = ROOT / "tests" / "data"


def read(strip: Path) -> tuple[Reading, str]:
    with np.load(strip) as data:
        relief, text = HeightMap(data["z_mm"], float(data["pitch_mm"])), str(data["text"])
    return Reader().read(relief), text


@pytest.mark.parametrize(
    "strip",
    [OWN / "penny_LIBERTY.npz", OWN / "penny_1997.npz"],
    ids=lambda strip: strip.stem,
)
def test_a_coin_is_read_without_any_setting(strip: Path) -> None:
    reading, text = read(strip)
    assert (reading.text, reading.raised) == (text, True)
    assert reading.decision is not Decision.REJECT

"""The scale of a scan when nobody gives the character height."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from glyphs.errors import MarksError
from pipeline.reading.character_height import find_height_mm
from recognition.reader import Reader
from recognition.settings import ReaderSettings


def read_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whose font it is takes long and is not the subject."""
    gothic = Reader(ReaderSettings(fonts=("gothic",), experts=("network",)))
    monkeypatch.setattr("pipeline.reading.character_height.Reader", lambda: gothic)


def test_dirt_does_not_make_the_characters_taller(monkeypatch: pytest.MonkeyPatch) -> None:
    """On this part the highest band is dirt and line together."""
    read_quickly(monkeypatch)
    part = stamp("KX407251", fonts="gothic", height_mm=5.0, seed=3, dirt=0.6)
    # shops stamp within a few percent of the height asked for
    assert find_height_mm(part.height_map, soil=part.soil) == pytest.approx(5.0, rel=0.06)


def test_a_map_without_characters_needs_a_height(monkeypatch: pytest.MonkeyPatch) -> None:
    read_quickly(monkeypatch)
    flat = HeightMap(np.zeros((30, 60), np.float32), 0.1)
    with pytest.raises(MarksError, match="--height-mm"):
        find_height_mm(flat)

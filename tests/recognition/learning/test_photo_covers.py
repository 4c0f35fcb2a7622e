"""Covers on photographs of strips: the text and what was felt stay."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.learning.photo_covers import _COVERS, cover_photos
from recognition.learning.training_samples import TALL_ROWS, TrainingStrip
from recognition.see.view import GREY, KNOWN, LAYERS

KINDS = [cover.__name__ for cover in _COVERS]


def strip(source: str, *, columns: int = 150) -> TrainingStrip:
    rng = np.random.default_rng(2)
    layers = np.zeros((LAYERS, TALL_ROWS, columns), dtype=np.float16)
    layers[KNOWN, :, 10:] = 1
    layers[GREY if source == "photo" else 0, :, 10:] = 0.3 + 0.4 * rng.random((TALL_ROWS, columns - 10))
    return TrainingStrip(layers, "K7B2", source, 0.0, ((10.0, 40.0),) * 4)


def test_only_photographs_are_covered_and_only_their_brightness() -> None:
    originals = [strip("photo"), strip("felt"), strip("heights")] * 10
    covered = cover_photos(originals, rng=np.random.default_rng(0), share=1.0)
    for before, after in zip(originals, covered, strict=True):
        assert (after.text, after.places, after.source) == (before.text, before.places, before.source)
        others = [k for k in range(LAYERS) if k != GREY]
        np.testing.assert_array_equal(after.layers[others], before.layers[others])
        assert (before.source == "photo") == (not np.array_equal(after.layers, before.layers))


def test_what_is_unknown_stays_unknown_and_brightness_stays_in_range() -> None:
    for seed in range(30):
        (after,) = cover_photos([strip("photo")], rng=np.random.default_rng(seed), share=1.0)
        grey = after.layers[GREY].astype(np.float32)
        assert not grey[:, :10].any()
        assert np.isfinite(grey).all()
        assert 0.0 <= grey.min() <= grey.max() <= 1.0


@pytest.mark.parametrize("kind", range(len(_COVERS)), ids=KINDS)
def test_every_cover_changes_some_of_the_strip(kind: int) -> None:
    grey = strip("photo").layers[GREY].astype(np.float32)
    changed = [np.mean(_COVERS[kind](grey, np.random.default_rng(seed)) != grey) for seed in range(5)]
    assert max(changed) > 0.002


def test_no_share_covers_nothing() -> None:
    before = strip("photo")
    assert cover_photos([before], rng=np.random.default_rng(0), share=0.0)[0] is before

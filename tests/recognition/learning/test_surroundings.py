"""What lies around and over a training strip changes, its characters do not."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.learning.photo_covers import _COVERS, cover_photos
from recognition.learning.surroundings import vary_surroundings
from recognition.learning.training_samples import TALL_ROWS, TrainingStrip
from recognition.see.view import EDGES, GREY, KNOWN, LAYERS

# ------------------------------------------------------------------------------------------------------ surroundings

FIRST, LAST = 30, 110


def strip(text: str = "K7B2", *, places: bool = True) -> TrainingStrip:
    """Land that is known all over, and characters as noise."""
    rng = np.random.default_rng(3)
    layers = np.zeros((LAYERS, TALL_ROWS, 140), dtype=np.float16)
    layers[0] = 0.01
    layers[:KNOWN, :, FIRST:LAST] = rng.normal(0.0, 1.0, (KNOWN, TALL_ROWS, LAST - FIRST))
    layers[KNOWN] = 1
    at = np.linspace(FIRST, LAST, len(text) + 1)
    where = tuple(zip(at[:-1].tolist(), at[1:].tolist(), strict=True)) if places else ()
    return TrainingStrip(layers, text, "felt", 0.0, where)


def test_characters_stay_and_their_places_move_with_them() -> None:
    many = vary_surroundings([strip()] * 60, rng=np.random.default_rng(1), turned=0.0)
    whole = strip().layers[:, :, FIRST:LAST]
    for one in many:
        first = round(one.places[0][0])
        assert np.array_equal(one.layers[EDGES:, :, first : first + LAST - FIRST], whole[EDGES:])
        assert one.text == "K7B2"
    assert max(one.layers.shape[2] for one in many) > 160
    assert min(one.layers[KNOWN].min() for one in many) == 0


def test_without_places_the_surroundings_stay() -> None:
    given = strip(places=False)
    (made,) = vary_surroundings([given], rng=np.random.default_rng(1), turned=0.0)
    assert made is given


def test_a_turned_strip_says_nothing_and_its_directions_change_places() -> None:
    given = strip()
    found = vary_surroundings([given] * 40, rng=np.random.default_rng(2), longer=0.0, edge=0.0, turned=1.0)
    ways = {(2, 1): [4, 5, 2, 3], (1, 2): [2, 5, 4, 3]}
    counts = {
        order[0]: sum(
            np.array_equal(
                one.layers[EDGES:KNOWN], given.layers[order][:, ::-1, :: -1 if order[0] == 4 else 1]
            )
            for one in found
        )
        for order in ways.values()
    }
    assert all(one.text == "" for one in found)
    assert sum(counts.values()) == len(found)
    assert min(counts.values()) > 0


def test_a_text_that_reads_the_other_way_as_well_is_never_turned() -> None:
    given = strip("806960")
    found = vary_surroundings([given] * 40, rng=np.random.default_rng(2), longer=0.0, edge=0.0, turned=1.0)
    kept = [one for one in found if one.text]
    assert len(kept) > 20  # upside down it is another serial; mirrored it is none
    assert all(np.array_equal(one.layers, given.layers) for one in kept)


# ------------------------------------------------------------------------------------------------------ photo covers

KINDS = [cover.__name__ for cover in _COVERS]


def plain_strip(source: str, *, columns: int = 150) -> TrainingStrip:
    rng = np.random.default_rng(2)
    layers = np.zeros((LAYERS, TALL_ROWS, columns), dtype=np.float16)
    layers[KNOWN, :, 10:] = 1
    layers[GREY if source == "photo" else 0, :, 10:] = 0.3 + 0.4 * rng.random((TALL_ROWS, columns - 10))
    return TrainingStrip(layers, "K7B2", source, 0.0, ((10.0, 40.0),) * 4)


def test_only_photographs_are_covered_and_only_their_brightness() -> None:
    originals = [plain_strip("photo"), plain_strip("felt"), plain_strip("heights")] * 10
    covered = cover_photos(originals, rng=np.random.default_rng(0), share=1.0)
    for before, after in zip(originals, covered, strict=True):
        assert (after.text, after.places, after.source) == (before.text, before.places, before.source)
        others = [k for k in range(LAYERS) if k != GREY]
        np.testing.assert_array_equal(after.layers[others], before.layers[others])
        assert (before.source == "photo") == (not np.array_equal(after.layers, before.layers))


def test_what_is_unknown_stays_unknown_and_brightness_stays_in_range() -> None:
    for seed in range(30):
        (after,) = cover_photos([plain_strip("photo")], rng=np.random.default_rng(seed), share=1.0)
        grey = after.layers[GREY].astype(np.float32)
        assert not grey[:, :10].any()
        assert np.isfinite(grey).all()
        assert 0.0 <= grey.min() <= grey.max() <= 1.0


@pytest.mark.parametrize("kind", range(len(_COVERS)), ids=KINDS)
def test_every_cover_changes_some_of_the_strip(kind: int) -> None:
    grey = plain_strip("photo").layers[GREY].astype(np.float32)
    changed = [np.mean(_COVERS[kind](grey, np.random.default_rng(seed)) != grey) for seed in range(5)]
    assert max(changed) > 0.002


def test_no_share_covers_nothing() -> None:
    before = plain_strip("photo")
    assert cover_photos([before], rng=np.random.default_rng(0), share=0.0)[0] is before

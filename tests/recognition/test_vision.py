"""The camera-only reader, by templates; what several engines say, joined."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.stamping.stamp import StampedPart
from recognition.box import Box
from recognition.lattice import Lattice
from recognition.reader_settings import ReaderSettings
from recognition.reading import Decision, ReadingFlag
from recognition.vision_combine import as_reading, joined
from recognition.vision_frame import LinePlace
from recognition.vision_reader import VisionReader

TEXT = "K7B29"
SETTINGS = ReaderSettings(fonts=("gothic",), format="A9A99", height_mm=5.0)


@pytest.fixture(scope="module")
def reader() -> VisionReader:
    return VisionReader(SETTINGS, engine="templates")


@pytest.fixture(scope="module")
def photo(make_part: Callable[..., StampedPart]) -> tuple[StampedPart, Photo]:
    part = make_part(TEXT)
    z = part.height_map.z_mm.astype(np.float64)
    gy, gx = np.gradient(z, part.height_map.pitch_mm)
    grey = 110.0 * np.clip((1.0 - 0.6 * gx - 0.4 * gy) / np.sqrt(1.0 + gx**2 + gy**2), 0.05, None)
    grey += np.random.default_rng(0).normal(0.0, 3.0, z.shape)
    w, h = part.height_map.size_mm
    pixels = np.rint(np.clip(grey, 0, 255)).astype(np.uint8)
    return part, Photo(pixels, pitch_mm=part.height_map.pitch_mm, centre_mm=(w / 2, h / 2))


def test_a_photograph_becomes_a_reading(reader: VisionReader, photo: tuple[StampedPart, Photo]) -> None:
    part, taken = photo
    found = reader.read_photo(taken)
    assert found.text == TEXT
    assert found.decision is Decision.ACCEPT
    assert found.source == "vision"
    assert found.trace.engine == "templates"
    assert found.trace.edge_map is not None
    assert found.trace.edge_map.pitch_mm == taken.pitch_mm
    # the letter's die grows by its bevels: a few percent
    assert found.height_mm == pytest.approx(part.height_mm, rel=0.05)
    for character, (x0, y0, x1, y1) in zip(found.characters, part.boxes_mm, strict=True):
        b = character.box
        assert b.x0_mm < 0.5 * (x0 + x1) < b.x1_mm
        assert b.y0_mm < 0.5 * (y0 + y1) < b.y1_mm


def test_a_rotation_that_dirt_hides_is_found_by_turning(
    reader: VisionReader, make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(TEXT, line_rotation_deg=8.0)
    z = part.height_map.z_mm.astype(np.float64)
    gy, gx = np.gradient(z, part.height_map.pitch_mm)
    rng = np.random.default_rng(1)
    # patches of grime with sharp rims, all over
    y, x = np.mgrid[: z.shape[0], : z.shape[1]]
    grime = np.zeros(z.shape)
    for _ in range(60):
        r, c, size = rng.uniform(0, z.shape[0]), rng.uniform(0, z.shape[1]), rng.uniform(4, 14)
        grime = np.maximum(grime, ((x - c) ** 2 + (y - r) ** 2 < size**2) * rng.uniform(0.2, 0.5))
    grey = 110.0 * np.clip((1.0 - 0.6 * gx - 0.4 * gy) / np.sqrt(1.0 + gx**2 + gy**2), 0.05, None)
    grey = grey * (1.0 - grime) + rng.normal(0.0, 3.0, z.shape)
    found = reader.read_photo(
        Photo(np.rint(np.clip(grey, 0, 255)).astype(np.uint8), pitch_mm=part.height_map.pitch_mm)
    )
    assert found.text == TEXT
    assert found.rotation_deg == pytest.approx(8.0, abs=1.0)


def test_a_place_known_beforehand_is_kept_to(reader: VisionReader, photo: tuple[StampedPart, Photo]) -> None:
    part, taken = photo
    boxes = np.array(part.boxes_mm)
    (x0, y0), (x1, y1) = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    about = LinePlace((0.5 * (x0 + x1), 0.5 * (y0 + y1)), x1 - x0, y1 - y0)
    assert reader.read_photo(taken, about=about).text == TEXT


def test_the_hook_for_calibration_has_the_last_word(photo: tuple[StampedPart, Photo]) -> None:
    def doubtful(lattice: Lattice) -> Lattice:
        return replace(lattice, log_belief=lattice.log_belief + np.log(0.5))

    found = VisionReader(SETTINGS, engine="templates", calibrated=doubtful).read_photo(photo[1])
    assert found.text == TEXT
    assert found.confidence < 0.5**5 * 1.001
    assert found.decision is Decision.REVIEW
    assert ReadingFlag.LOW_CONFIDENCE in found.flags


def lattice_of(belief: list[list[float]], chars: str = "AB8") -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(tuple(chars), np.log(np.array(belief)), boxes=(Box(0, 0, 1, 1),) * len(belief))


def test_engines_that_agree_are_surer_together() -> None:
    one, other = lattice_of([[0.6, 0.3, 0.1]]), lattice_of([[0.7, 0.1, 0.2]])
    both = np.exp(joined({"a": one, "b": other}, {"a": 1.0, "b": 1.0}).log_belief[0])
    expected = np.array([0.42, 0.03, 0.02])
    np.testing.assert_allclose(both, expected / expected.sum(), atol=1e-9)


def test_an_engine_that_sees_nothing_leaves_the_say_to_the_other() -> None:
    blind, sees = lattice_of([[1e-6, 2e-6, 1e-6]]), lattice_of([[0.9, 0.05, 0.05]])
    both = np.exp(joined({"a": blind, "b": sees}, {"a": 1.0, "b": 1.0}).log_belief[0])
    assert both.argmax() == 0
    # half of the engines say that nothing is there
    assert both.sum() == pytest.approx(0.5, abs=1e-3)


def test_what_no_engine_may_read_stays_impossible() -> None:
    one = lattice_of([[0.0, 0.5, 0.5]])
    assert np.isneginf(joined({"a": one, "b": one}, {"a": 1.0, "b": 1.0}).log_belief[0, 0])


def test_of_two_counts_the_surer_engine_speaks() -> None:
    two, one = lattice_of([[0.9, 0.05, 0.05]] * 2), lattice_of([[0.9, 0.05, 0.05]])
    assert joined({"a": one, "b": two}, {"a": 1.0, "b": 1.0}).n_places == 2
    with pytest.raises(ValueError, match="no engine"):
        joined({}, {})
    with pytest.raises(ValueError, match="different characters"):
        joined({"a": one, "b": lattice_of([[0.9, 0.05, 0.05]], "XYZ")}, {"a": 1.0, "b": 1.0})


def test_a_reading_is_accepted_by_confidence_and_margin() -> None:
    settings = ReaderSettings(accept_confidence=0.8, accept_margin=0.3)
    assert as_reading(lattice_of([[0.95, 0.03, 0.02]]), settings).decision is Decision.ACCEPT
    close = as_reading(lattice_of([[0.55, 0.4, 0.05]]), settings)
    assert close.decision is Decision.REVIEW
    assert close.flags == ReadingFlag.LOW_CONFIDENCE | ReadingFlag.AMBIGUOUS
    assert [c.char for c in close.characters[0].candidates] == ["A", "B", "8"]
    assert as_reading(Lattice(("A",), np.zeros((0, 1))), settings).decision is (Decision.REJECT)

"""The network behind the interface of an engine; most of it needs the extra `vision`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.fonts.serials import allowed_characters
from recognition import ocr_rapid
from recognition.ocr_rapid import Frames, RapidEngine
from recognition.ocr_views import FIRST_VIEW, VIEWS, View, view_of
from recognition.reader_settings import ALPHABET, ReaderSettings
from recognition.reading import Decision
from recognition.vision_engine import EngineMissingError
from recognition.vision_frame import line_crop, whole
from recognition.vision_reader import VisionReader

PHOTO = Path(__file__).parents[1] / "data" / "photos" / "1X2100H.jpg"


def real_photo() -> Photo:
    import cv2

    return Photo(np.ascontiguousarray(cv2.imread(str(PHOTO))[..., ::-1]))


@pytest.fixture(scope="module")
def engine() -> RapidEngine:
    pytest.importorskip("onnxruntime", reason="the extra `vision` is not installed")
    pytest.importorskip("rapidocr", reason="the extra `vision` is not installed")
    return RapidEngine()


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ocr_rapid, "find_spec", lambda name: None)
    with pytest.raises(EngineMissingError, match=r'pip install "tactile-marks\[vision\]"'):
        RapidEngine()
    with pytest.raises(EngineMissingError, match="vision"):
        VisionReader(ReaderSettings(fonts=("gothic",)), engine="rapidocr")


def test_best_without_the_extra_reads_by_templates_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ocr_rapid, "find_spec", lambda name: None)
    reader = VisionReader(ReaderSettings(fonts=("gothic",)), engine="best")
    assert reader.rapid is None
    assert reader.by_templates
    assert "templates alone" in reader.notes[0]
    assert "vision" in reader.notes[0]


@pytest.mark.parametrize("view", VIEWS, ids=lambda v: v.name)
@pytest.mark.parametrize("colour", [True, False])
def test_views_have_the_rows_asked_for(view: object, colour: bool) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (60, 300, 3), dtype=np.uint8)
    shown = view_of(Photo(pixels if colour else pixels[..., 0]), view, rows=48)  # type: ignore[arg-type]
    assert shown.shape[0] == 48
    assert shown.shape[2] == 3
    assert np.ptp(shown) > 20


def test_a_real_serial_is_read_with_its_format(engine: RapidEngine) -> None:
    photo = real_photo()
    crop = line_crop(photo, whole(photo))
    lattice = engine.read_line(crop.photo, chars=ALPHABET, places=allowed_characters("9A9999A"))
    assert lattice is not None
    assert "".join(lattice.chars[i] for i in lattice.log_belief.argmax(axis=1)) == "1X2100H"
    # what the format does not allow is impossible, not merely unlikely
    assert np.isneginf(lattice.log_belief[0, lattice.chars.index("A")])
    middles = [0.5 * (b.x0_mm + b.x1_mm) for b in lattice.boxes]
    assert middles == sorted(middles)


def test_views_that_are_known_are_not_shown_again(
    engine: RapidEngine, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo = real_photo()
    crop = line_crop(photo, whole(photo)).photo
    places = allowed_characters("9A9999A")
    plain = engine.read_line(crop, chars=ALPHABET, places=places)
    known = {FIRST_VIEW: engine.frames(crop, FIRST_VIEW, chars=ALPHABET)}
    shown: list[View] = []
    frames = RapidEngine.frames

    def counted(self: RapidEngine, crop: Photo, view: View, *, chars: str) -> Frames:
        shown.append(view)
        return frames(self, crop, view, chars=chars)

    monkeypatch.setattr(RapidEngine, "frames", counted)
    again = engine.read_line(crop, chars=ALPHABET, places=places, known=known)
    assert plain is not None
    assert again is not None
    assert shown == [v for v in VIEWS if v != FIRST_VIEW]
    np.testing.assert_array_equal(again.log_belief, plain.log_belief)


def test_small_letters_count_as_capitals_unless_asked_for() -> None:
    engine = RapidEngine.__new__(RapidEngine)
    engine._classes = {"A": 1, "a": 2, "7": 3}
    said = np.array([[0.1, 0.2, 0.3, 0.4]], dtype=np.float32)
    np.testing.assert_allclose(engine._shares(said, "A7Q"), [[0.5, 0.4, 0.0]], rtol=1e-6)
    np.testing.assert_allclose(engine._shares(said, "Aa"), [[0.2, 0.3]], rtol=1e-6)


def test_the_number_of_characters_is_found_without_a_format(engine: RapidEngine) -> None:
    photo = real_photo()
    lattice = engine.read_line(line_crop(photo, whole(photo)).photo, chars=ALPHABET, places=None)
    assert lattice is not None
    assert "".join(lattice.chars[i] for i in lattice.log_belief.argmax(axis=1)) == "1X2100H"


def test_a_real_photograph_end_to_end(engine: RapidEngine) -> None:
    found = VisionReader(ReaderSettings(format="9A9999A")).read_photo(real_photo())
    assert found.text == "1X2100H"
    assert found.decision is not Decision.REJECT
    assert found.source == "vision"
    # boxes lie on the characters: the first on the left, the last on the right of 560 pixels
    assert found.characters[0].box.x1_mm < 150.0
    assert found.characters[-1].box.x0_mm > 400.0


def test_nothing_written_is_not_trusted(engine: RapidEngine) -> None:
    grey = np.random.default_rng(2).normal(128.0, 4.0, (64, 320)).clip(0, 255).astype(np.uint8)
    lattice = engine.read_line(Photo(grey), chars=ALPHABET, places=allowed_characters("AA99"))
    assert lattice is None or np.exp(lattice.log_belief).sum(axis=1).max() < 0.5

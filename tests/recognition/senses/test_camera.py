"""The reader of photographs: pictures of stamped parts, one real one, and none at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.part import stamp
from glyphs.stamping.layouts import Layout
from glyphs.stamping.stamp import StampedPart
from recognition import camera
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.reading import Reading
from recognition.reader import Reader
from recognition.see.view import photo_view
from recognition.settings import ReaderSettings

TEXT = "K7B29"
SETTINGS = ReaderSettings(fonts=("gothic",), format="A9A99", height_mm=5.0)
REAL = Path(__file__).parents[2] / "data" / "photos" / "1X2100H.jpg"
NOISE = 3.0
"""Of the camera, grey levels."""


def lit(part: StampedPart, *, rng: np.random.Generator) -> NDArray[np.float64]:
    """Brightness of a matt part under one light from the upper left."""
    gy, gx = np.gradient(part.height_map.z_mm.astype(np.float64), part.height_map.pitch_mm)
    grey = 110.0 * np.clip((1.0 - 0.6 * gx - 0.4 * gy) / np.sqrt(1.0 + gx**2 + gy**2), 0.05, None)
    return np.asarray(grey + rng.normal(0.0, NOISE, grey.shape))


def taken(grey: NDArray[np.float64], part: StampedPart) -> Photo:
    pixels = np.rint(np.clip(grey, 0, 255)).astype(np.uint8)
    w, h = part.height_map.size_mm
    return Photo(pixels, pitch_mm=part.height_map.pitch_mm, centre_mm=(w / 2, h / 2))


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(SETTINGS)


@pytest.fixture(scope="module")
def photo(make_part: Callable[..., StampedPart]) -> tuple[StampedPart, Photo]:
    part = make_part(TEXT)
    return part, taken(lit(part, rng=np.random.default_rng(0)), part)


def rusty(part: StampedPart) -> Photo:
    """The part under a flat light, blotched with rust, in colour."""
    grey = 110.0 + 0.3 * (lit(part, rng=np.random.default_rng(0)) - 110.0)
    blotches = cv2.GaussianBlur(np.random.default_rng(3).normal(size=grey.shape), (0, 0), 4.0)
    cover = 1.0 / (1.0 + np.exp(-blotches / blotches.std() / 0.05))
    rust = 1.0 - cover[..., None] * (1.0 - np.array([0.65, 0.26, 0.12]) ** (1.0 / 2.2))
    return taken(grey[..., None] * rust, part)


def check_places(found: Reading, part: StampedPart) -> None:
    """The middle of every character lies in its box."""
    for character, (x0, y0, x1, y1) in zip(found.characters, part.boxes_mm, strict=True):
        b = character.box
        assert b.x0_mm < 0.5 * (x0 + x1) < b.x1_mm
        assert b.y0_mm < 0.5 * (y0 + y1) < b.y1_mm


def test_rust_is_told_from_relief_by_its_colour(reader: Reader, photo: tuple[StampedPart, Photo]) -> None:
    picture = rusty(photo[0])
    colourless = replace(picture, pixels=np.rint(255.0 * picture.grey()).astype(np.uint8))
    assert reader.read(colourless).decision is not Decision.ACCEPT
    reading = reader.read(picture)
    assert reading.text == TEXT
    assert reading.decision is Decision.ACCEPT
    check_places(reading, photo[0])


def test_a_sure_reading_in_review_is_not_replaced_by_one_without_stains(
    photo: tuple[StampedPart, Photo], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(picture: Photo) -> None:
        raise AssertionError(f"{picture} was read again")

    monkeypatch.setattr(camera, "stainless_view", never)
    reading = Reader(replace(SETTINGS, lines={"lot": "A9"})).read(photo[1])
    assert reading.confidence >= SETTINGS.least_score("vision")
    assert reading.decision is Decision.REVIEW
    assert reading.seconds["find"] > 0.0


def test_a_picture_without_stains_is_searched_only_if_a_line_promises_more_there(
    reader: Reader, photo: tuple[StampedPart, Photo], monkeypatch: pytest.MonkeyPatch
) -> None:
    stained = rusty(photo[0])
    colourless = replace(stained, pixels=np.rint(255.0 * stained.grey()).astype(np.uint8))
    texts, looks = [], []
    for clean in (None, replace(colourless, pixels=np.full_like(colourless.pixels, 110)), photo[1]):
        view = None if clean is None else photo_view(clean)
        monkeypatch.setattr(camera, "stainless_view", lambda _, view=view: view)
        reading = reader.read(colourless)
        texts.append(reading.text)
        looks.append(sum(sense.lines.looks for sense in reading.evidence.senses))
    assert texts[0] == texts[1]
    assert looks[0] == looks[1]
    assert texts[2] == TEXT


def test_a_photograph_becomes_a_reading(reader: Reader, photo: tuple[StampedPart, Photo]) -> None:
    part, picture = photo
    reading = reader.read(picture)
    assert reading.text == TEXT
    assert reading.decision is Decision.ACCEPT
    assert (reading.source, reading.unit) == ("vision", "mm")
    assert reading.trace.photo is not None
    assert reading.trace.line is not None
    assert "network" in reading.trace.by_expert
    # the height was given: the finder keeps it, and looks at moved lines a quarter off
    assert reading.height_mm == pytest.approx(part.height_mm, rel=0.25)
    assert reading.seconds["find"] > 0.0
    check_places(reading, part)


def test_a_text_that_may_be_a_piece_of_a_longer_one_is_not_accepted(
    reader: Reader, photo: tuple[StampedPart, Photo]
) -> None:
    evidence = reader.read(photo[1]).evidence
    (sense,) = evidence.senses
    piece = replace(sense, lines=replace(sense.lines, longer=sense.main))
    reading = decide(replace(evidence, vision=piece), SETTINGS)
    assert reading.decision is Decision.REVIEW
    assert f"a longer line reads “{TEXT}” about as well (give the format, or a narrower one)" in map(
        str, reading.findings
    )


def test_a_search_that_a_time_limit_cuts_short_is_not_accepted(photo: tuple[StampedPart, Photo]) -> None:
    _, picture = photo
    stopped = Reader(fonts="gothic", format="A9999999", height_mm=5.0, limit_s=1e-6).read(picture)
    assert stopped.text == ""
    assert stopped.flags & ReadingFlag.SEARCH_STOPPED
    assert "no characters found in this time" in map(str, stopped.findings)
    assert "the search stopped after 1e-06 s (allow more time)" in map(str, stopped.findings)
    with pytest.raises(ValueError, match="a time limit is a positive number of seconds"):
        Reader(limit_s=0.0)


@pytest.mark.parametrize("rise", [0.0, 0.2])
def test_a_serial_that_is_struck_out_is_not_accepted_by_either_sense(
    reader: Reader, photo: tuple[StampedPart, Photo], rise: float
) -> None:
    part, _ = photo
    surface = part.height_map
    (x0, y0, _, y1), (_, _, x1, _) = part.boxes_mm[0], part.boxes_mm[-1]
    y, x = np.indices(surface.shape) * surface.pitch_mm
    middle = 0.5 * (y0 + y1) + rise * (y1 - y0) * (x - x0) / (x1 - x0)
    groove = (np.abs(y - middle) < 0.2) & (x > x0 - 1.0) & (x < x1 + 1.0)
    depth = float(np.abs(surface.z_mm).max())
    struck = replace(
        part,
        height_map=replace(surface, z_mm=np.where(groove, np.minimum(surface.z_mm, -depth), surface.z_mm)),
    )
    for data in (struck.height_map, taken(lit(struck, rng=np.random.default_rng(0)), struck)):
        assert reader.read(data).decision is not Decision.ACCEPT
    felt = Reader(replace(SETTINGS, accept_risk=0.1)).read(struck.height_map)
    assert ReadingFlag.STRUCK_OUT in felt.flags
    for data in photo[0].height_map, photo[1]:
        assert reader.read(data).decision is Decision.ACCEPT


@pytest.mark.parametrize("place", [3, 4])
def test_a_drop_on_a_character_is_not_read_as_a_0(
    reader: Reader, photo: tuple[StampedPart, Photo], place: int
) -> None:
    """Its outline is as sharp as a mark, but nothing of the character below it was felt."""
    part, picture = photo
    surface = part.height_map
    x0, y0, x1, y1 = part.boxes_mm[place]
    y, x = np.indices(surface.shape) * surface.pitch_mm
    off = ((x - 0.5 * (x0 + x1)) / 1.5) ** 2 + ((y - 0.5 * (y0 + y1)) / 2.4) ** 2
    drop = np.exp(-(off**2))
    z_mm = np.where(drop < 0.05, surface.z_mm, 0.3 * drop).astype(np.float32)
    felt = Reader(replace(SETTINGS, accept_risk=0.1)).read(replace(surface, z_mm=z_mm))
    assert felt.decision is not Decision.ACCEPT
    (covered,) = (finding for finding in felt.findings if finding.flag is ReadingFlag.COVERED)
    assert covered.places == (place + 1,)
    assert "clean the part and scan it again" in covered.text
    # a camera that is sure of the same text has seen it there
    assert ReadingFlag.COVERED not in reader.read(part.height_map, picture).flags


@pytest.mark.parametrize("level", [255, 15])
@pytest.mark.parametrize("place", [1, 3])
def test_a_spot_on_a_character_keeps_the_part_from_acceptance(
    reader: Reader, photo: tuple[StampedPart, Photo], level: int, place: int
) -> None:
    part, picture = photo
    x0, y0, x1, y1 = np.divide(part.boxes_mm[place], picture.pitch_mm)
    centre, axes = (
        (round(0.5 * (x0 + x1)), round(0.5 * (y0 + y1))),
        (round(0.3 * (x1 - x0)), round(0.5 * (y1 - y0))),
    )
    covered = cv2.ellipse(picture.pixels.copy(), centre, axes, 0.0, 0.0, 360.0, level, -1)
    reading = reader.read(replace(picture, pixels=covered))
    assert reading.decision is not Decision.ACCEPT
    assert [finding.places for finding in reading.findings if finding.flag is ReadingFlag.SPOT] == [
        (place + 1,)
    ]
    assert ReadingFlag.SPOT not in reader.read(picture).flags


def test_a_spot_on_the_photograph_is_no_matter_where_touch_is_sure(
    reader: Reader, photo: tuple[StampedPart, Photo]
) -> None:
    part, picture = photo
    x0, y0, x1, y1 = np.rint(np.divide(part.boxes_mm[3], picture.pitch_mm)).astype(int)
    pixels = picture.pixels.copy()
    pixels[y0:y1, x0:x1] = 255
    felt = reader.read(part.height_map)
    both = reader.read(part.height_map, replace(picture, pixels=pixels))
    assert felt.decision is Decision.ACCEPT
    assert ReadingFlag.SPOT not in both.flags


@pytest.mark.parametrize(
    ("level", "noise", "flag"),
    [
        (0, 0.0, ReadingFlag.NO_CONTRAST),
        (128, 0.0, ReadingFlag.NO_CONTRAST),
        (20, 3.0, ReadingFlag.NO_CONTRAST),
        (255, 0.0, ReadingFlag.OVEREXPOSED),
    ],
)
def test_a_photograph_that_shows_nothing_is_not_searched(
    reader: Reader, level: int, noise: float, flag: ReadingFlag
) -> None:
    pixels = level + np.random.default_rng(1).normal(0.0, noise, (90, 160))
    reading = reader.read(Photo(np.clip(pixels, 0, 255).astype(np.uint8)))
    assert (reading.text, reading.decision) == ("", Decision.REJECT)
    assert reading.flags == flag | ReadingFlag.NO_CHARACTERS
    assert reading.messages()[0] == flag.text
    assert reading.evidence.vision.lines is None


def test_without_a_scale_lengths_are_pixels(reader: Reader, photo: tuple[StampedPart, Photo]) -> None:
    part, picture = photo
    reading = reader.read(Photo(picture.pixels))
    assert (reading.text, reading.unit) == (TEXT, "px")
    # millimetres are of no account then; finder and moves are within a quarter
    assert reading.height_mm == pytest.approx(part.height_mm / part.height_map.pitch_mm, rel=0.25)


@pytest.mark.parametrize("pitch_mm", [None, 0.08])
def test_a_region_crops_the_photograph_and_keeps_its_frame(
    photo: tuple[StampedPart, Photo], pitch_mm: float | None
) -> None:
    picture = photo[1].pixels
    rows, columns = picture.shape
    wide = np.full((4 * rows, 3 * columns), 110, dtype=np.uint8)
    wide[2 * rows : 3 * rows, columns : 2 * columns] = picture
    region = (0.4, 0.55, 0.6, 0.7)
    reading = Reader(format="A9A99", region=region).read(Photo(wide, pitch_mm))
    assert reading.text == TEXT
    seen, trace = reading.evidence.vision.views[0], reading.trace.photo
    assert seen.layers[0].size < 0.5 * wide.size
    assert trace.shape == wide.shape
    x, y = reading.box.x0_mm / (pitch_mm or 1.0), reading.box.y0_mm / (pitch_mm or 1.0)
    assert columns < x < 1.5 * columns
    assert 2 * rows < y < 3 * rows


@pytest.mark.parametrize("turns", [1, 2])
def test_a_picture_taken_from_another_side_is_read(
    turns: int, reader: Reader, photo: tuple[StampedPart, Photo]
) -> None:
    _, picture = photo
    reading = reader.read(Photo(np.rot90(picture.pixels, turns).copy(), pitch_mm=picture.pitch_mm))
    assert reading.text == TEXT
    # the picture was turned against the clock, so its line runs with -90 degrees a quarter
    off = (reading.rotation_deg + 90.0 * turns + 180.0) % 360.0 - 180.0
    assert off == pytest.approx(0.0, abs=3.0)


@pytest.mark.parametrize("turned_deg", [35.0, -125.0])
def test_a_slanted_line_is_read(
    turned_deg: float, reader: Reader, make_part: Callable[..., StampedPart]
) -> None:
    part = make_part(TEXT, line_rotation_deg=turned_deg)
    reading = reader.read(taken(lit(part, rng=np.random.default_rng(2)), part))
    assert reading.text == TEXT
    assert reading.rotation_deg == pytest.approx(turned_deg, abs=6.0)


def test_a_turned_line_under_grime_is_read(reader: Reader, make_part: Callable[..., StampedPart]) -> None:
    part = make_part(TEXT, line_rotation_deg=8.0)
    rng = np.random.default_rng(1)
    grey = lit(part, rng=rng)
    # patches of grime with sharp rims, all over
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
    grime = np.zeros(grey.shape)
    for _ in range(60):
        r, c, size = rng.uniform(0, grey.shape[0]), rng.uniform(0, grey.shape[1]), rng.uniform(4, 14)
        grime = np.maximum(grime, ((x - c) ** 2 + (y - r) ** 2 < size**2) * rng.uniform(0.2, 0.5))
    reading = reader.read(taken(grey * (1.0 - grime), part))
    assert reading.text == TEXT
    assert reading.rotation_deg > 0.0


def test_a_real_serial_is_read_with_its_format() -> None:
    import cv2

    picture = Photo(np.ascontiguousarray(cv2.imread(str(REAL))[..., ::-1]))
    reading = Reader(ReaderSettings(format="9A9999A")).read(picture)
    assert reading.text == "1X2100H"
    assert reading.decision is not Decision.REJECT
    # boxes lie on the characters: the first on the left, the last on the right of 560 pixels
    assert reading.characters[0].box.x1_mm < 150.0
    assert reading.characters[-1].box.x0_mm > 400.0
    assert all(a.box.x0_mm < b.box.x0_mm for a, b in pairwise(reading.characters))


def hidden(picture: Photo, part: StampedPart, places: slice) -> Photo:
    """The photograph with a glare over some characters."""
    pixels = np.array(picture.pixels)
    for x0, y0, x1, y1 in part.boxes_mm[places]:
        left, top, right, bottom = (round(v / part.height_map.pitch_mm) for v in (x0, y0, x1, y1))
        pixels[top - 4 : bottom + 4, left - 2 : right + 2] = 255
    return replace(picture, pixels=pixels)


def test_photographs_that_each_hide_other_characters_are_read_as_one(
    reader: Reader, photo: tuple[StampedPart, Photo]
) -> None:
    part, picture = photo
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    paint = 16.0 * np.sin(x / 9.0) * np.sin(y / 7.0)  # on the part, so in every photograph
    painted = taken(picture.pixels + paint, part)
    first, second = hidden(painted, part, slice(0, 2)), hidden(painted, part, slice(3, 5))
    unlike = taken(np.random.default_rng(3).uniform(0.0, 255.0, painted.shape), part)
    assert TEXT not in {reader.read(one).text for one in (first, second)}
    reading = reader.read(replace(first, others=(second, unlike)))
    assert (reading.text, reading.photos) == (TEXT, 2)
    assert reading.notes == ("photograph 3 does not show what the first one shows; it was left out",)
    check_places(reading, part)


def test_neither_jpeg_quality_nor_the_last_digit_of_the_scale_changes_the_line() -> None:
    part = stamp("XTR 0740257", height_mm=4.0, layout=Layout(other_text="MRXS36", other_above=True), seed=4)
    picture = part.photograph(pixel_mm=0.09)
    reader = Reader(ReaderSettings(format="AAA 9999999"))
    for quality, scale in ((60, 1.0), (60, 1.0 + 1e-7), (80, 1.0), (98, 1.0 + 1e-7)):
        _, jpeg = cv2.imencode(".jpg", picture.pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        pixels = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED), dtype=np.uint8)
        read = reader.read(Photo(pixels, pitch_mm=0.09 * scale))
        assert (read.text, read.decision) == ("XTR 0740257", Decision.ACCEPT), (quality, scale)

"""Photographs as files, and files that are not finished yet."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from PIL import Image

from glyphs.camera.photo import Photo
from glyphs.errors import FileError
from pipeline.formats.kinds import PHOTO_SUFFIXES, READ, is_cut_short, is_temporary
from pipeline.formats.photos import read_photo, write_photo
from tests.support.bad_files import chunk

RNG = np.random.default_rng(0)
COLOUR = RNG.integers(0, 256, (20, 31, 3), dtype=np.uint8)
SMOOTH = np.ascontiguousarray(
    np.stack(np.broadcast_arrays(np.arange(0, 240, 6)[None, :], np.arange(0, 150, 5)[:, None], 90), -1),
    np.uint8,
)


def _encoded(suffix: str, image: np.ndarray) -> bytes:
    done, data = cv2.imencode(suffix, image)
    assert done
    return bytes(data)


@pytest.mark.parametrize("pitch_mm", [None, 0.06, 0.0123])
@pytest.mark.parametrize("pixels", [COLOUR, COLOUR[..., 0]], ids=["colour", "grey"])
def test_a_photograph_comes_back_as_it_was(
    pixels: np.ndarray, pitch_mm: float | None, tmp_path: Path
) -> None:
    path = tmp_path / "part.png"
    write_photo(path, Photo(pixels, pitch_mm=pitch_mm))
    back = read_photo(path)
    np.testing.assert_array_equal(back.pixels if pixels.ndim == 3 else back.pixels[..., 1], pixels)
    if pitch_mm is None:
        assert back.pitch_mm is None
    else:
        # whole pixels a metre: half of one in 16,667
        assert back.pitch_mm == pytest.approx(pitch_mm, rel=5e-5)
    assert back.centre_mm is None


@pytest.mark.parametrize("suffix", [".jpg", ".bmp", ".tif", ".ppm"])
def test_other_formats_are_read(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"part{suffix}"
    path.write_bytes(_encoded(suffix, SMOOTH[..., ::-1]))
    # a JPEG of slow slopes is off by a few levels
    assert np.abs(read_photo(path).pixels.astype(int) - SMOOTH).max() <= (12 if suffix == ".jpg" else 0)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
@pytest.mark.parametrize("bits", [10, 12, 16])
def test_deep_pictures_fill_sixteen_bits(suffix: str, bits: int, tmp_path: Path) -> None:
    deep = (np.linspace(0, 2**bits - 1, 16 * 16).reshape(16, 16)).astype(np.uint16)
    path = tmp_path / f"part{suffix}"
    path.write_bytes(_encoded(suffix, deep))
    photo = read_photo(path)
    np.testing.assert_allclose(photo.pixels[..., 0], deep * (65535.0 / deep.max()), atol=0.5)
    np.testing.assert_array_equal(photo.eight_bit, photo.pixels >> 8)


@pytest.mark.parametrize("glint", [1, 9])
def test_a_glint_does_not_darken_a_deep_picture(glint: int, tmp_path: Path) -> None:
    deep = np.full((64, 64, 3), 900, np.uint16)
    deep[20:40, 10:50] = 700
    deep[:glint, :4] = 65535
    Path(tmp_path / "part.png").write_bytes(_encoded(".png", deep))
    grey = read_photo(tmp_path / "part.png").grey()
    assert grey[30, 30] < 0.1 < 0.2 < grey[50, 50] < 0.9
    assert grey[0, 0] == 1.0


def test_of_deep_colours_none_is_exchanged(tmp_path: Path) -> None:
    deep = np.zeros((16, 16, 3), np.uint16)
    deep[:8, :, 2] = 60000  # red, as OpenCV orders it
    deep[8:, :, 0] = 30000
    (tmp_path / "part.png").write_bytes(_encoded(".png", deep))
    np.testing.assert_array_equal(read_photo(tmp_path / "part.png").pixels[0, 0], (65535, 0, 0))


@pytest.mark.parametrize("dark", [True, False])
@pytest.mark.parametrize("deep", [False, True])
def test_what_is_transparent_is_laid_on_a_ground(dark: bool, deep: bool, tmp_path: Path) -> None:
    dtype, full = (np.uint16, 65535) if deep else (np.uint8, 255)
    picture = np.full((40, 60, 4), 0 if dark else full, dtype)
    picture[..., 3] = 0
    picture[10:30, 20:40, 3] = full  # the mark stands in the opacity alone
    path = tmp_path / "part.png"
    path.write_bytes(_encoded(".png", picture))
    photo = read_photo(path)
    land, mark = photo.grey()[0, 0], photo.grey()[20, 30]
    assert (land, mark) == ((1.0, 0.0) if dark else (0.0, 1.0))
    assert photo.notes == (
        f"the picture is transparent in places; it was laid on {'white' if dark else 'black'}",
    )


@pytest.mark.parametrize("deep", [False, True])
def test_the_first_page_that_is_not_blank_is_read(deep: bool, tmp_path: Path) -> None:
    path = tmp_path / "part.tif"
    shown = SMOOTH[..., 0].astype(np.uint16) * 257 if deep else SMOOTH[..., 0]
    pages = [Image.fromarray(np.full_like(shown, 128)), Image.fromarray(shown), Image.fromarray(shown[:20])]
    pages[0].save(path, save_all=True, append_images=pages[1:])
    photo = read_photo(path)
    assert photo.shape == SMOOTH.shape[:2]
    assert photo.notes == ("page 2 of the file's 3 was read; those before it are blank",)
    assert np.corrcoef(photo.grey().ravel(), SMOOTH[..., 0].ravel())[0, 1] > 0.999


def test_smaller_copies_are_no_pages(tmp_path: Path) -> None:
    path = tmp_path / "part.tif"
    pages = [Image.fromarray(SMOOTH), Image.fromarray(SMOOTH[::2, ::2].copy())]
    pages[1].encoderinfo = {"tiffinfo": {254: 1}}
    pages[0].save(path, save_all=True, append_images=pages[1:])
    assert read_photo(path).notes == ()


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_of_an_animation_the_first_frame_is_read(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"part{suffix}"
    frames = [Image.fromarray(SMOOTH), Image.fromarray(SMOOTH[::-1].copy())]
    frames[0].save(path, save_all=True, append_images=frames[1:])
    photo = read_photo(path)
    assert photo.notes == ("the first of the file's 2 frames was read",)
    assert np.abs(photo.pixels.astype(int) - SMOOTH).max() <= 60  # few colours


def _with_scans(picture: Image.Image, scans: int) -> bytes:
    """A progressive JPEG whose last pass is repeated."""
    stream = io.BytesIO()
    picture.save(stream, "JPEG", progressive=True, quality=10)
    data = stream.getvalue()
    last = data[data.rindex(b"\xff\xda") : -2]
    return data[:-2] + last * scans + b"\xff\xd9"


def test_a_jpeg_of_endless_passes_is_refused_from_its_markers(tmp_path: Path) -> None:
    path = tmp_path / "part.jpg"
    path.write_bytes(_with_scans(Image.new("L", (2000, 2000), 128), 400))
    with pytest.raises(FileError, match=r"JPEG of 4\d\d passes"):
        read_photo(path)
    path.write_bytes(_with_scans(Image.new("L", (64, 64), 128), 40))  # little work
    assert read_photo(path).shape == (64, 64)


def test_transparency_and_palettes(tmp_path: Path) -> None:
    clear = np.dstack([COLOUR, np.zeros(COLOUR.shape[:2], np.uint8)])
    path = tmp_path / "part.png"
    path.write_bytes(_encoded(".png", clear))
    np.testing.assert_array_equal(read_photo(path).pixels, COLOUR[..., ::-1])
    index = RNG.integers(0, 3, (9, 12), dtype=np.uint8)
    table = np.array([[255, 0, 0], [0, 9, 0], [1, 2, 3]], dtype=np.uint8)
    with Image.fromarray(index, "P") as picture:
        picture.putpalette(table.tobytes())
        picture.save(path)
    np.testing.assert_array_equal(read_photo(path).pixels, table[index])


def _exif(orientation: int) -> bytes:
    return b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 0x0112, 3, 1, orientation, 0, 0)


@pytest.mark.parametrize(("orientation", "turns"), [(1, 0), (3, 2), (6, -1), (8, 1)])
def test_a_turned_camera_is_turned_back(orientation: int, turns: int, tmp_path: Path) -> None:
    jpeg = _encoded(".jpg", SMOOTH[..., ::-1])
    body = b"Exif\0\0" + _exif(orientation)
    path = tmp_path / "part.jpg"
    path.write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:])
    plain = tmp_path / "plain.jpg"
    plain.write_bytes(jpeg)
    np.testing.assert_array_equal(read_photo(path).pixels, np.rot90(read_photo(plain).pixels, turns))


@pytest.mark.parametrize(
    ("suffix", "numbers", "pitch_mm"),
    [
        (".png", (20000, 20000, 1), 0.05),
        (".png", (20000, 20000, 0), None),  # no unit
        (".png", (2835, 2835, 1), None),  # 72 dpi
        (".png", (3780, 3780, 1), None),  # 96 dpi
        (".png", (20000, 10000, 1), None),  # not square
        (".png", (0, 0, 1), None),
        (".png", (100, 100, 1), None),  # a centimetre a pixel
        *((".jpg", (unit, n, n), pitch) for unit, n, pitch in ((1, 508, 0.05), (2, 200, 0.05))),
        *((".jpg", (unit, n, n), None) for unit, n in ((0, 1), (1, 72), (1, 96))),
    ],
)
def test_the_pitch_that_a_file_states(
    suffix: str, numbers: tuple[int, int, int], pitch_mm: float | None, tmp_path: Path
) -> None:
    data = _encoded(suffix, COLOUR if suffix == ".png" else SMOOTH)
    if suffix == ".png":
        data = data[:33] + chunk(b"pHYs", struct.pack(">IIB", *numbers)) + data[33:]
    else:
        place = data.index(b"JFIF\0") + 7
        data = data[:place] + struct.pack(">BHH", *numbers) + data[place + 5 :]
    path = tmp_path / f"part{suffix}"
    path.write_bytes(data)
    assert read_photo(path).pitch_mm == (None if pitch_mm is None else pytest.approx(pitch_mm))


@pytest.mark.parametrize("suffix", [".tif", ".bmp"])
def test_the_pitch_of_other_kinds(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"part{suffix}"
    Image.fromarray(COLOUR).save(path, dpi=(508.0, 508.0))
    assert read_photo(path).pitch_mm == pytest.approx(0.05, rel=1e-4)  # a BMP has whole pixels a metre


@pytest.mark.parametrize(
    ("unit", "count"), [("mm", 20.0), ("micron", 0.02), ("inch", 508.0), ("pixel", None)]
)
def test_the_pitch_that_imagej_states(unit: str, count: float | None, tmp_path: Path) -> None:
    tags = {270: f"ImageJ=1.54f\nunit={unit}\n", 282: count or 20.0, 283: count or 20.0, 296: 1}
    Image.fromarray(COLOUR).save(tmp_path / "part.tif", tiffinfo=tags)
    pitch = read_photo(tmp_path / "part.tif").pitch_mm
    assert pitch == (None if count is None else pytest.approx(0.05, rel=1e-4))


def test_what_a_phone_writes_into_exif_is_no_scale(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.update({282: 300.0, 283: 300.0, 296: 2})
    Image.fromarray(COLOUR).save(tmp_path / "part.jpg", exif=exif)
    assert read_photo(tmp_path / "part.jpg").pitch_mm is None


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (None, "is not there"),
        (b"a letter, not a picture", "is not a picture that can be read"),
        (_encoded(".webp", COLOUR)[:200], "WEBP that is damaged, unusual or ends too soon; copy it again"),
        (b"\xff\xd8\xff\xe0", "JPEG that is damaged or unusual; copy it again, or save it as PNG$"),
        (_encoded(".png", COLOUR[:5, :5]), "too few for characters"),
        (_encoded(".tiff", np.zeros((16, 16), np.float32)), "TIFF of 32 bit numbers"),
        (
            _encoded(".tiff", np.zeros((16, 16), np.float64)),
            "TIFF that is damaged or unusual; .*heights as TIFF",
        ),
    ],
)
def test_what_is_no_photograph_is_refused(data: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "part.png"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(FileError, match=message):
        read_photo(path)


KINDS = ("PNG", "JPEG", "BMP", "WEBP")
ENDINGS = ("part", "partial", "filepart", "crdownload", "tmp", "download", "!ut", "1", "inprogress", "a1B2c3")


def picture(kind: str) -> bytes:
    """A picture of noise; a JPEG has a preview, which ends as the picture does."""
    noise = Image.fromarray(np.random.default_rng(3).integers(0, 255, (60, 80, 3), dtype=np.uint8))
    stream, preview = io.BytesIO(), io.BytesIO()
    noise.save(preview, "JPEG")
    more = {"exif": b"Exif\0\0" + preview.getvalue()} if kind == "JPEG" else {}
    noise.save(stream, kind, **more)
    return stream.getvalue()


PICTURES = {kind: picture(kind) for kind in KINDS}


@pytest.mark.parametrize("kind", [kind.name for kind in READ])
def test_a_whole_picture_is_not_cut_short(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "whole"
    path.write_bytes(picture(kind))
    assert not is_cut_short(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(kind=st.sampled_from(KINDS), share=st.floats(0.0, 0.99))
def test_a_picture_whose_end_is_missing_is_cut_short(tmp_path: Path, kind: str, share: float) -> None:
    path = tmp_path / "cut"
    whole = PICTURES[kind]
    # the end mark itself may stand before the last bytes
    cut = whole[: int(share * (len(whole) - 16))]
    assume(b"\xff\xd9" not in cut[-4:])  # just where a preview has ended nothing is known
    path.write_bytes(cut)
    assert is_cut_short(path)


@given(st.sampled_from(PHOTO_SUFFIXES), st.sampled_from(ENDINGS), st.booleans())
def test_unfinished_uploads_have_temporary_names_and_photographs_have_none(
    suffix: str, ending: str, upper: bool
) -> None:
    name = f"tray 7.part-3{suffix.upper() if upper else suffix}"
    assert not is_temporary(name)
    for temporary in (f"{name}.{ending}", f".{name}", f"~{name}", f"{name}~", f".{name}.{ending}"):
        assert is_temporary(temporary)

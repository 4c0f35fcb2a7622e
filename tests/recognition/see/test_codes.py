"""Codes in photographs: decoded at any angle and low contrast, found where they were marked, and taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import zxingcpp

from glyphs.camera.photo import Photo
from recognition.see.codes import Code, codes_of, without_codes
from tests.support.codes import ENVELOPE, GS1, stamped_photo, with_code

TEXT = "KB740215"
QR = zxingcpp.BarcodeFormat.QRCode


@pytest.fixture(scope="module")
def photo() -> Photo:
    return stamped_photo(TEXT)


def test_a_photograph_without_codes_has_none(photo: Photo) -> None:
    assert codes_of(photo) == ()
    assert without_codes(photo, ()) is photo


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TEXT, TEXT),
        (ENVELOPE.format(TEXT), "[)>␞12␝MFR 0AB12␝SER KB740215␞␄"),
        (f"{GS1}{TEXT}", f"{GS1}{TEXT}"),
    ],
)
def test_what_was_written_is_read(photo: Photo, text: str, said: str) -> None:
    (code,) = codes_of(with_code(photo, text))
    assert (code.kind, code.text) == ("Data Matrix", said)
    assert said.isprintable()


@pytest.mark.parametrize("turn_deg", [0.0, 17.0, 45.0, 90.0, 200.0])
@pytest.mark.parametrize("kind", [zxingcpp.BarcodeFormat.DataMatrix, QR])
def test_it_is_found_where_it_was_marked(photo: Photo, kind: zxingcpp.BarcodeFormat, turn_deg: float) -> None:
    at = (0.5 * photo.shape[1], photo.shape[0] - 65.0)
    shown = with_code(photo, ENVELOPE.format(TEXT), kind=kind, turn_deg=turn_deg, module_px=3.0, at=at)
    (code,) = codes_of(replace(shown, centre_mm=None))
    assert code.box is not None
    # a module at most, for corners are told in whole pixels of a code drawn between them
    middle = np.array(code.corners).mean(axis=0) / (photo.pitch_mm or 1.0)
    assert middle == pytest.approx(at, abs=3.0)


@pytest.mark.parametrize("contrast", [0.6, 0.3, 0.2])
def test_low_contrast_will_do(photo: Photo, contrast: float) -> None:
    assert [c.text for c in codes_of(with_code(photo, TEXT, contrast=contrast))] == [TEXT]


@pytest.mark.parametrize(("dots", "contrast"), [(0.6, 0.5), (0.7, 0.3), (0.8, -0.5)])
def test_dots_that_do_not_touch_are_one_code(photo: Photo, dots: float, contrast: float) -> None:
    peened = with_code(photo, TEXT, dots=dots, contrast=contrast, module_px=6.0, turn_deg=12.0)
    (code,) = codes_of(peened)
    assert (code.kind, code.text) == ("Data Matrix", TEXT)


def test_modules_of_two_pixels_will_do(photo: Photo) -> None:
    assert [c.text for c in codes_of(with_code(photo, TEXT, module_px=2.0, blur_px=0.4))] == [TEXT]


def test_what_cannot_be_decoded_is_no_code(photo: Photo) -> None:
    assert codes_of(with_code(photo, TEXT, module_px=1.0)) == ()
    assert codes_of(with_code(photo, TEXT, blur_px=5.0)) == ()
    shown = with_code(photo, TEXT)
    pixels = np.array(shown.pixels)
    pixels[-90:, : photo.shape[1] // 2 + 5] = 255  # half of it under a glare
    assert codes_of(replace(shown, pixels=pixels)) == ()


def test_another_light_may_show_it(photo: Photo) -> None:
    assert [c.text for c in codes_of(replace(photo, others=(photo, with_code(photo, TEXT))))] == [TEXT]


def test_two_codes_are_two_and_one_text_is_told_once(photo: Photo) -> None:
    rows, cols = photo.shape
    both = with_code(photo, TEXT, at=(0.3 * cols, rows - 65.0))
    other = with_code(both, "4711", at=(0.7 * cols, rows - 65.0))
    assert sorted(c.text for c in codes_of(other)) == ["4711", TEXT]
    assert len(codes_of(with_code(both, TEXT, at=(0.7 * cols, rows - 65.0)))) == 1


def test_without_its_code_the_land_is_there(photo: Photo) -> None:
    shown = with_code(photo, TEXT)
    codes = codes_of(shown)
    bare = without_codes(replace(shown, others=(shown,)), codes)
    assert codes_of(bare) == ()
    # the serial's half is untouched; below, what is left of the code is fainter than a tenth of what it was
    half = photo.shape[0] // 2
    assert np.array_equal(bare.pixels[:half], shown.pixels[:half])
    marked = np.abs(shown.grey() - photo.grey()).max()
    # grain is no more than that either way
    assert np.abs(bare.grey() - photo.grey()).mean() < 0.01 * marked


def test_a_place_in_another_frame_is_not_told() -> None:
    assert Code("QR Code", TEXT).box is None

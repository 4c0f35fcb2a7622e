"""Where there is no text none is read; real coins are, without any setting."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from glyphs import stamp
from glyphs.camera.photo import Photo
from glyphs.soiling.soiled import Soiling, soil_part
from glyphs.stamping.plate import plate_texture
from glyphs.stamping.stamp import StampedPart
from glyphs.stamping.variation import PlateVariation
from glyphs.surface.maps import HeightMap
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.reading import Reading
from recognition.reader import Reader
from tests.support.felt import felt
from whisker_array.scan.scan import Scan

# ----------------------------------------------------------------------------------------------------------- no text

DEJAVU = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
HEIGHT_MM = 5.0
PITCH_MM = HEIGHT_MM / 60
SHAPE = (120, 360)
Readers = Callable[..., Reader]


def is_nothing(reading: Reading) -> bool:
    return (
        reading.text == ""
        and reading.decision is Decision.REJECT
        and ReadingFlag.NO_CHARACTERS in reading.flags
    )


def bare_plate(soil: str, severity: float) -> Scan:
    """A milled plate on which nothing was struck, dirty, as felt."""
    rows, cols = SHAPE
    z = plate_texture(
        np.arange(cols) * PITCH_MM, np.arange(rows) * PITCH_MM, PlateVariation(), rng=np.random.default_rng(7)
    )
    part = StampedPart(HeightMap(z, PITCH_MM), "", HEIGHT_MM, (), "gothic")
    soiled = soil_part(part, Soiling((soil,), severity), rng=np.random.default_rng(3))
    return felt(soiled.height_map, soil=soiled.soil)


@pytest.mark.parametrize(
    ("soil", "severity", "format"),
    [("casting", 0.6, "AA999999"), ("weld", 0.3, None)],
    ids=["casting", "scratch"],
)
def test_a_dirty_plate_without_a_mark_has_no_text(
    reader: Readers, soil: str, severity: float, format: str | None
) -> None:
    assert is_nothing(reader(format=format).read(bare_plate(soil, severity)))


def pictures() -> dict[str, NDArray[np.float64]]:
    """Brightness, 0 to 1, of what is no text."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:120, :360].astype(np.float64)
    noise = rng.random(x.shape)
    sky = y < 80.0 + 30.0 * np.sin(x / 70.0) + 12.0 * np.sin(x / 19.0)
    return {
        "noise": noise,
        "grating": np.sin(x / 6.0),
        "landscape": sky + 2.0 * ndimage.gaussian_filter(noise, 3.0),
    }


@pytest.mark.parametrize("name", list(pictures()))
def test_a_picture_of_something_else_has_no_text(reader: Readers, name: str) -> None:
    grey = pictures()[name]
    grey = (grey - grey.min()) / max(float(np.ptp(grey)), 1e-9)
    photo = Photo((255 * grey).astype(np.uint8))
    assert is_nothing(reader(format="AA999999").read(photo))


@pytest.mark.parametrize(("text", "accepted"), [("KX40", True), ("K%40", False)])
def test_a_sign_that_the_format_has_not_is_not_accepted_as_one_of_its_characters(
    reader: Readers, text: str, accepted: bool
) -> None:
    part = stamp(text, fonts=DEJAVU, height_mm=HEIGHT_MM, seed=3)
    reading = reader(format="AA99", height_mm=HEIGHT_MM).read(part.height_map)
    assert (reading.decision is Decision.ACCEPT) == accepted
    place = 1 + next((k for k, char in enumerate(text) if not char.isalnum()), -1)
    assert accepted or any(f"place {place}" in message for message in reading.messages())


# ------------------------------------------------------------------------------------------------------------- coins

ROOT = Path(__file__).parents[2]
OWN = ROOT / "tests" / "data"


def read(strip: Path) -> tuple[Reading, str]:
    with np.load(strip) as data:
        relief, text = HeightMap(data["z_mm"], float(data["pitch_mm"])), str(data["text"])
    return Reader().read(relief), text


@pytest.mark.parametrize(
    "strip", [OWN / "penny_LIBERTY.npz", OWN / "penny_1997.npz"], ids=lambda strip: strip.stem
)
def test_a_coin_is_read_without_any_setting(strip: Path) -> None:
    reading, text = read(strip)
    assert (reading.text, reading.raised) == (text, True)
    assert reading.decision is not Decision.REJECT

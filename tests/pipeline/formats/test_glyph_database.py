"""Glyph databases and whisker files: what is written comes back, and what is wrong is named."""

import json
import math
import zlib
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic_core import to_json

from glyphs.errors import FileError, MarksError
from glyphs.fonts.glyph import Font, Glyph
from glyphs.fonts.outlines import load_font
from pipeline.formats import glyph_database as module
from pipeline.formats.glyph_database import Exemplar, GlyphDatabase, load_database, save_database
from pipeline.formats.whisker_file import WhiskerFile, read_whisker_file, write_whisker_file
from tests.support.benches import known_whisker
from whisker_array.whisker.sections import MUSIC_WIRE, Material, Rectangle, Round, Taper, Tube
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import Touch

WHEN = "2024-05-17T09:30:00+00:00"


def exemplar(**change):
    relief = np.random.default_rng(0).normal(size=(20, 15)).astype(np.float32)
    values = {"char": "8", "font_name": "gothic", "relief": relief, "note": "worn ½", "enrolled_at": WHEN}
    return Exemplar(**{**values, **change})


def learned():
    """A font that was felt, in part."""
    relief = np.random.default_rng(1).normal(size=(53, 65)).astype(np.float32)
    square = np.array([[0.1, 0.0], [0.5, 0.0], [0.5, 1.0], [0.1, 1.0]])
    shapes = {"8": {"relief": relief}, "B": {"relief": -relief, "guessed": True}, "-": {}}
    glyphs = {char: Glyph(char, contours=(square,), advance=0.6, **more) for char, more in shapes.items()}
    return Font("press", glyphs, 0.0, "")


@pytest.fixture(scope="module")
def full():
    dejavu = load_font(f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans.ttf")
    fonts = (load_font("gothic"), load_font("timesr"), dejavu, learned())
    gaps = np.where(exemplar().relief > 1.0, np.nan, exemplar().relief)
    values = {"relief": gaps, "height_mm": 5.0, "rotation_deg": -2.5, "raised": True, "part": "part-7"}
    exemplars = (exemplar(), exemplar(char="B", note=""), exemplar(evidence="ab" * 32, **values))
    return GlyphDatabase({f.name: f for f in fonts}, exemplars)


@pytest.fixture(scope="module")
def saved(full, tmp_path_factory):
    path = tmp_path_factory.mktemp("database") / "glyphs.h5"
    save_database(full, path)
    return path


def plainly(database):
    return to_json(database, fallback=module._plain)


def test_round_trip_keeps_everything(full, saved):
    back = load_database(saved)
    assert plainly(back) == plainly(full)
    assert [name for name, font in back.fonts.items() if font.learned] == ["press"]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_flipped_byte_is_noticed(saved, tmp_path, data):
    content = bytearray(saved.read_bytes())
    place = data.draw(st.one_of(st.integers(0, 600), st.integers(0, len(content) - 1)))
    content[place] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "flipped.h5"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"flipped\.h5"):
        load_database(path)


def test_a_newer_version_is_named_as_such(saved, tmp_path):
    path = tmp_path / "newer.h5"
    path.write_bytes(saved.read_bytes().replace(b"format_version 3\n", b"format_version 4\n", 1))
    with pytest.raises(FileError, match=r"newer\.h5.*version 4, newer than 3.*update"):
        load_database(path)


def rewritten(saved, tmp_path, change):
    """The saved file with its JSON edited and the digest made good."""
    content = json.loads(zlib.decompress(saved.read_bytes().split(b"\n", 3)[3]))
    text = change(content)
    body = zlib.compress(text if isinstance(text, bytes) else json.dumps(content).encode())
    path = tmp_path / "edited.h5"
    path.write_bytes(module._head(body) + body)
    return path


def an_array(content, change):
    strokes = content["fonts"]["gothic"]["glyphs"]["A"]["strokes"]
    strokes[0] = {**strokes[0], **change}


@pytest.mark.parametrize(
    "change",
    [
        lambda content: an_array(content, {"base64": "AAAA"}),
        lambda content: an_array(content, {"base64": 7}),
        lambda content: content.update(fonts=7),
        lambda content: content["exemplars"][0].pop("relief") and None,
        lambda content: content["exemplars"][0].update(char="KK"),
        lambda content: content["exemplars"][0].update(note=["cos", "system"]),
        lambda content: content.update(more=1),
        lambda content: content["fonts"].update(other=content["fonts"]["gothic"]),
        lambda _: b"[" * 100_000,
        lambda _: b"no JSON",
        lambda _: b"7",
    ],
)
def test_nonsense_behind_a_right_digest_is_refused(saved, tmp_path, change):
    with pytest.raises(FileError, match=r"edited\.h5.*not a glyph database"):
        load_database(rewritten(saved, tmp_path, change))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: exemplar(char="AB"), "one character"),
        (lambda: exemplar(relief=np.zeros(3, dtype=np.float32)), "no rows and columns"),
        (lambda: exemplar(enrolled_at="yesterday"), "ISO 8601"),
        (lambda: GlyphDatabase({"other": load_font("gothic")}), "own name"),
    ],
)
def test_values_refuse(make, message):
    with pytest.raises(MarksError, match=message):
        make()


GOOD = """
kind = "L"
l1_mm = 30.0
l2_mm = 3.5
beta_deg = 10.0
preload_mm = 1.0
tip_radius_mm = 0.06
friction = 0.2
character_height_mm = 5.0
[section]
kind = "ribbon"
thickness_mm = 0.3
width_mm = 4.5
"""


IDENTIFIED = '[identified]\nnames = ["{}"]\nsd = [0.1]\ncorrelation = [[1]]\n[section]'


def touch_of(whisker: LShaped, *, preload_mm: float, radius_mm: float, friction: float) -> Touch:
    return Touch(whisker.tip_model(), preload_mm, radius_mm, friction, whisker.describe())


def size(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


sections = st.one_of(
    st.builds(Rectangle, size(0.05, 1.0), size(0.05, 5.0)), st.builds(Round, size(0.05, 1.0))
)
names = st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=20)
materials = st.one_of(
    st.just(MUSIC_WIRE),
    st.builds(Material, names, size(1e3, 5e5), size(0.0, 0.49), size(0.5, 20.0), size(10.0, 5000.0)),
)
angles = size(0.0, 1.2)
whiskers = st.one_of(
    st.builds(LShaped, size(5.0, 80.0), size(0.1, 20.0), size(-80.0, 40.0), angles, sections, materials),
    st.builds(straight_whisker, size(5.0, 80.0), angles, sections, materials),
)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(whisker=whiskers, data=st.data())
def test_what_is_written_comes_back(tmp_path: Path, whisker: LShaped, data: st.DataObject) -> None:
    numbers = [data.draw(size(0.01, 5.0)) for _ in range(5)]
    touch = touch_of(whisker, preload_mm=numbers[0], radius_mm=numbers[1], friction=data.draw(size(0.0, 1.0)))
    content = WhiskerFile(whisker, touch, *numbers[2:], data.draw(size(0.1, 1000.0)))
    path = tmp_path / "whisker.toml"
    write_whisker_file(path, content)
    back = read_whisker_file(path)
    assert type(back.whisker) is type(whisker)
    # degrees to radians and back may cost the last digit
    assert back.whisker.beta_rad == pytest.approx(whisker.beta_rad, rel=1e-15, abs=1e-300)
    for was, now, names in (
        (whisker, back.whisker, ("section", "material", "l1_mm", "l2_mm", "lowered_mm")),
        (content, back, ("character_height_mm", "line_pitch_mm", "sample_pitch_mm", "speed_mm_s")),
        (content.touch, back.touch, ("preload_mm", "tip_radius_mm", "friction")),
    ):
        assert [getattr(was, name) for name in names] == [getattr(now, name) for name in names]
    arm = whisker.tip_model().moment_arm_mm
    np.testing.assert_allclose(back.touch.tip.moment_arm_mm, arm, rtol=1e-12, atol=1e-12)


def test_what_is_left_out_is_scaled_to_the_height(tmp_path: Path) -> None:
    path = tmp_path / "w.toml"
    path.write_text(GOOD, encoding="utf-8")
    read = read_whisker_file(path)
    assert isinstance(read.whisker, LShaped)
    assert read.whisker.lowered_mm == 3.5
    assert read.whisker.material == MUSIC_WIRE
    assert read.whisker.beta_rad == pytest.approx(math.radians(10.0))
    assert (read.line_pitch_mm, read.sample_pitch_mm, read.speed_mm_s) == (0.125, 0.0625, 50.0)
    assert read.touch.whisker == read.whisker.describe()


def test_how_well_a_whisker_is_known_comes_back(tmp_path: Path) -> None:
    whisker, touch, known = known_whisker()
    path = tmp_path / "w.toml"
    write_whisker_file(path, WhiskerFile(whisker, touch, 5.0, 0.125, 0.03125, 50.0, known))
    read = read_whisker_file(path).known
    assert read is not None
    assert read.names == known.names
    np.testing.assert_allclose(read.covariance, known.covariance, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('kind = "L"\n', "", "has no kind; write kind = one of 'L', 'straight'"),
        ('kind = "L"', 'kind = "J"', "has the kind 'J'"),
        ("l1_mm", "l_mm", "lacks the key l1_mm"),
        ("friction = 0.2", "friction = 0.2\nfrictoin = 0.3", "has the unknown key frictoin"),
        ("friction = 0.2", 'friction = 0.2\nmaterial = "cheese"', "material"),
        ("friction = 0.2", "friction = ", "is not TOML"),
        ("[section]", '[identified]\nnames = ["l1_mm"]\nsd = [0.1]\ncorrelation = []\n[section]', "1 names"),
        ("[section]", IDENTIFIED.format("l9"), "identified.names"),
    ],
)
def test_a_wrong_file_says_what_and_where(tmp_path: Path, old: str, new: str, says: str) -> None:
    path = tmp_path / "w.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(FileError) as told:
        read_whisker_file(path)
    assert says in str(told.value)
    assert str(path) in str(told.value)
    assert told.value.hint


def test_what_cannot_be_written_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    touch = touch_of(LShaped(30.0, 3.0, None, 0.0, Round(0.3)), preload_mm=1.0, radius_mm=0.1, friction=0.2)
    for section in (Taper(Round(0.4), Round(0.2)), Tube(0.4, 0.2)):
        odd = LShaped(30.0, 3.0, None, 0.0, section)
        tube = WhiskerFile(odd, touch, 5.0, 0.1, 0.05, 50.0)
        with pytest.raises(FileError, match="cannot hold"):
            write_whisker_file(tmp_path / "w.toml", tube)
    assert not list(tmp_path.iterdir())


def test_versions_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "whisker.toml"
    path.write_text(GOOD)
    content = read_whisker_file(path)  # of before versions were told
    write_whisker_file(path, content)
    assert "format_version = 1\n" in path.read_text()
    path.write_text("format_version = 2\n" + GOOD)
    with pytest.raises(FileError, match="format version 2; this program reads 1; update this program"):
        read_whisker_file(path)

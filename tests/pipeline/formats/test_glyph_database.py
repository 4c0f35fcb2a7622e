import json
import zlib

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
from pipeline.formats.glyph_database import (
    Exemplar,
    GlyphDatabase,
    load_database,
    save_database,
)

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

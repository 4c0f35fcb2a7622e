import os

import h5py
import matplotlib
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glyphs.fonts.glyph import Font, Glyph
from glyphs.fonts.outlines import load_font
from pipeline.formats import glyph_database as module
from pipeline.formats.glyph_database import (
    DatabaseError,
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


@pytest.fixture(scope="module")
def full():
    dejavu = load_font(f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans.ttf")
    fonts = (load_font("gothic"), load_font("timesr"), dejavu)
    return GlyphDatabase({f.name: f for f in fonts}, (exemplar(), exemplar(char="B", note="")))


@pytest.fixture(scope="module")
def saved(full, tmp_path_factory):
    path = tmp_path_factory.mktemp("database") / "glyphs.h5"
    save_database(full, path)
    return path


def test_round_trip_keeps_everything(full, saved):
    back = load_database(saved)
    assert list(back.fonts) == list(full.fonts)
    for name, font in full.fonts.items():
        other = back.fonts[name]
        assert (other.stroke_ratio, other.source) == (font.stroke_ratio, font.source)
        assert list(other.glyphs) == list(font.glyphs)
        for char, glyph in font.glyphs.items():
            twin = other.glyphs[char]
            assert (twin.advance, twin.stroke) == (glyph.advance, glyph.stroke)
            assert len(twin.strokes) == len(glyph.strokes)
            assert len(twin.contours) == len(glyph.contours)
            for a, b in zip(twin.strokes + twin.contours, glyph.strokes + glyph.contours, strict=True):
                assert np.array_equal(a, b)
    for one, two in zip(back.exemplars, full.exemplars, strict=True):
        assert (one.char, one.font_name, one.note, one.enrolled_at) == (
            two.char,
            two.font_name,
            two.note,
            WHEN,
        )
        assert np.array_equal(one.relief, two.relief)


def test_any_hdf5_reader_opens_the_file(saved):
    with h5py.File(saved) as file:
        assert file.attrs["format"] == module.FORMAT_NAME
        assert file.attrs["format_version"] == module.FORMAT_VERSION
        assert set(file) == {"fonts", "exemplars"}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_flipped_byte_is_noticed(saved, tmp_path, data):
    content = bytearray(saved.read_bytes())
    at = data.draw(st.one_of(st.integers(0, 600), st.integers(0, len(content) - 1)))
    content[at] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "flipped.h5"
    path.write_bytes(content)
    with pytest.raises(DatabaseError, match=r"flipped\.h5"):
        load_database(path)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_truncation_and_any_noise_is_noticed(saved, tmp_path, data):
    content = saved.read_bytes()
    path = tmp_path / "cut.h5"
    path.write_bytes(
        data.draw(
            st.one_of(st.integers(0, len(content) - 1).map(lambda n: content[:n]), st.binary(max_size=2000))
        )
    )
    with pytest.raises(DatabaseError, match=r"cut\.h5"):
        load_database(path)


def test_a_newer_version_is_named_as_such(saved, tmp_path):
    path = tmp_path / "newer.h5"
    path.write_bytes(saved.read_bytes().replace(b"format_version 2\n", b"format_version 3\n", 1))
    with pytest.raises(DatabaseError, match=r"newer\.h5.*version 3, newer than 2.*update"):
        load_database(path)


def test_missing_file_folder_and_target(full, tmp_path):
    with pytest.raises(DatabaseError, match=r"nothing\.h5.*is not there"):
        load_database(tmp_path / "nothing.h5")
    with pytest.raises(DatabaseError, match="is not a file"):
        load_database(tmp_path)
    with pytest.raises(DatabaseError, match="name a folder"):
        save_database(full, tmp_path / "no folder" / "glyphs.h5")


def rewritten(saved, tmp_path, change):
    """The saved file with its HDF5 part edited and the digest made good."""
    body = tmp_path / "body.h5"
    body.write_bytes(saved.read_bytes()[module._BLOCK_BYTES :])
    with h5py.File(body, "r+") as file:
        change(file)
    path = tmp_path / "edited.h5"
    path.write_bytes(module._block(body.read_bytes()) + body.read_bytes())
    return path


def replace_with_objects(file):
    del file["fonts/0/advance"]
    file["fonts/0"].create_dataset("advance", data=["cos\nsystem\n"] * 3, dtype=h5py.string_dtype())


@pytest.mark.parametrize(
    "change",
    [
        replace_with_objects,
        lambda file: file.__delitem__("exemplars"),
        lambda file: file["exemplars/0"].__delitem__("relief"),
        lambda file: file["exemplars/0"].attrs.__setitem__("char", "KK"),
        lambda file: file["fonts/0/points"].__setitem__((0, 0), np.nan),
    ],
)
def test_nonsense_behind_a_right_digest_is_refused(saved, tmp_path, change):
    with pytest.raises(DatabaseError, match=r"edited\.h5.*not a glyph database"):
        load_database(rewritten(saved, tmp_path, change))


def test_a_failed_save_leaves_the_old_file_and_no_litter(full, tmp_path, monkeypatch):
    path = tmp_path / "glyphs.h5"
    save_database(GlyphDatabase(), path)
    before = path.read_bytes()

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(DatabaseError, match="No space left"):
        save_database(full, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["glyphs.h5"]


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
    with pytest.raises(DatabaseError, match=message):
        make()


def test_learned_glyphs_and_exemplars_with_reliefs_come_back(tmp_path):
    relief = np.random.default_rng(1).normal(size=(53, 65)).astype(np.float32)
    square = np.array([[0.1, 0.0], [0.5, 0.0], [0.5, 1.0], [0.1, 1.0]])
    glyphs = {
        "8": Glyph("8", contours=(square,), advance=0.6, relief=relief),
        "B": Glyph("B", contours=(square,), advance=0.6, relief=-relief, guessed=True),
        "-": Glyph("-", contours=(square,), advance=0.6),
    }
    felt = np.where(relief > 1.0, np.nan, relief)
    values = {"relief": felt, "height_mm": 5.0, "rotation_deg": -2.5, "raised": True}
    one = exemplar(part="part-7", evidence="ab" * 32, **values)
    save_database(GlyphDatabase({"press": Font("press", glyphs, 0.0, "")}, (one,)), tmp_path / "l.glyphs")
    back = load_database(tmp_path / "l.glyphs")
    font = back.fonts["press"]
    assert font.learned
    assert [g.guessed for g in font.glyphs.values()] == [False, True, False]
    assert np.array_equal(font.glyphs["B"].relief, -relief)
    assert font.glyphs["-"].relief is None
    twin = back.exemplars[0]
    assert np.array_equal(twin.relief, felt, equal_nan=True)
    assert (twin.height_mm, twin.rotation_deg, twin.raised) == (5.0, -2.5, True)
    assert (twin.part, twin.evidence) == ("part-7", "ab" * 32)


def never_written(file):
    """Declare 3.2 GB in a file of some kilobytes."""
    del file["fonts/0/points"]
    file["fonts/0"].create_dataset(
        "points", shape=(200_000_000, 2), dtype="f8", chunks=(1000, 2), compression="gzip"
    )


def one_value_in_a_large_chunk(file):
    for k in range(3):
        file["fonts/0"].create_dataset(
            f"more{k}", shape=(1,), dtype="f8", chunks=(8_000_000,), maxshape=(None,)
        )


def linked_outside(file):
    del file["fonts"]
    file["fonts"] = h5py.ExternalLink("other.h5", "/fonts")


def stored_outside(file):
    count = file["fonts/0/advance"].shape
    del file["fonts/0/advance"]
    file["fonts/0"].create_dataset(
        "advance", shape=count, dtype="f8", external=[("other.bin", 0, count[0] * 8)]
    )


def named_often(file):
    for k in range(3, 300):
        file[f"fonts/{k}"] = file["fonts/0"]


def many_fonts(file):
    for k in range(3, 300):
        file.copy("fonts/0", f"fonts/{k}")


def empty_lines(file):
    for name in ("line_points", "line_glyph"):
        del file[f"fonts/0/{name}"]
        file[f"fonts/0/{name}"] = np.zeros(600_000, dtype=np.uint32)


def crowded_glyph(file):
    group = file["fonts/0"]
    n = module.MOST_GLYPH_POINTS + 1
    for name, values in (("points", np.zeros((n, 2))), ("line_points", [n]), ("line_glyph", [0])):
        del group[name]
        group[name] = values


def far_point(file):
    file["fonts/0/points"][0, 0] = 1e30


def wide_advance(file):
    file["fonts/0/advance"][0] = 1e9


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (never_written, "unpacks to more than 64 MB"),
        (one_value_in_a_large_chunk, "unpacks to more than 64 MB"),
        (linked_outside, "link into another file"),
        (stored_outside, "in another file"),
        (named_often, "second name for its data"),
        (many_fonts, "300 fonts, over the limit"),
        (empty_lines, "lines, over the limit"),
        (crowded_glyph, "more than 5,000 points"),
        (far_point, "beyond 100 cap heights"),
        (wide_advance, "advance is 1000000000"),
    ],
)
def test_a_database_that_asks_for_far_more_than_its_size_is_refused(saved, tmp_path, change, why):
    with pytest.raises(DatabaseError, match=why):
        load_database(rewritten(saved, tmp_path, change))

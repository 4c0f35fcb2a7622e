"""Job files: settings of reading by name, what cannot be one, and the text that is written of one."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.common.job_file import job_text, read_job_file
from pipeline.common.serial_format import format_like
from pipeline.common.settings import ReadSettings
from recognition.language.grammar import Grammar

SHARES = st.integers(0, 999).map(lambda n: n / 1000.0)
REGIONS = st.tuples(SHARES, SHARES).map(lambda corner: [*corner, 1.0, 1.0])


def written(folder: Path, text: str, name: str = "housing-left.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8", errors="surrogateescape")  # half surrogates: bytes of no text
    return path


def test_a_job_is_settings_of_reading_and_names_files_beside_itself(tmp_path: Path) -> None:
    for name in ("lids.txt", "die.ttf"):
        (tmp_path / name).write_text("KX40\n", encoding="utf-8")
    text = 'format = "AA99"\nlexicon = "lids.txt"\nfont = ["gothic", "die.ttf"]\n[line.lot]\nformat = "A"\n'
    job = read_job_file(written(tmp_path, text + "region = [0, 0.5, 1, 1]\n"))
    assert job.name == "housing-left"
    assert job.settings == ReadSettings(
        format=("AA99",),
        lexicon=tmp_path / "lids.txt",
        font=("gothic", str(tmp_path / "die.ttf")),
        line=("lot@0,0.5,1,1=A",),
    )
    assert len(job.sha256) == 64
    assert read_job_file(written(tmp_path, "# as usual\n")).settings == ReadSettings()


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("format = ", "a.toml", "is not TOML .*; correct that line"),
        ("x = {" + "a." * 50_000 + "a = 1}", "a.toml", r"is not TOML \(a key of more than 200 dots\)"),
        ('formt = "AA"', "a.toml", "unknown setting formt; did you mean format"),
        ("height_mm = -1", "a.toml", "height_mm is -1: write a number above 0"),
        ('mode = "vision"', "a.toml", "sets mode, which a job cannot; take it out"),
        ('database = "die.glyphs"', "a.toml", "names the database .*die.glyphs, which is not there; put it"),
        ("[service]\nport = 1", "a.toml", "unknown setting service"),
        ("", "a.toml", "is empty; copy or save it again"),
        ('format = "\udce4"', "a.toml", "is not UTF-8 text; save it as UTF-8"),
        ("active = true", "the left one.toml", "is not a valid name for a job; write letters, digits"),
    ],
)
def test_what_is_no_job(text: str, name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=rf"{name}: {message}"):
        read_job_file(written(tmp_path, text, name))


@given(
    texts=st.lists(st.text("AZ09-/. \"\\'\x7fé", min_size=1, max_size=12).map("A".__add__), max_size=3),
    region=REGIONS,
    height_mm=st.floats(0.01, 999.0),
    lines=st.dictionaries(st.text("ab-_1", min_size=1, max_size=6).map("x".__add__), REGIONS, max_size=3),
)
def test_what_is_written_is_read_again(
    texts: list[str], region: list[float], height_mm: float, lines: dict[str, list[float]]
) -> None:
    table = {name: {"format": "AA9", "region": region_of_line} for name, region_of_line in lines.items()}
    keys = {"orientation": "upright", "region": region, "height_mm": height_mm, "active": True, "line": table}
    settings = {**keys, "font": texts}
    assert ReadSettings.of(
        **tomllib.loads(job_text(settings, ReadSettings.of(**settings).line))
    ) == ReadSettings.of(**settings)


@given(st.text("ABZabz0123456789-/.*\\ ", min_size=1, max_size=20).filter(str.strip))
def test_the_format_proposed_for_a_text_allows_it(text: str) -> None:
    format = format_like(text)
    assert Grammar.parse(format).allows(text)
    assert not set(format) & set("BZbz012345678")  # letters and figures are left open

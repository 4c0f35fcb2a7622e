"""What readers make of the settings, and job files."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from glyphs.errors import FileError, MarksError
from pipeline.common.job_file import job_text, read_job_file
from pipeline.common.serial_format import format_like
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.reading.readers import open_reader
from recognition.decide import risk as room
from recognition.decide.risk_text import USUAL_RISK
from recognition.decide.score import SOURCES, score_of
from recognition.language.grammar import Grammar
from recognition.recogniser.steps import EXPERTS
from recognition.settings import ReaderSettings


def test_a_program_builds_the_same_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTILE_MARKS_HEIGHT_MM", "4")
    settings = ReadSettings(font="gothic, futural", format="sets:AB,0-9", depth_rule="0.2:, MIL-STD-792")
    assert (settings.font, settings.format) == (("gothic", "futural"), ("sets:AB,0-9",))
    assert settings.depth_rule == ("0.2:", "MIL-STD-792")
    assert (settings.height_mm, settings.sensors) == (None, "real")
    assert ReadSettings.of(**settings.model_dump(exclude_unset=True)) == settings
    with pytest.raises(SettingsError, match="unknown setting hight_mm; did you mean height_mm"):
        ReadSettings.of(hight_mm=5.0)
    with pytest.raises(SettingsError, match=r"height_mm is -5\.0: write a number above 0"):
        ReadSettings.of(height_mm=-5.0)
    with pytest.raises(ValidationError, match="frozen"):
        settings.height_mm = 5.0


def test_the_reader_is_given_the_rules() -> None:
    def rules(**given: object) -> list[tuple[str, float]]:
        reader = open_reader(ReadSettings(font=("gothic",), **given))
        return [(rule.name, round(rule.windows[0].least_mm, 4)) for rule in reader.settings.depth_rules]

    assert rules() == []
    assert rules(depth_rule="0.2:") == [("own rule", 0.2)]
    assert rules(depth_rule="27CFR478.92, 0.2:") == [("27CFR478.92", 0.0762), ("own rule", 0.2)]
    two = rules(depth_rule="MIL-STD-792,press-7=0.05:0.1@1:2 burr=0.02")
    assert two == [("MIL-STD-792", 0.1), ("press-7", 0.05)]


def test_the_readers_are_told_grammar_and_thresholds() -> None:
    risk = score_of("tactile").thresholds[0].risk
    settings = open_reader(ReadSettings(format=("AA99",), accept_risk=risk)).settings
    assert settings.grammar is not None
    assert settings.grammar.format == "AA99"
    assert settings.accept_risk == risk
    assert open_reader(ReadSettings()).settings.grammar is None


def test_a_risk_that_is_set_must_be_kept_by_a_sense_of_the_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "threshold_of", lambda source, risk: None if source == "vision" else 0.9)
    with pytest.raises(MarksError, match="the camera cannot promise 1 in 1,000; allow 1 in"):
        open_reader(ReadSettings(mode="vision", accept_risk=0.001))
    assert open_reader(ReadSettings(accept_risk=0.001)).settings.accept_risk == 0.001


def test_without_a_risk_a_sense_accepts_at_the_usual_one_or_the_least_that_it_keeps() -> None:
    settings = open_reader(ReadSettings()).settings
    assert settings == ReaderSettings()
    for source in SOURCES:
        least = score_of(source).least_risk
        assert settings.risk_of(source) == max(USUAL_RISK, least)
        assert settings.least_score(source) == score_of(source).threshold(max(USUAL_RISK, least))
    assert ReaderSettings(accept_risk=0.05).risk_of("vision") == 0.05


def test_the_readers_are_told_who_has_a_say() -> None:
    reader = open_reader(ReadSettings(experts="network, templates"))
    assert reader.settings.experts == ("network", "templates")
    named = [
        open_reader(ReadSettings(font=("gothic",), experts=who)).settings.faces_judge
        for who in ((), ("network",), ("network", "templates"))
    ]
    assert named == [True, False, True]
    with pytest.raises(MarksError, match="templates cannot read photographs; add the expert network"):
        _ = open_reader(ReadSettings(experts=("templates",))).vision
    assert open_reader(ReadSettings()).settings.experts == EXPERTS


def test_settings_that_say_nothing_load_no_library_of_reading() -> None:
    """The command line gives every setting, most of them empty, before it starts the worker that reads."""
    program = (
        "import sys; from pipeline.common.settings import ReadSettings;"
        "ReadSettings(format=(), experts=(), depth_rule=(), line=(), region=None);"
        "print(*{name.partition('.')[0] for name in sys.modules} & {'recognition', 'numpy', 'scipy', 'numba'})"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"


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

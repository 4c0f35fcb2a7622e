"""Settings from file, environment and flags."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.settings import ReadSettings, SettingsError, load_settings
from pipeline.reading.readers import Readers, open_reader


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_defaults() -> None:
    assert load_settings() == ReadSettings()
    assert ReadSettings().fidelity == "contact"


def test_the_later_goes_over_the_former(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tactile-marks.toml").write_text(
        'font = ["gothic", "futural"]\nheight_mm = 3\nfidelity = "pointwise"\nformat = "A9"\n',
        encoding="utf-8",
    )
    monkeypatch.setenv("TACTILE_MARKS_HEIGHT_MM", "4")
    monkeypatch.setenv("TACTILE_MARKS_FIDELITY", "contact")
    settings = load_settings(height_mm=5.0, format=None)
    assert settings.font == ("gothic", "futural")
    assert settings.height_mm == 5.0
    assert settings.fidelity == "contact"
    assert settings.format == ("A9",)
    assert load_settings().height_mm == 4.0


def test_another_file_by_name_and_fonts_by_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other.toml"
    other.write_text('height_mm = 7\nfont = "gothic"\n', encoding="utf-8")
    assert load_settings(config=other).font == ("gothic",)
    monkeypatch.setenv("TACTILE_MARKS_FONT", "futural, my font.ttf")
    settings = load_settings(config=other)
    assert (settings.height_mm, settings.font) == (7.0, ("futural", "my font.ttf"))


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("hight_mm = 5", "hight_mm.*did you mean height_mm"),
        ("[read]\nheight_mm = 5", "unknown key read"),
        ("height_mm = -5", "height_mm in .*tactile-marks.toml is -5"),
        ("height_mm = nan", "height_mm"),
        ('height_mm = "tall"', "height_mm"),
        ('fidelity = "exact"', "fidelity"),
        ('mode = "smell"', "mode"),
        ("font = 5", "font"),
        ("format = ''", "format in .* the format is empty; write a mask"),
        ("format = ['AA99', 're:[']", r"format in .*toml"),
        ("check = 'luhm'", "check in .* unknown check digit 'luhm'; known are vin, luhn"),
        ("exclude = 'I O'", "exclude in .* is 'I O': it has a blank"),
        ("accept_confidence = 1.5", "accept_confidence in .* is 1.5"),
        ("accept_margin = -0.1", "accept_margin in .* is -0.1"),
        ("height_mm = ", "no TOML"),
        ('depth_rule = "VIN"', "depth_rule in .* is 'VIN': unknown depth rule 'VIN'; known are 27CFR478.92"),
        ("min_depth_mm = 0", "min_depth_mm in .* is 0"),
        ("min_depth_mm = -0.1", "min_depth_mm"),
    ],
)
def test_a_bad_file_is_told_by_key(toml: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "tactile-marks.toml").write_text(toml, encoding="utf-8")
    with pytest.raises(SettingsError, match=message):
        load_settings()


def test_a_bad_environment_is_told_by_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTILE_MARKS_HEIGHT_MM", "0")
    with pytest.raises(SettingsError, match="TACTILE_MARKS_HEIGHT_MM"):
        load_settings()
    monkeypatch.delenv("TACTILE_MARKS_HEIGHT_MM")
    monkeypatch.setenv("TACTILE_MARKS_FIDELTY", "contact")
    with pytest.raises(SettingsError, match=r"TACTILE_MARKS_FIDELTY.*did you mean fidelity"):
        load_settings()


def test_a_missing_file_is_an_error_only_when_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"none\.toml"):
        load_settings(config=tmp_path / "none.toml")
    assert load_settings().height_mm is None


def test_rules_for_depth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert (load_settings().depth_rule, load_settings().min_depth_mm) == (None, None)
    (tmp_path / "tactile-marks.toml").write_text(
        'depth_rule = "27 cfr 478.92"\nmin_depth_mm = 0.1\n', encoding="utf-8"
    )
    monkeypatch.setenv("TACTILE_MARKS_MIN_DEPTH_MM", "0.2")
    settings = load_settings()
    assert (settings.depth_rule, settings.min_depth_mm) == ("27CFR478.92", 0.2)
    assert load_settings(min_depth_mm=0.3).min_depth_mm == 0.3
    with pytest.raises(SettingsError, match="depth_rule in the flags is 'x'"):
        load_settings(depth_rule="x")


def test_the_reader_is_given_the_rules() -> None:
    def rules(**given: object) -> list[tuple[str, float]]:
        reader = open_reader(load_settings(font=("gothic",), **given))
        return [(rule.name, round(rule.least_depth_mm, 4)) for rule in reader.settings.depth_rules]

    assert rules() == []
    assert rules(min_depth_mm=0.2) == [("min_depth_mm", 0.2)]
    assert rules(min_depth_mm=0.2, depth_rule="27CFR478.92") == [
        ("27CFR478.92", 0.0762),
        ("min_depth_mm", 0.2),
    ]


def test_formats_from_every_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tactile-marks.toml").write_text(
        'format = ["sets:AB,0-9,0-9", "re:A\\\\d+"]\ncheck = "luhn@2-"\nexclude = "7"\naccept_margin = 0.5\n',
        encoding="utf-8",
    )
    settings = load_settings()
    assert settings.format == ("sets:AB,0-9,0-9", "re:A\\d+")
    assert (settings.check, settings.exclude, settings.accept_margin) == (("luhn@2-",), "7", 0.5)
    # a format has commas of its own, so the environment gives one; check digits have none
    monkeypatch.setenv("TACTILE_MARKS_FORMAT", "sets:AB,0-9,0-9")
    monkeypatch.setenv("TACTILE_MARKS_CHECK", "luhn@2-, iso7064mod11_10@2-")
    settings = load_settings(mode="auto")
    assert settings.format == ("sets:AB,0-9,0-9",)
    assert settings.check == ("luhn@2-", "iso7064mod11_10@2-")
    assert settings.mode == "auto"
    assert load_settings(format=("AA", "re:A.")).format == ("AA", "re:A.")


def test_the_readers_are_told_grammar_and_thresholds() -> None:
    told = Readers(load_settings(format=("AA99",), accept_confidence=0.5)).told
    assert told.grammar is not None
    assert told.grammar.mask == "AA99"
    assert (told.accept_confidence, told.accept_margin) == (0.5, Readers(load_settings()).told.accept_margin)
    assert Readers(load_settings()).told.grammar is None


def test_vision_that_verifies_knows_the_length_only() -> None:
    readers = Readers(load_settings(format=("AA99",), font=("gothic",)))
    vision = readers.open_vision("AB 12")
    assert readers.open_vision("XY99") is vision
    assert vision.places is not None
    assert len(vision.places) == 4
    assert all("Q" in place and "7" in place for place in vision.places)

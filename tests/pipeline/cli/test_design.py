"""`design` as an engineer meets it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.exit_status import FAILED, USAGE
from pipeline.cli.main import main

ASKED = {"alpha": "30:60", "mu": "0.1:0.5", "depth_mm": 0.2, "height_mm": 5.0}


def design(**flags: object) -> int:
    """Run the command with these flags."""
    words = [f"--{name.replace('_', '-')}={value}" for name, value in flags.items() if value is not True]
    return main(["design", *words, *(f"--{name}" for name, value in flags.items() if value is True)])


def test_one_inclination_is_singled_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "tuned.pdf"
    assert design(**ASKED, sensitive_to=45.0, picture=picture) == 0
    told = capsys.readouterr().out
    assert "null at 45 deg" in told
    assert "F, mu = 0.29" in told
    assert "-0.00" not in told
    assert picture.read_bytes().startswith(b"%PDF")


def test_a_level_whisker_can_be_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert design(**ASKED, beta_deg="0", **{"no-trade-offs": True}) == 0
    told = capsys.readouterr().out
    assert "beta 0.00 deg" in told
    assert "scan speed, mm/s" not in told


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"alpha": "60:30"}, "--alpha is '60:30'"),
        ({"alpha": "steep"}, "--alpha is 'steep'"),
        ({"alpha": "30:45:60"}, "write least:greatest"),
        ({"alpha": "30:90"}, "below 90"),
        ({"mu": "0.1:nan"}, "--mu"),
        ({"mu": "-0.1:0.5"}, "friction"),
        ({"depth_mm": 0.0}, "depth_mm"),
        ({"height_mm": -5.0}, "character_height_mm"),
        ({"beta_deg": "-10:45"}, "--beta-deg"),
        ({"section": "round"}, "take a ribbon"),
        ({"sensitive_to": 3.0}, "cannot be singled out"),
    ],
)
def test_bad_usage_is_one_line_and_status_2(
    change: dict[str, object], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert design(**(ASKED | change)) == USAGE
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(("flag", "name"), [("out", "w.json"), ("picture", "p.toml"), ("out", "none/w.toml")])
def test_files_are_refused_before_the_search(tmp_path: Path, flag: str, name: str) -> None:
    assert design(**ASKED, **{flag: tmp_path / name}) == FAILED


def test_an_array_is_told_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "array.png"
    assert design(height_mm=5.0, array=True, accuracy=0.5, whiskers="8", picture=picture) == 0
    told = capsys.readouterr().out
    assert "Quickest: 8 whiskers" in told
    assert max(map(len, told.splitlines()[:-1])) <= 80
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        *(
            ({"array": True, "whiskers": numbers}, "--whiskers is")
            for numbers in ("", "eight", "0,8", "1000")
        ),
        ({}, "--alpha, --mu and --depth-mm"),
    ],
)
def test_an_array_or_walls_must_be_given(
    flags: dict[str, object], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert design(height_mm=5.0, **flags) == USAGE
    assert says in capsys.readouterr().err

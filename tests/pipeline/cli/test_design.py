"""`design` as an engineer meets it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.design import design
from pipeline.cli.exit_status import FAILED, USAGE, CommandError

ASKED = {"alpha": "30:60", "mu": "0.1:0.5", "depth_mm": 0.2, "height_mm": 5.0}


def test_one_inclination_is_singled_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "tuned.pdf"
    assert design(**ASKED, sensitive_to=45.0, picture=picture) == 0
    told = capsys.readouterr().out
    assert "null at 45 deg" in told
    assert "F, mu = 0.29" in told
    assert "-0.00" not in told
    assert picture.read_bytes().startswith(b"%PDF")


def test_a_level_whisker_can_be_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert design(**ASKED, beta_deg="0", trade_offs=False) == 0
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
def test_bad_usage_is_one_line_and_status_2(change: dict[str, object], says: str) -> None:
    with pytest.raises(CommandError) as told:
        design(**(ASKED | change))
    assert told.value.status == USAGE
    assert says in str(told.value)


@pytest.mark.parametrize(("flag", "name"), [("out", "w.json"), ("picture", "p.toml"), ("out", "none/w.toml")])
def test_files_are_refused_before_the_search(tmp_path: Path, flag: str, name: str) -> None:
    with pytest.raises(CommandError) as told:
        design(**ASKED, **{flag: tmp_path / name})
    assert told.value.status == FAILED


def test_an_array_is_told_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "array.png"
    assert design(height_mm=5.0, array=True, accuracy=0.5, whiskers="8", picture=picture) == 0
    told = capsys.readouterr().out
    assert "Quickest: 8 whiskers" in told
    assert max(map(len, told.splitlines()[:-1])) <= 80
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize("whiskers", ["", "eight", "0,8", "1000"])
def test_numbers_of_whiskers_that_cannot_be(whiskers: str) -> None:
    with pytest.raises(CommandError, match="--whiskers is") as raised:
        design(height_mm=5.0, array=True, whiskers=whiskers)
    assert raised.value.status == USAGE


def test_without_an_array_walls_must_be_given() -> None:
    with pytest.raises(CommandError, match="--alpha, --mu and --depth-mm"):
        design(height_mm=5.0)

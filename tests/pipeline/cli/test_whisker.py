"""`scan`, `identify` and reading by chosen passes: plans in words, warnings, what is found."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from glyphs import stamp
from glyphs.surface.pieces import Piece
from pipeline.cli.main import main
from pipeline.cli.whisker import linear_beam_warning
from pipeline.formats.npz import write_npz
from tests.support.benches import recorded
from tests.support.run_tables import csv_rows
from whisker_array.identification.bench import Unknown
from whisker_array.identification.fit import identify
from whisker_array.scan.recording import save_scan
from whisker_array.whisker.array import LINES_PER_HEIGHT
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.sections import Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import Chain, LShaped, Whisker, straight_whisker


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_whisker_gives_no_warning(height: float) -> None:
    for mu in (0.0, 0.2, 0.5):
        assert linear_beam_warning(default_whisker(height), lift_mm=default_preload_mm(height), mu=mu) == ""


@pytest.mark.parametrize(
    ("whisker", "mu", "why"),
    [
        (LShaped(30.0, 3.0, None, -1.2, Rectangle(0.3, 4.5)), 0.5, "jams"),
        (Chain(np.array([[0.0, 0, 0], [-20, -2, 0], [-22, -4, 1]]), Round(0.3)), 0.2, "plane"),
        (straight_whisker(1.0, 0.0, Round(0.3)), 0.2, "cannot be"),
    ],
)
def test_no_exact_answer_is_said(whisker: Whisker, mu: float, why: str) -> None:
    line = linear_beam_warning(whisker, lift_mm=1.1, mu=mu)
    assert "cannot be checked" in line
    assert why in line


def test_negative_friction_is_refused() -> None:
    with pytest.raises(WhiskerError, match="mu"):
        linear_beam_warning(default_whisker(5.0), lift_mm=1.0, mu=-0.2)


@pytest.mark.usefixtures("inline")
def test_what_was_found_is_shown_beside_what_is_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # a coarser map than by default, and two of the numbers: how near they are is not asked here
    quickly = partial(identify, grid_mm=0.02, only=(Unknown.PRELOAD, Unknown.FRICTION))
    monkeypatch.setattr("pipeline.reading.identified.identify", quickly)
    monkeypatch.chdir(tmp_path)
    Path("piece.toml").write_text('kind = "pits"\nangle_deg = [45]\nland_mm = 1.2\n', encoding="utf-8")
    piece = Piece(angle_deg=(45.0,), land_mm=1.2)
    save_scan(recorded(piece, friction=0.25, whiskers=3), Path("piece.h5"))
    assert main(["identify", "piece.h5", "--piece", "piece.toml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "not identified, no usable line over the piece: whisker 1, 2" in lines
    rows = {words[0]: words for words in map(str.split, lines) if len(words) > 3}
    assert float(rows["friction"][1]) == pytest.approx(0.25, abs=0.03)
    assert float(rows["friction"][3]) == pytest.approx(0.2)  # as set
    assert float(rows["preload_mm"][1]) == pytest.approx(float(rows["preload_mm"][3]), rel=0.02)


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("parts") / "part.npz"
    write_npz(path, stamp("KX40", fonts="gothic", height_mm=5.0, seed=3).height_map)
    return path


@pytest.mark.usefixtures("inline")
def test_read_tells_what_the_serial_cost(
    part: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "read.csv"
    assert main(["read", str(part), "--format", "AA99", "--active", "--out", str(out)]) == 0
    (row,) = csv_rows(out)
    assert (row["text"], row["decision"]) == ("KX40", "accept")
    assert "s of stage time: the serial is sure" in row["flags"]


@pytest.mark.usefixtures("inline")
def test_an_active_scan_chooses_its_ways_itself(part: Path, tmp_path: Path) -> None:
    arguments = ("scan", str(part), "--out", str(tmp_path / "felt.h5"), "--height-mm", "5", "--active")
    assert main([*arguments, "--format", "AA99", "--two-way"]) == 2


@pytest.mark.usefixtures("inline")
def test_the_benchmark_compares_plans(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from pipeline.benchmark.readers import modes
    from pipeline.benchmark.readers import plans as touch_plans

    # three plans of all: the suite need not feel a part as often
    plans = (
        touch_plans.TouchPlan("active", 100.0),
        touch_plans.TouchPlan("uniform", 4),
        touch_plans.TouchPlan("whole", LINES_PER_HEIGHT),
    )
    monkeypatch.setattr(modes, "PLANS", plans)
    arguments = f"benchmark run --mode plans --out {tmp_path} --dirt 0 --parts 1 --format AA99".split()
    assert main(arguments) == 0
    rows = csv_rows(tmp_path / "benchmark.csv")
    assert [row["mode"] for row in rows] == [plan.mode for plan in plans]
    assert all(row["text"] == row["truth"] and float(row["scan_s"]) > 0.0 for row in rows)
    assert "mean scan by a stage" in capsys.readouterr().out

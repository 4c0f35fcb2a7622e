"""`identify` on a short recording; the numbers themselves are tested by `tests/whisker_array/identification`."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from glyphs.surface.pieces import Piece
from pipeline.cli.main import main
from tests.support.benches import recorded
from whisker_array.identification.bench import Unknown
from whisker_array.identification.fit import identify
from whisker_array.scan.recording import save_scan


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
    found = {words[0]: words for words in map(str.split, lines) if len(words) > 3}
    assert float(found["friction"][1]) == pytest.approx(0.25, abs=0.03)
    assert float(found["friction"][3]) == pytest.approx(0.2)  # as set
    assert float(found["preload_mm"][1]) == pytest.approx(float(found["preload_mm"][3]), rel=0.02)

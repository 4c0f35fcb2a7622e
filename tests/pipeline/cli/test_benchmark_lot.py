"""`benchmark lot`: the same parts read once and teaching themselves, beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pipeline.cli.benchmarking.lot import lot
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.formats.find_parts import discover
from pipeline.formats.synth import text_of
from pipeline.runs.options import RunOptions
from tests.support.run_tables import write_records


def test_a_lot_is_made_and_read_both_ways(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    texts: dict[str, str] = {}

    def noted(spec: Any, number: int) -> str:
        text = text_of(spec, number)
        texts[f"{spec.soiling.severity:g}-{len(texts):04d}"] = text
        return text

    runs: list[tuple[tuple[str, ...], bool | None]] = []

    def read(inputs: list[str], settings: ReadSettings, options: RunOptions, _: Any) -> int:
        names = [part.name for part in discover([Path(name) for name in inputs])]
        runs.append((settings.font, options.learn_die))
        by_dirt = {name.partition("-")[0]: text for name, text in texts.items()}
        rows = [
            # without what the lot teaches, the dirtiest is read wrongly
            ReadingRecord(
                "tactile",
                by_dirt[name.partition("-")[0]]
                if options.learn_die or not name.startswith("0.9")
                else "AA000000",
                "accept" if options.learn_die else "review",
                0.95,
                part=name,
            )
            for name in names
        ]
        assert options.out is not None
        write_records(rows, Path(options.out))
        return 0

    monkeypatch.setattr("pipeline.benchmark.exam.designed_parts.text_of", noted)
    monkeypatch.setattr("pipeline.runs.production.run_batch", read)
    assert lot(out=tmp_path, font="gothic", parts=4) == 0
    said = capsys.readouterr().out
    assert runs == [((), False), ((), True)]
    assert len(list(tmp_path.glob("lot-*/*.npz"))) == 4
    assert "dirt 0.9\nonce: " in said
    whole = said.partition("whole lot\n")[2].splitlines()
    assert "serials 75.00%" in whole[0]
    assert "accepted 0" in whole[0]
    assert whole[1].startswith("teaching itself: characters 100.00%")
    assert "accepted 4, of these wrong 0" in whole[1]
    assert "serials only right by it 1, only by the other 0" in whole[2]

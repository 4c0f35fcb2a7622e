"""Tables of records: flat in CSV, with lists and structs in JSON lines and Parquet."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pyarrow.parquet

from pipeline.common.reading_records import (
    CandidateRecord,
    CharacterRecord,
    CodeRecord,
    LineRecord,
    PassRecord,
    ReadingRecord,
    RivalRecord,
)
from tests.support.run_tables import record_of_json, write_records

PLACE = CharacterRecord(
    (CandidateRecord("8", 0.9, 0.8), CandidateRecord("B", 0.08)),
    (1.0, 2.0, 4.0, 7.0),
    "mismatch",
    "C",
    state_chars=("8", "B"),
    action="clean",
    depth_min_mm=0.21,
    depth_mean_mm=0.23,
)
RECORDS = [
    ReadingRecord(
        "tactile",
        "8",
        "accept",
        0.93,
        (PLACE,),
        ("marks are dirty", "this is not the serial expected"),
        "gothic",
        5.0,
        verdict="refuted",
        seconds=0.25,
        at=datetime(2026, 11, 21, 9, 30, tzinfo=UTC),
        part="p-0",
        raised=True,
        expected="B",
        verify_probability=0.0004,
        rivals=(RivalRecord("B", 0.08),),
        lines=(LineRecord("lot", "LOT77", 0.97, (1.0, 9.0, 20.0, 12.0)), LineRecord("", "12/26", 0.9)),
        codes=(
            CodeRecord("Data Matrix", "[)>␞12␝SER 8␞␄", True, (0.0, 9.0, 4.0, 13.0)),
            CodeRecord("QR Code", "PNR 7"),
        ),
        passes=(PassRecord(180, (1.0, 3.5), (0.0, 40.0), 50.0, 0.8, 1.25, "to try it", "KB7", 0.5),),
        stage_s=1.25,
        stopped="budget",
        program="1.2",
        settings="0123456789abcdef",
    ),
    ReadingRecord.failed("p,1", '"a", ü\nline two'),
]


def test_json_lines_and_parquet_hold_lists_and_structs(tmp_path: Path) -> None:
    for suffix in (".jsonl", ".parquet"):
        write_records(RECORDS, tmp_path / f"t{suffix}")
    lines = (tmp_path / "t.jsonl").read_bytes().splitlines()
    assert [record_of_json(line) for line in lines] == RECORDS
    told = json.loads(lines[0])
    assert list(told)[:7] == ["part", "text", "decision", "confidence", "source", "seconds", "error"]
    assert told["characters"] == [
        {
            "char": "8",
            "probability": 0.9,
            "score": 0.8,
            "alternatives": [{"char": "B", "probability": 0.08, "score": 0.0}],
            "box_mm": [1.0, 2.0, 4.0, 7.0],
            "state": "mismatch",
            "grade": "C",
            "box_px": None,
            "state_chars": ["8", "B"],
            "action": "clean",
            "depth_min_mm": 0.21,
            "depth_mean_mm": 0.23,
            "burr_mm": None,
        }
    ]
    assert told["rivals"] == [{"text": "B", "probability": 0.08}]
    assert told["lines"] == [
        {
            "name": "lot",
            "text": "LOT77",
            "confidence": 0.97,
            "box_mm": [1.0, 9.0, 20.0, 12.0],
            "box_px": None,
        },
        {"name": "", "text": "12/26", "confidence": 0.9, "box_mm": None, "box_px": None},
    ]
    assert [(one["kind"], one["same"]) for one in told["codes"]] == [("Data Matrix", True), ("QR Code", None)]
    assert (told["at"], told["program"], told["settings"]) == (
        "2026-11-21T09:30:00Z",
        "1.2",
        "0123456789abcdef",
    )
    assert told["passes"][0]["direction_deg"] == 180
    table = pyarrow.parquet.read_table(tmp_path / "t.parquet")
    assert table.column_names == list(told)
    assert table.to_pylist()[0] == {**told, "at": RECORDS[0].at}

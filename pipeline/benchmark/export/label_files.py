"""Write the truth of an exported exam in the label formats common in text recognition.

    rec_gt.txt     PaddleOCR, recognition: lines/NAME-VIEW.png <TAB> text
    det_gt.txt     PaddleOCR, detection: photos/NAME.png <TAB> [{"transcription": "AB12", "points": [[x, y] * 4]}]
    truth.jsonl    a picture a line: file, part, polygon, transcription, characters with a polygon each
    truth.csv      a part a line: part, text, all levels of its factors

A line that is not to be read has the transcription "###", which both kinds of scorer ignore.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from pipeline.benchmark.export.exported_part import polygon_px

RECOGNITION, DETECTION, LINES, TABLE = "rec_gt.txt", "det_gt.txt", "truth.jsonl", "truth.csv"
PASSED_OVER = "###"
_OF_PICTURES = ("photo", "edges", "relief", "ideal")
"""Views whose pictures are labelled; those of 16 bit lie on the same grid."""


def label_files(labels: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Contents of the four files, from the labels of all parts in order."""
    pictures = [(label, view) for label in labels for view in _OF_PICTURES if view in label["views"]]
    return {
        RECOGNITION: _lines(
            f"{path}\t{label['text']}" for label in labels for path in label["lines"].values()
        ),
        DETECTION: _lines(
            f"{label['views'][view]['file']}\t{_json(list(_detected(label, view)))}"
            for label, view in pictures
            if view != "ideal"  # of 16 bit, which detectors do not take
        ),
        LINES: _lines(_json(_picture(label, view)) for label, view in pictures),
        TABLE: _table(labels),
    }


def _detected(label: dict[str, Any], view: str) -> Iterator[dict[str, Any]]:
    for box, text in ((label["line_mm"], label["text"]), (label["beside_mm"], PASSED_OVER)):
        if box is not None:
            yield {"transcription": text, "points": polygon_px(box, label["views"][view])}


def _picture(label: dict[str, Any], view: str) -> dict[str, Any]:
    scale = label["views"][view]
    first, *beside = _detected(label, view)
    return {
        "file": scale["file"],
        "view": view,
        "part": label["part"],
        "transcription": first["transcription"],
        "polygon": first["points"],
        "characters": [
            {"char": c["char"], "polygon": polygon_px(c["box_mm"], scale)} for c in label["characters"]
        ],
        "beside": [other["points"] for other in beside],
    }


def _table(labels: Sequence[dict[str, Any]]) -> str:
    factors = list(dict.fromkeys(name for label in labels for name in label["levels"]))
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("part", "text", *factors))
    for label in labels:
        levels = label["levels"]
        writer.writerow((label["part"], label["text"], *(levels.get(name, "") for name in factors)))
    return stream.getvalue()


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)

"""Labels and card of an exported exam: its truth in common label formats, and its description.

    rec_gt.txt     PaddleOCR, recognition: lines/NAME-VIEW.png <TAB> text
    det_gt.txt     PaddleOCR, detection: photos/NAME.png <TAB> [{"transcription": "AB12", "points": [[x, y] * 4]}]
    truth.jsonl    one picture per line: file, part, polygon, transcription, characters with a polygon each
    truth.csv      one part per line: part, text, all levels of its factors
    card.json      the card, for programs
    README.md      the card, for people

A line that must not be read has the transcription "###", which both kinds of scorer ignore.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, metadata
from importlib.resources import files
from typing import Any

from pipeline.benchmark.exam.condition import font_name, level_name
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.export.exported_part import polygon_px
from pipeline.common.texts import CSV_BEGIN, csv_line
from pipeline.common.version import library_versions, program_mark, program_version

RECOGNITION, DETECTION, LINES, TABLE = "rec_gt.txt", "det_gt.txt", "truth.jsonl", "truth.csv"
IGNORED = "###"
# the 16 bit pictures have the same grid
_LABELLED_VIEWS = ("photo", "edges", "relief", "ideal")
CARD = "card.json"
# on which the numbers may depend
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-contrib-python-headless", "pillow", "fonttools")
_PAGE = files("pipeline.benchmark.export") / "templates" / "data_card.md"


def label_files(labels: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Contents of the four files, from the labels of all parts in order."""
    pictures = [(label, view) for label in labels for view in _LABELLED_VIEWS if view in label["views"]]
    return {
        RECOGNITION: _lines(
            f"{path}\t{label['text']}" for label in labels for path in label["lines"].values()
        ),
        DETECTION: _lines(
            f"{label['views'][view]['file']}\t{_json(list(_detection_boxes(label, view)))}"
            for label, view in pictures
            if view != "ideal"  # 16 bit, which detectors cannot read
        ),
        LINES: _lines(_json(_picture(label, view)) for label, view in pictures),
        TABLE: _table(labels),
    }


def _detection_boxes(label: dict[str, Any], view: str) -> Iterator[dict[str, Any]]:
    for box, text in ((label["line_mm"], label["text"]), (label["beside_mm"], IGNORED)):
        if box is not None:
            yield {"transcription": text, "points": polygon_px(box, label["views"][view])}


def _picture(label: dict[str, Any], view: str) -> dict[str, Any]:
    scale = label["views"][view]
    first, *beside = _detection_boxes(label, view)
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
    rows = (
        (label["part"], label["text"], *(label["levels"].get(name, "") for name in factors))
        for label in labels
    )
    return CSV_BEGIN + "".join(map(csv_line, (("part", "text", *factors), *rows)))


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _json(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def card_of(
    parts: DesignedParts, labels: Sequence[dict[str, Any]], *, design: dict[str, Any]
) -> dict[str, Any]:
    """Describe the exam in JSON values; `design` is everything that the parts depend on, except the program."""
    counts: dict[str, Counter[str]] = {}
    for label in labels:
        for name, level in label["levels"].items():
            counts.setdefault(name, Counter())[level_name(level)] += 1
    return {
        "name": parts.design.name,
        "about": parts.design.about,
        "parts": len(labels),
        "counts": {name: dict(by_level) for name, by_level in counts.items()},
        "missing_views": {
            view: gone
            for view in ("edges", "relief")
            if (gone := sum(view not in label["views"] for label in labels))
        },
        "fonts": _fonts(parts),
        "design": design,
        "version": program_version(),
        "program": program_mark(),
        "libraries": library_versions(_LIBRARIES),
    }


def page_of(card: dict[str, Any]) -> str:
    """The card as a page in Markdown."""
    import jinja2

    page = jinja2.Template(_PAGE.read_text(encoding="utf-8"), trim_blocks=True, keep_trailing_newline=True)
    return str(page.render(card))


def _fonts(parts: DesignedParts) -> dict[str, dict[str, str]]:
    """Origin of each font, and the licence of its package; the font may have a licence of its own."""
    design, fonts = parts.design, {}
    for name in design.font_names:
        packaged = design.fonts.get(name)
        if packaged is not None:
            origin = f"{packaged.package} {packaged.version}, {packaged.file}", _licence(packaged.package)
        elif font_name(name) != name:
            origin = "a file", "that of the file"
        else:
            origin = "tactile-marks", "that of the program"
        fonts[font_name(name)] = dict(zip(("from", "licence"), origin, strict=True))
    return fonts


def _licence(package: str) -> str:
    try:
        about = metadata(package)
    except PackageNotFoundError:
        return "not known"
    classified = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or () if "License ::" in c]
    written = about.get_all("License-Expression") or classified or about.get_all("License") or ()
    first = ", ".join(written).strip().splitlines()[:1]
    return first[0] if first else "not known"

"""Card of an exported exam: card.json for programs, README.md for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, metadata
from importlib.resources import files
from typing import Any

from pipeline.benchmark.exam.condition import font_name, level_name
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.common.version import library_versions, program_mark, program_version

CARD = "card.json"
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-contrib-python-headless", "pillow", "fonttools")
"""Libraries that the numbers may depend on."""
_PAGE = files("pipeline.benchmark.export") / "templates" / "data_card.md"


def card_of(
    parts: DesignedParts, labels: Sequence[dict[str, Any]], *, design: dict[str, Any]
) -> dict[str, Any]:
    """Describe the exam in JSON values.

    Args:
        parts: parts of the design.
        labels: labels of the parts that are written.
        design: all that the parts depend on beside the program.
    """
    counts: dict[str, Counter[str]] = {}
    for label in labels:
        for name, level in label["levels"].items():
            counts.setdefault(name, Counter())[level_name(level)] += 1
    return {
        "name": parts.design.name,
        "about": parts.design.about,
        "parts": len(labels),
        "counts": {name: dict(found) for name, found in counts.items()},
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
    """Origin of each font, and the licence of its package; its fonts may have others."""
    design, found = parts.design, {}
    for name in design.font_names:
        packaged = design.fonts.get(name)
        if packaged is not None:
            origin = f"{packaged.package} {packaged.version}, {packaged.file}", _licence(packaged.package)
        elif font_name(name) != name:
            origin = "a file", "that of the file"
        else:
            origin = "tactile-marks", "that of the program"
        found[font_name(name)] = dict(zip(("from", "licence"), origin, strict=True))
    return found


def _licence(package: str) -> str:
    try:
        about = metadata(package)
    except PackageNotFoundError:
        return "not known"
    classified = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or () if "License ::" in c]
    written = about.get_all("License-Expression") or classified or about.get_all("License") or ()
    first = ", ".join(written).strip().splitlines()[:1]
    return first[0] if first else "not known"

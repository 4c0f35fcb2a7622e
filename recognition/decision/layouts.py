"""Say that a doubtful part looks like another layout, which is not read as a serial."""

from __future__ import annotations

from recognition.decision.decide import EXPLANATIONS, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.find.layouts import Layout, LayoutKind
from recognition.find.part_lines import PartLines
from recognition.language.grammar import Grammar


def with_layout(
    reading: Reading,
    part: PartLines,
    grammar: Grammar | None,
    *,
    doubtful: float = 0.5,
    least_places: int = 4,
) -> Reading:
    """Say which layout a doubtful part looks like, in place of findings about its strokes.

    Args:
        reading: decided reading.
        part: lines of the part that were read.
        grammar: format of the serial.
        doubtful: score below which a reading is doubtful; a part in another layout has hardly more than 0.1.
        least_places: number of characters without a format below which they may be a piece of a column.
    """
    sure = bool(reading.characters) and reading.confidence >= doubtful
    if part.layout is None or (sure and (grammar is not None or len(reading.characters) >= least_places)):
        return reading
    text = _describe(part.layout)
    if sure:
        return reading.with_findings(Finding(ReadingFlag.UNREAD_MARKS, text))
    return reading.without_flags(EXPLANATIONS | ReadingFlag.FORMAT_NOT_MET).with_findings(
        Finding(ReadingFlag.LAYOUT, text)
    )


def _describe(layout: Layout) -> str:
    texts = [f"“{text}”" for text in layout.texts]
    if layout.kind is LayoutKind.MIRRORED:
        return f"the marks look mirrored: in a mirror they read {texts[0]} (mirror the picture or the map)"
    if layout.kind is LayoutKind.COLUMN:
        return (
            f"the characters stand below each other and read {texts[0]} (columns are not accepted; type it)"
        )
    what = f"two lines read {texts[0]} and {texts[1]}, which fit the format together"
    return f"{what} (give --format for one and --line for the other)"

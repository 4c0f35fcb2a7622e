"""How true depths are if the font is not known: measured depth less that of the clean mark, by font and dirt.

Run `python tests/benchmarks/depth_unnamed.py [--parts N] [--every N] [--named]`. The fonts are the built-in ones, and
those of DejaVu that come with matplotlib. The truth is measured on the surface as it was stamped, before any dirt,
along the strokes of the font that was stamped, at its places: neither touch nor reading has a part in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib
import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.part import Part, stamp
from recognition.decide.decision import ReadingFlag
from recognition.decide.reading import Reading
from recognition.glyph_match.felt_line import felt_line
from recognition.marks.depth import MarkDepth, mark_depths
from recognition.marks.laid_text import LaidText
from recognition.reader import Reader
from tests.support.felt import stamped_line, view_of
from whisker_array.estimation.relief import Relief, Route

SEVERITIES = (0.0, 0.3, 0.6)
FORMAT = "AA9999"
MOST_OFF_MM = 0.02


def fonts() -> list[Font]:
    """The built-in fonts, and the faces of DejaVu."""
    faces = sorted(Path(matplotlib.get_data_path(), "fonts", "ttf").glob("DejaVu*.ttf"))
    return [load_font(font) for font in (*BUILTIN_FONTS, *faces) if "Display" not in str(font)]


def true_depths(part: Part, font: Font) -> tuple[MarkDepth | None, ...]:
    """Depth of each character of the clean part, along the strokes that were stamped."""
    stamped = part.stamped
    z, pitch = stamped.height_map.z_mm, stamped.height_map.pitch_mm
    surface = Relief(z, None, None, pitch, (0.0, 0.0), 0.0, None, Route.FLOORS)
    felt = felt_line(view_of(surface), *stamped_line(stamped), stamped.text, (font,))
    return mark_depths(surface, LaidText(felt, tuple(stamped.text), font))


def readings(font: Font, severity: float, parts: int, *, named: bool) -> Iterator[tuple[Part, Reading]]:
    """Parts in a font, and their readings."""
    reader = Reader(fonts=[font] if named else [], format=FORMAT)
    for k in range(parts):
        part = stamp(
            format=FORMAT,
            fonts=font,
            height_mm=5.0,
            depth_mm=0.16,
            pitch_mm=0.06,
            dirt=severity,
            seed=(31, k),
        )
        yield part, reader.read(part.height_map, soil=part.soil)


def main(*, parts: int = 4, every: int = 1, named: bool = False) -> None:
    """Print a row for each font and severity.

    Args:
        parts: parts in each font, at each severity.
        every: every n-th font only.
        named: whether the font is named.
    """
    print("| font | dirt | characters | measured | mean off | least off | accepted | foreign |")
    print("|---|---|---|---|---|---|---|---|")
    for severity in SEVERITIES:
        total = np.zeros(6, dtype=int)
        for font in fonts()[::every]:
            row = np.zeros(6, dtype=int)
            for part, reading in readings(font, severity, parts, named=named):
                row[4:] += reading.decision == "accept", ReadingFlag.FOREIGN_SHAPES in reading.flags
                if reading.text != part.text:
                    continue
                for c, truth in zip(reading.characters, true_depths(part, font), strict=True):
                    if truth is None:
                        continue
                    row[0] += 1
                    if c.depth is not None:
                        row[1] += 1
                        row[2] += abs(c.depth.mean_mm - truth.mean_mm) > MOST_OFF_MM
                        row[3] += abs(c.depth.min_mm - truth.min_mm) > MOST_OFF_MM
            print(f"| {font.name} | {severity} | {' | '.join(map(str, row))} |", flush=True)
            total += row
        print(f"| **all** | {severity} | {' | '.join(map(str, total))} |", flush=True)


if __name__ == "__main__":
    from cyclopts import run

    run(main)

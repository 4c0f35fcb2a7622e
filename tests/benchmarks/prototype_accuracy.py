"""What naming the font is worth, and physics in it: characters read at the places that the network finds::

    python tests/benchmarks/prototype_accuracy.py --design tests/benchmarks/calibration.toml --parts 384

Every part is felt and read with its font named and its format given. At the places of that reading the characters are
chosen by the network alone, by prototypes predicted through the whisker, by prototypes of the same plate as it is (no
touch), and by the network with either. Prints a table in Markdown, by severity.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from recognition import Reader
from recognition.belief.line_belief import pool
from recognition.glyph_match.predicted import CANONICAL_HEIGHT_MM, ideal_plate
from recognition.glyph_match.prototypes import Prototypes, belief_of, cut_out
from recognition.language.lattice import Lattice
from recognition.views.view import felt_view, heights_view

ROWS = ("network", "felt", "outlines", "network and felt", "network and outlines")


def outlines(font_file: str, chars: str) -> Prototypes:
    """Prototypes of the ideal plate itself."""
    font = load_font(font_file)
    known = tuple(c for c in chars if c in font.glyphs)
    plate = ideal_plate(font, "".join(known), default_die(CANONICAL_HEIGHT_MM, font=font))
    view = heights_view(plate.surface)
    return cut_out(font.name, known, view, plate.middles_mm, plate.half_width, CANONICAL_HEIGHT_MM)


def right(lattice: Lattice, text: str) -> int:
    """Characters of a text that a lattice of as many places has."""
    best = [lattice.chars[k] for k in lattice.log_belief.argmax(axis=1)]
    return sum(a == b for a, b in zip(best, text, strict=True))


def main() -> None:
    """Read the parts and print the table."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--design", type=Path, required=True)
    asked.add_argument("--parts", type=int)
    given = asked.parse_args()
    parts = DesignedParts(Design.load(given.design), given.parts)
    readers: dict[tuple[str, str], tuple[Reader, Prototypes]] = {}
    found: dict[float, dict[str, int]] = defaultdict(lambda: dict.fromkeys((*ROWS, "characters"), 0))
    for item in parts.items():
        made, levels = parts.make(item), item.condition
        key = (parts.font_of(levels), levels.format)
        if key not in readers:
            reader = Reader(fonts=[key[0]], format=key[1])
            readers[key] = reader, outlines(key[0], reader.touch.chars)
        reader, drawn = readers[key]
        trace = reader.touch.read_height_map(made.height_map, soil=made.soil).trace
        counts = found[levels.severity]
        counts["characters"] += len(made.truth)
        line, own = trace.felt_line, trace.by_expert
        if line is None or trace.edge_map is None or own.get("templates") is None:
            continue
        if own["network"].n_places != len(made.truth):
            continue
        view = felt_view(trace.edge_map, trace.relief)
        without = belief_of([view], line.line, line.columns, [[drawn]], own["network"])
        assert without is not None
        lattices = (
            own["network"], own["templates"], without,
            pool({"network": own["network"], "templates": own["templates"]}),
            pool({"network": own["network"], "templates": without}),
        )  # fmt: skip
        for name, lattice in zip(ROWS, lattices, strict=True):
            counts[name] += right(lattice, made.truth)
    severities = sorted(found)
    print("| " + " | ".join(["characters right, %", *(f"dirt {s:g}" for s in severities), "all"]) + " |")
    print("|---" * (len(severities) + 2) + "|")
    for name in ROWS:
        shares = [found[s][name] / found[s]["characters"] for s in severities]
        whole = np.sum([found[s][name] for s in severities]) / np.sum(
            [found[s]["characters"] for s in severities]
        )
        print("| " + " | ".join([name, *(f"{100 * share:.1f}" for share in (*shares, float(whole)))]) + " |")


if __name__ == "__main__":
    main()

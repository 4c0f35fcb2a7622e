"""Photographs beside the touch of another part: none may be accepted, and no part of its own may be lost.

    python tests/benchmarks/mixed_pairs.py [--parts 200] [--seed 60]

Parts of one format, of three fonts, at dirt 0, 0.3 and 0.6. Each part is read once by touch and once by its photograph;
then every touch is fused with the photograph of its own part (true pairs), and with that of the next part of the same
dirt (mixed pairs; "nothing seen": the camera has read no characters in it). Each pair is judged at a risk of 1 in
100, with and without the rule for senses that disagree. Intervals are Wilson's, 95 %.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from glyphs import stamp
from glyphs.fonts.serials import random_text
from recognition import Reader
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.evidence import Evidence
from recognition.decide.reading import Reading

FORMAT = "AA999999"
FONTS = ("gothic", "futural", "timesrb")
SEVERITIES = (0.0, 0.3, 0.6)


class ReadPart(NamedTuple):
    """A part and its reading by each sense."""

    text: str
    dirt: float
    touch: Reading
    vision: Reading


def read_parts(reader: Reader, *, parts: int, seed: int) -> Iterator[ReadPart]:
    for number in range(parts):
        dirt, font = SEVERITIES[number % 3], FONTS[number // 3 % 3]
        text = random_text(FORMAT, rng=np.random.default_rng((seed, number)))
        part = stamp(text, fonts=font, dirt=dirt, seed=(seed, number))
        touch = reader.read(part.height_map, soil=part.soil)
        vision = reader.read(part.photograph())
        # fusion needs neither scan nor map, which are large
        yield ReadPart(text, dirt, lighter(touch), vision)


def lighter(reading: Reading) -> Reading:
    """The reading without scan and map."""
    touch = reading.evidence.touch.logged(scan=None, surface=None)
    trace = replace(reading.trace, scan=None, height_map=None, edge_map=None)
    return replace(reading, trace=trace, evidence=Evidence.of(touch))


def share(count: int, n: int) -> str:
    """Count of n, with its interval in percent."""
    low, high = binomtest(count, n).proportion_ci(method="wilson")
    return f"{count} of {n} ({100 * low:.1f} to {100 * high:.1f} %)"


def print_table(reader: Reader, rows: Sequence[ReadPart]) -> None:
    """Print what is accepted of mixed and true pairs, by dirt, with and without the rule."""
    accepted: dict[tuple[object, str, bool], list[bool]] = defaultdict(list)
    for dirt in SEVERITIES:
        level = [row for row in rows if row.dirt == dirt]
        for part, following in zip(level, [*level[1:], *level[:1]], strict=True):
            other = "mixed" if following.vision.characters else "mixed, nothing seen"
            for kind, vision in (("true", part.vision), (other, following.vision)):
                fused = reader.fuse(part.touch, vision)
                loose = fused.is_sure_but_for(ReadingFlag.SENSES_DISAGREE)
                for key in (dirt, "all"):
                    accepted[key, kind, True].append(fused.decision is Decision.ACCEPT)
                    accepted[key, kind, False].append(loose)
    columns = [
        ("mixed", True),
        ("mixed", False),
        ("mixed, nothing seen", True),
        ("true", True),
        ("true", False),
    ]
    print(f"| dirt | {' | '.join(kind + ('' if rule else ', without the rule') for kind, rule in columns)} |")
    print(f"|---{'|---' * len(columns)}|")
    for dirt in (*SEVERITIES, "all"):
        cells = [accepted[dirt, *column] for column in columns]
        print(f"| {dirt} | {' | '.join(share(sum(cell), len(cell)) if cell else '-' for cell in cells)} |")


def main(*, parts: int = 200, seed: int = 60) -> None:
    """Read the parts, and print the table.

    Args:
        parts: number of parts, of all dirts together.
        seed: of the parts.
    """
    reader = Reader(format=FORMAT, accept_risk=0.01)
    print_table(reader, list(read_parts(reader, parts=parts, seed=seed)))


if __name__ == "__main__":
    from cyclopts import run

    run(main)

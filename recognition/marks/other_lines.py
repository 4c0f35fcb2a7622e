"""Whether another line on a part was felt: dirt beside the serial is read as text now and then, and holds a part up.

Text is struck about as deep as the serial is, and its characters' strokes lie in what is deep there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recognition.belief.part_lines import PartLines, ReadLine
from recognition.marks.strokes_felt import FeltLine


def felt_others(
    part: PartLines, main: FeltLine, *, least_depth: float = 0.25, least_felt: float = 0.5
) -> PartLines:
    """Drop unassigned lines that were not felt as marks are.

    Args:
        part: its lines.
        main: the serial's as it was felt.
        least_depth: share of the serial's depth. Of 36 second lines of the exam, at any dirt, the shallowest had 0.46
            of it.
        least_felt: share of strokes felt, mean of the characters: those lines had 0.8 at least.
    """
    if not part.others:
        return part
    least_mm = least_depth * main.places.depth_mm()
    return replace(
        part, others=tuple(one for one in part.others if _is_felt(one, main, least_mm, least_felt))
    )


def _is_felt(one: ReadLine, main: FeltLine, least_mm: float, least_felt: float) -> bool:
    lattice, columns = one.belief.open_places
    line = replace(main, line=one.line, columns=columns)
    felt = [place.felt for place in line.strokes(lattice.text, lattice) if place.felt is not None]
    return line.places.depth_mm() >= least_mm and (not felt or float(np.mean(felt)) >= least_felt)

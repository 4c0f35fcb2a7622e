"""One part, one row: what a table says of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """What is said of one part; the fields are the columns, in this order.

    Attributes:
        part: name of the part.
        text: as read; empty when nothing was.
        decision: accept, review or reject; empty with an error.
        confidence: that the whole text is right, 0 to 1.
        source: tactile, vision or fused.
        seconds: time spent, loading included.
        error: why there is no reading; empty when there is one.
        font: font whose templates answered best.
        height_mm: character height found.
        rotation_deg: of the line, from +x towards +y.
        raised: raised marks.
        flags: what to know about the reading, and what the mark lacks for the rules asked for.
        alternatives: a place's other candidates with some belief, as "3:8B 5:S", places from 1.
        depth_min_mm: depth of the mark where it is least (height of a raised one); None where it was not felt.
        depth_mean_mm: mean depth of the characters; None where it was not felt.
        depths: least and mean depth of every character, mm, as "K 0.212/0.231 7 0.198/0.220"; "?" where not felt.
        expected: the text that the part should bear; empty where none is known.
        verdict: confirmed, refuted or undecided; empty where no text was expected.
        verify_probability: that the part bears the text expected; None where none was.
        states: places that are not plainly read, as "3:confused 8/B, 5:not read, 7:mismatch 1/7" (1 for 7).
        rivals: other serials with some belief, as "KB74 0.021"; a comma between.
        grade: mark quality, A to F, of the worst character; empty where none was graded.
        grades: of every character, a letter each; "?" where too little was felt.
        action: what to do about the mark and where, as "clean 3 5, re-strike 7"; empty where nothing is.
    """

    part: str
    text: str = ""
    decision: str = ""
    confidence: float = 0.0
    source: str = ""
    seconds: float = 0.0
    error: str = ""
    font: str = ""
    height_mm: float = 0.0
    rotation_deg: float = 0.0
    raised: bool = False
    flags: str = ""
    alternatives: str = ""
    depth_min_mm: float | None = None
    depth_mean_mm: float | None = None
    depths: str = ""
    expected: str = ""
    verdict: str = ""
    verify_probability: float | None = None
    states: str = ""
    rivals: str = ""
    grade: str = ""
    grades: str = ""
    action: str = ""

"""Whether a part is like those that confidences were fitted on; believed less the further it is from them.

    confidence --part's measures within their ranges--> as it is
              \\--so many widths beyond one of them----> log odds / (1 + widths), and a finding that names it

The ranges, of all readings that fitted a calibration but the worst of a hundred, stand beside it
(`recognition.belief.calibration`). They do not grow with the size of marks: all are shares. What is better than any of
those, a smoother land, is no stranger.
"""

from __future__ import annotations

from dataclasses import replace

from recognition.belief.calibration import calibration_of, shrunk
from recognition.decision.accept import decided_anew
from recognition.decision.decide import Thresholds
from recognition.decision.flags import Finding, ReadingFlag
from recognition.decision.part_measures import Measure, measures_of
from recognition.decision.reading import Reading

GROUND = (
    Measure.UNLIKENESS,
    Measure.STROKES,
    Measure.FINE_SHARE,
    Measure.COARSE_SHARE,
    Measure.GRAIN,
    Measure.PATCHES,
)
"""Measures that have a range: what of the marks is explained and felt, the texture of land and photograph."""


def on_known_ground(reading: Reading, settings: Thresholds) -> Reading:
    """The reading, its confidence shrunk where its part is unlike those that it was fitted on.

    Args:
        reading: of one sense or both, with its relief or photograph in the trace.
        settings: thresholds of acceptance.
    """
    if not reading.characters:
        return reading
    worth, measures = calibration_of(reading.source), measures_of(reading)
    off = {name: worth.beyond(name.name, measures[name]) for name in GROUND if name in measures}
    name = max(off, key=off.__getitem__, default=None)
    if name is None or not off[name]:
        return reading
    made = replace(reading, confidence=shrunk(reading.confidence, off[name]))
    if not made.confidence < settings.accept_confidence <= reading.confidence:
        return made
    low, high = worth.ground[name.name]
    text = (
        f"unlike the parts that the reader was tried on: {name.value} {measures[name]:.2g}, "
        f"there {low:.2g} to {high:.2g} (look at the part)"
    )
    return decided_anew(made.found(Finding(ReadingFlag.LOW_CONFIDENCE, text)))

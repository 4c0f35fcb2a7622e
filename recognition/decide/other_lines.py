"""Lines beside the serial: requested ones under their formats, others without one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recognition.decide.evidence import DecisionSettings, SenseEvidence
from recognition.decide.measures import piece_nats
from recognition.decide.reading import OtherLine, Reading, with_spaces
from recognition.decide.score import Measure, log_odds, score_of
from recognition.language.constrained_decoding import choose
from recognition.language.lattice import Lattice
from recognition.recogniser.read_line import word_gaps


def lines_beside(
    sense: SenseEvidence,
    settings: DecisionSettings,
    *,
    # log probability of the serial's format on a line, below which the line is not the serial. In the exam, 41
    # second lines of six characters, under a format of eight, have -19.5 at most; their serials have -5.5 at least.
    least_serial_evidence: float = -12.0,
) -> tuple[OtherLine, ...]:
    """Lines that a sense has read beside the serial."""
    if sense.lines is None:
        return ()
    lines = list[OtherLine]()
    for name, line in sense.lines.named.items():
        if line.is_text:
            grammar = settings.line_formats[name].grammar
            decoding = choose(line.lattice, grammar)
            text = with_spaces(decoding.text, line.spaces_in(decoding.text, grammar)).rstrip()
            confidence = _confidence(sense.source, decoding.text, line.lattice, decoding.probability)
            lines.append(OtherLine(name, text, confidence, line.placed.box, line=line.line))
    for line in sense.lines.others:
        lattice, columns = line.open_places
        text = with_spaces(lattice.text, word_gaps(columns, line.looks))
        belief = float(np.exp(lattice.log_belief.max(axis=1).sum()))
        confidence = _confidence(sense.source, lattice.text, lattice, belief)
        may_be_serial = line.evidence_of(settings.grammar) >= least_serial_evidence
        lines.append(
            OtherLine("", text, confidence, lattice.box, may_be_serial=may_be_serial, line=line.line)
        )
    return tuple(lines)


def _confidence(source: str, text: str, lattice: Lattice, belief: float) -> float:
    measures = {Measure.ODDS: log_odds(belief), Measure.PIECE: piece_nats(text, lattice)}
    known = {name: value for name, value in measures.items() if value is not None}
    return score_of(source).probability(known)


def joined_lines(touch: Reading, vision: Reading) -> tuple[OtherLine, ...]:
    """The other lines of both senses, the surer one of each."""
    joined = {line.key: line for line in touch.others}
    named = {line.text for line in (*touch.others, *vision.others) if line.name}
    for line in vision.others:
        felt = joined.get(line.key)
        box = line.box if vision.unit == touch.unit else None
        if felt is None or line.confidence > felt.confidence:
            joined[line.key] = replace(line, box=box if felt is None else felt.box)
    # drop unassigned text that the other sense has read as a requested line
    return tuple(line for line in joined.values() if line.name or line.text not in named)

"""Choose the text of a part from the posteriors of its lines.

one sense:  lattice --format--> text
both:       fuse_lattices --format--> text
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from recognition.decide.choice import Choice
from recognition.decide.evidence import DecisionSettings, Evidence, SenseEvidence
from recognition.decide.fuse_lattices import fuse_lattices, odds_by_touch
from recognition.decide.other_lines import joined_lines, lines_beside
from recognition.decide.reading import Reading, characters_of
from recognition.decide.score import log_odds
from recognition.language.constrained_decoding import choose
from recognition.language.lattice import Lattice

LEAST_PLACES = 4
"""Characters, without a format, from which unsure ones count as text: a scratch is read as a 1, two dents as OO."""


def choose_text(evidence: Evidence, settings: DecisionSettings, alone: Mapping[str, Reading]) -> Choice:
    """Choose the text of a part."""
    choice, *camera = (_text_of_sense(sense, settings) for sense in evidence.senses)
    if camera:
        choice = _text_of_both(choice, camera[0], settings, alone)
    return replace(choice, alone=alone, codes=evidence.codes(scaled=choice.sense.scaled))


def _text_of_sense(sense: SenseEvidence, settings: DecisionSettings) -> Choice:
    line, grammar = sense.main, settings.grammar
    if line is None:
        return Choice((sense,))
    decoding = choose(line.lattice, grammar)
    choice = Choice((sense,), lattice=line.placed, open_lattice=line.open_places[0])
    if not decoding.text or not line.is_text:
        return choice
    unsure = decoding.probability < settings.least_score(sense.source)
    if grammar is None and len(decoding.text) < LEAST_PLACES and unsure:
        return replace(choice, open_lattice=None)
    return replace(
        choice,
        decoding=decoding,
        characters=characters_of(decoding, line.placed),
        others=lines_beside(sense, settings),
        spaces_after=line.spaces_in(decoding.text, grammar),
        odds=log_odds(decoding.probability * line.count_probability),
    )


def _text_of_both(
    felt: Choice, seen: Choice, settings: DecisionSettings, alone: Mapping[str, Reading]
) -> Choice:
    if not alone["tactile"].characters:
        return seen if alone["vision"].characters else replace(felt, decoding=None, characters=())
    open_lattice = _fused(felt.open_lattice, seen.open_lattice) or felt.open_lattice
    lattice = _fused(felt.lattice, seen.lattice)
    decoding = None if lattice is None else choose(lattice, settings.grammar)
    if lattice is None or decoding is None or not decoding.text:
        return replace(felt, open_lattice=open_lattice)
    known = None if settings.grammar is None else settings.grammar.spaces(decoding.text)
    felt_text, trace = alone["tactile"].plain_text, alone["tactile"].trace
    by_touch = None
    if trace.lattice is not None and trace.odds is not None:
        by_touch = odds_by_touch(decoding.text, felt_text, trace.lattice, trace.odds)
    return Choice(
        (felt.sense, seen.sense),
        lattice=lattice,
        open_lattice=open_lattice,
        decoding=decoding,
        characters=characters_of(decoding, lattice),
        others=joined_lines(alone["tactile"], alone["vision"]),
        spaces_after=felt.spaces_after if known is None else known,
        odds=None if felt.line is None else log_odds(decoding.probability * felt.line.count_probability),
        odds_by_touch=by_touch,
    )


def _fused(felt: Lattice | None, seen: Lattice | None) -> Lattice | None:
    if felt is None or seen is None or felt.n_places != seen.n_places:
        return None
    return fuse_lattices(felt, seen)

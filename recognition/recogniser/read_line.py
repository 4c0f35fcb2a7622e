"""Posteriors of one line: the number of places, the character at each, and the gaps between words.

    Steps of each look --places of the format--> posteriors --mean of looks--> the recogniser's lattice
    lattices of recogniser and faces --`glyph_match.combine`--> the lattice that the format decides on

Looks are much alike: their logarithms are averaged, first at each view and then over the views. The same dirt lies
under every light: counted as more than one look, a wrong serial was accepted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.display import one_line
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Way
from recognition.recogniser.ctc import PlaceBelief
from recognition.recogniser.steps import Steps
from recognition.see.places import boxes_of
from recognition.see.text_line import HEIGHT_ROWS, TextLine

Floats = NDArray[np.float64]
_LEAST = 1e-12
LEAST_PROMISE = -0.8
"""Promise per place from which a line is text. Under a format 2 of 200 photographs of bare dirty plates reach it, 1 of
104 of other things, and 1 of 150 felt plates; a drawing of clutter reaches -0.86. Without a format short marks reach it
as well; they count only if they are sure."""

AGREED, AGREED_EVIDENCE = 0.99, -1.0
"""Least probability of the best character at every place, and log probability of the format, of an agreed line."""


@dataclass(frozen=True, eq=False)
class ReadLine:
    """A line and its posteriors."""

    line: TextLine
    lattice: Lattice
    columns: Floats
    evidence: float  # log probability of all that the format allows together; 0 where nothing is known
    count_probability: float  # probability that there are so many places; 1 where a format fixes the number
    by_expert: Mapping[str, Lattice]
    looks: Sequence[Steps]
    other_ways: Mapping[Way, ReadLine | None] = field(default_factory=lambda: MappingProxyType({}))
    faces: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))

    __repr__ = one_line

    @cached_property
    def open_places(self) -> tuple[Lattice, Floats]:
        """Posteriors for the most probable number of places, of any characters, and their columns."""
        first = self.looks[:1]
        posteriors, _ = _likeliest_count(first, None)
        lattice, columns = _lattice(first, posteriors) or (self.lattice, self.columns)
        return replace(with_slip(lattice), boxes=boxes_of(self.line, columns)), columns

    @cached_property
    def placed(self) -> Lattice:
        return replace(self.lattice, boxes=boxes_of(self.line, self.columns))

    def spaces_in(self, text: str, grammar: Grammar | None) -> frozenset[int]:
        """Places of a text that a word gap follows: from the format if it fixes them, or else from the line."""
        fixed = None if grammar is None else grammar.spaces(text)
        return word_gaps(self.columns, self.looks) if fixed is None else fixed

    def with_faces(self, faces: Mapping[str, float], by_faces: Lattice, together: Lattice) -> ReadLine:
        by_expert = MappingProxyType({**self.by_expert, "templates": by_faces})
        return replace(self, lattice=together, by_expert=by_expert, faces=MappingProxyType(dict(faces)))

    def evidence_of(self, grammar: Grammar | None, *, alike: Sequence[str] = ()) -> float:
        """Log probability of all texts that a grammar allows; 0 without a grammar, -inf without room."""
        if grammar is None:
            return 0.0
        return max((log for log, _ in _by_count(self.looks, grammar, alike).values()), default=-math.inf)

    def least_read(self) -> int:
        """Place with the least probability of any known character: another sign may stand there."""
        lattice, columns = self.lattice, self.columns
        reach = 0.5 * float(np.diff(columns).min(initial=math.inf)) if lattice.n_places > 1 else math.inf
        steps = self.looks[0]
        any_char = np.logaddexp.reduce(steps.log_chars, axis=1)
        near = np.abs(steps.columns[:, None] - columns) <= reach
        return int(np.where(near, any_char[:, None], -50.0).max(axis=0).argmin())

    @property
    def is_agreed(self) -> bool:
        texts = {lattice.text for lattice in self.by_expert.values()}
        least = float(np.exp(self.lattice.log_belief.max(axis=1)).min())
        return len(texts) == 1 and least > AGREED and self.evidence > AGREED_EVIDENCE

    @property
    def advance(self) -> float:
        """Mean distance from one character to the next, character heights; 0 with fewer than three."""
        if self.columns.size < 3:
            return 0.0
        return float(self.columns[-1] - self.columns[0]) / (self.columns.size - 1) / HEIGHT_ROWS

    @property
    def promise(self) -> float:
        """Evidence of the line against a guess, nats: the sum over its places."""
        return self._promise_of(self.lattice)

    def _promise_of(self, lattice: Lattice) -> float:
        best = np.maximum(lattice.log_belief.max(axis=1, initial=-np.inf), -3.0)
        return float((best + 1.0).sum()) + max(self.evidence, -50.0) / 4.0

    @property
    def is_text(self) -> bool:
        """Whether the expert that looked at the line saw text (`LEAST_PROMISE`); templates match any dirt somehow."""
        lattice = self.by_expert[self.looks[0].expert]
        return self._promise_of(lattice) >= LEAST_PROMISE * lattice.n_places


def combine_looks(line: TextLine, looks: Sequence[Steps], grammar: Grammar | None) -> ReadLine | None:
    """Combine the recogniser's looks at a line; None where no text fits."""
    posteriors, count_probability = _likeliest_count(looks, grammar)
    averaged = _lattice(looks, posteriors)
    if averaged is None:
        return None
    lattice, columns = averaged
    evidence = 0.0 if grammar is None else _evidence(posteriors)
    by_expert = MappingProxyType({looks[0].expert: lattice})
    return ReadLine(line, with_slip(lattice), columns, evidence, count_probability, by_expert, tuple(looks))


Posteriors = Sequence[PlaceBelief | None]


def _posteriors(looks: Sequence[Steps], allowed: Sequence[str]) -> Posteriors:
    return [steps.places(allowed) for steps in looks]


def _evidence(posteriors: Posteriors) -> float:
    logs = [posterior.log_evidence for posterior in posteriors if posterior is not None]
    return float(np.mean(logs)) if logs else -math.inf


def _by_count(
    looks: Sequence[Steps],
    grammar: Grammar | None,
    alike: Sequence[str] = (),
    *,
    most_lengths: int = 6,
    least_share: float = 0.05,
) -> Mapping[int, tuple[float, Posteriors]]:
    """Log probability and posteriors of each number of characters that the format allows, or that is likely: with a
    format the evidence of the number's texts."""
    lengths = None if grammar is None else grammar.lengths()
    counts = _log_counts(looks) if lengths is None or len(lengths) > most_lengths else np.zeros(0)
    if lengths is None:
        likely = np.flatnonzero(counts > counts.max() + math.log(least_share))
        lengths = frozenset(max(int(n), 1) for n in likely)
    if counts.size:
        usual = int(np.argmax(counts))
        lengths = frozenset(sorted(lengths, key=lambda n: abs(n - usual))[:most_lengths])
    if grammar is None:
        return {n: (float(counts[n]), _posteriors(looks, (looks[0].chars,) * n)) for n in lengths}
    by_length = {
        n: _posteriors(looks, [chars + "".join(a for a in alike if set(a) & set(chars)) for chars in allowed])
        for n in lengths
        if (allowed := grammar.places(n))
    }
    return {n: (_evidence(posteriors), posteriors) for n, posteriors in by_length.items()}


def _log_counts(looks: Sequence[Steps], *, most_looks: int = 3) -> Floats:
    logs = [np.maximum(steps.count(), -50.0) for steps in looks[:most_looks]]
    most = max(log.size for log in logs)
    total = np.mean([np.pad(log, (0, most - log.size), constant_values=-50.0) for log in logs], axis=0)
    return np.asarray(total - np.logaddexp.reduce(total))


def _likeliest_count(looks: Sequence[Steps], grammar: Grammar | None) -> tuple[Posteriors, float]:
    """Posteriors for the number of characters whose likeliest text is the likeliest, and that number's probability:
    with dirt in a gap, all texts together are likelier than the text without it, none by itself."""
    by_count = _by_count(looks, grammar)
    total = 0.0 if grammar is None else np.logaddexp.reduce([log for log, _ in by_count.values()])
    if not np.isfinite(total):
        return [None] * len(looks), 0.0

    def log_text(n: int) -> float:
        log, posteriors = by_count[n]
        if (averaged := _lattice(looks, posteriors)) is None:
            return -math.inf
        belief = averaged[0].log_belief
        # that a place may be none is in the probability of the number already
        return log + float((belief.max(axis=1) - np.logaddexp.reduce(belief, axis=1)).sum())

    likeliest = max(by_count, key=log_text) if len(by_count) > 1 else next(iter(by_count))
    log, posteriors = by_count[likeliest]
    return posteriors, float(np.exp(log - total))


def with_slip(lattice: Lattice, *, slip: float = 1e-4) -> Lattice:
    """Leave some probability, `slip`, to every allowed character of a place, whatever the experts say."""
    log, allowed = lattice.log_belief, np.isfinite(lattice.log_belief)
    read = np.logaddexp.reduce(log, axis=1, keepdims=True)
    even = read + np.log(slip / np.maximum(allowed.sum(axis=1, keepdims=True), 1))
    mixed = np.where(allowed, np.logaddexp(log + math.log1p(-slip), even), -np.inf)
    return replace(lattice, log_belief=np.minimum(mixed, 0.0))


def _lattice(
    looks: Sequence[Steps], posteriors: Posteriors, *, near_steps: float = 1.0
) -> tuple[Lattice, Floats] | None:
    logs: dict[int, list[Floats]] = {}
    columns, read = [], []
    for steps, places in zip(looks, posteriors, strict=True):
        if places is None:
            continue
        frames = np.clip(places.frame, 0, steps.columns.size - 1)
        columns.append(np.interp(frames, np.arange(steps.columns.size), steps.columns))
        logs.setdefault(steps.view, []).append(places.log_belief)
        steps_at = np.arange(steps.log_blank.size)
        near = (
            np.abs(steps_at[None] - places.frame[:, None]) <= np.maximum(near_steps, places.spread)[:, None]
        )
        # a character may show half at one step and half at the next: only blanks at all of them say that none is there
        unread = np.exp(np.where(near, steps.log_blank[None], 0.0).sum(axis=1))
        read.append((1.0 - unread).clip(_LEAST, 1.0))
    if not logs:
        return None
    log = np.mean([np.mean(of_view, axis=0) for of_view in logs.values()], axis=0)
    log = log - np.logaddexp.reduce(log, axis=1)[:, None] + np.log(np.mean(read, axis=0))[:, None]
    return Lattice(tuple(looks[0].chars), np.minimum(log, 0.0)), np.asarray(np.mean(columns, axis=0))


def word_gaps(
    columns: NDArray[np.float64],
    looks: Sequence[Steps] = (),
    *,
    least_gap: float = 0.4,
    least_wide_gap: float = 0.1,
    wide_heights: float = 0.5,
    wide_ratio: float = 1.45,
) -> frozenset[int]:
    """Find the places after which there is a space: a probable one, or a wide step with a less probable one."""
    if columns.size < 3:
        return frozenset()
    step = np.diff(columns) / HEIGHT_ROWS
    usual = float(np.median(step))
    wide = (step > usual + wide_heights) & (step > wide_ratio * usual)
    believed = greatest_between(list(pairwise(columns)), looks, "gap")
    if believed is not None:
        wide = (wide & (believed > least_wide_gap)) | (believed > least_gap)
    return frozenset(int(k) for k in np.flatnonzero(wide))


def greatest_between(
    spans: Sequence[tuple[float, float]], looks: Sequence[Steps], what: Literal["gap", "small"]
) -> NDArray[np.float64] | None:
    """Find the greatest probability along each span, mean of all looks, shape (spans,); None if no look has it."""
    each = [
        [float(values[(look.columns > low) & (look.columns < high)].max(initial=0.0)) for low, high in spans]
        for look in looks
        if (values := getattr(look, what)) is not None
    ]
    return np.mean(each, axis=0) if each else None

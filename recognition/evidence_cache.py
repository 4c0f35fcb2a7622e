"""Lines looked at for what the dirt has left of them, each once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from recognition.evidence import LineEvidence, line_evidence
from recognition.search import Hypothesis, LineFit, LineSearch

OWN_SHARE, OWN_QUANTILE = 0.58, 0.75
"""Share of its ideal evidence that a quarter of the characters reaches in the mark's own font: dirt spoils some of
them, another font most. Clean gothic reaches 0.82 to 0.93, coins and roman letters 0.47 to 0.65; a font of the same
plain skeleton 0.65 to 0.84, so this only says where other hands need not be tried, not what may be accepted."""


class EvidenceCache:
    """Evidence of the lines of one edge map."""

    def __init__(
        self, search: LineSearch, *, places: Sequence[str] | None, gaps: frozenset[int] = frozenset()
    ) -> None:
        """Prepare.

        Args:
            search: of the map.
            places: characters allowed at each place of a known format, or None.
            gaps: places of that format before a word gap.
        """
        self.search, self.places, self.gaps = search, places, gaps
        self._seen: dict[tuple[Hypothesis, bool], LineEvidence | None] = {}
        self._best: tuple[float, LineFit] | None = None

    @property
    def best(self) -> LineFit | None:
        """The line with most evidence of those looked at."""
        return self._best[1] if self._best is not None else None

    def at(self, line: LineFit) -> LineEvidence | None:
        """The evidence of a line; None where nothing is left of it."""
        key = (line.hypothesis, line.raised)
        if key not in self._seen:
            self._seen[key] = line_evidence(
                line,
                self.search.image(line.hypothesis.rotation_deg),
                self.search.templates(line.hypothesis, raised=line.raised),
                self.search.edges.directions,
                places=self.places,
                gaps=self.gaps,
            )
            found = self._seen[key]
            if found is not None and (self._best is None or found.total > self._best[0]):
                self._best = (found.total, line)
        return self._seen[key]

    def own_shapes(self, line: LineFit) -> bool:
        """Whether a line that fits badly is of its font's own shapes all the same.

        Only a format can tell: where any number of characters may stand, every stroke of another font is an I.
        """
        evidence = self.at(line) if line.placed and self.places is not None else None
        return evidence is not None and self.stands(evidence)

    def better(self, one: LineFit, other: LineFit) -> LineFit:
        """Of two fits of one line, the one with more evidence: under dirt correlation alone may lose its way."""
        if self.places is None:
            return other
        first, second = (self.at(line) if line.placed else None for line in (one, other))
        if first is None or second is None:
            return one if second is None else other
        return one if first.total > second.total else other

    @staticmethod
    def stands(evidence: LineEvidence) -> bool:
        """Whether enough of the characters are what the font predicts."""
        shares = []
        for place in evidence.places:
            best = int(np.argmax(place.evidence))
            shares.append(float(place.evidence[best] / max(place.ideal[best], 1e-9)))
        return bool(shares) and float(np.quantile(shares, OWN_QUANTILE)) >= OWN_SHARE

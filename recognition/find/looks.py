"""Looks of the recogniser at lines of views: each is run once, counted, and refused at a limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from recognition.find.deadline import Deadline
from recognition.recogniser.recogniser import WIDER, posteriors
from recognition.see.text_line import TextLine
from recognition.see.view import Layers, View


class Looks:
    """Posteriors along lines, kept while a part is read; `count` runs of at most `most` until the deadline."""

    def __init__(self, *, most: int | None = None, deadline: Deadline | None = None) -> None:
        self.count, self.most = 0, most
        self.deadline = Deadline() if deadline is None else deadline
        self._posteriors: dict[tuple[object, ...], NDArray[np.float32]] = {}
        self._strip: tuple[tuple[object, ...], Layers] | None = None

    def may_look(self, *, spared: int = 0) -> bool:
        allowed = self.most is None or self.count + spared < self.most
        return allowed and not self.deadline.is_over()

    def posteriors(
        self, view: View, line: TextLine, *, wider: float = WIDER, skip_columns: int = 0
    ) -> NDArray[np.float32]:
        """(steps, 1 + CHARACTERS) log posteriors along a line whose first columns are skipped."""
        place = (view, line.centre_mm.tobytes(), line.height_mm)
        look = (*place, wider, skip_columns)
        if look not in self._posteriors:
            if self._strip is None or self._strip[0] != place:
                self._strip = place, view.strip(line)
            self.count += 1
            self._posteriors[look] = posteriors(self._strip[1][:, :, skip_columns:], wider=wider)
        return self._posteriors[look]

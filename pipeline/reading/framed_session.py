"""A stage session in another frame, such as that of a photograph with a shifted middle."""

from __future__ import annotations

from dataclasses import replace

from whisker_array.scan.session import Fitting, StageSession
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.passes import Pass


class FramedSession:
    """A `StageSession` with its own frame for orders and samples; the field of its `fitting` is in that frame."""

    def __init__(
        self,
        session: StageSession,
        *,
        x_mm: float,
        y_mm: float,
        field_mm: tuple[float, float, float, float],
    ) -> None:
        """Wrap a session.

        Args:
            x_mm: x in the stage's frame minus x in this one.
            y_mm: likewise for y.
            field_mm: (x0, y0, x1, y1) that may be scanned, in this frame.
        """
        self._session, self._x_mm, self._y_mm = session, x_mm, y_mm
        self.fitting: Fitting = replace(session.fitting, field_mm=field_mm)

    def feel(self, order: Pass) -> Sweep:
        moved = order.moved(self._x_mm, self._y_mm)
        return replace(self._session.feel(moved), plan=order.sweep_plan())

    def close(self) -> None:
        self._session.close()

"""A stage session in another frame, such as that of a photograph with a shifted middle."""

from __future__ import annotations

from dataclasses import replace

from whisker_array.scan.session import Fitting, StageSession
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.passes import Pass


class FramedSession:
    """A `StageSession` with its own frame for orders and samples.

    (x_mm, y_mm) is a place in the stage's frame minus the same in this one; (x0, y0, x1, y1) `field_mm` may be scanned,
    in this frame.
    """

    def __init__(
        self,
        session: StageSession,
        *,
        x_mm: float,
        y_mm: float,
        field_mm: tuple[float, float, float, float],
    ) -> None:
        self._session, self._x_mm, self._y_mm = session, x_mm, y_mm
        self.fitting: Fitting = replace(session.fitting, field_mm=field_mm)

    def feel(self, order: Pass) -> Sweep:
        moved = order.moved(self._x_mm, self._y_mm)
        return replace(self._session.feel(moved), plan=order.sweep_plan())

    def close(self) -> None:
        self._session.close()

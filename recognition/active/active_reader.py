"""The active reader: a pass, a look, and either a stop or the next pass.

session --feel--> passes so far --edge map--> view --a look--> beliefs --sure? worth more?--> stop
                       ^-------------------- next pass <----------------------'
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

from glyphs.surface.maps import MapError, TraceDirection
from recognition.active.active_reading import ActiveReading, PassFelt, PlaceBelief, StopReason
from recognition.decision.decide import serial_is_sure
from recognition.decision.flags import ReadingFlag
from recognition.decision.reading import Decision, Reading
from recognition.senses.touch import TactileReader
from whisker_array.scan.felt_sweep import Sweep
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import Fitting, StageSession, gathered
from whisker_array.scan.stage_error import StageError
from whisker_array.whisker.array import LINES_PER_HEIGHT, SAFE_SPEED_MM_S, SAMPLES_PER_LINE_PITCH
from whisker_array.whisker.passes import Pass

Region = tuple[float, float, float, float]


@dataclass(frozen=True)
class ActiveSettings:
    """How to feel.

    Attributes:
        budget_s: most stage seconds a part.

    Raises:
        ValueError: a budget that is not positive.
    """

    budget_s: float = 20.0

    def __post_init__(self) -> None:
        if not self.budget_s > 0.0:
            raise ValueError(f"budget_s is {self.budget_s}; it must be positive")


class ActiveReader:
    """Reads parts that lie on a stage, pass by pass."""

    def __init__(self, reader: TactileReader, settings: ActiveSettings | None = None) -> None:
        self.reader = reader
        self.settings = settings if settings is not None else ActiveSettings()

    def read(self, session: StageSession, *, region_mm: Region | None = None) -> ActiveReading:
        """Feel the part and read it; the session stays open.

        Args:
            session: with the part mounted.
            region_mm: (x0, y0, x1, y1) around the line, where that is known; plate frame.
        """
        fitting = session.fitting
        region = region_mm if region_mm is not None else fitting.field_mm
        felt: list[Sweep] = []
        passes: list[PassFelt] = []
        reading = _nothing()
        spent, stop, problem = 0.0, StopReason.ALL_FELT, ""
        for order in _ladder(fitting, region):
            if spent + order.stage_s > self.settings.budget_s:
                stop = StopReason.BUDGET
                break
            try:
                felt.append(session.feel(order))
            except StageError as error:
                stop, problem = StopReason.STAGE_FAILED, str(error)
                break
            spent += order.stage_s
            start = time.process_time()
            reading = self._read(fitting, felt)
            passes.append(_felt(order, spent, time.process_time() - start, reading))
            if serial_is_sure(reading):
                stop = StopReason.SURE
                break
        return ActiveReading(reading, tuple(passes), stop, problem, scan_of(fitting, felt) if felt else None)

    def _read(self, fitting: Fitting, felt: list[Sweep]) -> Reading:
        try:
            return self.reader.read_scan(scan_of(fitting, felt))
        except MapError:
            return _nothing()


def scan_of(fitting: Fitting, felt: list[Sweep]) -> Scan:
    """The passes felt so far as one scan."""
    line_pitch_mm = fitting.height_mm / LINES_PER_HEIGHT
    return Scan(
        sweeps=gathered(felt),
        touch=fitting.touch,
        line_pitch_mm=line_pitch_mm,
        sample_rate_hz=SAFE_SPEED_MM_S / line_pitch_mm,
        calibration=fitting.calibration,
        part_id=fitting.part_id,
        fidelity=fitting.fidelity,
    )


def _ladder(fitting: Fitting, region: Region) -> Iterator[Pass]:
    """Passes along x, forward and back in turns, each between those before it."""
    x0, y0, x1, y1 = region
    array, height = fitting.array, fitting.height_mm
    pitch = height / LINES_PER_HEIGHT / SAMPLES_PER_LINE_PITCH
    tall = array.n_whiskers * array.pitch_mm
    blocks = max(1, round((y1 - y0) / tall + 0.49))
    top = 0.5 * (y0 + y1) - 0.5 * blocks * tall
    for k in range(20):
        share = _between(k)
        for direction in (TraceDirection.FORWARD_X, TraceDirection.BACK_X):
            for block in range(blocks):
                first = top + block * tall + share * array.pitch_mm
                yield Pass(
                    direction=direction,
                    line_mm=tuple(first + array.pitch_mm * i for i in range(array.n_whiskers)),
                    along_mm=(x0, x1),
                    sample_pitch_mm=pitch,
                    speed_mm_s=min(10.0 * height, SAFE_SPEED_MM_S),
                    lead_mm=0.3 * height,
                )


def _between(k: int) -> float:
    """0, 1/2, 1/4, 3/4, 1/8 ...: each as far from those before it as can be (van der Corput)."""
    share, bit = 0.0, 0.5
    while k:
        share += bit * (k & 1)
        k, bit = k >> 1, bit / 2
    return share


def _nothing() -> Reading:
    return Reading((), Decision.REJECT, 0.0, ReadingFlag.NO_CHARACTERS)


def _felt(order: Pass, stage_s: float, thought_s: float, reading: Reading) -> PassFelt:
    places = []
    for c in reading.characters:
        middle = (0.5 * (c.box.x0_mm + c.box.x1_mm), 0.5 * (c.box.y0_mm + c.box.y1_mm))
        rival = c.candidates[1].char if len(c.candidates) > 1 else ""
        places.append(PlaceBelief(c.char, c.confidence, rival, middle))
    return PassFelt(
        order, stage_s, thought_s, text=reading.text, confidence=reading.confidence, places=tuple(places)
    )

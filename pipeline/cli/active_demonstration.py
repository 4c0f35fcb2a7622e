"""Active touch at work: a dirty part is felt pass by pass until its serial is sure, and shown as an animation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from glyphs.soiling.soiled import Soiling
from glyphs.surface.maps import EdgeMap, MapError
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.plots.active_animation import FeltPart, save_animation
from pipeline.reading.simulated_scan import open_session
from recognition.active.active_reader import scan_of
from recognition.active.active_reading import ActiveReading
from recognition.active.replay import read_kept
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.views.levelling import level
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.session import Fitting
from whisker_array.scan.sweep import Sweep

FORMAT, HEIGHT_MM, SEVERITY, BUDGET_S = "AA999999", 5.0, 0.5, 60.0
_SEED, _NUMBER = 11, 2


@dataclass(frozen=True, eq=False)
class ActiveDemo:
    """What came of it.

    Attributes:
        truth: as stamped.
        found: the reading, and the way to it.
        animation: the moving picture.
        still: its last frame.
    """

    truth: str
    found: ActiveReading
    animation: Path
    still: Path


def run_active_demo(animation: Path) -> ActiveDemo:
    """Make a dirty part, feel it pass by pass, and write the animation and, beside it, its last frame.

    Raises:
        FileError: they cannot be written.
    """
    spec = SynthSpec(FORMAT, seed=_SEED, height_mm=HEIGHT_MM, soiling=Soiling(severity=SEVERITY))
    part = make_part(spec, _NUMBER)
    reader = Reader(format=FORMAT, fonts=(spec.font,), height_mm=HEIGHT_MM, orientation=Orientation.UPRIGHT)
    session = open_session(part.height_map, height_mm=HEIGHT_MM, soil=part.soil, sensor_seed=_SEED)
    try:
        found = read_kept(reader.touch, session, budget_s=BUDGET_S)
    finally:
        session.close()
    assert found.scan is not None
    assert found.scan.log is not None
    sweeps = [p.sweep for p in found.scan.log.passes]
    edges = [_edges(session.fitting, sweeps[: k + 1]) for k in range(len(sweeps))]
    still = animation.with_name(f"{animation.stem}-still.png")
    felt = FeltPart(level(part.height_map), found, edges, sure_from=reader.settings.accept_confidence)
    save_animation(felt, animation, still=still)
    return ActiveDemo(part.text, found, animation, still)


def _edges(fitting: Fitting, felt: list[Sweep]) -> EdgeMap | None:
    try:
        return edge_map(scan_of(fitting, felt))
    except MapError:
        return None

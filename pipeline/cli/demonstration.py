"""Demonstrations: plates stamped, scanned and read; the service at work; active touch as an animation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from glyphs.part import stamp
from glyphs.soiling.soiled import Soiling
from glyphs.stamping.faces import Face
from glyphs.surface.maps import EdgeMap, MapError
from pipeline.benchmark.report.charts import inlined
from pipeline.benchmark.report.page import write_page
from pipeline.common.records import PartRecord, PartState
from pipeline.common.texts import same_text
from pipeline.formats.lead_in import calibrate_scan
from pipeline.formats.npz import write_npz
from pipeline.formats.synth import SynthSpec, make_part, write_part
from pipeline.plots.active_animation import FeltPart, save_animation
from pipeline.plots.pictures import SheetPart, overview_figure, save_figure
from pipeline.reading.simulated_scan import feel, open_session
from pipeline.service.client import Client
from recognition.active.active_reader import scan_of
from recognition.active.active_reading import ActiveReading
from recognition.active.replay import read_kept
from recognition.decision.picture import reading_figure
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.views.levelling import level
from whisker_array.estimation.edges import edge_map
from whisker_array.scan.recording import load_scan, save_calibration, save_scan
from whisker_array.whisker.array import default_plan

_SEED = 2024
FORMAT = "AA999999"
SEVERITIES = (0.0, 0.2, 0.5, 0.7, 0.9, 1.0)
"""Severity of the dirt on each part that the service reads."""
_SERVED_SEED, _FELT_NUMBER, _BUDGET_S = 11, 2, 60.0


@dataclass(frozen=True)
class DemoPart:
    """One plate of the demonstration."""

    name: str
    text: str
    font: str
    face: Face
    height_mm: float
    raised: bool = False
    rotation_deg: float = 0.0


DEMO_PARTS = (
    DemoPart("flat-gothic", "KX407251", "gothic", Face.FLAT, 5.0),
    DemoPart("sharp-turned", "8B3S0D26", "gothic", Face.SHARP, 5.0, rotation_deg=2.0),
    DemoPart("round-roman", "TA19R645", "timesr", Face.ROUND, 7.0),
    DemoPart("raised", "HM52G793", "futural", Face.FLAT, 5.0, raised=True),
)


def read_plates(folder: Path) -> Iterator[SheetPart]:
    """Stamp, scan, record, calibrate and read the plates, one by one; their files are written into the folder.

    The reader knows neither font nor height, only that a serial has eight letters or figures.

    Raises:
        FileError: a file cannot be written.
    """
    reader = Reader(format="********", orientation=Orientation.UPRIGHT)
    for number, demo in enumerate(DEMO_PARTS):
        part = stamp(
            demo.text, font=demo.font, height_mm=demo.height_mm, face=demo.face,
            line_rotation_deg=demo.rotation_deg, raised=demo.raised, seed=(_SEED, number),
        )  # fmt: skip
        write_npz(folder / f"{demo.name}.npz", part.height_map)
        plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=part.height_mm)
        scan = feel(
            part.height_map,
            plan=plan,
            height_mm=part.height_mm,
            sensor_seed=_SEED + number,
            part_id=demo.name,
        )
        recording = folder / f"{demo.name}.h5"
        save_scan(scan, recording)
        save_calibration(recording, calibrate_scan(scan).calibration)
        reading = reader.read(load_scan(recording)).with_trace(height_map=level(part.height_map))
        yield SheetPart(demo.name, demo.text, reading)


def draw_plates(parts: list[SheetPart], folder: Path) -> tuple[Path, Path]:
    """Draw the overview and write a page that needs nothing beside it; return both files.

    Raises:
        FileError: a file cannot be written.
    """
    overview, page = folder / "overview.png", folder / "overview.html"
    save_figure(overview_figure(parts), overview)
    shown = [(part, inlined(reading_figure(part.reading, title=part.name), kind="jpg")) for part in parts]
    write_page(page, "demo.html.j2", title="Serials read by touch", parts=shown)
    return overview, page


@dataclass(frozen=True)
class ServedPart:
    """One part that the service has read.

    Attributes:
        name: of its files.
        truth: as stamped.
        dirt: severity.
        by_camera: the answer to its photograph.
        by_touch: the answer to its scan; None where the camera was sure.
    """

    name: str
    truth: str
    dirt: float
    by_camera: PartRecord
    by_touch: PartRecord | None = None

    @property
    def last(self) -> PartRecord:
        """The part as it stands."""
        return self.by_touch if self.by_touch is not None else self.by_camera

    @property
    def accepted_wrong(self) -> bool:
        """True if the service accepted a wrong serial."""
        return self.last.state is PartState.ACCEPTED and not same_text(self.last.text, self.truth)


def make_dirty_parts(folder: Path) -> dict[str, tuple[str, float]]:
    """Make a part with its photograph for every severity; return text and severity by name.

    Raises:
        FileError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for number, severity in enumerate(SEVERITIES):
        spec = SynthSpec(format=FORMAT, seed=_SERVED_SEED, soiling=Soiling(severity=severity))
        text = write_part(spec, folder / f"part-{number}", number, photos=True)
        made[f"part-{number}"] = (text, severity)
    return made


def serve_parts(client: Client, made: dict[str, tuple[str, float]], folder: Path) -> Iterator[ServedPart]:
    """Send each part's photograph to the service, and have it touched where the camera is unsure.

    Raises:
        ServiceError: the service refuses a part.
    """
    for name, (truth, severity) in made.items():
        by_camera = client.read(photo=folder / f"{name}.png", name=name)
        needed = by_camera.state is PartState.TOUCH_NEEDED
        yield ServedPart(name, truth, severity, by_camera, client.touch(by_camera.id) if needed else None)


def animate_active_touch(animation: Path) -> tuple[str, ActiveReading, Path]:
    """Feel a dirty part pass by pass, and write the animation and, beside it, its last frame.

    Returns:
        Text as stamped, the reading with its passes, and the file of the last frame.

    Raises:
        FileError: a file cannot be written.
    """
    spec = SynthSpec(FORMAT, seed=_SERVED_SEED, height_mm=5.0, soiling=Soiling(severity=0.5))
    part = make_part(spec, _FELT_NUMBER)
    height_mm = spec.height_mm
    reader = Reader(format=FORMAT, fonts=(spec.font,), height_mm=height_mm, orientation=Orientation.UPRIGHT)
    session = open_session(part.height_map, height_mm=height_mm, soil=part.soil, sensor_seed=_SERVED_SEED)
    try:
        found = read_kept(reader.touch, session, budget_s=_BUDGET_S)
    finally:
        session.close()
    assert found.scan is not None
    assert found.scan.log is not None
    sweeps = [p.sweep for p in found.scan.log.passes]

    def edges(passes: int) -> EdgeMap | None:
        try:
            return edge_map(scan_of(session.fitting, sweeps[:passes]))
        except MapError:
            return None

    still = animation.with_name(f"{animation.stem}-still.png")
    shown = FeltPart(
        level(part.height_map),
        found,
        [edges(k + 1) for k in range(len(sweeps))],
        sure_from=reader.settings.accept_confidence,
    )
    save_animation(shown, animation, still=still)
    return part.text, found, still

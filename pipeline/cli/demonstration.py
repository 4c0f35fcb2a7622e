"""The demonstration: a few plates are stamped, scanned with noisy whiskers, recorded, calibrated and read."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from glyphs.atomic import replacing
from glyphs.part import Part, stamp
from glyphs.stamping.faces import Face
from pipeline.common.texts import same_text
from pipeline.formats.lead_in import calibrate_scan
from pipeline.formats.npz import write_npz
from pipeline.plots.pictures import SheetPart, overview_figure, save_figure
from pipeline.reading.simulated_scan import feel
from recognition.decision.picture import reading_figure
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.views.levelling import level
from whisker_array.scan.recording import load_scan, save_calibration, save_scan
from whisker_array.scan.scan import Scan
from whisker_array.whisker.array import default_plan

_SEED = 2024


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


@dataclass(frozen=True, eq=False)
class DemoResult:
    """What came of it.

    Attributes:
        parts: every plate as it was read.
        overview: the picture.
        page: the self-contained page.
    """

    parts: tuple[SheetPart, ...]
    overview: Path
    page: Path

    @property
    def all_right(self) -> bool:
        """Whether every serial was read as stamped."""
        return all(same_text(p.reading.text, p.truth) for p in self.parts)


def run_demo(
    folder: Path,
    *,
    on_part: Callable[[SheetPart], None] | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> DemoResult:
    """Make, scan, calibrate and read the plates; write them, an overview and a page into the folder.

    The reader knows neither font nor height, only that a serial has eight letters or figures.

    Args:
        folder: for all of it.
        on_part: called with each plate once it is read.
        say: called with what is done next, in words.

    Raises:
        FileError: the folder or a recording cannot be written.
    """
    reader = Reader(format="********", orientation=Orientation.UPRIGHT)
    done = []
    for number, demo in enumerate(DEMO_PARTS):
        say(f"{demo.name}: stamping and scanning ...")
        part = _stamped(demo, number)
        write_npz(folder / f"{demo.name}.npz", part.height_map)
        scan = _recorded(part, folder / f"{demo.name}.h5", number)
        say(f"{demo.name}: reading ...")
        reading = reader.read(scan).with_trace(height_map=level(part.height_map))
        done.append(SheetPart(demo.name, demo.text, reading))
        if on_part is not None:
            on_part(done[-1])
    say("drawing the overview and the page ...")
    overview, page = folder / "overview.png", folder / "overview.html"
    save_figure(overview_figure(done), overview)
    with replacing(page) as temporary:
        temporary.write_text(_page(done), encoding="utf-8")
    return DemoResult(tuple(done), overview, page)


def _stamped(demo: DemoPart, number: int) -> Part:
    return stamp(
        demo.text,
        font=demo.font,
        height_mm=demo.height_mm,
        face=demo.face,
        line_rotation_deg=demo.rotation_deg,
        raised=demo.raised,
        seed=(_SEED, number),
    )


def _recorded(part: Part, path: Path, number: int) -> Scan:
    """Scan the part, record the raw moments, calibrate the recording and load it again."""
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=part.height_mm)
    scan = feel(
        part.height_map, plan=plan, height_mm=part.height_mm, sensor_seed=_SEED + number, part_id=path.stem
    )
    save_scan(scan, path)
    save_calibration(path, calibrate_scan(scan).calibration)
    return load_scan(path)


_STYLE = (
    "body{font:16px/1.5 sans-serif;max-width:75rem;margin:2rem auto;padding:0 1rem;color:#222}"
    "img{max-width:100%;border:1px solid #ccc}td,th{padding:.2rem 1rem .2rem 0;text-align:left}"
    ".wrong{color:#b00}.right{color:#070}code{font-size:1.1em}"
)


def _page(parts: list[SheetPart]) -> str:
    """One HTML file with its pictures inside."""
    rows, pictures = [], []
    for part in parts:
        reading = part.reading
        verdict = "right" if same_text(reading.text, part.truth) else "wrong"
        cells = (
            html.escape(part.name),
            f"<code>{html.escape(part.truth)}</code>",
            f"<code>{html.escape(reading.text)}</code>",
            f'<span class="{verdict}">{verdict}</span>',
            reading.decision.value,
            f"{reading.confidence:.3f}",
            html.escape(reading.font),
            f"{reading.height_mm:.2f} mm",
        )
        rows.append("<tr>" + "".join(f"<td>{c}</td>" for c in cells) + "</tr>")
        pictures.append(_inline(part))
    headings = ("part", "stamped", "read", "", "decision", "confidence", "font", "height")
    head = "".join(f"<th>{h}</th>" for h in headings)
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>tactile-marks: demo</title>'
        f"<style>{_STYLE}</style></head><body><h1>Serials read by touch</h1>"
        "<p>Every plate was stamped with the variation of a shop, scanned by a simulated whisker array with "
        "noisy sensors, recorded, calibrated and read without knowing font or size.</p>"
        f"<table><tr>{head}</tr>{''.join(rows)}</table>{''.join(pictures)}</body></html>\n"
    )


def _inline(part: SheetPart) -> str:
    stream = io.BytesIO()
    reading_figure(part.reading, title=part.name).savefig(stream, format="png")
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    name = html.escape(part.name)
    return f'<h2>{name}</h2><img alt="{name}" src="data:image/png;base64,{data}">'

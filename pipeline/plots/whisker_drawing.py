"""Draw the whisker for a workshop: side view and section to scale, with dimensions, as DXF or SVG.

        |<----------- l1 c ----------->|
                               ,-'---- o clamp   --- ---
                        ,-'   beta     . sensor   | l3  |
   ---  ,-'- - - - - - - - - - - - - - -  ---    ---    | height of the clamp over the land
l2  |   |                                               |
   ---  '__________________ land ______________________---
"""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.atomic import replacing
from pipeline.common.output_paths import check_writable
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace

    from pipeline.formats.whisker_file import WhiskerFile

_SUFFIXES = (".dxf", ".svg")
_SECTION_SCALE = 10.0
Point = tuple[float, float]


def check_drawing(path: Path) -> None:
    """Check, before the work starts, that a drawing can be written. Raises FileError: it cannot, or the suffix is
    unknown. ModuleNotFoundError: ezdxf is not installed (extra `drawing`)."""
    import_module("ezdxf")
    check_writable(path, _SUFFIXES)


def save_drawing(whisker: WhiskerFile, path: Path) -> None:
    """Write the drawing; the file appears whole or not at all. Errors are those of `check_drawing`."""
    check_drawing(path)
    drawing = whisker_drawing(whisker)
    with replacing(path) as temporary:
        if path.suffix.lower() == ".dxf":
            drawing.saveas(temporary)
        else:
            temporary.write_text(_svg(drawing), encoding="utf-8")


def whisker_drawing(whisker: WhiskerFile) -> Drawing:
    """Draw in millimetres, land at y = 0, the force-free tip at x = 0, the clamp at its height during a scan."""
    from ezdxf import units
    from ezdxf.filemanagement import new

    shape, touch = whisker.whisker, whisker.touch
    l1, l2, l3 = shape.l1_mm, shape.l2_mm, shape.lowered_mm
    run, rise = l1 * math.cos(shape.beta_rad), l1 * math.sin(shape.beta_rad)
    size = 0.04 * l1  # text height: the arm of an L may be as short as a tenth of l1
    drawing = new("R2010", setup=["linetypes", "styles"], units=units.MM)
    drawing.dimstyles.new(
        "mm",
        dxfattribs={
            "dimtxt": size, "dimasz": 0.6 * size, "dimexo": 0.4 * size, "dimexe": 0.4 * size, "dimgap": 0.3 * size,
            "dimtad": 1, "dimtih": 0, "dimtoh": 0, "dimdec": 2, "dimadec": 2,
            "dimdsep": ord("."), "dimzin": 0, "dimazin": 0,
            "dimtxsty": "OpenSans",
        },
    )  # fmt: skip
    space = drawing.modelspace()
    tip = (0.0, -touch.preload_mm)
    elbow = (0.0, tip[1] + l2)
    clamp, sensor = (run, elbow[1] + rise), (run, elbow[1] + rise - l3)
    _side_view(space, shape, tip, elbow, clamp, sensor, size=size)
    space.add_linear_dim((0.0, clamp[1] + 4.0 * size), elbow, clamp, dimstyle="mm").render()
    if rise > 0.0:
        level = (run, elbow[1])
        space.add_aligned_dim(elbow, clamp, distance=1.8 * size, text="l1 <>", dimstyle="mm").render()
        space.add_angular_dim_3p(
            (0.5 * run, elbow[1]), center=elbow, p1=level, p2=clamp, text="β <>", dimstyle="mm"
        ).render()
        dashes = {"linetype": "DASHDOT", "ltscale": 0.2 * size}
        space.add_line(elbow, (0.85 * run, elbow[1]), dxfattribs=dashes)
    far, below = run + 7.0 * size, min(tip[1], 0.0)
    for name, x, low, high in (
        ("l2", -3.0 * size, tip, elbow),
        ("l3", far, sensor, clamp),
        ("base", far + 4.0 * size, (run, 0.0), clamp),
        ("preload", -7.0 * size, tip, (0.0, 0.0)),
    ):
        if low[1] == high[1]:
            continue
        # horizontal labels above or below: the shortest of these dimensions is shorter than its label
        words = (x, high[1] + 1.2 * size) if name.startswith("l") else (x, low[1] - 1.8 * size)
        space.add_linear_dim(
            (x, 0.0), low, high, angle=90.0, text=f"{name} <>", location=words, text_rotation=0.0, dimstyle="mm",
            override={"dimtmove": 2},
        ).render()  # fmt: skip
    notes = _section_view(space, shape, (0.0, below - 9.0 * size), size=size)
    for k, line in enumerate(
        (
            f"{shape.material.name}, E {shape.material.e_mpa / 1000.0:.0f} GPa",
            f"tip radius {touch.tip_radius_mm:.3f} mm, preload {touch.preload_mm:.3f} mm below the land",
            f"characters {whisker.character_height_mm:g} mm, up to {whisker.speed_mm_s:.0f} mm/s, traced to the right",
            f"dimensions in mm, of the whisker's centre line; section {_SECTION_SCALE:g}:1",
        )
    ):
        _text(space, line, (notes, below - (6.0 + 1.8 * k) * size), size)
    return drawing


def _side_view(
    space: Modelspace, shape: LShaped, tip: Point, elbow: Point, clamp: Point, sensor: Point, *, size: float
) -> None:
    line = [tip, elbow, clamp] if elbow != tip else [tip, clamp]
    thickness_mm = 2.0 * shape.segments()[0].section_at(0.0).c_vertical_mm
    space.add_lwpolyline(line, dxfattribs={"const_width": thickness_mm})
    end = clamp[0] + 3.0 * size
    space.add_line((-2.0 * size, 0.0), (end, 0.0), dxfattribs={"linetype": "CONTINUOUS"})
    _text(space, "land", (clamp[0] + 0.5 * size, -1.4 * size), size)
    low, top = clamp[1] - size, clamp[1] + size
    corners = _box(space, (clamp[0], low), (end, top))
    hatch = space.add_hatch()
    hatch.set_pattern_fill("ANSI31", scale=0.08 * size)
    hatch.paths.add_polyline_path(corners, is_closed=True)
    # the sensor with its axis, on a bracket that holds it below, or above, the clamp
    space.add_circle(sensor, 0.3 * size)
    axis = {"linetype": "DASHDOT", "ltscale": 0.2 * size}
    for dx, dy in ((0.8 * size, 0.0), (0.0, 0.8 * size)):
        space.add_line((sensor[0] - dx, sensor[1] - dy), (sensor[0] + dx, sensor[1] + dy), dxfattribs=axis)
    _text(space, "sensor axis", (sensor[0] - 6.0 * size, sensor[1] + 0.4 * size), 0.8 * size)
    if sensor != clamp:
        out, edge = clamp[0] + size, low if sensor[1] < clamp[1] else top
        bracket = [(end, edge), (end, sensor[1]), (sensor[0] + 0.3 * size, sensor[1])]
        bracket += [(sensor[0] + 0.3 * size, sensor[1] + math.copysign(0.3 * size, edge - sensor[1]))]
        bracket += [(out, bracket[-1][1]), (out, edge)]
        if abs(edge - sensor[1]) > 0.3 * size:
            space.add_lwpolyline(bracket, close=True)


def _section_view(space: Modelspace, shape: LShaped, start: Point, *, size: float) -> float:
    section = shape.section
    dimensions: dict[str, Any] = {"dimstyle": "mm", "override": {"dimlfac": 1.0 / _SECTION_SCALE}}
    if isinstance(section, Rectangle):
        right, half = (
            start[0] + _SECTION_SCALE * section.width_mm,
            0.5 * _SECTION_SCALE * section.thickness_mm,
        )
        high = start[1] + half
        corners = _box(space, (start[0], start[1] - half), (right, high))
        above, left = (0.0, high + 2.0 * size), (start[0] - 2.0 * size, 0.0)
        space.add_linear_dim(above, corners[3], corners[2], **dimensions).render()
        space.add_linear_dim(left, corners[0], corners[3], angle=90.0, **dimensions).render()
        return right + 3.0 * size
    if isinstance(section, Round):
        wide = _SECTION_SCALE * section.diameter_mm
        space.add_circle((start[0] + 0.5 * wide, start[1]), 0.5 * wide)
        above = (0.0, start[1] + 0.5 * wide + 2.0 * size)
        space.add_linear_dim(above, start, (start[0] + wide, start[1]), text="⌀ <>", **dimensions).render()
        return start[0] + wide + 3.0 * size
    return start[0]


def _box(space: Modelspace, low: Point, high: Point) -> list[Point]:
    corners = [low, (high[0], low[1]), high, (low[0], high[1])]
    space.add_lwpolyline(corners, close=True)
    return corners


def _text(space: Modelspace, text: str, place: Point, size: float) -> None:
    space.add_text(text, height=size, dxfattribs={"style": "OpenSans"}).set_placement(place)


def _svg(drawing: Drawing) -> str:
    from ezdxf.addons.drawing import layout
    from ezdxf.addons.drawing.config import BackgroundPolicy, ColorPolicy, Configuration
    from ezdxf.addons.drawing.frontend import Frontend
    from ezdxf.addons.drawing.properties import RenderContext
    from ezdxf.addons.drawing.svg import SVGBackend

    backend = SVGBackend()
    config = Configuration(background_policy=BackgroundPolicy.WHITE, color_policy=ColorPolicy.BLACK)
    Frontend(RenderContext(drawing), backend, config=config).draw_layout(drawing.modelspace())
    page = layout.Page(0, 0, layout.Units.mm, margins=layout.Margins.all(5))
    return str(backend.get_string(page, settings=layout.Settings(scale=3.0)))

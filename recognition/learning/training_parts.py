"""Draw random parts for training: font, text, die, plate, practice, soil and touch, without those kept for exams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from glyphs.camera.appearance import draw_light
from glyphs.camera.photo import Photo
from glyphs.camera.pose import draw_camera
from glyphs.fonts.dots import dotted_font
from glyphs.fonts.glyph import Font, transform_glyph
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.part import Part, stamp
from glyphs.stamping.dies import DIES
from glyphs.stamping.layouts import Layout
from glyphs.stamping.plates import PLATES
from recognition.learning.parametric_face import draw_face, draw_style
from recognition.learning.training_fonts import has_small_letters
from recognition.recogniser.recogniser import CHARACTERS
from recognition.see.levelling import level
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import SensorChain, draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import ALL_DIRECTIONS, RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import Touch, default_touch

SOILS_LEARNED = ("workshop", "caked", "rust", "paint", "wear", "casting")
_CAPITALS, _FIGURES, _SMALL, _SIGNS = CHARACTERS[:26], CHARACTERS[26:36], CHARACTERS[36:62], CHARACTERS[62:69]
_PRACTICES = ("press", "hand")
_PHOTOS = 6
"""Photographs of a part; together they take a quarter of the time of its scan."""
_DOTTED = 0.25
"""Share of parts with a dotted font: these are the hardest to read."""


@dataclass(frozen=True, eq=False)
class TrainingPart:
    """A part with photographs and a scan, by a plan for a character height that may be wrong."""

    part: Part
    layout: Layout
    scan: Scan
    photos: tuple[Photo, ...]


def draw_text(font: Font, rng: np.random.Generator) -> str:
    """Draw a short text of a font's characters: a serial, a word or a number, often with signs or spaces."""
    length = int(rng.integers(3, 12))
    every = _CAPITALS + _FIGURES + (_SMALL if has_small_letters(font) else "")
    pools = (_CAPITALS + _FIGURES, _FIGURES, _CAPITALS, every)
    pool = str(rng.choice(pools, p=(0.5, 0.15, 0.1, 0.25)))
    chars = [str(c) for c in rng.choice(list(pool), length)]
    if rng.random() < 0.35:
        for _ in range(int(rng.integers(1, 4))):
            place = int(rng.integers(1, len(chars)))
            chars.insert(place, str(rng.choice(list(_SIGNS + "   "))))
    text = " ".join("".join(c for c in chars if c == " " or c in font.glyphs).split())
    if not any(c in _CAPITALS + _FIGURES for c in text):
        text += str(rng.choice(list(_CAPITALS)))
    return text


def draw_font(
    fonts: Sequence[Path], rng: np.random.Generator, *, builtin: float = 0.2, parametric: float = 0.3
) -> Font:
    """Draw a built-in font, a parametric face, or the font of a file. Raises FontError."""
    if rng.random() < builtin:
        return load_font(str(rng.choice(BUILTIN_FONTS)))
    if rng.random() < parametric:
        return draw_face(draw_style(rng))
    return load_font(fonts[int(rng.integers(len(fonts)))])


def draw_part(
    fonts: Sequence[Path],
    rng: np.random.Generator,
    *,
    soils: Sequence[str] = SOILS_LEARNED,
    wider: float = 0.15,
) -> TrainingPart:
    """Stamp, soil, scan and photograph a random part. Raises MarksError if it is impossible: draw again."""
    dotted = rng.random() < _DOTTED
    font = draw_font(fonts, rng, builtin=0.5 if dotted else 0.2)
    text = draw_text(font, rng)
    if dotted and (font.name not in BUILTIN_FONTS or rng.random() < 0.4):
        font = dotted_font(font, text, rng=rng)
    else:
        font = _widen(font, text, float(np.exp(rng.normal(0.0, wider))))
    height_mm = float(np.exp(rng.uniform(np.log(2.0), np.log(12.0))))
    die = "dotted" if dotted else str(rng.choice([die for die in DIES if die != "dotted"]))
    severity = 0.0 if rng.random() < 0.12 else float(rng.uniform(0.1, 1.0))
    many = 2 if rng.random() < 0.15 else 1
    layout = _draw_layout(font, text, height_mm, rng)
    part = stamp(
        text,
        fonts=font,
        height_mm=height_mm,
        pitch_mm=height_mm / float(rng.uniform(50.0, 75.0)),
        die=die,
        plate=str(rng.choice(list(PLATES))),
        practice=str(rng.choice(_PRACTICES)),
        layout=layout,
        raised=bool(rng.random() < 0.15),
        dirt=severity,
        soil=[str(s) for s in rng.choice(soils, many, replace=False)],
        seed=int(rng.integers(2**31)),
    )  # fmt: skip
    scan, photos = _trace(part, rng), []
    for _ in range(_PHOTOS):
        pixel_mm = height_mm / float(np.exp(rng.uniform(np.log(18.0), np.log(50.0))))
        light = draw_light(rng)
        photos.append(part.photograph(light=light, camera=draw_camera(rng, pitch_mm=pixel_mm)))
    return TrainingPart(part, layout, scan, tuple(photos))


def _widen(font: Font, text: str, x_scale: float) -> Font:
    have = {char: transform_glyph(font.glyph(char), x_scale=x_scale) for char in set(text)}
    return replace(font, glyphs={**font.glyphs, **have})


def _draw_layout(font: Font, text: str, height_mm: float, rng: np.random.Generator) -> Layout:
    straight = Layout(turned_deg=float(rng.normal(0.0, 2.0)))
    kind = rng.random()
    if kind < 0.12:
        side = 1.0 if rng.random() < 0.5 else -1.0
        radius_mm = max(5.0 * height_mm, float(rng.uniform(0.55, 1.5)) * height_mm * len(text))
        return replace(straight, radius_mm=side * radius_mm)
    if kind >= 0.3:
        return straight
    other, above = draw_text(font, rng)[: len(text)].strip() or "7", bool(rng.random() < 0.5)
    return replace(straight, other_text=other, other_above=above, gap=float(rng.uniform(0.2, 0.8)))


def _trace(part: Part, rng: np.random.Generator, *, pointwise: float = 0.4) -> Scan:
    # pointwise: share of scans by the pointwise map, which takes a fifth of the time of contact.
    surface = level(part.height_map)
    believed_mm = part.height_mm * float(np.exp(rng.normal(0.0, 0.2)))
    touch = draw_touch(believed_mm, rng)
    lines = 40 if rng.random() < 0.5 else int(np.exp(rng.uniform(np.log(10.0), np.log(40.0))))
    count = 4 if rng.random() < 0.6 else int(rng.integers(1, 4))
    directions = tuple(ALL_DIRECTIONS[i] for i in sorted(rng.permutation(len(ALL_DIRECTIONS))[:count]))
    pitch_mm = believed_mm / lines
    plan = RasterPlan(
        array=WhiskerArray(n_whiskers=8, pitch_mm=pitch_mm * max(1, lines // 2)),
        region_mm=(0.0, 0.0, *surface.size_mm),
        line_pitch_mm=pitch_mm,
        sample_pitch_mm=pitch_mm / 2,
        directions=directions,
        speed_mm_s=20.0,
        lead_mm=0.3 * believed_mm,
    )
    fidelity = Fidelity.POINTWISE if rng.random() < pointwise else Fidelity.CONTACT
    sensor = _draw_sensors(touch, plan.array.n_whiskers, rng)
    return trace_scan(
        surface, touch=touch, plan=plan, fidelity=fidelity, soil=part.soil, sensor=sensor, rng=rng
    )


def draw_touch(height_mm: float, rng: np.random.Generator, *, usual: float = 0.4, worn: float = 0.4) -> Touch:
    """Draw a whisker and its preload for characters of a height; a share of touches has the `usual` whisker."""
    touch = default_touch(height_mm)
    # the others range from nearly straight ones to feet of a third of the beam, with sensors from the clamp down to
    # the foot, at preloads of half to one and a half of the default
    if rng.random() >= usual:
        whisker = default_whisker(height_mm)
        foot_mm = whisker.l1_mm * float(np.exp(rng.uniform(np.log(0.03), np.log(0.33))))
        sensor_mm = foot_mm * float(rng.choice([0.0, 1.0, rng.uniform(0.0, 1.0)]))
        touch = touch.with_whisker(replace(whisker, l2_mm=foot_mm, l3_mm=sensor_mm))
        touch = replace(touch, preload_mm=touch.preload_mm * float(rng.uniform(0.5, 1.5)))
    if rng.random() < worn:
        touch = replace(touch, tip_radius_mm=touch.tip_radius_mm * float(rng.uniform(1.0, 2.5)))
    return touch


def _draw_sensors(
    touch: Touch,
    whiskers: int,
    rng: np.random.Generator,
    *,
    ideal: float = 0.4,
    range_land_moments: float = 3.0,
) -> SensorChain | None:
    # range_land_moments: range of the converter; edges of the usual whisker reach twice the moment on the land.
    if rng.random() < ideal:
        return None
    return draw_sensor_chain(
        whiskers,
        rng=rng,
        full_scale_n_mm=range_land_moments * abs(touch.land_moment_n_mm()),
        noise=2e-4 * float(np.exp(rng.uniform(0.0, np.log(10.0)))),
    )

"""Make the parts of a design from its seed: stamped parts, and sketches of marks."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from glyphs.fonts.outlines import load_font
from glyphs.fonts.serials import random_text
from glyphs.part import Part
from glyphs.sketch import ROWS_PER_HEIGHT, sketch
from glyphs.soiling.soiled import WORKSHOP, Soiling
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.condition import Condition, Level, level_name
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.font_packages import font_file, font_mark
from pipeline.benchmark.exam.specimens import Box, Item, Specimen
from pipeline.common.settings import SettingsError
from pipeline.common.texts import without_blanks
from pipeline.formats.synth import MAX_PARTS, SynthSpec, make_part, text_of

# above and below a sketch, so that it can be read as a whole part; character heights
_LAND = 0.5
# elevation of the lamp, degrees; its direction is drawn at random for every part
LIGHTS: Final[dict[str, float | None]] = {"drawn": None, "raking": 18.0, "steep": 70.0}
# lights, evenly spaced around the part, for the mode that reads several photographs
SEVERAL = 4
# settings of a design that do not affect its parts
COUNTS = ("parts", "parts_a_cell")
# of marks and plates: `glyphs.part`, or `glyphs.sketch`, which has its own variation
GENERATORS = ("stamped", "sketched")
_SPECIAL = ("generator", "soil", "severity", "light")
_SKETCHED = (*_SPECIAL, "format", "font", "height_mm")
_SYNTH_FACTORS = {f.name: f.type for f in fields(SynthSpec) if f.name not in ("seed", "soiling")}
_KINDS: Final[dict[type, str]] = {float: "a number", bool: "true or false", str: "a word in quotes"}


def sketch_part(
    format: str, *, font: str | Path, height_mm: float, soiling: Soiling, seed: Sequence[int]
) -> Part:
    """Sketch a random serial as a part, with the dirt of stamped ones. Raises FontError, FormatError."""
    key = tuple(int(number) for number in seed)
    rng = np.random.default_rng(key)
    letters, text = load_font(font), random_text(format, rng=rng)
    drawn = sketch(letters, text, rng, clean=True)
    land, mm = round(_LAND * ROWS_PER_HEIGHT), height_mm / ROWS_PER_HEIGHT
    surface = np.pad(drawn.surface, ((land, land), (0, 0)), mode="edge") * np.float32(height_mm)
    boxes = tuple((x0 * mm, (y0 + land) * mm, x1 * mm, (y1 + land) * mm) for x0, y0, x1, y1 in drawn.boxes)
    stamped = StampedPart(HeightMap(surface, mm), text, height_mm, boxes, letters.name)
    return Part(stamped, soiling, key)


@dataclass(frozen=True)
class DesignedParts:
    """Parts of a design; with `first`, so many of them, from each section in proportion. Raises FontError, FormatError,
    StampError: they cannot be stamped. SettingsError: an invalid factor or light, or too few parts."""

    design: Design
    first: int | None = None

    def __post_init__(self) -> None:
        if self.first is not None and not 1 <= self.first <= self.design.n_parts:
            raise SettingsError(f"parts is {self.first}", hint=f"the design has {self.design.n_parts}")
        for section in self.design.all_sections():
            levels = {**self.design.part, **section.part}
            for name in levels:
                if name not in (*_SPECIAL, *_SYNTH_FACTORS):
                    raise SettingsError(
                        f"a part has no factor {name!r}",
                        hint=f"the factors are {', '.join((*_SPECIAL, *_SYNTH_FACTORS))}",
                    )
                for value in levels[name]:
                    _check_type(name, value)
            first = {name: values[0] for name, values in levels.items()}
            for name, values in levels.items():
                for value in values:
                    self.spec(Condition(**{**first, name: value}))

    def items(self) -> list[Item]:
        items: list[Item] = []
        sections: list[list[Item]] = []
        numbers = np.random.default_rng(self.design.seed).permutation(self.design.n_parts)
        for section, number, replicate, condition in self.design.plan_parts():
            if number == 0:  # the next section begins
                sections.append([])
            levels = (_level_name(condition, factor) for factor in self.design.cross)
            name = "-".join([*([section.name] if section.name else []), *levels, f"{replicate:04d}"])
            if self.design.numbered:
                name = f"part-{numbers[len(items)]:04d}"
            index = replicate if self.design.alike else (len(sections) - 1) * MAX_PARTS + number
            item = Item(name, index, condition, self.design.given)
            items.append(item)
            sections[-1].append(item)
        if self.first is None:
            return items
        shares = {
            item.part: (rank + 0.5) / len(section)
            for section in sections
            for rank, item in enumerate(_severities_in_turn(section))
        }
        return sorted(items, key=lambda item: shares[item.part])[: self.first]

    def make(self, item: Item) -> Specimen:
        spec = self.spec(item.condition)
        if item.condition.get("generator") == "sketched":
            part = sketch_part(
                spec.format, font=spec.font, height_mm=spec.height_mm, soiling=spec.soiling,
                seed=(spec.seed, item.number),
            )  # fmt: skip
        else:
            part = make_part(spec, item.number)
        stamped = part.stamped
        boxes = tuple(b for b, char in zip(stamped.boxes_mm, stamped.text, strict=True) if char != " ")
        return Specimen(
            part=item.part,
            truth=without_blanks(stamped.text),
            height_map=part.height_map,
            soil=part.soil,
            take_photo=lambda: spec.photograph(part),
            take_lights=lambda: replace(spec, lights=SEVERAL).photograph(part),
            line_mm=hull(boxes),
            boxes_mm=boxes,
            height_mm=stamped.height_mm,
            beside_mm=hull(stamped.other_boxes_mm),
            number=item.number,
        )

    def truth_of(self, item: Item) -> str:
        return without_blanks(text_of(self.spec(item.condition), item.number))

    def font_of(self, condition: Condition) -> str:
        return str(font_file(condition.font, self.design.fonts))

    def spec(self, condition: Condition) -> SynthSpec:
        light = str(condition.get("light", "drawn"))
        if light not in LIGHTS:
            raise SettingsError(f"there is no light {light!r}", hint=f"use one of {', '.join(LIGHTS)}")
        generator = condition.get("generator", "stamped")
        if generator not in GENERATORS:
            raise SettingsError(f"there is no generator {generator!r}", hint=f"use {' or '.join(GENERATORS)}")
        if generator == "sketched" and (more := [name for name in condition if name not in _SKETCHED]):
            raise SettingsError(
                f"a sketched part has no {more[0]}", hint=f"its factors are {', '.join(_SKETCHED)}"
            )
        soils = tuple(str(condition.get("soil", WORKSHOP)).split("+"))
        factors: dict[str, Any] = {name: condition[name] for name in condition if name in _SYNTH_FACTORS}
        factors["font"] = self.font_of(condition)
        if LIGHTS[light] is not None:
            factors["light_elevation_deg"] = LIGHTS[light]
        return SynthSpec(seed=self.design.seed, soiling=Soiling(soils, condition.severity or 0.0), **factors)

    def description(self) -> dict[str, Any]:
        plain = self.design.model_dump(mode="json", exclude={"about", *COUNTS}, by_alias=True)
        plain["font_files"] = [font_mark(font, self.design.fonts) for font in self.design.font_names]
        return plain


def _severities_in_turn(items: Sequence[Item]) -> list[Item]:
    seen: Counter[float | None] = Counter()
    turns = []
    for item in items:
        turns.append(seen[item.condition.severity])
        seen[item.condition.severity] += 1
    return [item for _, item in sorted(zip(turns, items, strict=True), key=lambda pair: pair[0])]


def _check_type(factor: str, level: Level) -> None:
    if factor == "severity":  # checked by the design
        return
    annotation = str(_SYNTH_FACTORS.get(factor, "str"))
    kind = next((k for k in _KINDS if k.__name__ in annotation), str)
    if not isinstance(level, kind) or (kind is float and isinstance(level, bool)):
        raise SettingsError(f"a {factor} is {level!r}", hint=f"it is {_KINDS[kind]}")


def _level_name(condition: Condition, factor: str) -> str:
    level = condition.levels[factor]
    return re.sub(r"[^A-Za-z0-9.+]+", "_", level_name(level))


def hull(boxes: Sequence[Box]) -> Box | None:
    """(x0, y0, x1, y1) around boxes; None without boxes."""
    if not boxes:
        return None
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    return (min(x0), min(y0), max(x1), max(y1))

"""A design in a few words, from its description alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pipeline.benchmark.analysis.factors import factor_name
from pipeline.benchmark.exam.condition import level_name

_MOST_SHOWN = 12


def design_words(parts: Mapping[str, Any], n_parts: int, given: Sequence[str]) -> list[tuple[str, str]]:
    """(what, in words) for the head of a page.

    Args:
        parts: description of the parts, as `pipeline.benchmark.exam.specimens.Parts` gives it.
        n_parts: how many were read.
        given: what readers were given.
    """
    rows = [("parts", f"{n_parts:,}")]
    if isinstance(parts.get("part"), Mapping):
        rows = [("design", str(parts.get("name", ""))), *_factors(parts, n_parts)]
    elif "folder" in parts:
        rows.append(("made elsewhere", ", ".join(map(str, parts["folder"]))))
    things = "; ".join(g.replace(",", ", ") for g in given)
    often = f" ({len(given)} readings of every part)" if len(given) > 1 else ""
    return [*rows, ("readers are given", f"{things}{often}")]


def _factors(design: Mapping[str, Any], n_parts: int) -> list[tuple[str, str]]:
    levels = _all_levels(design)
    cross = [name for name in design.get("cross", ()) if name in levels]
    varied = [name for name in cross if len(levels[name]) > 1]
    balanced = [name for name in levels if name not in cross and len(levels[name]) > 1]
    fixed = [name for name in levels if len(levels[name]) == 1]
    rows = [("parts", f"{n_parts:,}")]
    if varied:
        cells = math.prod(len(levels[name]) for name in varied)
        text = " × ".join(_with_levels(name, levels[name]) for name in varied)
        rows.append(("crossed in full", f"{text}: {cells} cells" if len(varied) > 1 else text))
    if balanced:
        rows.append(
            ("balanced in every cell", "; ".join(_with_levels(name, levels[name]) for name in balanced))
        )
    if fixed:
        words = (f"{factor_name(name)} {level_name(levels[name][0])}" for name in fixed)
        rows.append(("the same for all", "; ".join(words)))
    named = [section for section in design.get("section", ()) if section.get("name")]
    if named:
        rows.append(("sections", "; ".join(_section(section) for section in named)))
    return rows


def _all_levels(design: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Of the design and of all its sections."""
    found = {name: list(values) for name, values in design["part"].items()}
    own: dict[str, list[Any]] = {}
    for section in design.get("section", ()):
        for name, values in section.get("part", {}).items():
            own.setdefault(name, []).extend(values)
    # what every section names for itself is not the design's
    sections = len(design.get("section", ()))
    for name, values in own.items():
        by_all = sum(name in s.get("part", {}) for s in design["section"]) == sections
        found[name] = list(dict.fromkeys([*([] if by_all else found.get(name, [])), *values]))
    return found


def _with_levels(name: str, levels: Sequence[Any]) -> str:
    words = [level_name(level) for level in levels[:_MOST_SHOWN]]
    more = [f"and {len(levels) - _MOST_SHOWN} more"] if len(levels) > _MOST_SHOWN else []
    return f"{factor_name(name)} ({', '.join([*words, *more])})"


def _section(section: Mapping[str, Any]) -> str:
    kept = ", kept out of every fit" if section.get("kept_out") else ""
    return f"{section['name']} ({section['parts']:,} parts{kept})"

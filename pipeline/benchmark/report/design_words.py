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
    levels, sections = _all_levels(design), design.get("section", ())
    cross = [name for name in design.get("cross", ()) if name in levels]
    varied = [name for name in cross if len(levels[name]) > 1]
    cells = math.prod(len(levels[name]) for name in varied)
    crossed = " × ".join(_with_levels(name, levels[name]) for name in varied)
    rows = {
        "crossed in full": f"{crossed}: {cells} cells" if len(varied) > 1 else crossed,
        "balanced in every cell": "; ".join(
            _with_levels(name, found)
            for name, found in levels.items()
            if name not in cross and len(found) > 1
        ),
        "the same for all": "; ".join(
            f"{factor_name(name)} {level_name(found[0])}" for name, found in levels.items() if len(found) == 1
        ),
        "sections": "; ".join(_section(section) for section in sections if section.get("name")),
    }
    return [("parts", f"{n_parts:,}"), *((what, words) for what, words in rows.items() if words)]


def _all_levels(design: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Levels of the design and its sections; a factor that every section has is not the design's."""
    own = [section.get("part", {}) for section in design.get("section", ())]
    found = {}
    for name in dict.fromkeys([*design["part"], *(name for part in own for name in part)]):
        shared = [] if own and all(name in part for part in own) else design["part"].get(name, [])
        found[name] = list(dict.fromkeys([*shared, *(level for part in own for level in part.get(name, ()))]))
    return found


def _with_levels(name: str, levels: Sequence[Any]) -> str:
    words = [level_name(level) for level in levels[:_MOST_SHOWN]]
    more = [f"and {len(levels) - _MOST_SHOWN} more"] if len(levels) > _MOST_SHOWN else []
    return f"{factor_name(name)} ({', '.join([*words, *more])})"


def _section(section: Mapping[str, Any]) -> str:
    kept = ", kept out of every fit" if section.get("kept_out") else ""
    return f"{section['name']} ({section['parts']:,} parts{kept})"

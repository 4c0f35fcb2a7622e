"""The section of a whisker in words, for reports and pictures."""

from __future__ import annotations

from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped


def describe_section(whisker: LShaped) -> str:
    """Describe section and material."""
    section, made = whisker.section, whisker.material.name
    if isinstance(section, Rectangle):
        return f"{made} ribbon {section.thickness_mm:.3f} mm thick, {section.width_mm:.2f} mm wide"
    if isinstance(section, Round):
        return f"round {made} {section.diameter_mm:.3f} mm"
    return f"{made}, {section}"

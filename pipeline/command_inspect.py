"""`tactile-marks inspect`: one part as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pipeline.failing import FAILED, CommandError, failures_told

FidelityName = Literal["pointwise", "contact"]


def inspect(
    file: Path,
    *,
    out: Path | None = None,
    font: Annotated[list[str] | None, Parameter(negative="")] = None,
    format: str | None = None,
    height_mm: float | None = None,
    fidelity: FidelityName | None = None,
    database: Path | None = None,
    depth_rule: str | None = None,
    min_depth_mm: float | None = None,
    config: Path | None = None,
) -> int:
    """Draw how one part was felt and read: heights, moments, edges, depth, slope, boxes and candidates.

    Parameters
    ----------
    file
        A height map or a scan.
    out
        Picture to write, .png, .svg or .pdf; FILE-inspect.png in the working folder unless given.
    font
        Built-in name or TTF/OTF file; may be repeated.
    format
        Mask of the serial: A letter, 9 digit, * either, any other character itself.
    height_mm
        Character height in mm.
    fidelity
        How touch is simulated.
    database
        Glyph database to take the fonts from.
    depth_rule
        Rule that the mark must meet, such as 27CFR478.92.
    min_depth_mm
        Depth in mm that the mark must have everywhere.
    config
        TOML file with settings.
    """
    with failures_told():
        from pipeline.batch import evidence_of
        from pipeline.parts import discover
        from pipeline.pictures import check_picture, headline, inspect_figure, save_figure
        from pipeline.readers import open_reader
        from pipeline.settings import load_settings

        picture = out if out is not None else Path(f"{file.stem}-inspect.png")
        check_picture(picture)
        settings = load_settings(
            config=config,
            font=tuple(font) if font else None,
            format=format,
            height_mm=height_mm,
            fidelity=fidelity,
            database=database,
            depth_rule=depth_rule,
            min_depth_mm=min_depth_mm,
        )
        parts = discover([file])
        if len(parts) > 1:
            raise CommandError(
                f"{file}: holds {len(parts)} parts; inspect draws one, name its file", status=FAILED
            )
        evidence = evidence_of(parts[0], open_reader(settings))
        save_figure(inspect_figure(evidence, title=parts[0].name), picture)
    print(f"{parts[0].name}: {headline(evidence.reading)}")
    for message in evidence.reading.messages():
        print(f"  {message}")
    print(f"wrote {picture}")
    return 0

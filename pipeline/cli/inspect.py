"""`tactile-marks inspect`: one part as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from pipeline.cli.exit_status import FAILED, CommandError, failures_told

if TYPE_CHECKING:
    from pipeline.files.parts import Part
    from pipeline.reading.part_reader import Sensed

ModeName = Literal["tactile", "vision", "fused", "auto"]
FidelityName = Literal["pointwise", "contact"]
Texts = Annotated[list[str] | None, Parameter(negative="")]


def inspect(
    file: Path,
    *,
    out: Path | None = None,
    mode: ModeName | None = None,
    font: Texts = None,
    format: Texts = None,
    lexicon: Path | None = None,
    check: Texts = None,
    exclude: str | None = None,
    height_mm: float | None = None,
    fidelity: FidelityName | None = None,
    database: Path | None = None,
    depth_rule: str | None = None,
    min_depth_mm: float | None = None,
    accept_confidence: float | None = None,
    accept_margin: float | None = None,
    config: Path | None = None,
) -> int:
    """Draw how one part was felt, seen and read: heights, moments, edges, depth, slope, boxes and candidates.

    A photograph of the same stem beside the file is shown, too, whether or not it is read.

    Parameters
    ----------
    file
        A height map, a scan or a photograph.
    out
        Picture to write, .png, .svg or .pdf; FILE-inspect.png in the working folder unless given.
    mode
        Senses that read, as of `read`.
    font
        Built-in name or TTF/OTF file; may be repeated.
    format
        What serials look like, as of `read`: AA999999, re:..., sets:..., vin; may be repeated.
    lexicon
        File of the serials that there are, one a line.
    check
        Check digit that must hold, such as luhn.
    exclude
        Characters that no serial has, such as IOQ.
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
    accept_confidence
        Least confidence, 0 to 1, of a reading that is accepted.
    accept_margin
        Least lead of every character over its rival, 0 to 1, in a reading that is accepted.
    config
        TOML file with settings.
    """
    with failures_told():
        from pipeline.common.settings import load_settings
        from pipeline.files.parts import discover
        from pipeline.plots.inspection import inspection_figure
        from pipeline.plots.pictures import check_picture, headline, save_figure
        from pipeline.reading.part_reader import Mode, Senses
        from pipeline.reading.readers import Readers

        picture = out if out is not None else Path(f"{file.stem}-inspect.png")
        check_picture(picture)
        settings = load_settings(
            config=config,
            mode=mode,
            font=tuple(font) if font else None,
            format=tuple(format) if format else None,
            lexicon=lexicon,
            check=tuple(check) if check else None,
            exclude=exclude,
            height_mm=height_mm,
            fidelity=fidelity,
            database=database,
            depth_rule=depth_rule,
            min_depth_mm=min_depth_mm,
            accept_confidence=accept_confidence,
            accept_margin=accept_margin,
        )
        parts = discover([file], beside=True)
        if len(parts) > 1:
            raise CommandError(
                f"{file}: holds {len(parts)} parts", hint="inspect draws one, name its file", status=FAILED
            )
        (part,) = parts
        sensed = Senses(Readers(settings), mode=Mode(settings.mode) if settings.mode else None).sense(part)
        save_figure(inspection_figure(_with_photo(sensed, part), title=part.name), picture)
    print(f"{part.name}: {headline(sensed.reading)}")
    for message in sensed.reading.messages():
        print(f"  {message}")
    print(f"wrote {picture}")
    return 0


def _with_photo(sensed: Sensed, part: Part) -> Sensed:
    """The part with its photograph to be shown; without one that cannot be used, which nobody asked for."""
    from dataclasses import replace

    from glyphs.errors import FileError
    from pipeline.reading.part_reader import load_photo

    if sensed.photo is not None or part.photo is None:
        return sensed
    try:
        photo = load_photo(part, over=None if sensed.touch is None else sensed.touch.height_map)
    except FileError as problem:
        print(f"  not shown: {problem}")
        return sensed
    return replace(sensed, photo=photo)

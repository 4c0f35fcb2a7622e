"""Identify a whisker and its bench from files, and report the numbers in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from glyphs.errors import FileError
from pipeline.errors import naming
from pipeline.formats.touch_file import read_scan
from pipeline.formats.whisker_file import (
    WhiskerFile,
    heights_of_piece,
    read_whisker_file,
    write_whisker_file,
)
from pipeline.reading.predictions import Prediction
from whisker_array.identification.bench import DRAWN, Bench, Unknown
from whisker_array.identification.fit import Identified, identify
from whisker_array.identification.knowledge import knowledge_of
from whisker_array.whisker.shapes import LShaped

_MEANINGS = {
    Unknown.L1: "length of the beam",
    Unknown.L2: "length of the tip arm",
    Unknown.L3: "distance by which the sensor is lowered towards the tip",
    Unknown.BETA: "setting angle of the beam",
    Unknown.STIFFNESS: "bending stiffness of the section, relative to the drawing",
    Unknown.RADIUS: "radius of the tip",
    Unknown.PRELOAD: "depth of the free tip below the land",
    Unknown.FRICTION: "friction between tip and piece",
    Unknown.PLAY: "play of the stage between forward and back",
    Unknown.SHIFT_X: "offset of the piece along x",
    Unknown.SHIFT_Y: "offset of the piece along y",
    Unknown.YAW: "rotation of the piece on the plate",
    Unknown.TILT_X: "rise of the plate along x",
    Unknown.TILT_Y: "rise of the plate along y",
}
_REMEDY = "hang a known weight on each tip to measure the gains, or record the piece once more"
_GAINS = "gains"
_MISFIT = 2.0
_WIDE = 1.96  # half width of the 95 % interval, standard deviations


def identify_recording(
    recording: Path, piece: Path, whisker: Path | None
) -> tuple[Identified, WhiskerFile | None]:
    """Identify the bench of a recording over a piece; return it and the whisker as drawn. Raises FileError."""
    drawn = read_whisker_file(whisker) if whisker is not None else None
    if whisker is not None and drawn is not None and drawn.whisker.is_straight:
        raise FileError(whisker, "is not an L-shaped whisker", "give the drawing of an L-shaped one")
    heights = heights_of_piece(piece)
    scan = read_scan(recording)
    if drawn is not None:
        scan = replace(scan, touch=drawn.touch)
    known = drawn.whisker if drawn is not None else scan.touch
    with naming(recording):
        return identify(scan, heights, whisker=known), drawn


def table_of(fit: Identified) -> list[str]:
    """Every number with its interval, and the numbers that the recording does not determine, in lines of text."""
    with_drawing = fit.nominal[Unknown.L1] > 0.0
    lines = [f"{'':15}{'found':>10}{'95 %':>12}{'as drawn':>11}   what it is"]
    names = [name for name in Unknown if with_drawing or name not in DRAWN]
    lines += [_line(name.value, *fit.of(name), fit.nominal[name], _MEANINGS[name]) for name in names]
    for whisker in fit.whiskers:
        gain, sd = float(fit.bench.gain[whisker]), float(fit.sd[len(Unknown) + whisker])
        lines.append(_line(f"gain {whisker}", gain, sd, 1.0, digits=".4f"))
    unused = [str(whisker) for whisker in range(fit.bench.gain.size) if whisker not in fit.whiskers]
    if unused:
        lines.append(f"not identified, no usable line over the piece: whisker {', '.join(unused)}")
    if with_drawing and fit.drawn is not None:
        stiffness = partial(_stiffness, whisker=fit.drawn)
        numbers = (stiffness(fit.bench), fit.sd_of(stiffness), stiffness(fit.nominal))
        lines.append(_line("tip, N/mm", *numbers, "stiffness of the tip, upwards"))
    lines.append(f"{len(fit.traces)} lines fitted, {1000.0 * fit.scatter_n_mm:.3g} mN mm of scatter")
    if fit.misfit > _MISFIT:
        lines.append(
            f"warning: the fit leaves {fit.misfit:.1f} times the scatter: the piece, the drawing or the bench"
            " is not as assumed, and the intervals are too narrow"
        )
    if not fit.settled:
        lines.append("warning: the fit has not converged; check the figure before you trust it")
    lines += [f"known only in combination: {', '.join(group)}" for group in confounded(fit)]
    if open_ := [name for name in undetermined(fit) if name in names]:
        lines.append(f"not determined by this recording: {', '.join(open_)}; {_REMEDY}")
    return lines


def undetermined(fit: Identified, *, open_share: float = 0.7) -> tuple[Unknown, ...]:
    """Numbers whose standard deviation stays above the share `open_share` of the prior one."""
    names = [name for k, name in enumerate(Unknown) if fit.sd[k] > open_share * fit.before[k]]
    return tuple(names)


def confounded(
    fit: Identified, *, open_share: float = 0.25, least_part: float = 0.3
) -> tuple[tuple[str, ...], ...]:
    """Find groups of numbers that are known only in combination; the gains count as one.

    In units of the prior standard deviations, the covariance has large eigenvalues along directions that the recording
    does not determine. A combination counts as open above `open_share` of the prior standard deviation, and a number as
    part of it from the component `least_part` of the unit direction.
    """
    scaled = fit.covariance / np.outer(fit.before, fit.before)
    felt = [*range(len(Unknown)), *(len(Unknown) + whisker for whisker in fit.whiskers)]
    values, vectors = np.linalg.eigh(scaled[np.ix_(felt, felt)])
    names = [*(name.value for name in Unknown), *(_GAINS for _ in fit.whiskers)]
    groups: list[tuple[str, ...]] = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < open_share**2:
            break
        weight: dict[str, float] = {}
        for name, part in zip(names, vector, strict=True):
            weight[name] = weight.get(name, 0.0) + float(part**2)
        group = tuple(name for name, share in weight.items() if share > least_part**2)
        if len(group) > 1 and not any(set(group) <= set(other) for other in groups):
            groups.append(group)
    return tuple(groups)


def _line(name: str, value: float, sd: float, drawn: float, what: str = "", *, digits: str = ".4g") -> str:
    within = f"+-{_WIDE * sd:.2g}"
    return f"{name:15}{value:10{digits}}{within:>12}{drawn:11.4g}   {what}".rstrip()


def _stiffness(bench: Bench, *, whisker: LShaped) -> float:
    return float(1.0 / bench.touch(whisker).tip.compliance_mm_per_n[1, 1])


def write_found(path: Path, fit: Identified, drawn: WhiskerFile) -> None:
    """Write the identified whisker, with the drawing's raster and character height. Raises FileError."""
    whisker = fit.bench.whisker(drawn.whisker)
    touch = fit.bench.touch(drawn.whisker)
    write_whisker_file(path, replace(drawn, whisker=whisker, touch=touch, known=knowledge_of(fit)))


def prediction_lines(figures: Sequence[Prediction], *, measured: bool = True) -> list[str]:
    """Figures of the whisker in lines of text, with their uncertainty if it was measured."""
    lines = [f"{'as identified':32}{'':>10}{'95 %':>12}" if measured else "as drawn"]
    for figure in figures:
        if math.isnan(figure.value):
            lines.append(f"{figure.what:32}{'jams':>10}")
            continue
        within = "may jam" if math.isnan(figure.sd) else f"+-{_WIDE * figure.sd:.2g}" if measured else ""
        lines.append(f"{figure.what:32}{figure.value:10.4g}{within:>12}".rstrip())
    return lines

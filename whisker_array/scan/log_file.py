"""The log of passes in a recording: the group `/log`, whose layout stands in `whisker_array.scan.recording`."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import h5py
import numpy as np

from glyphs.errors import MarksError
from whisker_array.scan.checked import CheckedFile, text_attribute
from whisker_array.scan.felt_sweep import Sweep
from whisker_array.scan.pass_log import LoggedPass, PassLog
from whisker_array.whisker.array import WhiskerArray
from whisker_array.whisker.passes import Pass

GROUP = "log"
_TIMES = ("speed_mm_s", "lead_mm", "turnaround_s")
_TEXTS = ("text", "why")
_LONGEST_TEXT = 1000
_MISSED_STEPS = 0.5
"""A pass may begin beside its plan by so many samples."""


def write_log(log: PassLog, file: h5py.File) -> None:
    """Write the log of a recording whose passes are written already, in the log's order."""
    group = file.create_group(GROUP)
    group.attrs.update(
        {
            # what room whiskers take is of no account to where they felt
            "array": json.dumps(dataclasses.asdict(dataclasses.replace(log.array, body=None))),
            "height_mm": log.height_mm,
            "field_mm": log.field_mm,
            "stopped": log.stopped,
            "problem": log.problem,
        }
    )
    if log.budget_s is not None:
        group.attrs["budget_s"] = log.budget_s
    orders = [p.order for p in log.passes]
    group["along_mm"] = np.array([o.along_mm for o in orders], dtype=np.float64)
    for name in _TIMES:
        group[name] = np.array([getattr(o, name) for o in orders], dtype=np.float64)
    group["preload_mm"] = np.array([np.nan if o.preload_mm is None else o.preload_mm for o in orders])
    group["confidence"] = np.array([p.confidence for p in log.passes], dtype=np.float64)
    for name in _TEXTS:
        group.create_dataset(name, data=[getattr(p, name) for p in log.passes], dtype=h5py.string_dtype())


def read_log(file: CheckedFile, sweeps: tuple[Sweep, ...]) -> PassLog:
    """The log of a recording.

    Args:
        file: with the group.
        sweeps: of single passes, in order.

    Raises:
        FileError: a log that is not according to the layout, or does not fit the passes.
    """
    n, group = len(sweeps), file.file[GROUP]
    along = file.numbers(f"{GROUP}/along_mm", (n, 2))
    times = {name: file.numbers(f"{GROUP}/{name}", (n,)) for name in _TIMES}
    preload, confidence = np.full(n, np.nan), np.zeros(n)
    if "preload_mm" in group:
        preload = np.asarray(file.dataset(f"{GROUP}/preload_mm", (n,))[()], dtype=np.float64)
    if "confidence" in group:
        confidence = file.numbers(f"{GROUP}/confidence", (n,))
    texts = {name: _texts(file, name, n) for name in _TEXTS}
    field = np.atleast_1d(group.attrs.get("field_mm", ()))
    if field.shape != (4,) or field.dtype.kind not in "fiu" or not np.isfinite(field).all():
        raise file.fail("/log says of no field that could be felt", "write field_mm as x0, y0, x1, y1")
    try:
        passes = tuple(
            LoggedPass(
                Pass(
                    direction=sweep.plan.direction,
                    line_mm=tuple(float(v) for v in sweep.plan.line_mm[0]),
                    along_mm=(float(along[k, 0]), float(along[k, 1])),
                    sample_pitch_mm=sweep.plan.step_mm,
                    air_samples=sweep.air_n_mm.shape[2],
                    pushed=sweep.plan.pushed,
                    offset_mm=sweep.plan.offset_mm,
                    preload_mm=None if np.isnan(preload[k]) else float(preload[k]),
                    **{name: float(values[k]) for name, values in times.items()},
                ),
                sweep,
                confidence=float(confidence[k]),
                **{name: values[k] for name, values in texts.items()},
            )
            for k, sweep in enumerate(sweeps)
        )
        log = PassLog(
            passes,
            array=_array(file, text_attribute(group.attrs, "array", "")),
            height_mm=file.attribute(group.attrs, "height_mm"),
            field_mm=(float(field[0]), float(field[1]), float(field[2]), float(field[3])),
            stopped=text_attribute(group.attrs, "stopped", ""),
            problem=text_attribute(group.attrs, "problem", ""),
            budget_s=file.attribute(group.attrs, "budget_s") if "budget_s" in group.attrs else None,
        )
    except MarksError as error:
        raise file.fail(f"log of passes cannot be used: {error.what}", error.hint) from error
    for k, one in enumerate(passes):
        plan, order = one.sweep.plan, one.order
        beside = abs(plan.start_mm - order.start_mm) > _MISSED_STEPS * plan.step_mm
        if beside or plan.n_samples != order.n_samples:
            raise file.fail(
                f"pass {k} has {plan.n_samples} samples from {plan.start_mm:.3f} mm, its plan "
                f"{order.n_samples} from {order.start_mm:.3f} mm"
            )
    return log


def _texts(file: CheckedFile, name: str, n: int) -> list[str]:
    group = file.file[GROUP]
    if name not in group:
        return [""] * n
    found = group[name]
    if (
        not isinstance(found, h5py.Dataset)
        or found.shape != (n,)
        or h5py.check_string_dtype(found.dtype) is None
    ):
        raise file.fail(f"/log/{name} is not one text for each pass")
    return [str(text)[:_LONGEST_TEXT] for text in found.asstr(errors="replace")[()]]


def _array(file: CheckedFile, written: str) -> WhiskerArray:
    try:
        fields: dict[str, Any] = json.loads(written)
        return WhiskerArray(**{name: _frozen(value) for name, value in fields.items()})
    except (TypeError, ValueError, AttributeError) as error:
        raise file.fail(
            f"/log describes no array of whiskers ({error})", 'as JSON: {"n_whiskers": 8, "pitch_mm": 2.5}'
        ) from error


def _frozen(value: Any) -> Any:
    """A field's value out of JSON, which knows no tuples."""
    return tuple(value) if isinstance(value, list) else value

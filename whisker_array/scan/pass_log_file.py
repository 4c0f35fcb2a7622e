"""The log of passes in a recording: the group `/log`; layout: see `whisker_array.scan.recording`."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import h5py
import numpy as np

from whisker_array.scan.checked_file import CheckedFile
from whisker_array.scan.pass_log import LoggedPass, PassLog
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.passes import Pass

GROUP = "log"
_TIMES = ("speed_mm_s", "lead_mm", "turnaround_s")
_TEXTS = ("text", "why")
_LONGEST_TEXT = 1000
_MISSED_STEPS = 0.5
"""Greatest distance of a pass from its plan, samples."""


def write_log(log: PassLog, file: h5py.File) -> None:
    """Write the log of a recording whose passes are already written in the log's order."""
    group = file.create_group(GROUP)
    # the whiskers' bodies have no effect on where they touched
    group.attrs["array"] = json.dumps(dataclasses.asdict(dataclasses.replace(log.array, body=None)))
    for name in ("height_mm", "field_mm", "region_mm", "stopped", "problem", "budget_s"):
        if getattr(log, name) is not None:
            group.attrs[name] = getattr(log, name)
    group.attrs["other_texts"] = " ".join(sorted(log.other_texts))
    for name in ("along_mm", *_TIMES):
        group[name] = np.array([getattr(p.order, name) for p in log.passes], dtype=np.float64)
    preloads = [p.order.preload_mm for p in log.passes]
    group["preload_mm"] = np.array([np.nan if p is None else p for p in preloads])
    group["confidence"] = np.array([p.confidence for p in log.passes], dtype=np.float64)
    for name in _TEXTS:
        group.create_dataset(name, data=[getattr(p, name) for p in log.passes], dtype=h5py.string_dtype())


def read_log(file: CheckedFile, sweeps: tuple[Sweep, ...]) -> PassLog:
    """Read the log of a recording. Raises FileError if it does not follow the layout or does not fit the passes."""
    n, group = len(sweeps), file.file[GROUP]
    along = file.numbers(f"{GROUP}/along_mm", (n, 2))
    times = {name: file.numbers(f"{GROUP}/{name}", (n,)) for name in _TIMES}
    preload = file.numbers(f"{GROUP}/preload_mm", (n,), default=np.nan)
    confidence = file.numbers(f"{GROUP}/confidence", (n,), default=0.0)
    texts = {name: _texts(file, name, n) for name in _TEXTS}
    passes = []
    for k, sweep in enumerate(sweeps):
        plan = sweep.plan
        with file.naming(f"pass {k} of the log cannot be used: "):
            order = Pass(
                direction=plan.direction,
                line_mm=tuple(float(v) for v in plan.line_mm[0]),
                along_mm=(float(along[k, 0]), float(along[k, 1])),
                sample_pitch_mm=plan.step_mm,
                air_samples=sweep.air_n_mm.shape[2],
                pushed=plan.pushed,
                offset_mm=plan.offset_mm,
                preload_mm=None if np.isnan(preload[k]) else float(preload[k]),
                **{name: float(values[k]) for name, values in times.items()},
            )
        late = abs(plan.start_mm - order.start_mm) > _MISSED_STEPS * plan.step_mm
        file.require(
            not late and plan.n_samples == order.n_samples,
            f"pass {k} has {plan.n_samples} samples from {plan.start_mm:.3f} mm, its plan "
            f"{order.n_samples} from {order.start_mm:.3f} mm",
        )
        words = {name: values[k] for name, values in texts.items()}
        passes.append(LoggedPass(order, sweep, confidence=float(confidence[k]), **words))
    with file.naming("log of passes cannot be used: "):
        return PassLog(
            tuple(passes),
            array=_read_array(file),
            height_mm=file.attribute("height_mm", group=GROUP),
            field_mm=_area(file, "field"),
            region_mm=_area(file, "region") if "region_mm" in group.attrs else None,
            other_texts=frozenset(file.text("other_texts", group=GROUP).split()),
            stopped=file.text("stopped", group=GROUP),
            problem=file.text("problem", group=GROUP),
            budget_s=file.attribute("budget_s", group=GROUP) if "budget_s" in group.attrs else None,
        )


def _area(file: CheckedFile, what: str) -> tuple[float, float, float, float]:
    area = np.atleast_1d(file.file[GROUP].attrs.get(f"{what}_mm", ()))
    numbers = area.shape == (4,) and area.dtype.kind in "fiu" and np.isfinite(area).all()
    file.require(numbers, f"/log has no valid {what}", f"write {what}_mm as x0, y0, x1, y1")
    x0, y0, x1, y1 = area.tolist()
    return x0, y0, x1, y1


def _texts(file: CheckedFile, name: str, n: int) -> list[str]:
    dataset = file.file[GROUP].get(name)
    if dataset is None:
        return [""] * n
    texts = isinstance(dataset, h5py.Dataset) and h5py.check_string_dtype(dataset.dtype) is not None
    file.require(texts and dataset.shape == (n,), f"/log/{name} is not one text for each pass")
    return [str(text)[:_LONGEST_TEXT] for text in dataset.asstr(errors="replace")[()]]


def _read_array(file: CheckedFile) -> WhiskerArray:
    try:
        fields = json.loads(file.text("array", group=GROUP))
        # JSON has no tuples
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
        return WhiskerArray(**values)
    except (TypeError, ValueError, AttributeError) as error:
        raise file.fail(
            f"/log describes no array of whiskers ({error})", 'as JSON: {"n_whiskers": 8, "pitch_mm": 2.5}'
        ) from error

"""Metrics and log lines of a part that was read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import structlog

from pipeline.common.records import PartRecord
from pipeline.common.serial_rules import SerialAlarm

if TYPE_CHECKING:
    from pipeline.reading.bench_watch import BenchWatch
    from pipeline.reading.drift import DriftWatch
    from pipeline.reading.triage import ReadPart
    from pipeline.service.metrics import Metrics

log = structlog.get_logger("tactile-marks")


def count_reading(
    part: PartRecord, done: ReadPart, *, metrics: Metrics, bench: BenchWatch, watch: DriftWatch | None
) -> None:
    """Count a part's new readings, and log them with what they show of serials, whiskers and drift.

    Args:
        part: as it stands after them.
        done: the readings.
        metrics: counters.
        bench: watch of whiskers and bench.
        watch: drift watch of the part's job; None if it is not certified.
    """
    for reason in part.reading.reasons if part.reading is not None else ():
        if reason.code in set(SerialAlarm):
            metrics.serial_alarms.inc()
            log.warning("serial alarm", part=part.id, name=part.name, text=part.text, why=reason.code)
    last = done.record
    if last.source != "vision" and bench.add(last.faults):
        log.warning("whiskers or bench faulty", why=bench.message())
    if watch is not None and watch.add(last.source, done.measures):
        log.warning("parts unlike the certified ones", job=part.job, why=watch.message())
    for reading in done.readings:
        metrics.readings.labels(reading.source, reading.decision).inc()
        metrics.reading_seconds.labels(reading.source).observe(reading.seconds)
    log.info(
        "part read",
        part=part.id,
        name=part.name,
        job=part.job,
        state=part.state.value,
        text=part.text,
        readings=[f"{r.source}: {r.decision}" for r in done.readings],
    )

"""Read the part of one job: by the camera, by touch, or by both, whatever its files allow."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from pipeline.common.records import EvidenceKind, PartState, ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.reading.jobs import Done, Job, Limits, MadeFile, named_problems

if TYPE_CHECKING:
    from pipeline.reading.job_senses import JobSenses, Seen
    from pipeline.reading.vision_file import KeptVision


def read_job(job: Job, settings: ReadSettings, limits: Limits) -> Done:
    """Read a part.

    Args:
        job: its files.
        settings: how to read; `mode` is of no account, a part is read by all that it has files for.
        limits: checked from the files' heads before anything is decoded.

    Raises:
        FileError: a file that cannot be used; or an expected text or a database, named so.
        ValueError: a job without any file to read, or sight without touch.
    """
    from pipeline.reading.job_senses import JobSenses
    from pipeline.reading.kept_readers import reader_of

    felt = job.scan is not None or job.height_map is not None
    if not felt and (job.photo is None or job.vision is not None):
        raise ValueError("a job has a photo, a scan or a height map; sight goes with one of the latter")
    with named_problems(job, "database", job.database or settings.database):
        reader = reader_of(settings, job.database)
    senses = JobSenses(job, reader, limits, settings)
    if not felt:
        return _by_vision(job, senses, settings, limits)
    return _by_touch(job, senses)


def _by_vision(job: Job, senses: JobSenses, settings: ReadSettings, limits: Limits) -> Done:
    from pipeline.reading.job_pictures import photo_picture, vision_edges_picture
    from pipeline.reading.scan_plan import plan_of
    from pipeline.reading.triage import state_after, why_touch
    from pipeline.reading.vision_file import save_vision

    seen = senses.see()
    record = senses.record(seen.vision, seen.seconds)
    made = [
        photo_picture(seen.photo, job.folder),
        *vision_edges_picture(seen.photo, seen.height_mm, job.folder),
    ]
    if state_after(record) is not PartState.TOUCH_NEEDED:
        return Done((record,), tuple(made))
    plan = plan_of(
        seen.vision, seen.photo, settings, field_mm=limits.stage_field_mm, reason=why_touch(record)
    )
    path = job.folder / "sight.npz"
    save_vision(path, seen.kept)
    made.append(MadeFile(EvidenceKind.VISION, path, "application/octet-stream"))
    return Done((record,), tuple(made), plan)


def _by_touch(job: Job, senses: JobSenses) -> Done:
    from pipeline.reading.job_pictures import edges_picture, photo_picture, vision_edges_picture

    started = time.perf_counter()
    # a photograph that cannot be used is told before the time of touch is spent
    photo = senses.load_photo() if job.photo is not None and job.vision is None else None
    remembered = senses.remembered() if job.vision is not None else None
    touch = senses.feel()
    readings: list[ReadingRecord] = []
    made = edges_picture(touch.trace.edge_map, job.folder)
    seen: Seen | KeptVision | None = remembered
    if photo is not None:
        looked = senses.see(photo, over=touch.trace.height_map)
        readings.append(senses.record(looked.vision, looked.seconds))
        made = [
            photo_picture(looked.photo, job.folder),
            *made,
            *vision_edges_picture(looked.photo, looked.height_mm, job.folder),
        ]
        seen = looked
    reading = senses.verified(touch) if seen is None else senses.fused(touch, seen)
    readings.append(senses.record(reading, time.perf_counter() - started))
    return Done(tuple(readings), tuple(made))

"""Certify a reader: read labelled parts, resumably, and find the confidence from which readings may be accepted."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar

from glyphs.compiling import show_compiling
from glyphs.errors import FileError
from pipeline.common.accepted_risk import (
    THRESHOLDS,
    ThresholdTest,
    parts_missing,
    proven_threshold,
    threshold_tests,
)
from pipeline.common.job_file import files_of
from pipeline.common.settings import MapSettings, ReadSettings, SettingsError
from pipeline.common.texts import without_blanks
from pipeline.common.version import reader_versions
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import load_truth
from pipeline.reading.certificate import Certificate, settings_described
from pipeline.reading.certificate_statistics import KindOfParts
from pipeline.reading.part_job import PartJob, Wants, files_to_send, lost_part, read_listed
from pipeline.reading.readers import open_reader
from pipeline.reading.triage import ReadPart
from pipeline.runs.journal import Journal, resumable
from pipeline.runs.production import parts_for
from pipeline.runs.progress import Progress
from pipeline.workers.options import WorkerSettings
from recognition.decide.risk import least_score, risk_of


class CertificationJournal(Journal[ReadPart]):
    """The parts read by an interrupted certification."""

    kind: ClassVar[str] = "certification"
    version: ClassVar[int] = 4
    keeps: ClassVar[Any] = ReadPart


@dataclass(frozen=True)
class Certification:
    """Result of a certification on labelled parts."""

    certificate: Certificate | None  # None if no threshold is proven to keep the risk
    tests: tuple[ThresholdTest, ...]
    parts: int
    errors: int  # parts that could not be read
    without_truth: int  # parts that are not in the truth, and were not read
    # estimated number of further parts for a certificate; None if there is one, or if no number suffices
    missing: int | None


def certify(
    inputs: Sequence[str],
    truth: Path,
    settings: ReadSettings,
    workers: WorkerSettings,
    *,
    out: Path,
    risk: float,
    confidence: float,
    manifests: Sequence[str] = (),
) -> Certification:
    """Read labelled parts, and find the confidence from which readings may be accepted at a risk: the largest share
    of wrong readings among the accepted, at a level of `confidence`, both from 0 to 1. The journal lies beside
    `out`. Raises FileError: a table is unusable, or another certification is unfinished. MarksError: no sense keeps
    the risk."""
    if settings.certificate is not None:
        raise SettingsError("a certificate is set, which prevents acceptance", hint="leave it out")
    known = load_truth(truth)
    listing = parts_for(inputs, settings, manifests=manifests)
    listing.report_passed_over([*files_of(settings), truth])
    texts = ((part.name, known.text_of(part.name)) for part in listing)
    labels = {name: without_blanks(text) for name, text in texts if text is not None}
    parts = [part for part in listing if part.name in labels]
    if not parts:
        raise FileError(truth, "has no row for any of the parts", "name the parts as their files")
    if special := next((part.name for part in parts if part.format or part.font), ""):
        raise SettingsError(
            f"{special} has a format or font of its own, but a certificate holds for one way of reading",
            hint="certify the parts of each format separately, with --format and --font",
        )
    open_reader(settings)  # refuse invalid settings before anything is read
    settings.check_accept_risk()
    risks = {source: risk_of(source, settings.accept_risk) for source in settings.sources}
    least = min(least_score(source, risk) for source, risk in risks.items())
    description = {
        "settings": settings_described(settings),
        "mode": settings.mode,
        "maps": settings.model_dump(include=set(MapSettings.model_fields)),
        "inputs": [*inputs, *manifests],
        "versions": reader_versions(),
    }
    place = out.with_name(f"{out.name}.unfinished")
    with CertificationJournal(place, description, output=out) as journal:
        _read_all(parts, settings, workers, journal)
        read = dict(sorted(journal.done.items()))
        accepted = {name: part.record for name, part in read.items() if part.record.decision == "accept"}
        tests = threshold_tests(
            [record.confidence for record in accepted.values()],
            [without_blanks(record.text) == labels[name] for name, record in accepted.items()],
            risk=risk,
            confidence=confidence,
            thresholds=(*(t for t in THRESHOLDS if t > least), least),
        )
        certificate = missing = None
        if (chosen := proven_threshold(tests)) is None:
            missing = parts_missing(tests, len(read), risk=risk, confidence=confidence)
        else:
            sources = {r.source for r in accepted.values() if r.confidence >= chosen.threshold}
            certificate = Certificate(
                made_at=datetime.now(UTC).replace(microsecond=0),
                risk=risk,
                confidence=confidence,
                threshold=chosen.threshold,
                sources=tuple(sorted(sources)),
                parts=len(read),
                accepted=chosen.accepted,
                wrong=chosen.wrong,
                bound=chosen.bound,
                tests=tests,
                kind=KindOfParts.of([p.measures for p in read.values() if p.record.source in sources]),
                data_sha256=_hash_of(read, labels),
                settings=settings_described(settings),
                versions=reader_versions(),
            )
        journal.remove()
    errors = sum(bool(part.record.error) for part in read.values())
    return Certification(certificate, tests, len(read), errors, len(listing) - len(parts), missing)


def _read_all(
    parts: Sequence[PartFiles],
    settings: ReadSettings,
    workers: WorkerSettings,
    journal: CertificationJournal,
) -> None:
    known = len(journal.names)
    if known:
        print(f"continuing a broken-off certification: {known:,} parts are read already")
    with (
        Progress() as progress,
        show_compiling(progress.line),
        workers.opened(len(parts), limit_s=settings.limit_s) as executor,
    ):
        progress.start(len(parts) - known)
        sent = files_to_send(settings) if executor.remote else None
        job = PartJob(settings=settings, wants=Wants(digest=True, measures=True), sent=sent)
        tasks = [part.absolute() for part in parts] if executor.remote else parts
        for _, read in resumable(journal, tasks, executor, read_listed, job, lost=lost_part):
            progress.advance(failed=bool(read.record.error))


def _hash_of(parts: Mapping[str, ReadPart], labels: Mapping[str, str]) -> str:
    lines = (f"{name}\t{labels[name]}\t{part.sha256}\n" for name, part in parts.items())
    return hashlib.sha256("".join(lines).encode()).hexdigest()

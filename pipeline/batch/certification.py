"""Certifying: labelled parts are read as `read` reads them, and show from which confidence their kind may be accepted.

parts, truth --worker--> reading, measures, hash --> thresholds tested --> Certificate, or what is missing
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from glyphs.compiling import compiling_shown, part_done
from glyphs.errors import FileError
from pipeline.batch.progress import Progress
from pipeline.batch.setup import absolute, parts_for
from pipeline.batch.task import ReadPart, RunOrder, read_listed
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.common.version import reader_versions
from pipeline.files.listed import ListedPart
from pipeline.files.truth import load_truth, name_in, without_blanks
from pipeline.reading.certificate import Certificate, settings_described
from pipeline.reading.readers import open_reader
from pipeline.workers.options import ExecutorOptions
from recognition.decision.accepted_risk import (
    THRESHOLDS,
    ThresholdTest,
    certified,
    parts_missing,
    threshold_tests,
)
from recognition.decision.likeness import KindOfParts


@dataclass(frozen=True)
class LabelledPart:
    """A part of known text, as it was read.

    Attributes:
        read: its reading, or why there is none, and its measures.
        truth: what is stamped on it, without blanks.
        sha256: of its files.
    """

    read: ReadPart
    truth: str
    sha256: str

    @property
    def right(self) -> bool:
        """Whether it was read without any error."""
        return without_blanks(self.read.record.text) == self.truth


@dataclass(frozen=True)
class Certification:
    """What labelled parts have shown.

    Attributes:
        certificate: that they earn; None where no threshold is shown to hold the risk.
        tests: of every threshold.
        parts: how many there are.
        errors: of these, that could not be read.
        without_truth: parts that are in no line of the truth, and were not read.
        missing: how many more parts would earn a certificate, about; None where it has one, or no number would.
    """

    certificate: Certificate | None
    tests: tuple[ThresholdTest, ...]
    parts: int
    errors: int
    without_truth: int
    missing: int | None


def certify(
    inputs: Sequence[str],
    truth: Path,
    settings: ReadSettings,
    executors: ExecutorOptions,
    *,
    risk: float,
    confidence: float,
    manifests: Sequence[str] = (),
) -> Certification:
    """Read labelled parts, and test from which confidence on they may be accepted.

    Args:
        inputs: files, folders, globs, URLs and manifests.
        truth: CSV with the columns part and text.
        settings: of reading; the certificate holds for these.
        executors: who reads.
        risk: share of wrong ones among the accepted that is not to be passed.
        confidence: with which that is to be shown.
        manifests: tables of parts.

    Raises:
        FileError: a table that cannot be used, or that names none of the parts.
        SettingsError: settings that cannot be certified.
        NothingFoundError: no part.
        ValueError: a risk or confidence that is none, settings that cannot be used.
    """
    if settings.certificate is not None:
        raise SettingsError("a certificate is set, which keeps parts from acceptance", hint="leave it away")
    threshold_tests((), (), risk=risk, confidence=confidence)
    known = load_truth(truth)
    found = parts_for(inputs, settings, manifests=manifests)
    parts = [part for part in found if name_in(known, part.name) is not None]
    if not parts:
        raise FileError(truth, "tells the truth of none of the parts", "name the parts as their files")
    if own := next((part.name for part in parts if part.format or part.font), ""):
        raise SettingsError(
            f"{own} has a format or font of its own, but a certificate holds for one way of reading",
            hint="certify the parts of each format by themselves, with --format and --font",
        )
    least = open_reader(settings).settings.accept_confidence
    labels = {part.name: without_blanks(known[str(name_in(known, part.name))]) for part in parts}
    read = _all_read(parts, labels, settings, executors)
    return _certification(
        read, len(found) - len(parts), settings, risk=risk, confidence=confidence, least=least
    )


def _all_read(
    parts: Sequence[ListedPart],
    labels: dict[str, str],
    settings: ReadSettings,
    executors: ExecutorOptions,
) -> list[LabelledPart]:
    """Every part with its label, by name."""
    from pipeline.batch.run import lost_part
    from pipeline.batch.setting_files import files_to_send

    sent = files_to_send(settings) if executors.cluster is not None else {}
    order, found = RunOrder(settings, measures=True, sent=sent), []
    tasks = absolute(parts) if executors.cluster is not None else parts
    with Progress() as progress, compiling_shown(progress.line), executors.opened(len(parts)) as executor:
        progress.start(len(parts))
        for outcome in executor.calls(_read_and_hashed, order, tasks):
            sha256 = outcome.result[1] if outcome.result is not None else ""
            one = outcome.result[0] if outcome.result is not None else lost_part(outcome.task, outcome.error)
            found.append(LabelledPart(one, labels[outcome.task.name], sha256))
            part_done()
            progress.advance(failed=bool(one.record.error))
    return sorted(found, key=lambda part: part.read.listed.name)


def _read_and_hashed(order: RunOrder, listed: ListedPart) -> tuple[ReadPart, str]:
    """A part as it was read, and the hash of its files."""
    from pipeline.files.remote import fetched

    read, digest = read_listed(order, listed), hashlib.sha256()
    if not read.record.error:
        with fetched(listed) as part:
            for path in (part.height_map, part.scan, part.photo, *part.more_photos):
                digest.update(b"" if path is None else path.read_bytes())
    return read, digest.hexdigest()


def _certification(
    parts: Sequence[LabelledPart],
    without_truth: int,
    settings: ReadSettings,
    *,
    risk: float,
    confidence: float,
    least: float,
) -> Certification:
    """What the parts show of confidences from the least that the settings accept."""
    accepted = [part for part in parts if part.read.record.decision == "accept"]
    tests = threshold_tests(
        [part.read.record.confidence for part in accepted],
        [part.right for part in accepted],
        risk=risk,
        confidence=confidence,
        thresholds=(*(t for t in THRESHOLDS if t > least), least),
    )
    errors, chosen = sum(bool(part.read.record.error) for part in parts), certified(tests)
    if chosen is None:
        missing = parts_missing(tests, len(parts), risk=risk, confidence=confidence)
        return Certification(None, tests, len(parts), errors, without_truth, missing)
    sure = [part.read.record for part in accepted if part.read.record.confidence >= chosen.threshold]
    sources = tuple(sorted({record.source for record in sure}))
    made = Certificate(
        made_at=datetime.now(UTC).replace(microsecond=0),
        risk=risk,
        confidence=confidence,
        threshold=chosen.threshold,
        sources=sources,
        parts=len(parts),
        accepted=chosen.accepted,
        wrong=chosen.wrong,
        bound=chosen.bound,
        tests=tests,
        kind=KindOfParts.of([part.read.measures for part in parts if part.read.record.source in sources]),
        data_sha256=_hash_of(parts),
        settings=settings_described(settings),
        versions=reader_versions(),
    )
    return Certification(made, tests, len(parts), errors, without_truth, None)


def _hash_of(parts: Sequence[LabelledPart]) -> str:
    """Of all files and labels, by the names of the parts."""
    lines = (f"{part.read.listed.name}\t{part.truth}\t{part.sha256}\n" for part in parts)
    return hashlib.sha256("".join(lines).encode()).hexdigest()

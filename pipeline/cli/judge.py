"""`tactile-marks certify` and `study`: test the reliability of readings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import FAILED, UsageError, resumable
from pipeline.cli.settings import (
    PARTS,
    READING,
    WORKERS,
    Config,
    JobPath,
    Parts,
    Reading,
    ReadingOfFile,
    Workers,
    with_flags,
)
from pipeline.cli.shared import Jobs, Positive
from pipeline.common.texts import first_of
from pipeline.workers.options import WorkerSettings

if TYPE_CHECKING:
    from pipeline.runs.certification import Certification

_GO_ON = "start the same command again to continue"


def certify(
    *inputs: str,
    truth: Path,
    risk: str = "1 in 1000",
    confidence: float = 0.95,
    out: Path = Path("certificate.json"),
    manifest: tuple[str, ...] = (),
    workers: Workers = WORKERS,
    reading: Reading = READING,
    job: JobPath = None,
    config: Config = None,
) -> int:
    """Show, on parts whose serials are known, from which confidence readings may be accepted, and write a certificate.

    Parts are read as by the command read, with the same settings. The certificate states the confidence from which at
    most RISK of the accepted serials are wrong, with a guarantee that allows for the number of parts. A page about it
    is written beside it (.html). Give it to read, serve and benchmark as --certificate. If no confidence can be
    certified, the command estimates how many parts are missing, and the exit status is 1. The same command continues an
    interrupted run.

    Args:
        inputs: Parts, as for read.
        truth: CSV with the columns part and text: the stamped serials. Parts without a line are left out.
        risk: Greatest share of wrong serials among the accepted: 0.001, 1/1000 or "1 in 1000".
        confidence: Confidence level of that guarantee, such as 0.95.
        out: Certificate to write (.json).
        manifest: Table (.csv) of parts, as for read; may be repeated.
    """
    if not (inputs or manifest):
        raise UsageError("certify: name the parts, as for read")
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"certify: confidence is {confidence:g}", "it lies between 0 and 1")
    from recognition.decide.risk_text import parse_risk, risk_in_words

    try:
        greatest_risk = parse_risk(risk)
    except ValueError as error:
        raise UsageError(f"certify: risk is {risk}", str(error)) from error
    if out.suffix.lower() != ".json":
        raise UsageError(f"certify: --out is {out}", "name a file that ends in .json")
    from pipeline.benchmark.report.page import write_certificate_page
    from pipeline.common.output_paths import check_writable
    from pipeline.reading.certificate import load_certificate, write_certificate
    from pipeline.runs import certification

    check_writable(out)
    with resumable(out.parent, hint=_GO_ON):
        result = certification.certify(
            inputs, truth, reading, workers, out=out, risk=greatest_risk, confidence=confidence,
            manifests=manifest,
        )  # fmt: skip
    _print_tests(result, confidence)
    if result.certificate is None:
        print(_what_is_missing(result, greatest_risk, confidence))
        if out.exists():
            old = load_certificate(out)
            print(
                f"{out} is still the one of {old.made_at:%Y-%m-%d}, for a risk of {risk_in_words(old.risk)}"
            )
        return FAILED
    page = out.with_suffix(".html")
    write_certificate(result.certificate, out)
    write_certificate_page(result.certificate, page)
    print(f"{result.certificate.describe()}\nwrote {out}\nwrote {page}")
    return 0


def _print_tests(result: Certification, confidence: float) -> None:
    from pipeline.cli.shared import print_table

    words = [f"{result.parts:,} labelled parts"]
    words += [f"{result.errors:,} with an error"] if result.errors else []
    words += [f"{result.without_truth:,} without a label left out"] if result.without_truth else []
    print(", ".join(words))
    rows = (
        (f"{test.threshold:g}", f"{test.accepted:,}", test.wrong, f"{test.bound:.3%}", test.shown.value)
        for test, after in zip(result.tests, (*result.tests[1:], None), strict=True)
        # the last of the thresholds that accept the same parts
        if after is None or after.accepted != test.accepted or after.shown is not test.shown
    )
    headings = ("accepted from", "parts", "wrong", f"at most ({confidence:.4g})", "risk")
    print_table(headings, rows, ("risk",))


def _what_is_missing(result: Certification, risk: float, confidence: float) -> str:
    from pipeline.common.accepted_risk import parts_needed
    from recognition.decide.risk_text import risk_in_words

    needed = parts_needed(risk, confidence=confidence)
    more = (
        "parts like these are accepted wrongly too often, or never accepted: more will not help"
        if result.missing is None
        else f"about {result.missing:,} more parts like these are missing"
    )
    return (
        f"not certified: a risk of {risk_in_words(risk)} at {confidence:.0%} confidence takes {needed:,} accepted "
        f"parts without a wrong one, or more with few wrong ones; {more}"
    )


def study(
    *inputs: str,
    repeats: Jobs = 3,
    arrays: Jobs = 2,
    reviewers: Path | None = None,
    truth: Path | None = None,
    out: Path = Path("study"),
    jobs: Positive = None,
    parts: Parts = PARTS,
    reading: ReadingOfFile = READING,
    job: JobPath = None,
    config: Config = None,
) -> int:
    """Read every part several times, and report the agreement of readings and the repeatability of depth.

    Height maps are scanned again for every trial. Files NAME.1, NAME.2 ... are trials of one part. A single scan or
    photograph is perturbed for every trial. Writes study.html, study.md, study.json and readings.csv. The exit status
    is 1 if any trial has no reading. The same command continues an interrupted run.

    Args:
        inputs: Height maps, scans and photographs, folders, globs and manifests of them, as for read.
        repeats: Trials of every part.
        arrays: Virtual arrays that each measure every height map, to show what another array changes; recordings and
            photographs have one.
        reviewers: CSV with the columns part, reviewer and text: readings by people; several lines with one reviewer and
            part are trials.
        truth: CSV with the columns part and text (default: the expected texts of a manifest).
        out: Folder for the page and the tables.
        jobs: Worker processes (default: one for each core), or none for a few parts.
    """
    if not inputs:
        raise UsageError("study: name parts, folders, globs or manifests")
    from pipeline.benchmark.study.repeats import StudyPlan
    from pipeline.benchmark.study.run import run_study
    from pipeline.cli.shared import print_document

    with resumable(out, hint=_GO_ON):
        plan = StudyPlan(with_flags(reading, parts), repeats, arrays)
        result, document, written = run_study(
            plan, inputs, out, WorkerSettings(jobs=jobs), reviewers=reviewers, truth=truth
        )
    print_document(document, written)
    errors = {m.part for m in result.measured if m.error}
    if errors:
        what = f"{len(errors)} parts could not be read in every trial; they are in readings.csv"
        print(f"{what}: {first_of(sorted(errors))}", file=sys.stderr)
    return FAILED if errors else 0

"""`tactile-marks certify`: from which confidence one's own parts may be accepted, shown and written down."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import INTERRUPTED, USAGE, CommandError, failures_reported
from pipeline.cli.settings import READING, Config, JobPath, Reading
from pipeline.workers.options import ExecutorOptions

if TYPE_CHECKING:
    from pipeline.runs.certification import Certification

_EXECUTORS = ExecutorOptions()


def certify(
    *inputs: str,
    truth: Path,
    risk: float = 0.001,
    confidence: float = 0.95,
    out: Path = Path("certificate.json"),
    manifest: tuple[str, ...] = (),
    executors: Annotated[ExecutorOptions, Parameter(name="*")] = _EXECUTORS,
    reading: Reading = READING,
    job: JobPath = None,
    config: Config = None,
) -> int:
    """Show, on parts whose serials are known, from which confidence readings may be accepted, and write a certificate.

    Parts are read as read does, with the same settings. The certificate names the confidence from which at most RISK
    of what is accepted is wrong, by a guarantee that allows for the number of parts; a page of it stands beside it, in
    .html. Give it to read, serve and benchmark as --certificate. Where no confidence can be shown, it says about how
    many parts are missing, and the exit status is 1. What was broken off, the same command goes on with.

    Parameters
    ----------
    inputs
        Parts, as for read.
    truth
        CSV with the columns part and text: what is stamped on them. Parts without a line are left out.
    risk
        Share of wrong serials among the accepted that is not to be passed, such as 0.001.
    confidence
        With which that is to be shown, such as 0.95.
    out
        Certificate to write (.json).
    manifest
        Table (.csv, .parquet) of parts, as for read; may be repeated.
    """
    if not (inputs or manifest):
        raise CommandError("certify: name the parts, as for read", status=USAGE)
    for name, value in (("risk", risk), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise CommandError(f"certify: {name} is {value:g}", hint="it lies between 0 and 1", status=USAGE)
    if out.suffix.lower() != ".json":
        raise CommandError(f"certify: --out is {out}", hint="name a file that ends in .json", status=USAGE)
    with failures_reported():
        from glyphs.atomic import check_writable
        from pipeline.benchmark.report.certificate_page import write_certificate_page
        from pipeline.benchmark.report.writing import command_line
        from pipeline.reading.certificate import write_certificate
        from pipeline.runs.certification import certify as certified_by
        from pipeline.workers.cluster import ClusterError

        check_writable(out)
        try:
            found = certified_by(
                inputs,
                truth,
                reading,
                executors,
                out=out,
                risk=risk,
                confidence=confidence,
                manifests=manifest,
            )
        except ClusterError as error:
            raise CommandError(str(error)) from error
        except KeyboardInterrupt as error:
            raise CommandError(
                "interrupted", hint="start the same command again to go on", status=INTERRUPTED
            ) from error
        _print_tests(found, confidence)
        if found.certificate is None:
            print(_what_is_missing(found, risk, confidence))
            return 1
        page = out.with_suffix(".html")
        write_certificate(found.certificate, out)
        write_certificate_page(found.certificate, page, command=command_line())
        print(found.certificate.describe())
        for path in (out, page):
            print(f"wrote {path}")
    return 0


def _print_tests(found: Certification, confidence: float) -> None:
    """What was read, and the thresholds at which anything changes."""
    from pipeline.cli.benchmarking.result import plain_table, screen

    words = [f"{found.parts:,} labelled parts"]
    words += [f"{found.errors:,} with an error"] if found.errors else []
    words += [f"{found.without_truth:,} without a label left out"] if found.without_truth else []
    print(", ".join(words))
    bound = f"at most ({confidence:.4g})"
    table = plain_table(("accepted from", "parts", "wrong", bound, "risk"), ("risk",))
    for test, after in zip(found.tests, (*found.tests[1:], None), strict=True):
        # of thresholds that accept the same parts, the most lenient
        if after is None or after.accepted != test.accepted or after.shown is not test.shown:
            table.add_row(
                f"{test.threshold:g}",
                f"{test.accepted:,}",
                str(test.wrong),
                f"{test.bound:.3%}",
                test.shown.value,
            )
    screen().print(table)


def _what_is_missing(found: Certification, risk: float, confidence: float) -> str:
    from recognition.decision.accepted_risk import parts_needed

    needed = parts_needed(risk, confidence=confidence)
    said = (
        f"not certified: a risk of {risk:g} at {confidence:.0%} confidence takes {needed:,} accepted parts without "
        "a wrong one, or more with few wrong ones"
    )
    if found.missing is None:
        return (
            f"{said}; parts like these are accepted wrongly too often, or never accepted: more will not help"
        )
    return f"{said}; about {found.missing:,} more parts like these are missing"

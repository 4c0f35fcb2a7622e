"""`tactile-marks read`: parts in, a table of serials out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import INTERRUPTED, USAGE, CommandError, failures_told
from pipeline.cli.settings import READING, Config, Reading

Texts = Annotated[list[str] | None, Parameter(negative="")]


def read(
    *inputs: str,
    manifest: Texts = None,
    verify: str | None = None,
    truth: Path | None = None,
    out: str | None = None,
    evidence: Path | None = None,
    summary: Path | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    part_timeout_s: float = 900.0,
    reading: Reading = READING,
    config: Config = None,
) -> int:
    """Read the serials of parts: height maps, scans and photographs, folders, globs and manifests of them.

    Rows are kept as they come: a run that was broken off goes on when the same command is given again. The exit
    status is 1 if any part could not be read, and where texts are expected unless every part is confirmed.

    Parameters
    ----------
    inputs
        Height maps (.npz, .x3p, .sdf, .sur ...), scans (.h5) and photographs (.png, .jpg ...), or folders and globs
        of them; files of one stem are one part. URLs (s3://, gs:// ...) with the extra cluster, and manifests.
    manifest
        Table (.csv, .parquet) of parts, with the columns part, height_map, scan, photo, expected, format, font, of
        which any may be missing; may be repeated. Files are named from where the table lies.
    verify
        Text that the parts should bear, or a CSV with the columns part and text: each is confirmed, refuted or
        undecided, and the exit status is 1 unless every part is confirmed.
    truth
        CSV with the columns part and text; prints the accuracy.
    out
        Table to write (.csv, .jsonl or .parquet), or the store of a service (sqlite:///FILE, postgresql://...).
        Parts that cannot be read are listed beside it, in NAME.quarantine.csv, a manifest itself.
    evidence
        The service's folder of evidence: with a store, pictures of the parts to be reviewed are put there.
    summary
        JSON file for the counts, reasons, rate and slowest parts that are printed.
    jobs
        Worker processes; one for each core unless given, or none for a few parts.
    cluster
        Address of a Dask scheduler (tcp://HOST:8786), whose workers read instead. Needs the extra cluster.
    part_timeout_s
        A part that takes a worker process longer is given up.
    """
    from pipeline.batch.production import Asked, produce
    from pipeline.batch.setup import Target
    from pipeline.store.errors import StoreError
    from pipeline.workers.cluster import ClusterError
    from pipeline.workers.options import ExecutorOptions

    given = (*inputs, *(manifest or ()))
    if not given:
        raise CommandError(
            "read: name a height map, a scan, a photograph, a folder, a glob or a manifest", status=USAGE
        )
    with failures_told():
        target = Target(out, evidence)
        target.check()
        means = ExecutorOptions(jobs, cluster, part_timeout_s)
        try:
            return produce(
                Asked(inputs, tuple(manifest or ()), verify, truth, summary), reading, target, means
            )
        except (ClusterError, StoreError) as error:
            raise CommandError(str(error)) from error
        except KeyboardInterrupt as error:
            if out is None:
                raise
            raise CommandError(
                "interrupted",
                hint=f"what is done stands in {out}, the same command goes on from there",
                status=INTERRUPTED,
            ) from error

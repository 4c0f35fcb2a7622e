"""`tactile-marks read`: parts in, a table of serials out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pipeline.cli.exit_status import INTERRUPTED, USAGE, CommandError, failures_told

ModeName = Literal["tactile", "vision", "fused", "auto"]
FidelityName = Literal["pointwise", "contact"]
Texts = Annotated[list[str] | None, Parameter(negative="")]


def read(
    *inputs: str,
    manifest: Texts = None,
    mode: ModeName | None = None,
    font: Texts = None,
    format: Texts = None,
    lexicon: Path | None = None,
    check: Texts = None,
    exclude: str | None = None,
    verify: str | None = None,
    height_mm: float | None = None,
    fidelity: FidelityName | None = None,
    database: Path | None = None,
    depth_rule: str | None = None,
    min_depth_mm: float | None = None,
    accept_confidence: float | None = None,
    accept_margin: float | None = None,
    truth: Path | None = None,
    out: str | None = None,
    evidence: Path | None = None,
    summary: Path | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    part_timeout_s: float = 900.0,
    config: Path | None = None,
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
    mode
        Senses that read: touch, the camera, both together, or whatever a part has files for. Without it touch
        reads, and the camera what is a photograph only.
    font
        Built-in name or TTF/OTF file; may be repeated. Without it every built-in font competes.
    format
        What serials look like; may be repeated, all must hold. A mask (A letter, 9 digit, * either, any other
        character itself), re:EXPRESSION, sets:AB,0-9,... a place each, vin, check:RULE; +check=RULE and
        +exclude=IOQ may follow any of them.
    lexicon
        File of the serials that there are, one a line; # starts a comment.
    check
        Check digit that must hold, such as luhn, iso7064mod37_2 or stdnum:imei; luhn@3-8 looks at places 3 to 8.
    exclude
        Characters that no serial has, such as IOQ.
    verify
        Text that the parts should bear, or a CSV with the columns part and text: each is confirmed, refuted or
        undecided, and the exit status is 1 unless every part is confirmed.
    height_mm
        Character height in mm; found out if not given.
    fidelity
        How touch is simulated.
    database
        Glyph database to take the fonts from.
    depth_rule
        Rule that the marks must meet, such as 27CFR478.92; parts that do not are told, the text is read alike.
    min_depth_mm
        Depth in mm that the marks must have everywhere; told alike.
    accept_confidence
        Least confidence, 0 to 1, of a reading that is accepted.
    accept_margin
        Least lead of every character over its rival, 0 to 1, in a reading that is accepted.
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
    config
        TOML file with settings; tactile-marks.toml in the working folder is read by itself.
    """
    from pipeline.batch.production import Asked, produce
    from pipeline.batch.setup import ExecutorOptions, Target
    from pipeline.common.settings import load_settings
    from pipeline.store.errors import StoreError
    from pipeline.workers.cluster import ClusterError

    given = (*inputs, *(manifest or ()))
    if not given:
        raise CommandError(
            "read: name a height map, a scan, a photograph, a folder, a glob or a manifest", status=USAGE
        )
    with failures_told():
        settings = load_settings(
            config=config,
            mode=mode,
            font=tuple(font) if font else None,
            format=tuple(format) if format else None,
            lexicon=lexicon,
            check=tuple(check) if check else None,
            exclude=exclude,
            height_mm=height_mm,
            fidelity=fidelity,
            database=database,
            depth_rule=depth_rule,
            min_depth_mm=min_depth_mm,
            accept_confidence=accept_confidence,
            accept_margin=accept_margin,
        )
        target = Target(out, evidence)
        target.check()
        means = ExecutorOptions(jobs, cluster, part_timeout_s)
        try:
            return produce(
                Asked(inputs, tuple(manifest or ()), verify, truth, summary), settings, target, means
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

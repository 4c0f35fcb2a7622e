"""`tactile-marks demo`: make, scan and read a few parts."""

from __future__ import annotations

from pathlib import Path

from pipeline.cli.exit_status import FAILED, USAGE, CommandError, failures_told


def demo(out: Path = Path("demo-out"), *, service: bool = False, stay: bool = False) -> int:
    """Stamp a few plates, scan them with the virtual whiskers, read them, and draw what happened.

    The exit status is 1 if a serial was not read correctly.

    Parameters
    ----------
    out
        Folder for plates, recordings, overview.png and overview.html.
    service
        Show the service instead: dirty parts pass its camera, and what that is unsure of, its stage feels. The
        exit status is then 1 if it accepted a serial that is wrong.
    stay
        With --service: leave it running, for a look at the operator's page, until Ctrl-C.
    """
    if stay and not service:
        raise CommandError("demo: --stay goes with --service", status=USAGE)
    if service:
        return _serve(out, stay=stay)
    with failures_told():
        from pipeline.cli.demonstration import run_demo
        from pipeline.plots.pictures import SheetPart, headline, same_text

        def tell(part: SheetPart) -> None:
            right = "right" if same_text(part.reading.text, part.truth) else "WRONG"
            print(
                f"{part.name:<14} stamped {part.truth}: {right}: {headline(part.reading)}",
                flush=True,
            )

        print("stamping, scanning and reading (the first part also compiles the kernels) ...", flush=True)
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CommandError(
                f"{out} cannot be made ({error.strerror})", hint="name another folder"
            ) from error
        result = run_demo(out, on_part=tell)
    print(f"picture: {result.overview.resolve()}")
    print(f"page:    {result.page.resolve()}")
    return 0 if result.all_right else FAILED


def _serve(out: Path, *, stay: bool) -> int:
    """The service at work, part by part."""
    with failures_told():
        import pipeline.cli.serving  # noqa: F401 - what is not installed is told before parts are made
        from pipeline.cli.service_demonstration import ServedPart, run_service_demo
        from pipeline.service.client import ServiceError
        from pipeline.service.process import NotServingError

        def tell(part: ServedPart) -> None:
            print(f"{part.name}  dirt {part.dirt:.1f}  stamped {part.truth}")
            for kind, record in (("camera", part.seen), ("touch", part.felt)):
                if record is not None and record.reading is not None:
                    reading = record.reading
                    print(
                        f"    {kind:<7} {reading.text or 'nothing':<10} confidence {reading.confidence:.3f}, "
                        f"{reading.seconds:.1f} s -> {record.state.value.replace('_', ' ')}",
                        flush=True,
                    )
            if part.seen.plan is not None:
                plan = part.seen.plan
                x0, y0, x1, y1 = plan.region_mm
                print(
                    f"            felt {x1 - x0:.0f} x {y1 - y0:.0f} mm in {plan.passes} passes, {plan.seconds:.0f} s"
                )

        try:
            served = run_service_demo(
                out,
                on_part=tell,
                say=lambda line: print(line, flush=True),
                stay=_until_interrupted if stay else None,
            )
        except (NotServingError, ServiceError) as error:
            raise CommandError(str(error)) from error
    states = [part.last.state.value for part in served]
    print(
        f"{len(served)} parts: {states.count('accepted')} accepted, {states.count('review')} for a person to look at"
    )
    return FAILED if any(part.accepted_wrong for part in served) else 0


def _until_interrupted() -> None:
    import time

    try:
        while True:
            time.sleep(3600.0)
    except KeyboardInterrupt:
        print()

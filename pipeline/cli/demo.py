"""`tactile-marks demo`: make, scan and read a few parts."""

from __future__ import annotations

import sys
from pathlib import Path

from pipeline.cli.exit_status import FAILED, USAGE, CommandError, failures_reported


def demo(
    out: Path = Path("demo-out"),
    *,
    service: bool = False,
    stay: bool = False,
    animation: Path | None = None,
) -> int:
    """Stamp a few plates, scan them with simulated whiskers, read them, and draw what happened.

    The exit status is 1 if a serial was not read correctly.

    Parameters
    ----------
    out
        Folder for plates, recordings, overview.png and overview.html.
    service
        Show the service instead: dirty parts pass its camera, and where the camera is unsure, its stage scans
        them. The exit status is then 1 if it accepted a wrong serial.
    stay
        With --service: leave it running until Ctrl-C, for a look at the operator's page.
    animation
        Show active touch instead: a dirty part is felt pass by pass until its serial is sure, and drawn as an
        animation, .gif or .png (APNG), with its last frame beside it as NAME-still.png.
    """
    if stay and not service:
        raise CommandError("demo: --stay goes with --service", status=USAGE)
    if animation is not None:
        if service:
            raise CommandError("demo: give --service or --animation, not both", status=USAGE)
        return _animate(animation)
    if service:
        return _serve(out, stay=stay)
    with failures_reported():
        from pipeline.cli.demonstration import run_demo
        from pipeline.common.texts import same_text
        from pipeline.plots.pictures import SheetPart

        def show(part: SheetPart) -> None:
            reading = part.reading
            right = "right" if same_text(reading.text, part.truth) else "WRONG"
            print(
                f"{part.name:<13} {part.truth:<9} {reading.text or 'nothing':<9} {right:<6} {reading.decision:<9}"
                f" {reading.confidence:10.3f}  {reading.font}",
                flush=True,
            )

        print("Stamping plates, scanning them with simulated whiskers, and reading them without")
        print("being given font or size. The first run on a machine takes longer: it compiles.\n")
        print(f"{'part':<13} {'stamped':<9} {'read':<9} {'':<6} {'decision':<9} confidence  font", flush=True)
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CommandError(
                f"{out} cannot be made ({error.strerror})", hint="name another folder"
            ) from error
        result = run_demo(out, on_part=show, say=lambda line: print(line, file=sys.stderr, flush=True))
    print(f"\npicture: {result.overview.resolve()}")
    print(f"page:    {result.page.resolve()}  (open it in a browser)")
    return 0 if result.all_right else FAILED


def _animate(path: Path) -> int:
    """Draw active touch, and print what was believed pass by pass."""
    with failures_reported():
        from pipeline.cli.active_demonstration import run_active_demo
        from pipeline.common.texts import same_text
        from pipeline.plots.active_animation import check_animation

        check_animation(path)
        print(
            "Feeling a dirty part pass by pass. The first run on a machine takes longer: it compiles.\n",
            flush=True,
        )
        done = run_active_demo(path)
        for number, one in enumerate(done.found.passes, start=1):
            believed = f"{one.text} {one.confidence:.3f}" if one.text else ""
            print(f"pass {number:>2}  {one.stage_s:5.1f} s  {one.why:<36} {believed}")
    right = same_text(done.found.reading.text, done.truth)
    print(f"\n{done.found.describe()}; stamped {done.truth}: {'right' if right else 'WRONG'}")
    print(f"animation: {done.animation.resolve()}\nlast frame: {done.still.resolve()}")
    return 0 if right else FAILED


def _serve(out: Path, *, stay: bool) -> int:
    """Print what the service does, part by part."""
    with failures_reported():
        import pipeline.cli.serving  # noqa: F401 - what is not installed is said before parts are made
        from pipeline.cli.service_demonstration import ServedPart, run_service_demo
        from pipeline.service.client import ServiceError
        from pipeline.service.process import NotServingError

        def show(part: ServedPart) -> None:
            print(f"{part.name}  stamped {part.truth}, dirt {part.dirt:.1f}")
            for sense, record in (("camera", part.by_camera), ("touch", part.by_touch)):
                if record is not None and record.reading is not None:
                    reading = record.reading
                    print(
                        f"    {sense:<7} {reading.text or 'nothing':<9} confidence {reading.confidence:.3f} in "
                        f"{reading.seconds:.1f} s: {record.state.value.replace('_', ' ')}",
                        flush=True,
                    )
                plan, felt = part.by_camera.plan, part.last.reading
                if sense == "camera" and plan is not None and felt is not None and felt.stage_s is not None:
                    print(
                        f"    stage   feels {len(felt.passes)} passes in {felt.stage_s:.0f} s of stage time "
                        f"({felt.stopped}); the whole plan takes {plan.passes} in {plan.seconds:.0f} s"
                    )

        try:
            served = run_service_demo(
                out,
                on_part=show,
                say=lambda line: print(line, flush=True),
                stay=_until_interrupted if stay else None,
            )
        except (NotServingError, ServiceError) as error:
            raise CommandError(str(error)) from error
    states = [part.last.state.value for part in served]
    print(
        f"{len(served)} parts: {states.count('accepted')} accepted, {states.count('review')} for a person to review"
    )
    return FAILED if any(part.accepted_wrong for part in served) else 0


def _until_interrupted() -> None:
    import time

    try:
        while True:
            time.sleep(3600.0)
    except KeyboardInterrupt:
        print()

"""`tactile-marks demo`: make, scan and read a few parts."""

from __future__ import annotations

import contextlib
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import FAILED, CommandError, UsageError

if TYPE_CHECKING:
    from pipeline.cli.demonstration import ServedPart


def demo(
    out: Path = Path("demo-out"), *, service: bool = False, stay: bool = False, animation: Path | None = None
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
        raise UsageError("demo: --stay goes with --service")
    if animation is not None and service:
        raise UsageError("demo: give --service or --animation, not both")
    if animation is not None:
        return _animate(animation)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"{out} cannot be made ({error.strerror})", hint="name another folder") from error
    return _serve(out, stay=stay) if service else _read(out)


def _read(out: Path) -> int:
    """Print each plate as it is read."""
    from pipeline.cli.demonstration import draw_plates, read_plates

    print("Stamping plates, scanning them with simulated whiskers, and reading them without")
    print("being given font or size. The first run on a machine takes longer: it compiles.\n")
    print(f"{'part':<13} {'stamped':<9} {'read':<9} {'':<6} {'decision':<9} confidence  font", flush=True)
    parts = []
    for part in read_plates(out):
        reading = part.reading
        print(
            f"{part.name:<13} {part.truth:<9} {reading.text or 'nothing':<9} {'right' if part.right else 'WRONG':<6} "
            f"{reading.decision:<9} {reading.confidence:10.3f}  {reading.font}",
            flush=True,
        )
        parts.append(part)
    print("drawing the overview and the page ...", file=sys.stderr, flush=True)
    overview, page = draw_plates(parts, out)
    print(f"\npicture: {overview.resolve()}")
    print(f"page:    {page.resolve()}  (open it in a browser)")
    return 0 if all(part.right for part in parts) else FAILED


def _animate(path: Path) -> int:
    """Draw active touch, and print the reading pass by pass."""
    from pipeline.cli.demonstration import animate_active_touch
    from pipeline.common.texts import same_text
    from pipeline.plots.active_animation import check_animation

    check_animation(path)
    print(
        "Feeling a dirty part pass by pass. The first run on a machine takes longer: it compiles.\n",
        flush=True,
    )
    truth, found, still = animate_active_touch(path)
    for number, one in enumerate(found.passes, start=1):
        read = f"{one.text} {one.confidence:.3f}" if one.text else ""
        print(f"pass {number:>2}  {one.stage_s:5.1f} s  {one.why:<36} {read}")
    right = same_text(found.reading.text, truth)
    print(f"\n{found.describe()}; stamped {truth}: {'right' if right else 'WRONG'}")
    print(f"animation: {path.resolve()}\nlast frame: {still.resolve()}")
    return 0 if right else FAILED


def _serve(out: Path, *, stay: bool) -> int:
    """Print what the service does, part by part."""
    import uvicorn  # noqa: F401 - a missing extra is reported before parts are made

    from pipeline.cli import demonstration as shown
    from pipeline.service.client import Client
    from pipeline.service.process import service_process

    folder, served = out / "parts", []
    print(
        f"making {len(shown.SEVERITIES)} parts, from clean to filthy, and their photographs in {folder} ..."
    )
    made = shown.make_dirty_parts(folder)
    print("starting the service (the first start on a machine takes longer: it compiles) ...", flush=True)
    reading = ("--format", shown.FORMAT, "--font", "gothic", "--height-mm", "5", "--orientation", "upright")
    folders = ("--stage.folder", str(folder), "--camera.folder", str(folder))
    with service_process(out / "service", *folders, *reading) as service, Client(service.url) as client:
        print(f"it answers at {service.url}", flush=True)
        for part in shown.serve_parts(client, made, folder):
            served.append(part)
            _print_served(part)
        if stay:
            print(f"the operator's page is at {service.url}/review; Ctrl-C ends the service", flush=True)
            with contextlib.suppress(KeyboardInterrupt):
                threading.Event().wait()
    states = [part.last.state.value for part in served]
    print(
        f"{len(served)} parts: {states.count('accepted')} accepted, {states.count('review')} for a person to review"
    )
    return FAILED if any(part.accepted_wrong for part in served) else 0


def _print_served(part: ServedPart) -> None:
    print(f"{part.name}  stamped {part.truth}, dirt {part.dirt:.1f}")
    for sense, record in (("camera", part.by_camera), ("touch", part.by_touch)):
        if record is None or record.reading is None:
            continue
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

"""`tactile-marks demo`: make, scan and read a few parts."""

from __future__ import annotations

from pathlib import Path

from pipeline.failing import FAILED, CommandError, failures_told


def demo(out: Path = Path("demo-out")) -> int:
    """Stamp a few plates, scan them with the virtual whiskers, read them, and draw what happened.

    The exit status is 1 if a serial was not read correctly.

    Parameters
    ----------
    out
        Folder for plates, recordings, overview.png and overview.html.
    """
    with failures_told():
        from pipeline.demo import run_demo
        from pipeline.pictures import SheetPart, headline, same_text
        from pipeline.problems import FileProblem
        from whisker_array.recording import RecordingError

        def tell(part: SheetPart) -> None:
            right = "right" if same_text(part.evidence.reading.text, part.truth) else "WRONG"
            print(
                f"{part.name:<14} stamped {part.truth}: {right}: {headline(part.evidence.reading)}",
                flush=True,
            )

        print("stamping, scanning and reading (the first part also compiles the kernels) ...", flush=True)
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CommandError(f"{out} cannot be made ({error.strerror}); name another folder") from error
        try:
            result = run_demo(out, on_part=tell)
        except RecordingError as error:
            raise FileProblem(error.path, error.problem, error.mend) from error
    print(f"picture: {result.overview.resolve()}")
    print(f"page:    {result.page.resolve()}")
    return 0 if result.all_right else FAILED

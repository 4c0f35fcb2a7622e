"""`tactile-marks benchmark export`: an exam as files, for readers that are no part of this program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import INTERRUPTED, CommandError, failures_reported


def export(
    design: str,
    folder: Path,
    *,
    parts: int | None = None,
    felt: bool = True,
    jobs: int = 1,
    cluster: str | None = None,
    check: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Write an exam's parts, photographs, felt views and truth. An interrupted export goes on with the same command.

    Parameters
    ----------
    design
        An edition: marks-exam-1, marks-exam-1-240, marks-exam-1-48; or a TOML file of your own.
    folder
        For the files; made if it is not there.
    parts
        The first so many parts; all unless given. The first of a design are balanced, too.
    felt
        Write what touch feels; it takes a third of the time.
    jobs
        Worker processes.
    cluster
        Address of a Dask scheduler (tcp://HOST:8786), whose workers make the parts instead. Needs the extra cluster.
    check
        Write nothing: compare the folder with its manifest, and name what differs.
    """
    with failures_reported():
        from pipeline.benchmark.exam.designed_parts import DesignedParts
        from pipeline.benchmark.exam.editions import design_named
        from pipeline.benchmark.export import folder as exporting
        from pipeline.benchmark.export.exported_part import ExportOrder
        from pipeline.runs.progress import Progress
        from pipeline.workers.cluster import ClusterError
        from pipeline.workers.executors import WorkerLostError
        from pipeline.workers.options import ExecutorOptions

        order = ExportOrder(DesignedParts(design_named(design), parts), felt=felt)
        if check:
            found = exporting.check(order, folder)
            for difference in found:
                print(f"{difference.path}: {difference.problem}")
            if found:
                raise CommandError(
                    f"the folder differs from its manifest, files: {len(found)}",
                    hint="run the export again, and remove what is not in the manifest",
                )
            print(f"{folder} is as its manifest says")
            return 0
        total = len(order.parts.items())
        with Progress() as progress, ExecutorOptions(jobs, cluster).opened(total) as executor:
            try:
                written = exporting.export(
                    order,
                    folder,
                    executor=executor,
                    on_start=progress.start,
                    on_part=lambda _: progress.advance(),
                )
            except KeyboardInterrupt as error:
                raise CommandError(
                    "interrupted",
                    hint=f"finished parts are kept in {folder}, run the same command again to continue",
                    status=INTERRUPTED,
                ) from error
            except (WorkerLostError, ClusterError) as error:
                raise CommandError(str(error)) from error
    print(f"wrote {written} parts and their truth to {folder}")
    return 0

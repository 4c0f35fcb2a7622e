"""`tactile-marks benchmark`: how well parts of growing dirt are read, and a report of it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from cyclopts import App, Parameter

from pipeline.cli.choices import FaceName, FidelityName, listed
from pipeline.cli.exit_status import INTERRUPTED, USAGE, CommandError, failures_reported
from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from pipeline.benchmark.exam.condition import Condition
    from pipeline.benchmark.report.writing import Written
    from pipeline.benchmark.trials.journal import Trial
    from pipeline.benchmark.trials.run import Benchmark
    from pipeline.workers.executors import Executor

R = TypeVar("R")

app = App(name="benchmark", help="Measure how well dirty marks are read, by this reader and by others.")
app.command(
    "pipeline.cli.benchmarking.gate:gate",
    name="gate",
    help="Fail if the smallest edition is read worse than before.",
)
app.command(
    "pipeline.cli.benchmarking.export:export",
    name="export",
    help="Write an exam as files, for readers that are no part of this program.",
)
app.command("pipeline.cli.benchmarking.score:score", name="score", help="Score anybody's answers to an exam.")
app.command(
    "pipeline.cli.benchmarking.lot:lot",
    name="lot",
    help="Show what a lot of an unknown die gains by teaching itself.",
)
app.command(
    "pipeline.cli.benchmarking.compare:compare", name="compare", help="Show what a change did, part by part."
)


@app.default
def benchmark(
    *,
    out: Path,
    design: str | None = None,
    soil: str | None = None,
    dirt: str | None = None,
    parts: int | None = None,
    mode: str = "tactile,vision,fused",
    font: str | None = None,
    format: str | None = None,
    give: Annotated[list[str] | None, Parameter(negative="")] = None,
    seed: int | None = None,
    jobs: int = 1,
    cluster: str | None = None,
    experts: str | None = None,
    experts_apart: Annotated[bool, Parameter(negative="")] = False,
    peers: Annotated[bool, Parameter(negative="")] = False,
    perturb: Annotated[bool, Parameter(negative="")] = False,
    active: Annotated[bool, Parameter(negative="")] = False,
    reader: Annotated[list[str] | None, Parameter(negative="")] = None,
    height_mm: float | None = None,
    depth_mm: float | None = None,
    face: FaceName | None = None,
    fidelity: FidelityName = "contact",
    certificate: Path | None = None,
    inputs: Annotated[list[str] | None, Parameter(negative="")] = None,
    truth: Path | None = None,
) -> int:
    """Make dirty parts, read each in every mode, and write report.html, benchmark.csv, benchmark.json and benchmark.md.

    Start an interrupted run again with the same command; with more --parts it goes on where it ended. With --inputs
    and --truth the parts of a folder are read instead.

    Parameters
    ----------
    out
        Folder for the trials and the report; made if it is not there.
    design
        Which parts, and what readers are given of them: marks-exam-1, marks-exam-1-240, marks-exam-1-48, or a TOML
        file of your own. In place of the flags that say what parts are, but for --parts.
    soil
        What the dirt is, several separated by commas, each on parts of its own: workshop unless given, caked, rust,
        paint, weld, mud, wear, casting, module:function of your own; rust+paint is one over the other.
    dirt
        How dirty, 0 to 1, separated by commas; 0,0.3,0.6,0.9 unless given. Of --inputs: theirs, if known.
    parts
        Number of parts for every soil, dirt, font and format; 200 unless given. Of a design: the first so many; all
        unless given.
    mode
        What reads: tactile, vision, fused, lights (vision of four photographs, the lamp on another side each time),
        "rapidocr relief" and its like, separated by commas.
    font
        Built-in names or TTF/OTF files, separated by commas; gothic unless given. Of --inputs: those that may be
        theirs, all built-in ones unless given.
    format
        Masks of the serials, separated by commas; AA999999 unless given. Of --inputs: theirs, if known.
    give
        What the reader is given beside the part: font, height, format, several separated by commas, or nothing; the
        format alone, or what the design says, unless given. Repeat it to read every part with each:
        --give format --give font,format.
    seed
        Of everything random: the same seed gives the same parts; 1 unless given.
    jobs
        Worker processes.
    cluster
        Address of a Dask scheduler (tcp://HOST:8786), whose workers try the parts instead. Needs the extra cluster.
    experts
        Who has a say, separated by commas: network, templates; both unless given. Templates alone read by touch only.
    experts_apart
        Show beside each mode what every one of its experts would read alone: "tactile network", "tactile templates" and
        their like, which --mode takes, too.
    peers
        Let RapidOCR and Tesseract read the line as photographed, as felt (edges, relief) and as it is (ideal), for
        comparison (extra peers).
    perturb
        Read every part again under changes that should not matter: traced lines half a pitch beside, sensor noise, 6 %
        light, 1 % scale, another order of the passes. Fail (status 1) if an accepted serial becomes another accepted
        one. Takes about five times as long.
    active
        Show what a serial costs in stage seconds instead: touch that chooses its passes against uniform and random
        plans of several lengths and the whole one, read by touch alone. Writes active.html, active.csv and active.png.
    reader
        A reader of your own, module:function, that takes a pipeline.ExamPart and gives its text.
    height_mm
        Character height, mm; 5 unless given.
    depth_mm
        Depth of the marks, mm; 0.2 unless given.
    face
        Face of the die; flat unless given.
    fidelity
        How touch is simulated.
    certificate
        Certificate (.json, see certify), whatever settings it was made with: the modes accept nothing that it does
        not vouch for, and the report says where the parts are unlike the certified ones.
    inputs
        Folders, files or globs of parts made elsewhere: NAME.npz, with NAME.png beside it for the camera.
    truth
        CSV with the columns part and text, for --inputs.
    """
    with failures_reported():
        if (inputs is None) != (truth is None):
            raise CommandError("benchmark: --inputs and --truth go together", status=USAGE)
        if jobs < 1:
            raise CommandError(f"benchmark: jobs is {jobs}", hint="it must be at least 1", status=USAGE)
        if parts is not None and parts < 1:
            raise CommandError(f"benchmark: parts is {parts}", hint="it must be at least 1", status=USAGE)
        of_folders = {"dirt": dirt, "font": font, "format": format}
        of_made = {
            "soil": soil,
            "seed": seed,
            "height-mm": height_mm,
            "depth-mm": depth_mm,
            "face": face,
        }
        if inputs is not None and (extra := _given({"parts": parts, "give": give, **of_made})):
            raise CommandError(f"benchmark: {extra} is for parts that are made", status=USAGE)
        if design is not None and (extra := _given({"inputs": inputs, **of_folders, **of_made})):
            raise CommandError(
                f"benchmark: --design says what the parts are, and so does {extra}",
                hint="leave one of them out",
                status=USAGE,
            )
        from pipeline.benchmark.exam.design import Design
        from pipeline.benchmark.exam.designed_parts import DesignedParts
        from pipeline.benchmark.exam.editions import design_named
        from pipeline.benchmark.exam.folder_parts import FolderParts
        from pipeline.benchmark.exam.specimens import Parts
        from pipeline.benchmark.readers.experts import experts_in
        from pipeline.benchmark.readers.modes import PEERS
        from pipeline.benchmark.report.writing import command_line, write_report
        from pipeline.benchmark.trials.run import Benchmark
        from pipeline.cli.benchmarking.result import print_result
        from pipeline.reading.certificate import checked
        from pipeline.reading.perturbation import PERTURBATIONS
        from recognition.language.orientation import Orientation
        from recognition.senses.settings import ReaderSettings
        from whisker_array.simulation.traces import Fidelity

        source: Parts
        vouching = checked(certificate) if certificate is not None else None
        # parts of a design lie upright; how those of somebody else lie is not known
        lie = Orientation.UPRIGHT if inputs is None else Orientation.ANY
        try:
            reading = ReaderSettings(
                fidelity=Fidelity(fidelity), orientation=lie, experts=listed(experts or "")
            )
        except ValueError as error:
            raise SettingsError(f"--experts is {experts!r}: {error}") from error
        if vouching is not None:
            reading = replace(reading, **vouching.thresholds())
        if inputs is not None and truth is not None:
            reading = replace(reading, fonts=listed(font or ""))
            source = FolderParts.load(inputs, truth, _condition(listed(format or ""), _numbers(dirt or "")))
        elif design is not None:
            source = DesignedParts(design_named(design).giving(tuple(give or ())), parts)
        else:
            source = DesignedParts(
                Design.of(
                    seed=1 if seed is None else seed,
                    parts_a_cell=200 if parts is None else parts,
                    cross=("font", "format", "soil", "severity"),
                    alike=True,
                    part={
                        "font": listed(font or "gothic"),
                        "format": listed(format or "AA999999"),
                        "soil": listed(soil or "workshop"),
                        "severity": tuple(_numbers(dirt or "0,0.3,0.6,0.9")),
                        "height_mm": (5.0 if height_mm is None else height_mm,),
                        "depth_mm": (0.2 if depth_mm is None else depth_mm,),
                        "face": (face or "flat",),
                    },
                    given=tuple(give or ("format",)),
                )
            )
        if active:
            from pipeline.benchmark.readers.plans import PLANS
            from pipeline.cli.benchmarking.active import show_plans

            plans = Benchmark(
                source, tuple(p.mode for p in PLANS), ReaderSettings(orientation=Orientation.UPRIGHT)
            )
            _run(plans, out, lambda trials, _: show_plans(trials, out), jobs=jobs, cluster=cluster)
            return 0
        named = listed(mode) + tuple(reader or ())
        added = (*(experts_in(named) if experts_apart else ()), *(PEERS if peers else ()))
        chosen = named + tuple(mode for mode in added if mode not in named)
        again = PERTURBATIONS if perturb else ()
        tried = Benchmark(source, chosen, reading, again)

        def report(trials: Sequence[Trial], executor: Executor) -> Written:
            typed = command_line()
            return write_report(tried, trials, out, command=typed, certificate=vouching, executor=executor)

        written = _run(tried, out, report, jobs=jobs, cluster=cluster)
        print_result(written)
        _check_stable(written)
    return 0


def _check_stable(written: Written) -> None:
    """Name every accepted serial that a perturbation made another accepted serial.

    Of single experts and programs of others, which decide nothing, the report tells.

    Raises:
        CommandError: there is one.
    """
    from pipeline.benchmark.readers.modes import EXPERTS, PEERS

    deciding = [s for s in written.statistics.stability if s.key.mode not in {*EXPERTS, *PEERS}]
    faults = [(s.key.reader, f) for s in deciding if s.perturbation for f in s.faults]
    for reader, f in faults:
        print(f"FAULT: {f.part}, {reader}: accepted as {f.before}, and under {f.perturbation} as {f.after}")
    if faults:
        raise CommandError(
            f"benchmark: accepted serials became other accepted serials under a perturbation: {len(faults)}",
            hint="the parts are named above and in the report",
        )


def _given(flags: Mapping[str, object]) -> str:
    """The first flag that was given; empty if none was."""
    return next((f"--{name}" for name, value in flags.items() if value is not None), "")


def _condition(formats: tuple[str, ...], severities: list[float]) -> Condition:
    """Of the parts of a folder."""
    if len(formats) > 1 or len(severities) > 1:
        raise CommandError("benchmark: a folder has one format and one dirt", status=USAGE)
    from pipeline.benchmark.exam.condition import Condition

    return Condition(severity=severities[0] if severities else None, format=formats[0] if formats else "")


def _numbers(text: str) -> list[float]:
    try:
        return [float(item) for item in listed(text)]
    except ValueError as error:
        raise SettingsError(f"--dirt is {text!r}", hint="give numbers separated by commas") from error


def _run(
    benchmark: Benchmark,
    out: Path,
    report: Callable[[Sequence[Trial], Executor], R],
    *,
    jobs: int,
    cluster: str | None,
) -> R:
    from pipeline.benchmark.report.writing import crossed_of
    from pipeline.benchmark.trials.planning import foresight
    from pipeline.benchmark.trials.run import run_benchmark
    from pipeline.runs.progress import Progress
    from pipeline.workers.cluster import ClusterError
    from pipeline.workers.executors import WorkerLostError
    from pipeline.workers.options import ExecutorOptions

    items = benchmark.parts.items()
    print(foresight(items, crossed_of(benchmark.description())), file=sys.stderr)
    with Progress() as progress:
        try:
            with ExecutorOptions(jobs, cluster).opened(len(items)) as executor:
                trials = run_benchmark(
                    benchmark,
                    out,
                    executor=executor,
                    on_start=progress.start,
                    on_part=lambda _: progress.advance(),
                )
                progress.step("drawing the report")
                return report(trials, executor)
        except KeyboardInterrupt as error:
            raise CommandError(
                "interrupted",
                hint=f"finished parts are kept in {out}, run the same command again to continue",
                status=INTERRUPTED,
            ) from error
        except (WorkerLostError, ClusterError) as error:
            raise CommandError(str(error)) from error

"""`tactile-marks benchmark`: run an exam, compare two runs, export it, and score answers."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import CommandError, UsageError, resumable
from pipeline.cli.shared import Flag, Jobs, Positive, SensorsName, Speed
from pipeline.common.settings import SettingsError
from pipeline.common.texts import first_of, split_commas

if TYPE_CHECKING:
    from pipeline.benchmark.analysis.statistics import Statistics
    from pipeline.benchmark.exam.specimens import Parts
    from pipeline.runs.progress import Progress
    from pipeline.workers.executors import Executor


def run(
    *,
    out: Path,
    design: str | None = None,
    parts: Positive = None,
    mode: str = "tactile,vision,fused",
    give: Annotated[list[str] | None, Parameter(negative="")] = None,
    jobs: Jobs = 1,
    soil: str | None = None,
    dirt: str | None = None,
    font: str | None = None,
    format: str | None = None,
    height_mm: float | None = None,
    seed: int | None = None,
    inputs: Annotated[list[str] | None, Parameter(negative="")] = None,
    truth: Path | None = None,
    perturb: Flag = False,
    experts: str = "",
    ablate: str = "",
    sensors: SensorsName = "real",
    whisker: Annotated[list[Path] | None, Parameter(negative="", consume_multiple=True)] = None,
    speed_mm_s: Speed = None,
    accept_risk: str = "1 in 100",
    certificate: Path | None = None,
    cluster: str | None = None,
) -> None:
    """Make dirty parts, read each in every mode, and write report.html, benchmark.csv, benchmark.json and benchmark.md.

    Start an interrupted run again with the same command; with more --parts it continues. With --inputs
    and --truth the parts of a folder are read instead.

    Args:
        out: Folder for the trials and the report; made if missing.
        design: Exam that defines the parts and what readers know of them: marks-exam-1-1600, marks-exam-1-208,
            marks-exam-1-40, marks-exam-2-1000, marks-exam-2-96, marks-training-1, or a TOML file of your own. It
            replaces the flags that describe parts, except --parts.
        parts: Number of parts for every soil, dirt, font and format (default: 200). With --design: number of its first
            parts (default: all).
        mode: Readers, separated by commas: tactile, vision, fused, lights (vision of four photographs, each with the
            lamp on another side), a reader of your own, module:function, that takes a pipeline.ExamPart and returns its
            text, or another program, such as "rapidocr relief". Also groups: experts (every expert of the named modes
            alone), peers (RapidOCR and Tesseract on the line as photographed, as felt and as it is; extra peers), plans
            (touch that chooses its passes, against uniform, random and whole plans).
        give: Facts that the reader knows beside the part: font, height, format, several separated by commas, or nothing
            (default: those of the design, else the format). Repeat it to read every part with each: --give format
            --give font,format.
        jobs: Worker processes.
        soil: Soils, separated by commas, each on parts of its own (default: workshop): caked, rust, paint, weld, mud,
            wear, casting, module:function of your own; rust+paint is one over the other.
        dirt: Severity of the dirt, 0 to 1, separated by commas (default: 0,0.3,0.6,0.9). With --inputs: theirs, if
            known.
        font: Built-in names or TTF/OTF files, separated by commas (default: gothic). With --inputs: those that may be
            theirs (default: all built-in ones).
        format: Masks of the serials, separated by commas (default: AA999999). With --inputs: theirs, if known.
        height_mm: Character height, mm (default: 5).
        seed: Random seed: the same seed gives the same parts (default: 1).
        inputs: Folders, files or globs of parts made elsewhere: NAME.npz, with NAME.png beside it for the camera.
        truth: CSV with the columns part and text, for --inputs.
        perturb: Read every part again with changes that should not matter: traced lines shifted by half a pitch, sensor
            noise, 6 % light, 1 % scale, another order of the passes. Fail (status 1) if an accepted serial becomes
            another accepted one. Takes about five times as long.
        experts: Experts to combine, separated by commas: network, templates (default: both). Templates alone read by
            touch only.
        ablate: Rules of the decision to leave out, separated by commas: tactile, vision, lights and fused are also
            decided without each, as "tactile without unread-marks", and compared with the full decision. Rules are
            contracts and terms of the score; a wrong name lists them. Nothing is read again.
        sensors: Simulated sensors and stage that feel the parts: real (with the errors of scan) or ideal.
        whisker: Whisker files to feel with, as from design --out (default: a whisker for the character height). The
            modes read with the first; tactile and fused also with each of the others, as "tactile with long.toml".
        speed_mm_s: Speed of the simulated stage, mm/s (default: the whisker file's, or 10 heights a second up to 50
            mm/s).
        accept_risk: Greatest share of wrong readings among those that our readers accept: 0.001, 1/1000 or "1 in 1000".
        certificate: Certificate (.json, see certify), whatever settings it was made with: the modes accept nothing that
            it does not cover, and the report says where the parts are unlike the certified ones.
        cluster: Address of a Dask scheduler (tcp://HOST:8786), whose workers read the parts instead. Needs the extra
            cluster.
    """
    from pipeline.benchmark.readers.modes import expand_groups
    from pipeline.benchmark.report.writing import write_report
    from pipeline.benchmark.trials.run import Benchmark, run_benchmark
    from pipeline.cli.shared import print_document
    from pipeline.reading.certificate import valid_certificate
    from pipeline.reading.perturbation import PERTURBATIONS
    from pipeline.reading.readers import with_whisker_file
    from recognition.decide.risk_text import parse_risk
    from recognition.language.orientation import Orientation
    from recognition.see.virtual_array import VirtualArray
    from recognition.settings import ReaderSettings
    from whisker_array.scan.sensor import Sensors

    source = _parts(
        inputs, truth, design, parts, tuple(give or ()),
        {"soil": soil, "severity": dirt, "font": font, "format": format, "height_mm": height_mm, "seed": seed},
    )  # fmt: skip
    vouching = valid_certificate(certificate) if certificate is not None else None
    # parts of a design are upright; the orientation of other parts is unknown
    orientation = Orientation.UPRIGHT if inputs is None else Orientation.ANY
    try:
        risk = parse_risk(accept_risk)
    except ValueError as error:
        raise SettingsError(f"--accept-risk is {accept_risk!r}: {error}") from error
    felt_with = whisker or []
    array = VirtualArray(sensors=Sensors(sensors), given_speed_mm_s=speed_mm_s)
    if felt_with:
        array = with_whisker_file(array, felt_with[0])
    try:
        reading = ReaderSettings(
            array=array,
            accept_risk=risk,
            orientation=orientation,
            experts=split_commas(experts),
        )
    except ValueError as error:
        raise SettingsError(f"--experts is {experts!r}: {error}") from error
    if vouching is not None:
        reading = replace(reading, **vouching.thresholds())
    if inputs is not None:
        reading = replace(reading, fonts=split_commas(font or ""))
    tried = Benchmark(
        source,
        expand_groups(
            split_commas(mode), ablate=split_commas(ablate), whiskers=tuple(map(str, felt_with[1:]))
        ),
        reading,
        PERTURBATIONS if perturb else (),
    )
    with _at_work(len(source.items()), out, jobs, cluster) as (progress, executor):
        trials = run_benchmark(tried, out, executor=executor, progress=progress)
        progress.step("drawing the report")
        document, files, result = write_report(tried, trials, out, certificate=vouching, executor=executor)
    print_document(document, files)
    _check_stable(result)


def export(
    design: str,
    folder: Path,
    /,
    *,
    parts: int | None = None,
    jobs: Jobs = 1,
    cluster: str | None = None,
    check: Flag = False,
) -> None:
    """Write an exam's parts, photographs, views of touch and truth; the same command continues an interrupted export.

    Args:
        design: An edition: marks-exam-1-1600, marks-exam-1-208, marks-exam-1-40, marks-exam-2-1000, marks-exam-2-96,
            marks-training-1 (for readers that learn); or a TOML file of your own.
        folder: Folder for the files; made if missing.
        parts: Number of parts, from the first (default: all). The first parts of a design are balanced, too.
        jobs: Worker processes.
        cluster: Address of a Dask scheduler (tcp://HOST:8786), whose workers make the parts instead. Needs the extra
            cluster.
        check: Write nothing: compare the folder with its manifest, and list the differences.
    """
    from pipeline.benchmark.exam.design import design_named
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.benchmark.export import folder as exporting

    exam = DesignedParts(design_named(design), parts)
    if check:
        differences = exporting.check(exam, folder)
        for path, problem in differences.items():
            print(f"{path}: {problem}")
        if differences:
            hint = "run the export again, and remove files that are not in the manifest"
            raise CommandError(f"the folder differs from its manifest, files: {len(differences)}", hint=hint)
        print(f"{folder} matches its manifest")
        return
    with _at_work(len(exam.items()), folder, jobs, cluster) as (progress, executor):
        written = exporting.export(exam, folder, executor=executor, progress=progress)
    print(f"wrote {written} parts and their truth to {folder}")


def score(
    readings: list[Path],
    /,
    *,
    design: str | None = None,
    truth: Path | None = None,
    parts: int | None = None,
    name: str | None = None,
    give: str = "nothing",
    out: Path | None = None,
) -> None:
    """Score tables of answers against an exam: columns part (or file) and text, also confidence, decision or accepted.

    Args:
        readings: CSV files, one for each reader. The second and later ones are compared with the first, part by part.
        design: The exam: marks-exam-1-1600, marks-exam-1-208, marks-exam-1-40, marks-exam-2-1000, marks-exam-2-96, or a
            TOML file of your own.
        truth: In place of --design: a CSV with the columns part and text, and one for each factor, like truth.csv of an
            export.
        parts: Number of parts of the design, from the first (default: all). A part without an answer counts as read
            empty.
        name: Names of the readers, separated by commas (default: those of their files).
        give: Facts that the readers knew beside the part: font, height, format, or nothing.
        out: Folder for report.html, benchmark.csv, benchmark.json and benchmark.md, like those of a run.
    """
    if (design is None) == (truth is None):
        raise UsageError("score: give --design or --truth")
    if design is None and parts is not None:
        raise UsageError("score: --parts goes with --design")
    names = split_commas(name) if name else tuple(path.stem for path in readings)
    if len(names) != len(readings) or len(set(names)) != len(names):
        what = f"score: {len(readings)} tables, and the names {', '.join(names)}"
        raise UsageError(what, "give each its own name with --name")
    from pipeline.benchmark.analysis.statistics import statistics_of
    from pipeline.benchmark.exam.condition import parse_given
    from pipeline.benchmark.exam.design import design_named
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.benchmark.exam.listed_parts import ListedParts
    from pipeline.benchmark.report.writing import document_of, write_report
    from pipeline.benchmark.trials.answers import designed_items, load_answers
    from pipeline.benchmark.trials.run import Benchmark
    from pipeline.cli.shared import print_document
    from recognition.settings import ReaderSettings

    source: ListedParts | DesignedParts
    if truth is not None:
        source = ListedParts.of_table(truth)
        items = source.items()
    else:
        source = DesignedParts(design_named(design or ""), parts)
        items = designed_items(source)
    senses = parse_given(give)
    read = {
        reader: load_answers(path, items, reader=reader, given=senses)
        for reader, path in zip(names, readings, strict=True)
    }
    for reader, answers in read.items():
        for some, what in (
            (answers.missing, "without an answer, counted as read empty"),
            (answers.unknown, "not in the exam, not counted"),
        ):
            if some:
                print(f"{reader}: {len(some)} {what}: {first_of(some)}", file=sys.stderr)
    # ordered by part, like the trials of a run
    trials = [t for same in zip(*(a.trials for a in read.values()), strict=True) for t in same]
    benchmark = Benchmark(source, names, ReaderSettings())
    if out is None:
        print_document(document_of(statistics_of(trials, benchmark.crossed)))
    else:
        document, files, _ = write_report(benchmark, trials, out)
        print_document(document, files)


def compare(before: Path, after: Path, /, *, out: Path | None = None) -> None:
    """Compare two finished benchmarks of the same parts, and show the changed readings.

    Writes compare.html, with pictures of the parts that flipped, compare.md and compare.csv.

    Args:
        before: Folder of the benchmark before the change (its --out).
        after: Folder of the benchmark after it.
        out: Folder for the page and the table (default: that of the second benchmark).
    """
    from pipeline.benchmark.report.change_report import SHOWN, write_comparison
    from pipeline.cli.shared import print_document
    from pipeline.workers.options import WorkerSettings

    with WorkerSettings(jobs=1).opened(SHOWN) as executor:
        document, files = write_comparison(before, after, out or after, executor=executor)
    print_document(document, files)


@contextmanager
def _at_work(n: int, journal: Path, jobs: int, cluster: str | None) -> Iterator[tuple[Progress, Executor]]:
    from pipeline.runs.progress import Progress
    from pipeline.workers.options import WorkerSettings

    with (
        Progress() as progress,
        resumable(journal),
        WorkerSettings(jobs=jobs, cluster=cluster).opened(n) as executor,
    ):
        yield progress, executor


def _parts(
    inputs: list[str] | None, truth: Path | None, design: str | None, parts: int | None, give: tuple[str, ...],
    flags: dict[str, str | float | None],
) -> Parts:  # fmt: skip
    from pipeline.benchmark.exam.condition import Condition
    from pipeline.benchmark.exam.design import design_named, of_flags
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.benchmark.exam.listed_parts import ListedParts

    levels: dict[str, tuple[str | float, ...]] = {}
    for name, value in flags.items():
        if isinstance(value, str):
            levels[name] = _numbers(value) if name == "severity" else split_commas(value)
        elif value is not None:
            levels[name] = (value,)
    words = {"severity": "dirt", "height_mm": "height-mm"}
    if (inputs is None) != (truth is None):
        raise UsageError("benchmark: --inputs and --truth go together")
    if design is not None and (more := [*levels, *(["inputs"] if inputs else [])]):
        what = f"benchmark: --design and --{words.get(more[0], more[0])} both describe the parts"
        raise UsageError(what, "leave one of them out")
    if inputs is not None and truth is not None:
        part_flags = ["parts"] * (parts is not None) + ["give"] * bool(give)
        if extra := [*part_flags, *(name for name in levels if name not in ("severity", "font", "format"))]:
            raise UsageError(f"benchmark: --{words.get(extra[0], extra[0])} is for parts that are made")
        formats, severities = levels.get("format", ("",)), levels.get("severity", (None,))
        if len(formats) > 1 or len(severities) > 1:
            raise UsageError("benchmark: --inputs takes one --format and one --dirt")
        return ListedParts.of_files(inputs, truth, Condition(severity=severities[0], format=formats[0]))
    if design is not None:
        return DesignedParts(design_named(design).with_given(give), parts)
    (seed,) = levels.pop("seed", (1,))
    return DesignedParts(of_flags(levels, parts=parts or 200, seed=int(seed), given=give or ("format",)))


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(item) for item in split_commas(text))
    except ValueError as error:
        raise SettingsError(f"--dirt is {text!r}", hint="give numbers separated by commas") from error


def _check_stable(statistics: Statistics) -> None:
    """Report accepted serials that a perturbation changed into other accepted ones; single experts and other programs
    make no decisions: only the report shows their changes."""
    from pipeline.benchmark.readers.modes import EXPERTS, PEERS

    deciding = [s for s in statistics.stability if s.perturbation and s.key.mode not in {*EXPERTS, *PEERS}]
    faults = [(s.key.reader, f) for s in deciding for f in s.faults]
    for reader, f in faults:
        print(f"FAULT: {f.part}, {reader}: accepted as {f.before}, and under {f.perturbation} as {f.after}")
    if faults:
        raise CommandError(
            f"benchmark: accepted serials became other accepted serials under a perturbation: {len(faults)}",
            hint="the parts are named above and in the report",
        )

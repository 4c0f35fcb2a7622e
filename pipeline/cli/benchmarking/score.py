"""`tactile-marks benchmark score`: how right anybody's answers to an exam are."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.choices import listed
from pipeline.cli.exit_status import USAGE, CommandError, failures_reported

if TYPE_CHECKING:
    from pipeline.benchmark.trials.answers import Answers
    from pipeline.benchmark.trials.journal import Trial

_MOST_NAMED = 5


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
) -> int:
    """Score tables of answers against an exam: columns part (or file) and text, also confidence, decision or accepted.

    Parameters
    ----------
    readings
        CSV files, one for each reader. The second and later ones are compared with the first, part by part.
    design
        The exam: marks-exam-1, marks-exam-1-240, marks-exam-1-48, or a TOML file of your own; or
    truth
        a CSV with the columns part and text, and a column for each factor, as truth.csv of an export.
    parts
        The first so many parts of the design; all unless given. A part without an answer counts as read empty.
    name
        What the readers are called, separated by commas; as their files unless given.
    give
        What the readers were given beside the part: font, height, format, or nothing.
    out
        Folder for report.html, benchmark.csv, benchmark.json and benchmark.md, as of a run.
    """
    with failures_reported():
        if (design is None) == (truth is None):
            raise CommandError("score: give --design or --truth", status=USAGE)
        if design is None and parts is not None:
            raise CommandError("score: --parts goes with --design", status=USAGE)
        names = listed(name) if name else tuple(path.stem for path in readings)
        if len(names) != len(readings) or len(set(names)) != len(names):
            raise CommandError(
                f"score: {len(readings)} tables, and the names {', '.join(names)}",
                hint="give each a name of its own with --name",
                status=USAGE,
            )
        from pipeline.benchmark.exam.condition import Given
        from pipeline.benchmark.exam.designed_parts import DesignedParts
        from pipeline.benchmark.exam.editions import design_named
        from pipeline.benchmark.report.writing import command_line, write_report
        from pipeline.benchmark.trials.answers import TruthParts, designed_items, load_answers
        from pipeline.benchmark.trials.run import Benchmark
        from recognition.senses.settings import ReaderSettings

        source: TruthParts | DesignedParts
        if truth is not None:
            source = TruthParts.load(truth)
            items = source.items()
        else:
            source = DesignedParts(design_named(design or ""), parts)
            items = designed_items(source)
        read = {
            reader: load_answers(path, items, reader=reader, given=Given.parse(give))
            for reader, path in zip(names, readings, strict=True)
        }
        for reader, answers in read.items():
            _say_gaps(reader, answers)
        print_scores([answers.trials for answers in read.values()])
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            # part by part, as a run has them
            trials = [t for same in zip(*(a.trials for a in read.values()), strict=True) for t in same]
            benchmark = Benchmark(source, names, ReaderSettings())
            written = write_report(benchmark, trials, out, command=command_line())
            for path in (written.page, written.table, written.figures):
                print(f"wrote {path}")
    return 0


def _say_gaps(reader: str, answers: Answers) -> None:
    for parts, what in (
        (answers.missing, "have no answer and count as read empty"),
        (answers.unknown, "are not in the exam and do not count"),
    ):
        if parts:
            more = ", ..." if len(parts) > _MOST_NAMED else ""
            print(
                f"{reader}: {len(parts)} parts {what}: {', '.join(parts[:_MOST_NAMED])}{more}",
                file=sys.stderr,
            )


def print_scores(read: Sequence[Sequence[Trial]]) -> None:
    """A line a reader, and each but the first beside the first; trials of the same parts, none without any."""
    from pipeline.benchmark.analysis.confusion import characters_right
    from pipeline.benchmark.analysis.pairs import compare_characters, mcnemar
    from pipeline.common.shares import share

    right = [[characters_right(trial) for trial in trials] for trials in read]
    total = [len(trial.truth) for trial in read[0]]
    for trials, characters in zip(read, right, strict=True):
        all_characters = share(sum(characters), sum(total))
        serials = share(sum(t.right for t in trials), len(trials))
        accepted = [t for t in trials if t.accepted]
        print(
            f"{trials[0].mode}: characters {all_characters.value:.2%} "
            f"({all_characters.low:.2%} to {all_characters.high:.2%}), "
            f"serials {serials.value:.2%} ({serials.low:.2%} to {serials.high:.2%}) of {len(trials)}, "
            f"accepted {len(accepted)}, of these wrong {sum(not t.right for t in accepted)}"
        )
    for trials, characters in zip(read[1:], right[1:], strict=True):
        pairs = mcnemar([t.right for t in trials], [t.right for t in read[0]])
        difference = compare_characters(characters, right[0], total)
        print(
            f"{trials[0].mode} less {read[0][0].mode}: characters {difference.difference:+.2%} "
            f"({difference.low:+.2%} to {difference.high:+.2%}), serials only right by it {pairs.only_first}, "
            f"only by the other {pairs.only_second} (p {pairs.p_differ:.2g})"
        )

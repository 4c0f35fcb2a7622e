"""Answers of people on the same parts: a table, a line an answer.

part,reviewer,text
part-1,Ada,KX407251
part-1,Ada,KX407251         the second time that Ada read it; trials come in the order of their lines
part-1,Ben,KX407Z51         an empty text: not readable
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from pathlib import Path

from glyphs.errors import FileError
from pipeline.benchmark.study.repeats import RECORDED
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.texts import first_of
from pipeline.formats.truth import load_part_lines

_HEADINGS = ("reviewer", "appraiser", "who")


def load_reviews(path: Path, parts: Collection[str]) -> tuple[list[Trial], tuple[str, ...]]:
    """Load the reviewers' answers for some parts from a table.

    Returns:
        The answers, whose mode is the reviewer; and parts of the table that the study has not.

    Raises:
        FileError: a table of another kind, a line without a reviewer, no part of the study, or a reviewer
            that did not read every part equally often.
    """
    answers: list[Trial] = []
    times: dict[str, Counter[str]] = {}
    unknown: dict[str, None] = {}
    for line in load_part_lines(path, repeated=True):
        who = next((line.others[name] for name in _HEADINGS if line.others.get(name)), "")
        if not who:
            raise FileError(path, f"line {line.line} names no reviewer", "fill the column reviewer")
        if line.part not in parts:
            unknown[line.part] = None
            continue
        times.setdefault(who, Counter())[line.part] += 1
        number, text = times[who][line.part], "".join(line.text.split())
        answers.append(Trial(line.part, number, {RECORDED: True}, who, truth="", text=text))
    if not answers:
        raise FileError(
            path, "answers no part of the study", f"name the parts as {next(iter(parts), 'they are')}"
        )
    for who, counts in times.items():
        if len(set(counts.values())) > 1:
            most = max(counts.values())
            few = first_of([part for part, n in counts.items() if n < most])
            raise FileError(
                path, f"{who} read some parts {most} times and others less often: {few}",
                "give as many lines for each",
            )  # fmt: skip
    return answers, tuple(unknown)

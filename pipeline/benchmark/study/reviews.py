"""Answers of people on the same parts: a table, a line an answer.

part,reviewer,text
part-1,Ada,KX407251
part-1,Ada,KX407251         the second time that Ada read it; trials come in the order of their lines
part-1,Ben,KX407Z51         an empty text: not readable
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from glyphs.errors import FileError
from pipeline.formats.truth import load_part_lines

_HEADINGS = ("reviewer", "appraiser", "who")
_MOST_NAMED = 5


def load_reviews(
    path: Path, parts: Collection[str]
) -> tuple[dict[str, dict[str, tuple[str, ...]]], tuple[str, ...]]:
    """Load the reviewers' answers for some parts from a table.

    Returns:
        The answers without blanks by reviewer and part, trial by trial; and parts of the table that the study has not.

    Raises:
        FileError: a table of another kind, a line without a reviewer, no part of the study, or a reviewer
            that did not read every part equally often.
    """
    answers: dict[str, dict[str, tuple[str, ...]]] = {}
    unknown: dict[str, None] = {}
    for line in load_part_lines(path, repeated=True):
        who = next((line.others[name] for name in _HEADINGS if line.others.get(name)), "")
        if not who:
            raise FileError(path, f"line {line.line} names no reviewer", "fill the column reviewer")
        if line.part not in parts:
            unknown[line.part] = None
            continue
        by_part = answers.setdefault(who, {})
        by_part[line.part] = (*by_part.get(line.part, ()), "".join(line.text.split()))
    if not answers:
        raise FileError(
            path, "answers no part of the study", f"name the parts as {next(iter(parts), 'they are')}"
        )
    for who, by_part in answers.items():
        counts = {part: len(said) for part, said in by_part.items()}
        if len(set(counts.values())) > 1:
            most = max(counts.values())
            few = [part for part, n in counts.items() if n < most][:_MOST_NAMED]
            raise FileError(
                path, f"{who} read some parts {most} times and others less often: {', '.join(few)}",
                "give as many lines for each",
            )  # fmt: skip
    return answers, tuple(unknown)

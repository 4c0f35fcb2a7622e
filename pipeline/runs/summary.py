"""Summary of a run: decisions, reasons, rate and slowest parts, counted row by row."""

from __future__ import annotations

import heapq
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from textwrap import shorten
from typing import Any

from pipeline.common.reading_records import ReadingRecord
from recognition.decide.decision import CHECK_FORMAT, ReadingFlag
from recognition.decide.risk_text import CANNOT_PROMISE

DECISIONS, VERDICTS = ("accept", "review", "reject"), ("confirmed", "refuted", "undecided")
GLOSSARY = "docs/pages/reference/glossary.md"  # page of the sources on decisions, grades, actions, reasons
MOST_REASONS = 8
_MOST_KINDS = 500
_MOST_KIND = 160
_SLOWEST = 5
_LOW = ReadingFlag.LOW_CONFIDENCE.name.lower()
# details of an error that differ from part to part: numbers, and names in quotes
_NUMBER = re.compile(r"(?<![\w.])\d+(?:[.,]\d+)*(?!\w)")
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"|“[^”]*”")


@dataclass
class Summary:
    """Counts over any number of rows."""

    parts: int = 0
    decisions: Counter[str] = field(default_factory=Counter)
    verdicts: Counter[str] = field(default_factory=Counter)
    errors: int = 0
    reasons: Counter[str] = field(default_factory=Counter)  # of parts not accepted; a part may have several
    faults: Counter[str] = field(default_factory=Counter)
    misfits: Counter[str] = field(default_factory=Counter)  # by how a clear text does not fit the format
    seconds: float = 0.0
    slowest: list[tuple[float, str]] = field(default_factory=list)  # (seconds, part), slowest first
    unsure: int = 0  # parts whose low score is the only reason against them, and enough for a larger risk

    def add(self, record: ReadingRecord) -> None:
        self.parts += 1
        self.seconds += record.seconds
        self.slowest = heapq.nlargest(_SLOWEST, [*self.slowest, (record.seconds, record.part)])
        if record.error:
            self.errors += 1
            _count(self.faults, _kind(record.error.partition(": ")[2] or record.error))
            return
        self.decisions[record.decision] += 1
        if record.verdict:
            self.verdicts[record.verdict] += 1
        if record.decision != "accept":
            self.unsure += _lacks_only_score(record)
            for code in dict.fromkeys(reason.code for reason in record.reasons):
                _count(self.reasons, _words(code, record.messages))
            for message in record.messages:
                if message.endswith(CHECK_FORMAT):
                    _count(self.misfits, _misfit(message))
            if not record.reasons:
                _count(self.reasons, "not sure enough")

    def counts(self) -> str:
        counted = {
            **{word: self.decisions[word] for word in DECISIONS},
            **{word: self.verdicts[word] for word in VERDICTS},
            "with an error": self.errors,
        }
        return ", ".join((f"{self.parts:,} parts", *(f"{n} {word}" for word, n in counted.items() if n)))

    def lines(self, *, elapsed_s: float, read_now: int, workers: int) -> list[str]:
        """The summary in lines of text; `elapsed_s` since the run began or was resumed."""
        lines = [self.counts()]
        for title, counter in (("not accepted", self.reasons), ("errors", self.faults)):
            shown = counter.most_common(MOST_REASONS)
            lines += [f"{title}:"] if shown else []
            lines += [f"  {n:>6,}  {kind}" for kind, n in shown]
            if len(counter) > len(shown):
                lines.append(f"  ... and {len(counter) - len(shown)} more kinds")
        if self.unsure:
            lines.append(
                f"{self.unsure:,} of these lack nothing but a higher score: a larger --accept-risk accepts more"
            )
        lines += self._format_hints()
        if self.reasons:
            lines.append(f"what these words mean: {GLOSSARY}")
        if read_now and elapsed_s > 0.0:
            at_once = f" with {workers} workers" if workers > 1 else ""
            lines += [
                f"{read_now:,} read in {_duration(elapsed_s)}{at_once}: {read_now / elapsed_s:.2f} a second,"
                f" {self.seconds / self.parts:.2f} s of work each",
                "slowest: " + ", ".join(f"{part} {seconds:.2f} s" for seconds, part in self.slowest),
            ]
        return lines

    def _format_hints(self, *, least_share: float = 0.5, most_hints: int = 3) -> list[str]:
        read = sum(self.decisions.values())
        return [
            f"{misfit} on {'every part' if n == read else f'{n:,} of {read:,} parts'}: check --format"
            for misfit, n in self.misfits.most_common(most_hints)
            if n >= max(2, least_share * read)
        ]

    def as_json(self) -> dict[str, Any]:
        return {
            "parts": self.parts,
            **{d: self.decisions[d] for d in DECISIONS},
            "errors": self.errors,
            **{v: n for v in VERDICTS if (n := self.verdicts[v])},
            "reasons": dict(self.reasons.most_common()),
            "faults": dict(self.faults.most_common()),
            "seconds": round(self.seconds, 3),
            "slowest": [{"part": part, "seconds": seconds} for seconds, part in self.slowest],
        }


def _lacks_only_score(record: ReadingRecord) -> bool:
    from recognition.decide.score import score_of  # numpy is slow to import

    low = {reason.code for reason in record.reasons} == {_LOW}
    return low and record.confidence >= score_of(record.source).least_threshold


def _words(code: str, messages: Sequence[str]) -> str:
    flag = ReadingFlag.__members__.get(code.upper())
    if flag is ReadingFlag.RISK_NOT_KEPT:
        return next((message for message in messages if CANNOT_PROMISE in message), flag.text)
    if flag is ReadingFlag.NO_CHARACTERS:
        return "no serial found (the rows say why)"  # its text blames the view; it may be the format
    return flag.text if flag else code.replace("_", " ")


def _misfit(message: str) -> str:
    what = _QUOTED.sub("", message.removesuffix(CHECK_FORMAT)).replace(" ()", "").strip()
    return what.removesuffix(", which the format does not allow")


def _kind(error: str) -> str:
    return shorten(_NUMBER.sub("#", _QUOTED.sub("'...'", error)), _MOST_KIND, placeholder=" …")


def _count(counter: Counter[str], kind: str) -> None:
    # faults may name anything; their memory must not grow during a long run
    if kind in counter or len(counter) < _MOST_KINDS:
        counter[kind] += 1
    else:
        counter["other"] += 1


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    minutes = seconds / 60.0
    return f"{minutes:.1f} min" if minutes < 120.0 else f"{minutes / 60.0:.1f} h"

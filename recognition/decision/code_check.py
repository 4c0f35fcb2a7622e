"""A part's codes beside its serial: one that holds another serial sends the part to a person, with both shown.

serial read, codes decoded --one holds it, or none speaks of serials--> as it is
                           \\--those that do hold another-------------> review
A code that holds the serial as it was read shows which way up the part lies, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from recognition.decision.flags import Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.language.code_text import holds
from recognition.views.codes import Code


def checked_by_codes(reading: Reading, codes: Sequence[Code]) -> Reading:
    """The reading with its part's codes, in review where none holds the serial and one holds another.

    Args:
        reading: decided.
        codes: of the part's photographs.
    """
    made = replace(reading.without_flags(ReadingFlag.CODE_DISAGREES), codes=tuple(codes))
    said = [holds(code.text, made.text) for code in made.codes]
    if True in said:
        made = made.without_flags(ReadingFlag.ORIENTATION_UNKNOWN)
    if made.text and True not in said:
        made = made.with_findings(
            *(
                Finding(
                    ReadingFlag.CODE_DISAGREES,
                    f"the {code.kind} holds “{code.text}”, the marks read “{made.text}” (look at the part)",
                )
                for code, same in zip(made.codes, said, strict=True)
                if same is False
            )
        )
    return made

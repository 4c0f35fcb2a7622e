"""Build the reading of a part from its text and what the judges say of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from recognition.decide.choice import Choice
from recognition.decide.decision import Finding
from recognition.decide.deferred import deferred
from recognition.decide.evidence import Evidence
from recognition.decide.reading import CharacterReading, Reading, ReadingTrace
from recognition.decide.verify import Verification
from recognition.language.box import hull


def build_reading(
    evidence: Evidence,
    choice: Choice,
    findings: Sequence[Finding],
    verification: Verification | None,
    seconds: Mapping[str, float],
) -> Reading:
    """Build the reading of a part, with all that it rests on."""
    sense, vision = choice.sense, evidence.vision
    notes = (finding.text for finding in findings if not finding.flag)
    return Reading(
        _checked(choice.characters, verification),
        choice.score,
        tuple(finding for finding in findings if finding.flag),
        font=deferred(lambda: choice.font),
        height_mm=deferred(lambda: choice.height_mm),
        rotation_deg=deferred(lambda: choice.rotation_deg),
        raised=choice.marks is not None and sense.marks is not None and sense.marks.felt.raised,
        box=hull([place.box for place in choice.characters]),
        source=evidence.source,
        spaces_after=choice.spaces_after,
        seconds=MappingProxyType(dict(seconds)),
        notes=(*sense.log.notes, *notes, *evidence.notes),
        unit="mm" if sense.scaled else "px",
        others=choice.others,
        photos=0 if vision is None else vision.log.photos,
        codes=choice.codes,
        accept_risk=choice.accept_risk,
        threshold=choice.threshold,
        measures=choice.measures,
        trace=_trace(evidence, choice, verification),
        evidence=evidence,
    )


def _checked(
    characters: tuple[CharacterReading, ...], verification: Verification | None
) -> tuple[CharacterReading, ...]:
    if verification is None or verification.places != len(characters):
        return characters
    states = {check.place: check.state for check in verification.characters}
    return tuple(replace(place, state=states.get(k, place.state)) for k, place in enumerate(characters))


def _trace(evidence: Evidence, choice: Choice, verification: Verification | None) -> ReadingTrace:
    vision, line = evidence.vision, None if choice.decoding is None else choice.line
    trace = partial(
        ReadingTrace,
        photo=None if vision is None else vision.log.whole_photo or vision.log.photo,
        odds=choice.odds,
        evidence=None if line is None else line.evidence,
        strokes=deferred(lambda: choice.strokes),
        verification=verification,
    )
    if choice.alone:
        return trace(touch=choice.alone["tactile"], vision=choice.alone["vision"])
    sense = choice.sense
    view = sense.views[0] if sense.views else None
    by_expert = {} if line is None else line.by_expert
    boxes = () if choice.lattice is None else choice.lattice.boxes
    return trace(
        edge_map=None if view is None else view.edges,
        relief=None if view is None else view.relief,
        scan=sense.log.scan,
        height_map=sense.log.surface,
        lattice=choice.lattice,
        open_lattice=choice.open_lattice,
        choice=choice.decoding,
        line=None if line is None else line.line,
        by_expert=MappingProxyType(
            {name: replace(lattice, boxes=boxes) for name, lattice in by_expert.items()}
        ),
        faces=choice.faces,
        laid=deferred(lambda: None if choice.marks is None else choice.marks.laid),
    )

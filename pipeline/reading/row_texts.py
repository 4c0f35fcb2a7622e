"""What a reading says of its places, in the few characters that a table has room for; places count from 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recognition.confusions import PlaceState
    from recognition.grammar import Grammar
    from recognition.lattice import Lattice
    from recognition.reading import MarkDepth, Reading

BELIEF_WORTH_TELLING = 0.01
MOST_RIVALS = 3
_UNGRADED = "?"


def depth_text(depth: MarkDepth | None) -> str:
    """Least and mean depth of a character, mm."""
    return "?" if depth is None else f"{depth.min_mm:.3f}/{depth.mean_mm:.3f}"


def depths_text(reading: Reading) -> str:
    """Depths of every character."""
    if all(c.depth is None for c in reading.characters) and reading.source == "vision":
        return ""
    return " ".join(f"{c.char} {depth_text(c.depth)}" for c in reading.characters)


def alternatives_text(reading: Reading) -> str:
    """Each place's other candidates with some belief: "3:8B 5:S"."""
    told = []
    for place, character in enumerate(reading.characters, start=1):
        others = [c.char for c in character.candidates[1:] if c.probability >= BELIEF_WORTH_TELLING]
        if others:
            told.append(f"{place}:{''.join(others)}")
    return " ".join(told)


def states_text(reading: Reading) -> str:
    """Places that are not plainly read: "3:confused 8/B, 5:not read"."""
    from recognition.confusions import CharacterState

    return ", ".join(
        f"{place}:{state_text(c.state)}"
        for place, c in enumerate(reading.characters, start=1)
        if c.state is not None and c.state.state is not CharacterState.READ
    )


def state_text(state: PlaceState) -> str:
    """One place: "read", "not read", "confused 8/B", or "mismatch 8/B" where 8 stands in place of a B."""
    from recognition.confusions import CharacterState

    if state.state is CharacterState.CONFUSED:
        return f"{state.state.value} {state.char}/{state.rival}"
    if state.state is CharacterState.MISMATCH:
        return f"{state.state.value} {state.rival}/{state.expected or '-'}"
    return state.state.value


def rivals_text(reading: Reading, lattice: Lattice | None, grammar: Grammar | None) -> str:
    """Other serials that the format allows, and belief in them: "KB74 0.021, KB14 0.013".

    Args:
        reading: its candidates stand in where there is no lattice.
        lattice: beliefs of places that the reading was chosen from.
        grammar: what serials may be; None for anything.
    """
    from recognition.constrained_decoding import choose

    if lattice is None or lattice.n_places != len(reading.characters):
        lattice = _of_candidates(reading)
    if not lattice.n_places:
        return ""
    choice = choose(lattice, grammar, k=MOST_RIVALS + 1)
    read = "".join(c.char for c in reading.characters)
    named = [(choice.text, choice.probability), *((r.text, r.probability) for r in choice.rivals)]
    others = [(t, p) for t, p in named if t and t != read and p >= BELIEF_WORTH_TELLING]
    return ", ".join(f"{text} {probability:.3f}" for text, probability in others[:MOST_RIVALS])


def _of_candidates(reading: Reading) -> Lattice:
    """The beliefs that a reading tells."""
    import numpy as np

    from recognition.lattice import Lattice

    chars = tuple(sorted({c.char for place in reading.characters for c in place.candidates}))
    belief = np.zeros((len(reading.characters), len(chars)))
    for row, place in zip(belief, reading.characters, strict=True):
        for candidate in place.candidates:
            row[chars.index(candidate.char)] = candidate.probability
    belief /= np.maximum(1.0, belief.sum(axis=1, keepdims=True))
    with np.errstate(divide="ignore"):
        return Lattice(chars, np.log(belief))


def grade_letters(reading: Reading) -> str:
    """A letter a character; empty where none was graded."""
    if all(c.grade is None for c in reading.characters):
        return ""
    return "".join(_UNGRADED if c.grade is None else c.grade.letter for c in reading.characters)


def worst_letter(reading: Reading) -> str:
    """The worst of the grades; "?" where all characters were felt too little for one."""
    letters = grade_letters(reading)
    return max(letters.replace(_UNGRADED, ""), default=letters[:1])


def action_text(reading: Reading) -> str:
    """What to do, and at which places: "clean 3 5, re-strike 7"; empty where nothing is."""
    from recognition.grade import Action

    places: dict[Action, list[int]] = {}
    for place, character in enumerate(reading.characters, start=1):
        if character.grade is not None and character.grade.action is not Action.NONE:
            places.setdefault(character.grade.action, []).append(place)
    return ", ".join(
        f"{action.value} {' '.join(map(str, places[action]))}" for action in Action if action in places
    )

"""Formats of serials, alone or together; as text: see `recognition.language.format_text`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import compress

import numpy as np

from glyphs.fonts.serials import FormatError, allowed_characters
from recognition.language.automaton import Automaton, Machine, Strings, WordList, encode, unroll
from recognition.language.check_digits import CheckDigit
from recognition.language.elements import names_before_gaps
from recognition.language.expression import (
    MOST_CHARACTERS,
    MOST_PLACES,
    expression_machine,
    too_many_characters,
    written_characters,
)
from recognition.language.format_text import parts_of
from recognition.language.remainders import ALPHANUMERIC

MOST_WORDS = 100_000


@dataclass(frozen=True)
class Grammar:
    """Prior knowledge of a serial; a field that is None or empty sets no limit. `exclude` does not hold for literals of
    the format; the `alphabet` holds where no other field lists characters. Raises FormatError: an invalid part, or
    parts that no serial meets together."""

    format: str | None = None
    expression: str | None = None
    sets: tuple[str, ...] | None = None
    lexicon: frozenset[str] | None = None
    checks: tuple[CheckDigit, ...] = ()
    exclude: str = ""
    alphabet: str = ALPHANUMERIC
    elements: str | None = None

    def __post_init__(self) -> None:
        if self.lexicon is not None:
            words = frozenset("".join(word.split()) for word in self.lexicon) - {""}
            if not words or len(words) > MOST_WORDS:
                raise FormatError(f"the lexicon has {len(words)} serials", hint=f"give 1 to {MOST_WORDS}")
            object.__setattr__(self, "lexicon", words)
        if len(self.characters) > MOST_CHARACTERS:
            raise too_many_characters(str(self))
        lengths = self.lengths()
        # the longest serials need the most states: a format that is too complex is refused here, not while it is read
        longest = MOST_PLACES if lengths is None else max(lengths, default=0)
        if self.strings(longest) is not None or lengths is None:
            return
        if any(self.strings(n) is not None for n in sorted(lengths)):
            return
        raise FormatError(
            f"no serial meets {self}",
            hint=(
                "check that its parts agree in length and characters (serials have at most "
                f"{MOST_PLACES} characters; write word gaps in a mask:, not in an expression)"
            ),
        )

    @classmethod
    def parse(cls, *texts: str, lexicon: Iterable[str] | None = None) -> Grammar:
        """Parse texts (see `recognition.language.format_text`); all of them must hold. Raises FormatError."""
        return cls(**parts_of(texts), lexicon=None if lexicon is None else frozenset(lexicon))

    def __repr__(self) -> str:
        text = str(self)
        return f"Grammar({text[:157] + '...' * (len(text) > 157)!r})"

    def __str__(self) -> str:
        parts = [
            f"mask:{self.format}" if self.format is not None else "",
            f"re:{self.expression}" if self.expression is not None and self.elements is None else "",
            f"fields:{self.elements}" if self.elements is not None else "",
            f"sets:{','.join(self.sets)}" if self.sets is not None else "",
            f"lexicon of {len(self.lexicon)}" if self.lexicon is not None else "",
            *(f"check={check}" for check in self.checks),
            f"exclude={self.exclude}" if self.exclude else "",
        ]
        return " + ".join(part for part in parts if part) or "any serial"

    @property
    def gaps(self) -> frozenset[int]:
        places = allowed_characters(self.format) if self.format else ()
        inked = [k for k, chars in enumerate(places) if chars != " "]
        return frozenset(k for k in range(len(inked) - 1) if inked[k + 1] - inked[k] > 1)

    def spaces(self, text: str) -> frozenset[int] | None:
        """Places of a serial without blanks after which there is a word gap; None if not defined."""
        if self.format is not None:
            return self.gaps
        return None if self.elements is None else names_before_gaps(text)

    @property
    def characters(self) -> tuple[str, ...]:
        return _characters(self)

    @property
    def opaque(self) -> tuple[CheckDigit, ...]:
        """Check digits that need the whole text."""
        return tuple(check for check in self.checks if check.remainder is None)

    def lengths(self) -> frozenset[int] | None:
        """Possible lengths of a serial without blanks, up to `expression.MOST_PLACES`; None if unlimited."""
        limits: list[frozenset[int]] = []
        if self.format is not None:
            limits.append(frozenset({sum(c != " " for c in allowed_characters(self.format))} - {0}))
        if self.sets is not None:
            limits.append(frozenset({len(self.sets)} - {0}))
        if self.lexicon is not None:
            limits.append(frozenset(len(word) for word in self.lexicon))
        if self.expression is not None:
            limits.append(expression_machine(self.expression, self.characters).lengths() - {0})
        limits.extend(frozenset({check.length}) for check in self.checks if check.length is not None)
        if not limits:
            return None
        return frozenset(n for n in frozenset.intersection(*limits) if n <= MOST_PLACES)

    def places(self, n_places: int) -> tuple[str, ...] | None:
        """The characters at each place of the serials of a length, or too many; None without such a serial."""
        strings = self.strings(n_places)
        return None if strings is None else strings.places

    @property
    def fixed_places(self) -> tuple[str, ...] | None:
        lengths = self.lengths()
        return self.places(next(iter(lengths))) if lengths is not None and len(lengths) == 1 else None

    def strings(self, n_places: int, chars: tuple[str, ...] | None = None) -> Strings | None:
        """Return the serials of a length with only these characters, if any; `opaque` checks only narrow a lexicon."""
        return _strings(self, n_places, self.characters if chars is None else chars)

    def allows(self, text: str) -> bool:
        return not self.objections(text)

    def objections(self, text: str) -> tuple[str, ...]:
        plain = "".join(text.split())
        broken = []
        if self.lexicon is not None and plain not in self.lexicon:
            broken.append("it is not in the lexicon")
        for part in self._parts():
            if not _core_accepts(part, plain):
                broken.append(f"it does not fit {str(part).replace('mask:', 'the format ')}")
        broken.extend(
            f"{check} has {check.length} characters"
            if check.length not in (None, len(plain))
            else f"the check digit {check} is wrong"
            for check in self.checks
            if not check.holds(plain)
        )
        return tuple(broken)

    def _parts(self) -> list[Grammar]:
        bare = Grammar(exclude=self.exclude, alphabet="".join(self.characters))
        # fields of each part; without the first one the part is not there
        kinds = (("format",), ("expression", "alphabet", "elements"), ("sets",))
        parts = [
            replace(bare, **{name: getattr(self, name) for name in names})
            for names in kinds
            if getattr(self, names[0]) is not None
        ]
        return parts or ([bare] if self.lexicon is None else [])


def _core_accepts(part: Grammar, text: str) -> bool:
    if not text or not set(text) <= set(part.characters):
        return False
    strings = part.strings(len(text))
    codes = encode([text], part.characters)
    return isinstance(strings, Automaton) and bool(strings.accepts(codes)[0])


@lru_cache(maxsize=128)
def _characters(grammar: Grammar) -> tuple[str, ...]:
    known = set(grammar.alphabet)
    if grammar.format is not None:
        known.update(*allowed_characters(grammar.format))
    if grammar.expression is not None:
        known |= written_characters(grammar.expression)
    known.update(*(grammar.sets or ()), *(grammar.lexicon or ()))
    known.update(*(check.alphabet for check in grammar.checks))
    return tuple(sorted(known - {" "}))


@lru_cache(maxsize=32)
def _strings(grammar: Grammar, n_places: int, chars: tuple[str, ...]) -> Strings | None:
    machines = [check.machine(n_places, chars) for check in grammar.checks if check.remainder is not None]
    sets: list[Sequence[str]] = []
    if grammar.format is not None:
        every = allowed_characters(grammar.format, exclude=grammar.exclude)
        sets.append([place for place in every if place != " "])
    elif grammar.exclude:
        sets.append(["".join(c for c in chars if c not in grammar.exclude)] * n_places)
    if grammar.sets is not None:
        sets.append(grammar.sets)
    if grammar.expression is not None:
        machines.append(expression_machine(grammar.expression, chars).machine)
    if grammar.format is None and grammar.sets is None and grammar.expression is None:
        sets.append(["".join(_characters(grammar))] * n_places)
    machines += [_sets_machine(allowed, n_places, chars) for allowed in sets]
    automaton = unroll(machines, n_places, chars)
    if grammar.lexicon is None or automaton is None:
        return automaton
    known_chars = set(chars)
    words = sorted(w for w in grammar.lexicon if len(w) == n_places and known_chars.issuperset(w))
    if words:
        words = list(compress(words, automaton.accepts(encode(words, chars))))
    words = [word for word in words if all(check.holds(word) for check in grammar.opaque)]
    return WordList(chars, tuple(words)) if words else None


def _sets_machine(allowed: Sequence[str], n_places: int, chars: tuple[str, ...]) -> Machine:
    sets = allowed if len(allowed) == n_places else [""] * n_places
    return Machine(lambda place: np.array([[0 if c in sets[place] else -1 for c in chars]]), np.ones(1, bool))

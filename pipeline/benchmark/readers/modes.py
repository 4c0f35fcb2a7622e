"""The modes of a benchmark: each reads the same part with its own senses.

    tactile, vision, lights, fused     readings of our own
    MODE without RULE                  the same, decided without one contract or term of the score
    MODE with WHISKER                  the same, felt with another whisker (tactile and fused)
    SENSE EXPERT                       the same, from the lattice of one expert alone
    ENGINE PICTURE, PLAN LEVEL, module:function

The second and fourth read nothing again: line, places and the charged time are those of the full reading.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.benchmark.readers.own_reader import own_mode
from pipeline.benchmark.readers.peers import open_peer
from pipeline.benchmark.readers.plans import PLANS, TouchPlan, plan_mode
from pipeline.common.settings import SettingsError
from pipeline.reading.readers import with_whisker_file
from recognition.decide.decide import decide
from recognition.decide.decision import BROKEN, MEASURE_FLAGS, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.decide.score import SOURCES, Measure, score_of
from recognition.find.part_lines import PartLines
from recognition.reader import Reader
from recognition.settings import ReaderSettings

# sense and expert (`recognition.settings.EXPERTS`): single experts of the built-in modes
EXPERTS = ("tactile network", "tactile templates", "vision network")
# modes of third-party programs
PEERS = tuple(
    f"{engine} {picture}"
    for engine in ("rapidocr", "tesseract")
    for picture in ("photo", "edges", "relief", "ideal")
)
# between a mode and the decision rule that it leaves out
WITHOUT = " without "
# between a mode and the file of the other whisker
WITH = " with "


def rules() -> dict[str, ReadingFlag | Measure]:
    """List contracts and terms of the score by name, such as unread-marks or strokes."""
    terms = {term for source in SOURCES for term in score_of(source).terms if term is not Measure.ODDS}
    single = (*(BROKEN & ~MEASURE_FLAGS), *sorted(terms))
    named = {str(rule.name).lower().replace("_", "-"): rule for rule in single}
    return {**named, "mark-rules": MEASURE_FLAGS}


def leave_out(name: str, settings: ReaderSettings) -> Callable[[Reading], Reading]:
    """A function that decides on a reading's evidence without one rule. Raises SettingsError: there is no such rule."""
    known = rules()
    if name not in known:
        what = f"there is no rule {name!r} to leave out"
        raise SettingsError(what, hint=f"the rules are {', '.join(known)}")
    rule = known[name]
    if isinstance(rule, ReadingFlag):
        return lambda reading: decide(_evidence_of(reading), settings, without=rule)
    return lambda reading: decide(_evidence_of(reading), settings, without_measures=frozenset({rule}))


def expert_alone(whole: Reading, expert: str, settings: ReaderSettings) -> Reading:
    """The reading of one expert alone, from the reading `whole` of one sense by all experts together."""
    (sense,) = _evidence_of(whole).senses
    main = sense.main
    lattice = None if main is None else main.by_expert.get(expert)
    lines = None if main is None or lattice is None else PartLines(replace(main, lattice=lattice))
    alone = SenseEvidence(sense.source, lines=lines, log=Log(seconds=sense.log.seconds))
    return decide(Evidence.of(alone), replace(settings, lines=()))


def _evidence_of(reading: Reading) -> Evidence:
    assert reading.evidence is not None  # a reading of our own has it
    return reading.evidence


def experts_in(modes: tuple[str, ...]) -> tuple[str, ...]:
    """Modes of the single experts that these modes use."""
    senses = {sense for sense in ("tactile", "vision") if {sense, "fused"} & {*modes}}
    return tuple(mode for mode in EXPERTS if mode.split()[0] in senses)


def whiskers_in(modes: tuple[str, ...]) -> tuple[Path, ...]:
    """Files of the other whiskers that these modes feel with."""
    return tuple(dict.fromkeys(Path(path) for mode in modes if (path := mode.partition(WITH)[2])))


def _sense(uses: tuple[str, ...], read: Callable[[PartReadings, Reader], Reading], reader: Reader) -> Mode:
    if "touch" in uses:
        _ = reader.touch  # refuse invalid settings before anything is read
    if uses != ("touch",):
        _ = reader.vision
    return Mode.of(uses, lambda senses: read(senses, reader))


def _change_reading(whole: str, change: Callable[[Reading], Reading], reader: Reader) -> Mode:
    mode = MODES[whole](reader)
    return Mode.of(mode.uses, lambda senses: change(mode.read(senses)[0]))


# built-in modes
MODES: dict[str, Callable[[Reader], Mode]] = {
    "tactile": partial(_sense, ("touch",), lambda senses, _: senses.touch),
    "vision": partial(_sense, ("vision",), lambda senses, _: senses.vision),
    "lights": partial(_sense, ("lights",), lambda senses, _: senses.lights),
    "fused": partial(_sense, ("touch", "vision"), lambda s, reader: reader.fuse(s.touch, s.vision)),
}


def _felt_with(whole: str, path: Path, reader: Reader) -> Mode:
    settings = reader.settings
    other = Reader(replace(settings, array=with_whisker_file(settings.array, path)))
    _ = other.touch  # refuse invalid settings before anything is read

    def read(senses: PartReadings) -> tuple[Reading, dict[str, Any]]:
        felt = PartReadings(senses.specimen, other)
        reading = felt.touch if whole == "tactile" else other.fuse(felt.touch, senses.vision)
        return reading, {"scan_s": round(felt.scan_s, 3)}

    return Mode(("vision",) if whole == "fused" else (), read)


_FELT = ("tactile", "fused")  # modes that other whiskers can feel for


def expand_groups(
    named: tuple[str, ...], *, ablate: tuple[str, ...] = (), whiskers: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Replace the groups experts (of the other modes), peers, and plans (of touch) among the names of modes; add the
    modes without each of the rules `ablate`, and with each of the files `whiskers`."""
    groups = {"experts": experts_in(named), "peers": PEERS, "plans": tuple(p.mode for p in PLANS)}
    single = tuple(name for name in named if name not in groups)
    more = dict.fromkeys(mode for name in named for mode in groups.get(name, ()))
    less = tuple(f"{mode}{WITHOUT}{rule}" for rule in ablate for mode in single if mode in MODES)
    other = tuple(f"{mode}{WITH}{path}" for path in whiskers for mode in single if mode in _FELT)
    return (*single, *(mode for mode in more if mode not in single), *less, *other)


def open_mode(name: str, reader: Reader) -> Mode:
    """Open a mode by name, a touch plan, or a user's own reader, `module:function`. Raises ModeUnavailableError: it
    cannot run here. SettingsError: there is no such mode, or it cannot use a font or format."""
    if ":" in name:
        return own_mode(name, reader.settings)
    whole, _, rule = name.partition(WITHOUT)
    if rule and whole in MODES:
        return _change_reading(whole, leave_out(rule, reader.settings), reader)
    whole, _, path = name.partition(WITH)
    if path and whole in _FELT:
        return _felt_with(whole, Path(path), reader)
    if (plan := TouchPlan.of(name)) is not None:
        return plan_mode(plan, reader)
    if name in EXPERTS:
        sense, expert = name.split()
        return _change_reading(sense, lambda reading: expert_alone(reading, expert, reader.settings), reader)
    if name in PEERS:
        written = reader.settings.format
        return open_peer(*name.split(), format=written if isinstance(written, str) else None)
    if name not in MODES:
        raise SettingsError(
            f"there is no mode {name!r}",
            hint=f"the modes are {', '.join((*MODES, *PEERS))}, and MODULE:FUNCTION",
        )
    return MODES[name](reader)

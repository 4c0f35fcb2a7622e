"""Fonts for training: files of installed packages (listed in `docs`), without those of exams and of the score's fit."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font, Glyph
from glyphs.fonts.outlines import SERIAL_CHARACTERS, load_font

KEPT_OUT = (
    "manrope", "hanken", "caladea", "cambo", "sourceserif", "sourcesans", "fredoka", "amatic",
    "cmb", "cmex", "cmmi", "cmr", "cmss", "cmsy", "cmti", "cmtt", "cmu", "computermodern",
    "lmroman", "lmmono", "lmsans", "latinmodern", "osifont", "ospdin", "opendin",
    "sharetech", "quantico", "redhatmono", "redhatdisplay", "redhattext", "sarpanch", "routedgothic",
    "ocrb", "allertastencil", "sairastencilone", "stardosstencil", "oxygenmono", "novamono", "synemono",
    "majormonodisplay", "vt323", "iceland", "iceberg", "wallpoet", "gugi", "kronaone", "tomorrow",
    "kodemono", "sometypemono", "martianmono", "dmmono", "azeretmono", "xanhmono", "cutivemono",
    "anonymouspro", "nanumgothiccoding", "lekton", "monda", "scada", "russoone", "squadaone",
    "racingsansone", "jockeyone", "teko", "khand", "rationale", "geo", "unicaone", "sixcaps", "antonio",
    "bigshoulderstext", "bigshouldersdisplay", "sticknobills",
)  # fmt: skip
"""Beginnings of names of font files that are never learned from: exams use these fonts."""
SCORE_FAMILIES = (
    "adventpro", "aldrich", "allerta", "archivonarrow", "armata", "arvo", "audiowide", "b612",
    "baijamjuree", "barlow", "bebasneue", "blackopsone", "blinker", "chakrapetch", "chivomono", "daysone",
    "electrolize", "encodesanscondensed", "exo2", "fjallaone", "fragmentmono", "francoisone", "glegoo",
    "goldman", "homenaje", "ibmplexmono", "k2d", "kanit", "leaguegothic", "metrophobic", "michroma",
    "nixieone", "numans", "orbitron", "orienta", "oxanium", "pathwaygothicone", "pragatinarrow", "rajdhani",
    "rokkitt", "ropasans", "saira", "solway", "sono", "spacegrotesk", "spacemono", "specialelite",
    "splinesansmono", "staatliches", "strait", "syncopate", "titilliumweb", "turretroad", "varelaround",
    "victormono", "viga", "voltaire", "zillaslab",
)  # fmt: skip
"""The same, for the fit of the score: on fonts that the recogniser has learned it would be too sure of itself."""
MOST_OF_A_FAMILY = 8
_NOT_LETTERS = re.compile(
    r"symbol|dingbat|emoji|math|icons?|braille|ornament|initial|border|music|chess|barcode|dseg|lastresort|smallcap|^alfa|^ellen|^elleb|d050000l|abogado|ocrb[ef]$|wasn_t|solidemirage|abecedario|ecolier|caps\b",
    re.I,
)


_FONTSOURCE = re.compile(r"(?P<family>.+)-latin-\d+-(normal|italic)")


@dataclass(frozen=True)
class TrainingFonts:
    """Fonts, divided by family."""

    seen: tuple[Path, ...]
    held_out: tuple[Path, ...]


def family(path: Path) -> str:
    """Name of the family from the file name: lower case, without style and punctuation."""
    packed = _FONTSOURCE.fullmatch(path.stem)
    if packed:
        return re.sub(r"[^a-z0-9]", "", packed["family"])
    return re.sub(r"[^a-z0-9]", "", re.split(r"[-_]|(?<=[a-z])(?=[A-Z][a-z]+$)", path.stem)[0].lower())


def kept_out(path: Path) -> bool:
    """Whether a font may not be learned from, because an exam or the fit of the score uses it."""
    whole = re.sub(r"[^a-z0-9]", "", path.stem.lower())
    return whole.startswith(KEPT_OUT + SCORE_FAMILIES)


def is_learnable(path: Path) -> bool:
    """Whether a font may be learned from and its name promises letters."""
    return not kept_out(path) and not _NOT_LETTERS.search(path.stem)


def find_fonts(folders: Iterable[Path], *, held_out_share: float = 0.1) -> TrainingFonts:
    """Find all fonts in folders for training, a share of the families held out. Raises MarksError without any."""
    by_family: dict[str, list[Path]] = {}
    names: set[str] = set()
    files = {f for folder in folders for kind in ("ttf", "otf", "woff") for f in folder.rglob(f"*.{kind}")}
    for path in sorted(files, key=lambda p: (p.stem.lower(), str(p))):
        if path.stem.lower() in names or not is_learnable(path):
            continue
        if _has_serials(path):
            names.add(path.stem.lower())
            by_family.setdefault(family(path), []).append(path)
    if not by_family:
        raise MarksError(
            "there are no fonts to learn from", hint="name folders of TrueType or OpenType files"
        )
    families = {
        name: files[:: max(1, -(-len(files) // MOST_OF_A_FAMILY))] for name, files in by_family.items()
    }
    # divide families by their first four letters: eurof55 and eurof56 are one design
    held = {name for name in families if crc32(name[:4].encode()) % 1000 < 1000 * held_out_share}
    return TrainingFonts(
        tuple(f for name, files in families.items() if name not in held for f in files),
        tuple(f for name, files in families.items() if name in held for f in files),
    )


def _has_serials(path: Path) -> bool:
    try:
        font = load_font(path)
        drawn = [font.glyph(char) for char in SERIAL_CHARACTERS]
    except (MarksError, ValueError, OSError):
        return False
    return all(glyph.contours for glyph in drawn)


def has_small_letters(font: Font) -> bool:
    """Whether the font has lower-case letters, not capitals in their place."""
    try:
        return all(_top(font.glyph(char)) < 0.93 for char in "aceosxz")
    except MarksError:
        return False


def _top(glyph: Glyph) -> float:
    return max((float(c[:, 1].max()) for c in glyph.contours + glyph.strokes), default=9.0)

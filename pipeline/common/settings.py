"""Settings of reading, declared once: flags, file, environment, help and reference follow from this model, and a
library user builds it, `ReadSettings(font="gothic")`."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from glyphs.errors import MarksError
from pipeline.common.parsed import Strict, advice, json_of, shown
from pipeline.common.texts import split_commas


class SettingsError(MarksError):
    """An invalid setting or argument, or one that contradicts another."""


FROM_MACHINE = "leave it out: it follows from the machine (see tactile-marks settings)"
GIVEN_UP = "limit_s (a worker gives a part up after twice as long)"


class Settings(BaseModel):
    """Checked settings; unknown names are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
    # of `tactile-marks.toml`, and part of the environment variables' names; empty for its top
    table: ClassVar[str] = ""
    # former names: what to write instead; empty if it follows from the machine
    replaced: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        for field in cls.model_fields.values():
            field.description = " ".join(str(field.description or "").split())

    @classmethod
    def leaves(cls) -> dict[str, FieldInfo]:
        """Every setting by its name, those of a section as section.name."""
        settings: dict[str, FieldInfo] = {}
        for name, field in cls.model_fields.items():
            if isinstance(field.annotation, type) and issubclass(field.annotation, Settings):
                settings |= {f"{name}.{leaf}": below for leaf, below in field.annotation.leaves().items()}
            else:
                settings[name] = field
        return settings

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Make settings from a program's arguments. Raises SettingsError: a setting is unknown or invalid."""
        for name in values:
            if name not in cls.model_fields:
                cls.check_known(name)
        try:
            return cls(**values)
        except ValidationError as error:
            raise bad_value(error) from error

    @classmethod
    def check_known(cls, name: str, *, called: str = "", where: str = "") -> None:
        """Refuse a name that no setting has. Raises SettingsError: its hint lists similar ones."""
        known = list(cls.leaves())
        if name not in known:
            near = difflib.get_close_matches(name.lower(), known, n=2)
            near = near or [other for other in known if other.split("_")[0] == name.lower().split("_")[0]]
            hint = f"did you mean {' or '.join(near)}?" if near else f"the settings are {', '.join(known)}"
            if name in cls.replaced:
                hint = f"did you mean {cls.replaced[name]}?" if cls.replaced[name] else FROM_MACHINE
            raise SettingsError(f"unknown setting {called or name}{where and ' in '}{where}", hint=hint)

    @classmethod
    def variable(cls, name: str) -> str:
        path = name.split(".")
        return "_".join(("TACTILE_MARKS", *([cls.table] if cls.table else []), *path)).upper()


_MODES = {
    **dict.fromkeys(("touch", "whisker", "whiskers"), "tactile"),
    **dict.fromkeys(("camera", "photo", "visual"), "vision"),
    **dict.fromkeys(("both", "fusion"), "fused"),
}
"""Everyday words for a mode, which is stored under its own name."""


def bad_value(error: ValidationError, *, called: Callable[[str], str] = str) -> SettingsError:
    """Make the error of the first invalid value; `called` returns the name by which the user knows a setting."""
    first = error.errors()[0]
    if not first["loc"]:  # settings that contradict each other
        return SettingsError(first["msg"].removeprefix("Value error, "))
    name = ".".join(key for key in first["loc"] if isinstance(key, str))
    if first["type"] in ("dataclass_type", "model_type"):
        what = f"{called(name)} is {shown(first['input'])}, but it is a group of settings"
        return SettingsError(what, hint="write one of them after a dot, such as watch.folder or tcp.port")
    value = first["input"]
    if isinstance(value, (list, tuple)) and len(value) == 1:
        (value,) = value  # a flag that may be repeated, given once
    return SettingsError(f"{called(name)} is {shown(value)}: {advice(first)}")


def _by_commas(value: Any) -> Any:
    return split_commas(value) if isinstance(value, str) else value


def _split(value: tuple[str, ...]) -> tuple[str, ...]:
    # one flag may hold several names
    return split_commas(",".join(value))


def _mode(value: Any) -> Any:
    return _MODES.get(value, value) if isinstance(value, str) else value


def _in_tuple(value: Any) -> Any:
    # a format may hold commas itself
    return (value,) if isinstance(value, str) else value


def _by_name(value: Any) -> Any:
    if isinstance(value, str) and value.lstrip().startswith("{"):
        value = json_of(value)
    if not isinstance(value, Mapping):
        return _in_tuple(value)
    return tuple(_line_of_table(name, written) for name, written in value.items())


class _LineTable(Strict):
    format: str
    region: list[Any] | None = None


def _line_of_table(name: str, written: Any) -> str:
    try:
        line = _LineTable.model_validate({"format": written} if isinstance(written, str) else written)
    except ValidationError as error:
        hint = "write its format, or a table of format and region"
        raise ValueError(f"line {name} is {shown(written)}; {hint}") from error
    place = f"{name}@{','.join(map(str, line.region))}" if line.region else name
    return f"{place}={line.format}"


@dataclass(frozen=True)
class NamedLine:
    """Another line beside the serial, written as lot=AAA99, or lot@0,0.5,1,1=AAA99 with the region of its middle."""

    name: str
    format: str
    region: Region | None = None

    @classmethod
    def parse(cls, text: str) -> NamedLine:
        """Parse the written form. Raises ValueError: the name or format is missing, or the region is invalid."""
        place, sign, written = (piece.strip() for piece in text.partition("="))
        if not (sign and written):
            raise ValueError(f"{text!r} is not a line; write NAME=FORMAT, such as lot=AAA99")
        name, at_sign, region = place.partition("@")
        if not _LINE_NAME.fullmatch(name):
            raise ValueError(f"{name!r} is not a name for a line; write letters, digits, _ and -")
        return cls(name, written, _region(_by_commas(region)) if at_sign else None)

    def __str__(self) -> str:
        region = "" if self.region is None else "@" + ",".join(f"{share:g}" for share in self.region)
        return f"{self.name}{region}={self.format}"


def _lines(value: tuple[str, ...]) -> tuple[str, ...]:
    lines = [NamedLine.parse(text) for text in value]
    names = [line.name for line in lines]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"two lines are called {name}; give each a name of its own")
    for line in lines:
        _formats((line.format,))
    return tuple(map(str, lines))


def _region(value: Any) -> Any:
    if value is None:
        return None
    from recognition.find.region import check_region  # slow

    try:
        left, top, right, bottom = (float(share) for share in _by_commas(value))
        check_region((left, top, right, bottom))
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(_REGION_HINT) from error
    return (left, top, right, bottom)


MOST_RULES, MOST_RULE_CHARS = 16, 2_000
"""Most formats, lines or depth rules of a job, and characters in each: preparing them takes time."""


def _risk(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    from recognition.decide.risk_text import parse_risk

    return parse_risk(value)


def _few(value: Any) -> Any:
    if isinstance(value, tuple | list):
        if len(value) > MOST_RULES:
            raise ValueError(f"there are {len(value)}; give {MOST_RULES} at most")
        longest = max((len(text) for text in value if isinstance(text, str)), default=0)
        if longest > MOST_RULE_CHARS:
            raise ValueError(f"one has {longest:,} characters; give {MOST_RULE_CHARS:,} at most")
    return value


def _formats(value: tuple[str, ...]) -> None:
    from recognition.language.format_text import parts_of
    from recognition.language.grammar import Grammar

    parts_of(value)  # refuses two of one kind, before any is prepared
    for text in value:
        Grammar.parse(text)


def _experts(value: tuple[str, ...]) -> None:
    from recognition.settings import ReaderSettings

    ReaderSettings(experts=value)


def _rules(value: tuple[str, ...]) -> None:
    from recognition.decide.depth_rules import depth_rule

    for text in value:
        depth_rule(text)


def _where_given(check: Callable[[tuple[str, ...]], None]) -> AfterValidator:
    """Check values by libraries that are slow to import; they are imported only if there are values."""

    def checked(value: tuple[str, ...]) -> tuple[str, ...]:
        if value:
            check(value)
        return value

    return AfterValidator(checked)


_LINE_NAME = re.compile(r"\w[\w-]*")
_REGION_HINT = "give left, top, right and bottom as shares, 0 to 1, such as 0,0.5,1,1"
Region = tuple[float, float, float, float]
Names = Annotated[tuple[str, ...], BeforeValidator(_by_commas)]
"""Several names, in one text separated by commas."""

MOST_FONTS = 64  # templates are made for each


class MapSettings(Settings):
    """Settings of height files, for values that a file lacks or states wrongly."""

    unit: Literal["nm", "um", "mm", "m", "in"] | None = None
    """Unit of the numbers in height files, whatever the file states. Default: the unit that the file states, and mm
    where it states none."""
    pitch_mm: float | None = Field(default=None, gt=0.0, le=10.0, allow_inf_nan=False)
    """Distance of neighbouring samples in mm, for height files that do not state it (.npy, text matrices, height
    images) or state it wrongly."""
    height_image: bool = False
    """Read .png and .tif as heights, one number a pixel, and not as photographs; see --unit and --pitch-mm."""
    rows: Literal["top-first", "bottom-first"] | None = None
    """Order of the rows of a height file, or the end of the part at which the smallest y lies, whatever the file
    states. Default: as the file states; where it states nothing, the usual order of its format, and a serial that is
    another serial mirrored goes to review."""


@dataclass(frozen=True)
class Limits:
    """Largest sizes of a part's files that others send, checked from a file's header."""

    photo_pixels: int = 40_000_000
    map_samples: int = 30_000_000


class PartSettings(Settings):
    """Settings of reading that most parts need; every command that reads has flags for them."""

    mode: Annotated[Literal["tactile", "vision", "fused", "auto"], BeforeValidator(_mode)] = "auto"
    """Senses to read with: touch (tactile), the camera (vision), both together (fused), or those that each part has
    files for (auto); a photograph beside a named map only with vision and fused."""
    font: Annotated[Names, Field(max_length=MOST_FONTS)] = ()
    """Built-in font or TTF/OTF file to compare the marks with; may be repeated. Any font is read."""
    format: Annotated[
        tuple[str, ...], BeforeValidator(_few), BeforeValidator(_in_tuple), _where_given(_formats)
    ] = ()
    """Format of the serials; may be repeated, all must hold. For example AA999999 (A is a letter, a a small letter, 9 a
    digit, * A or 9, a blank a word gap; any other character, and any after a \\, stands for itself), re:EXPRESSION,
    sets:AB,0-9,... (the characters of each place), fields:SER (text elements and GS1 identifiers), vin
    (vin-na: with its check digit everywhere), or check:RULE; +check=RULE and +exclude=IOQ may follow any of them."""
    height_mm: float | None = Field(default=None, gt=0.0, le=1000.0, allow_inf_nan=False)
    """Character height in mm (default: measured)."""
    database: Path | None = None
    """Glyph database (.glyphs) to take the fonts from; see glyphs build and enroll."""
    accept_risk: Annotated[float, BeforeValidator(_risk), Field(gt=0.0, lt=1.0)] | None = None
    """Greatest share of wrong readings among those accepted (default: 1/1000, or the least that a sense keeps)."""


class ReadSettings(MapSettings, PartSettings):
    """Settings of reading."""

    replaced: ClassVar[Mapping[str, str]] = {
        "check": 'format = "check:RULE"',
        "exclude": 'format = "MASK+exclude=IOQ"',
        "min_depth_mm": 'depth_rule = "0.2:"',
    }

    experts: Annotated[Names, AfterValidator(_split), _where_given(_experts)] = ()
    """Experts to read with, separated by commas: network (any font), templates (the named fonts, and the die learned
    from a lot; alone they read by touch only). Default: both."""
    lexicon: Path | None = None
    """File of all serials that exist, one per line; # starts a comment."""
    region: Annotated[Region | None, BeforeValidator(_region)] = None
    """Region in which the middle of the serial lies: left, top, right and bottom as shares, 0 to 1, of the photograph
    or of the scanned area. Default: anywhere."""
    orientation: Literal["upright", "any"] = "any"
    """Orientation of the parts: upright, or any, also upside down. With any, a serial that is another serial upside
    down, such as 900608, goes to review. Parts before a fixed camera or in a fixture are upright."""
    line: Annotated[
        tuple[str, ...], BeforeValidator(_few), BeforeValidator(_by_name), AfterValidator(_lines)
    ] = ()
    """Another line on the part, as NAME=FORMAT, such as lot=AAA99, or with its region,
    lot@0,0.5,1,1=AAA99; may be repeated. A part without it goes to review. In the file also a table, [line] with lot =
    "AAA99", or [line.lot] with format and region; in the environment also JSON, {"lot": "AAA99"}."""
    sensors: Literal["real", "ideal"] = "real"
    """Simulated sensors and stage that feel height maps: real (gains, offsets, noise, drift, vibration, 16 bits, errors
    of position, ringing) or ideal."""
    whisker: Path | None = None
    """Whisker file with which height maps are felt, as from design --out (default: a whisker for the character
    height)."""
    speed_mm_s: float | None = Field(default=None, gt=0.0, le=1000.0, allow_inf_nan=False)
    """Speed of the simulated stage, mm/s (default: the whisker file's, or 10 heights a second up to 50 mm/s)."""
    depth_rule: Annotated[Names, AfterValidator(_few), _where_given(_rules)] = ()
    """Rule for depth, burr and size of the marks; may be repeated. 27CFR478.92, CONTRAN24/98, MIL-STD-792, 70-16-05,
    or one of your own in mm, NAME=LEAST:MOST@HEIGHTS, such as "press-7=0.05:0.15@0.8:2 0.15:0.3@2.5:4 burr=0.05
    height=1.6", or only a least depth, 0.2:. A part that breaks one is read all the same and goes to review."""
    certificate: Path | None = None
    """Certificate (.json, see certify): readings that it does not cover are not accepted, and parts unlike the
    certified ones raise a warning."""
    active: bool = False
    """Scan height maps pass by pass, and stop when the serial is sure or more touch would not help. Default: the whole
    plan. A message of the part states the stage seconds used."""
    budget_s: float = Field(default=60.0, gt=0.0, le=3600.0, allow_inf_nan=False)
    """Most stage seconds of a part that is scanned pass by pass."""
    limit_s: float | None = Field(default=None, gt=0.0, le=3600.0, allow_inf_nan=False)
    """Seconds after which a sense searches a part no further: the best text so far is shown, "stopped after N s". It is
    not accepted, unless the other sense accepts the same text. Pass by pass, budget_s counts instead. Default: no
    limit; 60 for parts that are sent to the service."""

    @property
    def regions(self) -> bool:
        lines = map(NamedLine.parse, self.line)
        return self.region is not None or any(line.region is not None for line in lines)

    @property
    def sources(self) -> tuple[str, ...]:
        return ("tactile", "vision", "fused") if self.mode == "auto" else (self.mode,)

    def check_accept_risk(self) -> None:
        """Check that a sense keeps the accepted risk, if one was set. Raises MarksError: none does."""
        if self.accept_risk is not None:
            from recognition.decide.risk import require_kept  # slow

            require_kept(self.accept_risk, self.sources)

    @property
    def touch_budget_s(self) -> float | None:
        return self.budget_s if self.active else None

"""Description of trace files from other systems, as TOML: columns, units, and positions of the whiskers.

whisker = "whisker.toml"          the whiskers (`pipeline.formats.whisker_file`), beside this file
moment_unit = "V"                 N*mm, mN*m, N*m, or V
position_unit = "mm"              um, mm, m, in
lead_mm = 1.5                     run-in and run-out of each pass
[columns]                         by name, or by number from 1; of TDMS "group/channel"
moment = ["ch0", "ch1"]           one a whisker
x = "X"
y = "Y"
...
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pipeline.common.parsed import Finite, Positive, Strict, read_toml

_FORMAT_VERSION = 1
Column = Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)]


class Columns(Strict, strict=True):
    """Columns of the quantities."""

    moment: tuple[Column, ...] = Field(min_length=1, strict=False)
    x: Column  # of the stage's position, as y, in the plate frame, with y down the part
    y: Column
    time: Column | None = None  # in `time_unit`, or time stamps; None: the rate is known
    lifted: Column | None = None  # not 0 where the array is lifted off; None: all samples touch
    number: Column | None = Field(default=None, alias="pass")  # negative between passes; None: a pass a file

    def named(self) -> tuple[Column, ...]:
        others = (self.x, self.y, self.time, self.lifted, self.number)
        return (*self.moment, *(c for c in others if c is not None))


class Csv(Strict, strict=True):
    """Layout of text; `skip_lines` stand before the header, or before the first values if columns are numbered."""

    delimiter: str = Field(default=",", min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    skip_lines: int = Field(default=0, ge=0)


class TracesFile(Strict, strict=True):
    """Description of trace files."""

    whisker: str
    columns: Columns
    moment_unit: Literal["N*mm", "mN*m", "N*m", "V"] = "N*mm"
    # of the position columns only; keys in mm stay in mm
    position_unit: Literal["um", "mm", "m", "in", "nm"] = "mm"
    time_unit: Literal["s", "ms", "us", "ns", "d"] = "s"
    sampling_rate_hz: Positive | None = None  # if neither a time column nor a TDMS channel states it
    lead_mm: float = Field(default=0.0, ge=0.0, allow_inf_nan=False)  # run-in and run-out on bare land
    # lateral distance of each tip from the stage's position: towards +y in passes along x, +x along y (default: 0)
    across_mm: tuple[Finite, ...] = Field(default=(), strict=False)
    turns: bool = False  # the comb turns with the direction: across_mm is then to the right of the travel
    # distance of each tip behind the position (default: 0)
    behind_mm: tuple[Annotated[Finite, Field(ge=0.0)], ...] = Field(default=(), strict=False)
    # x0, y0, x1, y1 of the part; a tip beyond it does not touch (default: the whole plate)
    part_mm: tuple[Finite, Finite, Finite, Finite] | None = Field(default=None, strict=False)
    part_id: str = ""
    start_time: str = ""  # ISO 8601 with zone
    csv: Csv = Csv()

    @model_validator(mode="after")
    def _one_each(self) -> Self:
        n = len(self.columns.moment)
        for name, distances in (("across_mm", self.across_mm), ("behind_mm", self.behind_mm)):
            if len(distances) not in (0, n):
                raise ValueError(
                    f"has {len(distances)} numbers in {name}, and {n} whiskers in columns.moment"
                )
        if n > 1 and not self.across_mm:
            raise ValueError(f"lacks the key across_mm, with {n} whiskers that do not run on one line")
        if self.behind_mm and min(self.behind_mm) != 0.0:
            raise ValueError("has no whisker with 0 in behind_mm, which counts from the foremost whisker")
        if self.part_mm is not None and not (
            self.part_mm[0] < self.part_mm[2] and self.part_mm[1] < self.part_mm[3]
        ):
            raise ValueError(
                f"has part_mm {list(self.part_mm)}; it must be least x, least y, greatest x, greatest y"
            )
        named = self.columns.named()
        if len(set(named)) < len(named):
            twice = next(c for c in named if named.count(c) > 1)
            raise ValueError(f"names the column {twice!r} twice")
        return self


def read_traces_file(path: Path) -> TracesFile:
    """Read a description of trace files. Raises FileError: it is missing or not TOML, or has invalid keys."""
    hidden = ("constrained-str", "constrained-int")
    return read_toml(path, TracesFile, format_version=_FORMAT_VERSION, hidden=hidden)

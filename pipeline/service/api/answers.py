"""Fields and answers of the interface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from fastapi import Depends, Form, Header, Path, Request
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from pipeline.common.records import EvidenceKind, PartRecord, PartState, ReviewAction, Scope
from pipeline.service.web.access import Access, Caller

HIDDEN = r"\x00-\x1f\x7f-\x9f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ue000-\uf8ff\ufeff\ufff9-\ufffb"
"""Members of a character class of a regular expression: hidden characters of the Basic Multilingual Plane.

Without half surrogates, which never come out of UTF-8.
"""
TEXT = f"^[^{HIDDEN}]*$"
NOTE = f"^(?:[\\t\\n\\r]|[^{HIDDEN}])*$"
PICTURES = {"photo": EvidenceKind.PHOTO_PICTURE, "edges": EvidenceKind.EDGES_PICTURE}
PictureName = Literal["photo", "edges", "boxes"]


@dataclass(frozen=True)
class PartAnswer(PartRecord):
    """A part in its present state, with links to more.

    Attributes:
        links: addresses of the part, its history, and of its pictures by name.
    """

    links: Mapping[str, str] = field(default_factory=dict)


def answer(part: PartRecord, root_path: str = "") -> PartAnswer:
    """The part with its links, with the prefix of a proxy, if any."""
    here = f"{root_path}/v1/parts/{part.id}"
    pictures = {name: f"{here}/pictures/{name}" for name in (*PICTURES, "boxes")}
    return PartAnswer(**part.__dict__, links={"self": here, "history": f"{here}/history", **pictures})


class ReviewBody(BaseModel):
    """A person's review of a part."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"action": "correct", "text": "KX407251", "who": "Anna", "before": "KX4O7251"}]
        },
    )

    action: ReviewAction
    text: str = Field("", max_length=200, pattern=TEXT, description="the serial; empty for unreadable")
    who: str = Field(
        "", max_length=100, pattern=TEXT, description="the person; a token signs with its own name"
    )
    note: str = Field("", max_length=2000, pattern=NOTE)
    outside_format: bool = Field(
        False, description="save a serial that does not fit the format; else that is answered 422"
    )
    before: str | None = Field(
        None, max_length=200, description="the text as it was; if it has changed since, the answer is 409"
    )


def _text(description: str, **more: Any) -> Any:
    return Form(max_length=200, pattern=TEXT, description=description, **more)


def _sought(description: str) -> Any:
    return Field("", max_length=200, pattern=TEXT, description=description)


Name = Annotated[str, _text("what the line calls the part", examples=["tray-7/part-3"])]
Expected = Annotated[str, _text("the serial it should read: confirmed, refuted or undecided")]
Database = Annotated[str, _text("glyph database, as /v1/databases lists them")]
JobName = Annotated[
    str, _text("job that says how to read, as /v1/jobs lists them", examples=["housing-left"])
]
Time = Annotated[datetime, AfterValidator(lambda at: at if at.tzinfo else at.replace(tzinfo=UTC))]
PartId = Annotated[
    str, Path(max_length=64, description="of the part", examples=["01JD8Z6Y3Q5V7W9X1B2C3D4E5F"])
]
Key = Annotated[
    str | None,
    Header(
        max_length=200,
        pattern=r"^[\x21-\x7e]+$",
        description="made by the sender for each part; a request that is sent again with it makes no second part",
    ),
]


class Sought(BaseModel):
    """Filters of a list of parts; times without a zone are UTC."""

    state: PartState | None = None
    text: str = _sought("that its serial holds")
    name: str = _sought("that its name holds")
    job: str = _sought("that it was read by")
    line: str = _sought("that it comes from")
    since: Time | None = Field(
        None, description="received then or later: 2026-11-21, 2026-11-21T06:00:00Z", examples=["2026-11-21"]
    )
    until: Time | None = Field(None, description="received before then", examples=["2026-11-22"])


class SoughtPage(Sought):
    """A page of a list of parts."""

    before: str | None = Field(None, max_length=64, pattern=TEXT, description="id after which to continue")
    limit: int = Field(50, ge=1, le=500)


def may(access: Access, scope: Scope) -> Any:
    """The dependency of a route that only callers with a scope may use."""

    def check(request: Request) -> Caller:
        return access.caller(request, scope)

    return Depends(check)

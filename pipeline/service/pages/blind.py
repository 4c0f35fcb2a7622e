"""The page of a part whose serial a person reads without seeing what was read before: pictures, and a field to type in.

It is given no reading and no text, so it can show none.
"""

from __future__ import annotations

from dataclasses import replace

from starlette.requests import Request
from starlette.responses import Response

from pipeline.common.people_records import Person
from pipeline.common.records import PartRecord
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.pictures import PictureView, picture_pair
from pipeline.service.web.access import Caller


def blind_page(
    frame: Frame,
    request: Request,
    part: PartRecord,
    *,
    caller: Caller,
    person: Person,
    address: str,
    why: str,
    most: tuple[int, int, int],
    typed: str = "",
    note: str = "",
    fault: str = "",
    taken: str = "",
    outside: str = "",
    remark: str = "",
    status: int = 200,
) -> Response:
    """The page.

    Args:
        frame: of all pages.
        request: for it.
        part: that is read; its name and its time are shown.
        caller: who looks.
        person: who reads.
        address: of the form; the next part is at its `next`.
        why: it is read so, in words.
        most: characters of text, name and note.
        typed: text typed before.
        note: typed before.
        fault: why what was typed could not be taken.
        taken: who else is at the part, in words.
        outside: a text outside the format that is saved if it comes again.
        remark: anything else to say.
        status: of the answer.
    """
    readings, evidence = frame.store.readings(part.id), frame.store.evidence(part.id)
    pictures = picture_pair(part, readings, evidence, frame.evidence, low_margin=frame.low_margin)
    # marks without small letters are typed in capitals by the page; that says nothing of what stands there
    small = any(c.char.islower() for r in readings for place in r.characters for c in place.candidates)
    return frame.page(
        request,
        "blind.html.j2",
        status=status,
        caller=caller,
        part_id=part.id,
        name=part.name,
        since=part.created_at,
        pictures=[_bare(one) for one in pictures],
        upper=not small,
        address=address,
        next_address=f"{address.rsplit('/', 1)[0]}/next?after={part.id}",
        why=why,
        who=person.name,
        signed=bool(person.token),
        text=typed,
        note=note,
        most=most,
        fault=fault,
        taken=taken,
        outside=outside,
        remark=remark,
    )


def _bare(view: PictureView) -> PictureView:
    """Turned upright, but whole and without boxes: where the line was found may be wrong too."""
    return replace(view, boxes=(), source="", line=view.whole, note="" if view.href else view.note)

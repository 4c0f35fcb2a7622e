"""People at the pages: whose name a review bears, who is at which part, reading without seeing what was read."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.common.records import EvidenceKind, PartState
from tests.support.page_shop import Shop, goes_to, reading

SERIAL = "KX407251"


@pytest.fixture
def shop(tmp_path: Path) -> Iterator[Shop]:
    with contextlib.closing(Shop(tmp_path)) as made:
        yield made


@pytest.fixture
def strict(tmp_path: Path) -> Iterator[Shop]:
    """Where two people must agree."""
    with contextlib.closing(Shop(tmp_path, review={"second_reader": True})) as made:
        yield made


def shown_to_nobody_else(page: str) -> None:
    """Nothing of what was read stands in the page."""
    for told in (SERIAL, "KX407257", "confused", "low confidence", "0.99", "data-place", 'class="box'):
        assert told not in page, told


def test_the_second_reader_sees_nothing_of_what_was_read(strict: Shop) -> None:
    photo = strict.keep(EvidenceKind.PHOTO_PICTURE, b"photo")
    part_id = strict.add(
        expected=SERIAL, evidence=(photo,), readings=(reading(SERIAL, source="vision"), reading(SERIAL))
    )
    second, third = strict.another(), strict.another()
    assert SERIAL in strict.client.get(f"/review/{part_id}").text
    assert strict.say(part_id, "KX407257") == 303
    assert (
        "is reviewed when another person has read the same" in strict.client.get(goes_to(strict.answer)).text
    )
    assert strict.store.part(part_id).state is PartState.REVIEW
    assert goes_to(strict.client.get("/review/next")) == "/review"  # Ada has read it
    for client in (second, third):
        client.get("/review")
    queue = second.get("/review").text
    assert SERIAL not in queue
    assert "read by 1 person" in queue
    everything = second.get(f"/parts/{part_id}").text
    assert "Read by 1 person; shown when you have read it" in everything
    assert "KX407257" not in everything
    assert "KX407257" in strict.client.get(f"/parts/{part_id}").text
    page = second.get(f"/review/{part_id}").text
    shown_to_nobody_else(page)
    assert "/pictures/photo" in page
    assert strict.say(part_id, SERIAL, who="Grace", client=second) == 303
    assert strict.store.part(part_id).state is PartState.REVIEW
    shown_to_nobody_else(third.get(f"/review/{part_id}").text)
    assert strict.say(part_id, "", who="Mary", client=third) == 422
    shown_to_nobody_else(strict.answer.text)
    assert strict.say(part_id, "KX407257", who="Mary", client=third) == 303
    part = strict.store.part(part_id)
    assert (part.state, part.text) == (PartState.REVIEWED, "KX407257")
    assert [r.who for r in strict.store.story(part_id).reviews] == ["Ada", "Grace", "Mary"]


def test_an_audit_shows_nothing_of_what_was_accepted_and_says_what_came_of_it(shop: Shop) -> None:
    accepted = reading(SERIAL, decision="accept")
    ids = [
        shop.add(name=f"P-{k}", state=PartState.ACCEPTED, readings=(accepted,), audit=True) for k in range(3)
    ]
    shop.client.get("/review")
    assert "<b>3</b> accepted parts wait for an audit" in shop.client.get("/review").text
    assert goes_to(shop.client.get("/audit")) == f"/review/{ids[0]}"
    shown_to_nobody_else(shop.client.get(f"/review/{ids[0]}").text)
    assert shop.say(ids[0], SERIAL) == 303
    assert goes_to(shop.answer) == f"/review/{ids[1]}?done={ids[0]}"
    assert f"{SERIAL}</span> is what was accepted" in shop.client.get(goes_to(shop.answer)).text
    assert shop.say(ids[1], "KX407257") == 303
    assert shop.say(ids[2], "", action="unreadable") == 303
    assert "not counted" in shop.client.get(goes_to(shop.answer)).text
    assert [shop.store.part(i).state for i in ids] == [
        PartState.ACCEPTED, PartState.REVIEW, PartState.ACCEPTED,
    ]  # fmt: skip
    assert "KX407257</span> in an audit. Which is right?" in shop.client.get(f"/review/{ids[1]}").text
    assert shop.say(ids[1], SERIAL) == 303
    tile = " ".join(shop.client.get("/dashboard").text.split())
    assert "0 of 2 audited; 95 % interval 0.0 – 84.2 %" in tile  # 1 - 0.025 ** (1 / 2)
    late = {"text": SERIAL, "who": "Eve", "mode": "audit"}  # a page that was open when somebody was quicker
    assert shop.client.post(f"/review/{ids[0]}", data=late).status_code == 409

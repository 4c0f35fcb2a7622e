"""The operator's pages as a browser without script sees them: forms, refusals, escapes, and the geometry behind."""

from __future__ import annotations

import contextlib
import html
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.reading_records import CharacterRecord, PassRecord, ReadingRecord
from pipeline.common.records import (
    Agreement,
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ReviewAction,
    Scope,
    ShadowRecord,
    TrendStep,
)
from pipeline.service.pages.dashboard import charts_of
from pipeline.service.pages.pictures import picture_pair
from pipeline.service.pages.places import align_places, cells_of, expected_cells, places_of
from pipeline.service.pages.routes import own_address
from tests.support.page_shop import HEIGHT, WIDTH, Shop, character, goes_to, reading


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    """For tests that look at parts of their own alone."""
    with contextlib.closing(Shop(tmp_path_factory.mktemp("shop"))) as made:
        yield made


@pytest.fixture
def empty_shop(tmp_path: Path) -> Iterator[Shop]:
    with contextlib.closing(Shop(tmp_path)) as made:
        yield made


# ---- places


def test_a_place_is_doubtful_by_its_state_its_margin_or_its_belief() -> None:
    made = ReadingRecord(
        "fused", "ABCDEF", "review", 0.5,
        (
            character("A", 0),
            character("B", 1, state="confused"),
            character("C", 2, probability=0.6),
            CharacterRecord((), (0.0, 0.0, 1.0, 1.0)),
            character("E", 4, probability=0.9),
            character("F", 5, state="mismatch"),
        ),
    )  # fmt: skip
    assert [p.doubt for p in places_of(made)] == ["", "confused", "unsure", "not read", "unsure", "mismatch"]
    assert places_of(made)[3].char == "?"
    assert places_of(None) == ()


def test_of_a_reading_not_accepted_the_least_sure_place_is_marked() -> None:
    text = tuple(character(c, k, probability=p) for k, (c, p) in enumerate((("A", 0.99), ("C", 0.96))))
    unsure = ReadingRecord("fused", "AC", "review", 0.9, text)
    assert [p.doubt for p in places_of(unsure)] == ["", "least sure"]
    assert [p.doubt for p in places_of(replace(unsure, decision="accept"))] == ["", ""]
    # not accepted for something else than its characters
    sure = replace(unsure, characters=tuple(character(c, k, probability=0.995) for k, c in enumerate("AC")))
    assert [p.doubt for p in places_of(sure)] == ["", ""]


@given(st.text("ABC ", max_size=12), st.text("ABC", max_size=12))
def test_cells_spell_the_text_and_name_places_in_order(text: str, read: str) -> None:
    places = places_of(reading(read))
    cells = cells_of(text, places)
    assert "".join(c.char for c in cells) == text
    named = [c.place for c in cells if c.place is not None]
    assert named == sorted(set(named))
    assert all(0 <= n < len(places) for n in named)
    if len(text.replace(" ", "")) == len(read):
        assert len(named) == len(read)


def test_a_character_too_many_leaves_its_neighbours_their_places() -> None:
    assert align_places("KX407", "KX1407") == (0, 1, None, 2, 3, 4)
    assert align_places("KX407", "K407") == (0, 2, 3, 4)


def test_characters_that_the_part_does_not_bear_are_marked_in_the_text_expected() -> None:
    at = datetime.now(UTC)
    part = PartRecord("X", "", PartState.REVIEW, "KX 401", at, at, reading("KX 401"), expected="KX4 07")
    assert [c.doubt for c in expected_cells(part)] == ["", "", "", "", "", "mismatch"]
    assert all(c.doubt == "mismatch" for c in expected_cells(replace(part, text="")) if c.char != " ")


# ---- pictures


def pair(shop: Shop, *readings: ReadingRecord, evidence: tuple[EvidenceRecord, ...]):  # type: ignore[no-untyped-def]
    part_id = shop.add(readings=readings, evidence=evidence)
    return picture_pair(shop.store.story(part_id), shop.evidence)


def test_boxes_lie_where_the_frame_of_the_picture_puts_them(shop: Shop) -> None:
    photo, edges = shop.pictures()
    seen, felt = reading("KX401", source="vision"), reading("KX407")
    first, second = pair(shop, seen, felt, evidence=(photo, edges))
    assert (first.source, second.source) == ("vision", "fused")
    box = second.boxes[1]
    # x: (7 mm - 1 mm) / 0.05 mm from the middle of pixel 0, whose middle is 0.5 from the rim
    assert (box.x, box.y, box.width, box.height) == pytest.approx((120.5, 40.5, 60.0, 100.0))
    assert [b.place for b in first.boxes] == [0, 1, 2, 3, 4]
    x, y, width, height = second.line
    assert all(x <= b.x and b.x + b.width <= x + width for b in second.boxes)
    # cut at the picture's rims, but for room for the characters written above the boxes
    assert (y, y + height) == (40.5 - 0.5 * 100.0, HEIGHT)
    assert first.href.startswith("/v1/parts/")


@pytest.mark.parametrize("seen", ["7100", "ZZ1Z2"])
def test_where_touch_knows_better_the_photograph_is_whole_and_without_the_cameras_boxes(
    shop: Shop, seen: str
) -> None:
    photo, edges = shop.pictures()
    by_camera = reading(seen, source="vision")
    first, second = pair(shop, by_camera, reading("KX407"), evidence=(photo, edges))
    assert (first.boxes, first.source) == ((), "")
    assert first.line == first.whole
    assert "read something else" in first.note
    assert len(second.boxes) == 5
    alone, _ = pair(shop, by_camera, evidence=(photo, edges))  # before touch it is all that is known
    assert len(alone.boxes) == len(seen)


@pytest.mark.parametrize(("rotation_deg", "turns"), [(10.0, 0), (92.0, 1), (-178.0, 2), (-90.0, 3)])
def test_a_line_that_does_not_run_to_the_right_is_turned_by_quarters(
    shop: Shop, rotation_deg: float, turns: int
) -> None:
    edges = shop.keep(EvidenceKind.EDGES_PICTURE, b"edges")
    # along the line as it lies on the picture: the first character comes first after turning
    steps = {0: (1, 0), 1: (0, 1), 2: (-1, 0), 3: (0, -1)}[turns]
    middle = (21.0, 7.0)
    boxes = [(middle[0] + k * steps[0] * 2.0, middle[1] + k * steps[1] * 2.0) for k in (-1, 0, 1)]
    places = tuple(
        replace(character(c), box_mm=(x - 0.8, y - 0.8, x + 0.8, y + 0.8))
        for c, (x, y) in zip("ABC", boxes, strict=True)
    )
    _, view = pair(shop, reading("ABC", characters=places, rotation_deg=rotation_deg), evidence=(edges,))
    xs = [b.x for b in view.boxes]
    assert xs == sorted(xs)
    assert len(set(xs)) == 3
    assert len({b.y for b in view.boxes}) == 1
    assert view.turns == turns
    assert sorted(view.whole[2:]) == sorted((WIDTH, HEIGHT))


def test_boxes_that_cannot_be_drawn_are_left_out(shop: Shop) -> None:
    edges = shop.keep(EvidenceKind.EDGES_PICTURE, b"edges")
    odd = ((0.0, 0.0, 0.0, 0.0), (900.0, 4.0, 903.0, 9.0), (3.0, 4.0, 6.0, 9.0))
    places = tuple(replace(character("A"), box_mm=box) for box in odd)
    _, view = pair(shop, reading("AAA", characters=places), evidence=(edges,))
    assert [b.place for b in view.boxes] == [2]
    flawed = replace(edges, meta={"width": 8.0})
    _, scaleless = pair(shop, reading("AAA"), evidence=(flawed,))
    assert scaleless.boxes == ()
    assert "scale is not known" in scaleless.note


# ---- review


def test_another_person_being_quicker_is_told_and_nothing_is_lost(shop: Shop) -> None:
    part_id = shop.add("KX407251")
    shop.store.review(part_id, action=ReviewAction.CORRECT, text="KX407259", person=Person("Grace"))
    assert shop.say(part_id, "KX407257", before="KX407251") == 409
    page = shop.answer.text
    assert "Grace was quicker" in page
    assert "KX407259" in page
    assert 'value="KX407257"' in page  # what was typed
    assert 'name="before" value="KX407259"' in page
    assert len(shop.store.story(part_id).reviews) == 1
    assert shop.say(part_id, "KX407257") == 303
    assert [r.after for r in shop.store.story(part_id).reviews] == ["KX407259", "KX407257"]


def test_what_cannot_be_taken_is_told_on_the_same_page(shop: Shop) -> None:
    part_id = shop.add()
    for text, more, told in (
        ("KX407252", {"who": ""}, "Type your name first"),
        ("", {}, "Type the serial"),
        ("K" * 201, {}, "at most 200"),
        ("KX\x0041", {}, "cannot be printed"),
        ("KX407252", {"action": "burn"}, "Choose what to do"),
    ):
        assert shop.say(part_id, text, **more) == 422
        assert told in shop.answer.text
    assert shop.store.story(part_id).reviews == ()


NASTY = ["<script>alert(1)</script>", "\"'><img src=x onerror=alert(1)>", "{{ 7*7 }}", "A&amp;B", "A" * 40]


@pytest.mark.parametrize("text", NASTY)
def test_texts_are_shown_as_they_are_everywhere(shop: Shop, text: str) -> None:
    part_id = shop.add(text, name=text, expected=text)
    shop.say(part_id, f"{text}!", note=text, who=text[:80], before=text)
    addresses = ("/review", f"/review/{part_id}", "/parts", f"/parts/{part_id}", f"/review?done={part_id}")
    for address in (*addresses, f"/parts?text={part_id}&name=%22%3E%3Cb%3E"):
        page = shop.client.get(address)
        assert page.status_code == 200
        assert "<script>alert" not in page.text
        assert "<img" not in page.text
        assert "style=" not in page.text  # the policy forbids it
    shown = re.sub(r"<[^>]*>", "", shop.client.get(f"/parts/{part_id}").text)
    assert html.unescape(shown).count(text) >= 3  # name, reading, review


def test_what_would_be_accepted_with_another_serial_comes_first_and_the_surest_first(
    empty_shop: Shop,
) -> None:
    states = (PartState.ACCEPTED, PartState.REVIEW)
    shares = {
        empty_shop.add(
            state=PartState.SHADOW,
            readings=(reading("KX407251", confidence=0.1 * k),),
            expected="KX407257",
            shadow=ShadowRecord(Agreement.OTHER, states[k % 2]),
        ): 0.1 * k
        for k in (3, 6, 9, 4, 8, 1)
    }
    accepted = [part_id for part_id in shares if round(10 * shares[part_id]) % 2 == 0]
    for address, ids in (("/shadow", accepted), ("/shadow?show=other", list(shares))):
        page = empty_shop.client.get(address).text
        shown = re.findall(r'<a class="row" href="./parts/([^"]+)"', page)
        assert shown == sorted(ids, key=lambda part_id: -shares[part_id])
        assert 'show=accepted">look at these first</a>' in page


def test_parts_without_reading_or_characters_have_pages(shop: Shop) -> None:
    bare = shop.add(readings=())
    empty = shop.add(readings=(ReadingRecord("fused", "", "reject", 0.0),), expected="KX4")
    for part_id, told in ((bare, "has not been read"), (empty, "No characters were found")):
        assert told in shop.client.get(f"/review/{part_id}").text
        assert shop.client.get(f"/parts/{part_id}").status_code == 200
        assert shop.say(part_id, "KX4") == 303
        assert shop.store.part(part_id).text == "KX4"


def test_unknown_addresses_are_refused_in_words(shop: Shop) -> None:
    for address in (f"/review/{new_part_id()}", f"/parts/{new_part_id()}"):
        answer = shop.client.get(address)
        assert answer.status_code == 404
        assert "Not found" in answer.text
    for address in (
        "/parts?state=lost",
        "/dashboard?span=era",
        "/parts?before=x",
        f"/parts?text={'A' * 300}",
    ):
        assert shop.client.get(address).status_code == 422
    assert goes_to(shop.client.get("/")) == "/review"


# ---- parts and dashboard


def test_the_dashboard_counts_what_was_read_and_said(empty_shop: Shop) -> None:
    assert "–" in empty_shop.client.get("/dashboard?span=hour").text
    accepted = reading("KX1", source="vision", decision="accept", seconds=0.25)
    for _ in range(3):
        empty_shop.add("KX1", state=PartState.ACCEPTED, readings=(accepted,))
    empty_shop.say(empty_shop.add("KX401"), "KX401")
    empty_shop.say(empty_shop.add("KX402"), "KX407", before="KX402")
    for span in ("hour", "day", "week"):
        page = " ".join(empty_shop.client.get(f"/dashboard?span={span}").text.split())
        assert 'data-figure="parts"><h2>Parts read</h2><p class="figure">5</p>' in page
        assert "1 of 2 reviewed; 95 % interval 9.5 – 90.5 %" in page
        assert "9 of 10" in page
        assert '<tr data-source="vision"><td>camera</td><td class="n">0.250</td>' in page
        assert '<tr data-state="accepted">' in page


@given(st.lists(st.integers(0, 5000), min_size=2, max_size=170))
def test_bars_and_lines_stay_within_the_chart(counts: list[int]) -> None:
    start = datetime(2026, 1, 1, tzinfo=UTC)
    trend = [
        TrendStep(start + timedelta(hours=k), n, n // 2, n - n // 2, n // 7) for k, n in enumerate(counts)
    ]
    bars, accepted, trouble = charts_of(trend, each="hour")
    assert bars.bars == counts
    assert bars.top >= max(counts)
    for chart in (bars, accepted, trouble):
        assert chart.top % chart.tick == 0
        assert chart.top // chart.tick <= 5
        assert -(-len(counts) // chart.every) <= 8
    for chart in (accepted, trouble):
        for values in chart.lines.values():
            assert [value is not None for value in values] == [n > 0 for n in counts]
            assert all(0.0 <= value <= chart.top for value in values if value is not None)


# ---- headers, files, tokens


def test_pages_allow_nothing_from_elsewhere(empty_shop: Shop) -> None:
    part_id = empty_shop.add()
    for address in ("/review", f"/review/{part_id}", "/parts", f"/parts/{part_id}", "/dashboard", "/parts/x"):
        answer = empty_shop.client.get(address)
        policy = answer.headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert "http://" not in answer.text.replace("http://www.w3.org", "")
        assert "https://" not in answer.text
        assert not re.search(r"\son[a-z]+=", answer.text)
        assert not re.search(r"<script(?![^>]*\ssrc=)", answer.text)
    cookie = empty_shop.another().get("/review").headers.get("set-cookie", "").lower()
    assert "samesite=strict" in cookie
    assert "httponly" in cookie


def test_static_files_are_kept_by_the_browser_and_lead_nowhere(shop: Shop) -> None:
    page = shop.client.get("/review").text
    for address in re.findall(r'(?:href|src)="(/static/[^"]+)"', page):
        found = shop.client.get(address)
        assert found.status_code == 200
        assert found.headers["cache-control"] == "no-cache"
        tag = {"if-none-match": found.headers["etag"]}
        assert shop.client.get(address, headers=tag).status_code == 304
    for name in ("..%2Fpages.py", "pages.py", "%2Fetc%2Fpasswd", "page.css%00"):
        assert shop.client.get(f"/static/{name}").status_code == 404


def test_with_tokens_a_person_signs_in_and_only_reviewers_review(tmp_path: Path) -> None:
    with contextlib.closing(Shop(tmp_path, tokens="on")) as shop:
        part_id = shop.add()
        turned = shop.client.get(f"/review/{part_id}?done=x")
        assert goes_to(turned) == f"/login?to=%2Freview%2F{part_id}%3Fdone%3Dx"
        data = {"to": f"/review/{part_id}", "secret": "tm_wrong"}
        assert shop.client.post("/login", data=data).status_code == 403
        looker = shop.store.add_token("looker", [Scope.READ])
        answer = shop.client.post("/login", data={**data, "secret": looker})
        assert goes_to(answer) == f"/review/{part_id}"
        assert "httponly" in answer.headers["set-cookie"].lower()
        assert "lets you look, not review" in shop.client.get(f"/review/{part_id}").text
        denied = shop.client.post(f"/review/{part_id}", data={"text": "A", "who": "E"})
        assert denied.status_code == 403
        assert "allows read" in denied.text
        shop.client.post("/logout")
        assert shop.client.get("/review").status_code == 303
        reviewer = shop.store.add_token("reviewer", [Scope.READ, Scope.REVIEW])
        shop.client.post("/login", data={**data, "secret": reviewer})
        assert "Signed as <b>reviewer</b>" in shop.client.get(f"/review/{part_id}").text
        assert shop.say(part_id, "KX407251") == 303
        assert shop.store.story(part_id).reviews[-1].token == "reviewer"


def felt(direction_deg: int, line_mm: tuple[float, ...], stage_s: float, **more: object) -> PassRecord:
    along = (3.0, 38.0) if direction_deg in (0, 180) else (3.0, 10.0)
    made = PassRecord(direction_deg, line_mm, along, 50.0, 1.0, stage_s, "to try it")
    return replace(made, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "to", ["//evil.example", "https://evil.example", "/\\evil", "", "javascript:alert(1)"]
)
def test_signing_in_leads_nowhere_else(to: str) -> None:
    assert own_address(to) == "/review"
    assert own_address("/parts?text=a") == "/parts?text=a"


def test_agreement_with_the_lines_own_reader(empty_shop: Shop) -> None:
    assert "serve --shadow" in empty_shop.client.get("/shadow").text
    kinds = (
        (Agreement.SAME, PartState.ACCEPTED, "KX407251"),
        (Agreement.SAME, PartState.TOUCH_NEEDED, "KX407251"),
        (Agreement.OTHER, PartState.ACCEPTED, "KX4O<251"),
        (Agreement.NOTHING, PartState.TOUCH_NEEDED, "KX400000"),
        (Agreement.ALONE, PartState.ACCEPTED, ""),
    )
    ids = []
    for kind, would_be, expected in kinds:
        given = reading("" if kind is Agreement.NOTHING else "KX407251")
        shadow = ShadowRecord(kind, would_be)
        ids.append(
            empty_shop.add(state=PartState.SHADOW, readings=(given,), expected=expected, shadow=shadow)
        )
    page = empty_shop.client.get("/shadow").text
    figures = dict(re.findall(r'data-figure="([a-z-]+)">.*?<p class="figure">([\d.–]+)', page))
    assert figures == {
        "compared": "4", "agreement": "50.0", "acceptance": "50.0", "accepted-agreement": "50.0",
        "accepted-other": "1",
    }  # fmt: skip
    (day,) = re.findall(r'<tr data-day="([\d-]+)">(.*?)</tr>', page)
    assert day[0] == datetime.now(UTC).date().isoformat()
    assert re.findall(r'class="n">([^<]*)', day[1]) == ["5", "4", "2", "1", "1", "2", "1", "50.0"]
    assert re.findall(r'<a class="row" href="./parts/([^"]+)"', page) == [ids[2]]
    assert '<mark class="mismatch" title="mismatch">O</mark>' in page
    assert "&lt;" in page
    nothing = empty_shop.client.get("/shadow?show=nothing&span=week").text
    assert re.findall(r'<a class="row" href="./parts/([^"]+)"', nothing) == [ids[3]]
    assert "another serial; would be" in empty_shop.client.get(f"/parts/{ids[2]}").text
    # what a person says afterwards says who was right
    assert empty_shop.say(ids[2], "KX4O<251") == 303
    page = empty_shop.client.get("/shadow").text
    assert "the line’s</td>" in page
    assert '<mark class="mismatch" title="mismatch">O</mark>' in page
    for address in ("/shadow?span=era", "/shadow?show=all", "/shadow?before=x"):
        assert empty_shop.client.get(address).status_code == 422

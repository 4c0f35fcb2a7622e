"""The operator's page in a real browser: reviewed by keyboard, nothing asked of other hosts, nothing on the console.

Set MARKS_SCREENSHOTS to a folder to keep pictures of the pages.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from pipeline.common.people_records import Person
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartState, ReviewAction
from tests.support.line_fakes import serving
from tests.support.page_shop import MM, Shop, character, reading
from tests.support.waiting import program, wait_until

CELL, LEFT, TOP, TALL = 80, 60, 80, 100  # pixels of the drawings, where the places of a reading lie
PICTURES = {"photo": EvidenceKind.PHOTO_PICTURE, "edges": EvidenceKind.EDGES_PICTURE}
SETTLED_MS = 350
"""An Enter sooner after a page has come is taken for one meant for the page before."""
NO = ("sandbox", "first-run")
DISABLE = ("gpu", "background-networking", "component-update", "sync")
ARGUMENTS = [*(f"--no-{what}" for what in NO), *(f"--disable-{what}" for what in DISABLE)]


class Service(Shop):
    """The pages at a loopback address."""

    url = ""

    def draw(self, text: str, kind: EvidenceKind, *, around: int = 0) -> EvidenceRecord:
        """A picture of the text with its characters in their boxes, and so many pixels around all."""
        import cv2

        paper, ink = (246, (145, 78, 27)) if kind is EvidenceKind.EDGES_PICTURE else (150, (70, 70, 70))
        pixels = np.full((TOP + TALL + 60, 2 * LEFT + CELL * len(text), 3), paper, np.uint8)
        for k, char in enumerate(text):
            at = (LEFT + CELL * k + 6, TOP + TALL - 10)
            cv2.putText(pixels, char, at, cv2.FONT_HERSHEY_SIMPLEX, 2.8, ink, 8)
        pixels = cv2.copyMakeBorder(pixels, around, around, around, around, cv2.BORDER_REFLECT)
        rows, cols = pixels.shape[:2]
        first_mm = -around * MM
        meta = {"x0_mm": first_mm, "y0_mm": first_mm, "mm_per_pixel": MM, "width": cols, "height": rows}
        return replace(self.keep(kind, cv2.imencode(".png", pixels)[1].tobytes()), meta=meta)

    def put(self, text: str, *, unsure: dict[int, str] | None = None, around: int = 0, **more: Any) -> str:
        """A part to be reviewed, or audited."""
        unsure = {5: "B38E"} if unsure is None else unsure
        places = tuple(character(c, k, rivals=unsure.get(k, "")) for k, c in enumerate(text))
        readings = tuple(reading(text, source=source, characters=places) for source in ("vision", "fused"))
        evidence = tuple(self.draw(text, kind, around=around) for kind in PICTURES.values())
        return self.add(text, readings=readings, evidence=evidence, **more)


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    """A service with pages; any other can stand in its place."""
    with contextlib.closing(Service(tmp_path)) as made, serving(made.app) as made.url:
        yield made


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A browser without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program("chromium"), args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def desk(chromium: Any) -> Any:
    """A page that tests use one after the other; opening one takes longer than most of them."""
    return chromium.new_page()


Sit = Callable[..., Any]


def settled(page: Any) -> None:
    """Wait until the page takes keys."""
    page.wait_for_load_state("load")
    page.wait_for_timeout(SETTLED_MS)


def shown(page: Any) -> str:
    """The serial as it stands in the field."""
    return str(page.input_value("#text"))


def chosen(page: Any) -> list[int]:
    """What is selected in the field."""
    return page.eval_on_selector("#text", "(t) => [t.selectionStart, t.selectionEnd]")  # type: ignore[no-any-return]


@pytest.fixture
def sit_down(chromium: Any, desk: Any, service: Service) -> Iterator[Sit]:
    """Opens a page for a person; in the end nothing may have gone wrong on it, and no other host been asked."""
    pages, wrong, hosts = list[Any](), list[str](), set[str | None]()
    watched = {
        # the browser informs of an autofocus that came after a click
        "console": lambda message: message.type == "info" or wrong.append(message.text),
        "pageerror": lambda error: wrong.append(str(error)),
        "request": lambda request: hosts.add(urlsplit(request.url).hostname),
    }

    def open_page(
        address: str = "", *, who: str = "Ada", width: int = 1280, height: int = 900, own: bool = False
    ) -> Any:
        page = chromium.new_page() if own or pages else desk
        pages.append(page)
        page.set_viewport_size({"width": width, "height": height})
        if who:
            page.context.add_cookies([{"name": "tactile_marks_who", "value": who, "url": service.url}])
        page.wrong = wrong
        for event, note in watched.items():
            page.on(event, note)
        if address:
            page.goto(service.url + address)
        return page

    yield open_page
    for page in pages:
        if page is not desk:
            page.close()
    desk.goto("about:blank")
    for event, note in watched.items():
        desk.remove_listener(event, note)
    desk.unroute_all()
    desk.context.clear_cookies()
    assert wrong == []
    assert hosts <= {"127.0.0.1"}


def test_a_queue_is_worked_off_by_keyboard(service: Service, sit_down: Sit) -> None:
    ids = [service.put(text, name=f"P-{k}") for k, text in enumerate(("KX407251", "KX407252", "KX407253"))]
    page = sit_down("/")
    settled(page)
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/review/{ids[0]}")
    settled(page)
    assert chosen(page) == [5, 6]  # the first place in doubt
    page.keyboard.press("Enter")  # right as it is
    page.wait_for_url(f"**/review/{ids[1]}?done={ids[0]}")
    assert "confirmed for P-0" in page.inner_text(".flash")
    settled(page)
    page.keyboard.press("8")  # typing replaces and goes on
    assert shown(page) == "KX407852"
    assert chosen(page) == [6, 7]
    assert "Save correction" in page.inner_text(".button.main")
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/review/{ids[2]}?done={ids[1]}")
    settled(page)
    page.keyboard.press("Alt+u")
    page.wait_for_url(f"**/review?done={ids[2]}")
    assert "Nothing waits for you" in page.inner_text("main")
    reviews = [service.store.story(i).reviews[-1] for i in ids]
    assert [(r.action, r.before, r.after, r.who) for r in reviews] == [
        (ReviewAction.CONFIRM, "KX407251", "KX407251", "Ada"),
        (ReviewAction.CORRECT, "KX407252", "KX407852", "Ada"),
        (ReviewAction.UNREADABLE, "KX407253", "", "Ada"),
    ]
    assert service.store.part(ids[1]).state is PartState.REVIEWED


def test_places_are_chosen_and_candidates_taken_by_key(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251")
    page = sit_down(f"/review/{part_id}")
    page.keyboard.press("Alt+3")  # 2, B, 3, 8, E
    assert shown(page) == "KX407351"
    page.keyboard.press("ArrowUp")
    assert shown(page) == "KX407B51"
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowDown")
    assert shown(page) == "KX407B51"
    for key, at in (("ArrowLeft", [4, 5]), ("Home", [0, 1]), ("End", [8, 8]), ("ArrowRight", [8, 8])):
        page.keyboard.press(key)
        assert chosen(page) == at
    page.keyboard.type("9a")  # beyond the end it grows; marks without small letters get none
    assert shown(page) == "KX407B519A"
    page.keyboard.press("Backspace")
    page.keyboard.press("Home")
    page.keyboard.press("Delete")
    assert shown(page) == "X407B519"
    page.keyboard.press("Insert")
    page.keyboard.type("K")
    assert shown(page) == "KX407B519"
    # the places are still who they were: the chosen place's card goes with its character
    page.keyboard.press("Insert")
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    assert page.get_attribute(".place.chosen", "data-place") == "5"
    page.keyboard.press("Escape")
    assert shown(page) == "KX407251"
    assert service.store.story(part_id).reviews == ()


def test_what_is_pasted_is_the_whole_serial(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251")
    page = sit_down(f"/review/{part_id}")
    paste = """(text) => {const data = new DataTransfer(); data.setData('text', text);
        const event = new ClipboardEvent('paste', {clipboardData: data, bubbles: true, cancelable: true});
        const input = document.getElementById('text');
        if (input.dispatchEvent(event)) document.execCommand('insertText', false, text)}"""
    page.evaluate(paste, " kx407299\n")
    assert shown(page) == "KX407299"
    page.keyboard.press("Home")
    page.evaluate(paste, "AB12")  # shorter, and at another place: still the whole
    assert shown(page) == "AB12"
    page.keyboard.press("Shift+Home")
    page.evaluate(paste, "CD1234")
    assert shown(page) == "CD1234"
    page.keyboard.press("Insert")
    page.keyboard.press("End")
    page.evaluate(paste, "56")  # inserting was asked for
    assert shown(page) == "CD123456"


def test_a_place_is_lit_on_both_pictures_and_chosen_by_pointing(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251")
    page = sit_down(f"/review/{part_id}")
    assert page.locator(".box.chosen[data-place='5']").count() == 2
    page.locator("[data-which=edges] .box[data-place='2'] .edge").hover()
    assert page.locator(".box.hover[data-place='2']").count() == 2
    page.locator("[data-which=photo] .box[data-place='2'] .edge").click()
    assert chosen(page) == [2, 3]
    page.locator(".place[data-place='5'] .candidate").nth(1).click()
    assert shown(page) == "KX407B51"
    assert chosen(page) == [5, 6]
    # the boxes lie on the ink: the middle of each is over its drawn character
    drawn = page.evaluate(
        "[...document.querySelectorAll('[data-which=edges] .edge')].map((r) => [r.getBBox().x, r.getBBox().y])"
    )
    assert drawn == pytest.approx(
        np.array([[LEFT + CELL * k + 0.5, TOP + 0.5] for k in range(8)]), abs=0.01
    )  # hundredths of a pixel are written


def test_the_line_fills_the_picture_until_the_whole_is_asked_for(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251", around=300)
    page = sit_down(f"/review/{part_id}")
    box = page.locator("[data-which=photo] .box[data-place='2'] .edge")
    near = box.bounding_box()["width"]
    assert near > 40  # of the 1280 of the window, for each of eight characters and both pictures
    page.keyboard.press("Alt+z")
    assert box.bounding_box()["width"] < 0.7 * near
    page.keyboard.press("Alt+z")
    assert box.bounding_box()["width"] == near


def test_a_picture_that_does_not_come_is_told_in_words(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251")
    page = sit_down("")
    page.route("**/pictures/photo*", lambda route: route.abort())
    page.goto(f"{service.url}/review/{part_id}")
    page.wait_for_selector("[data-which=photo] .failed")
    assert "could not be loaded" in page.inner_text("[data-which=photo]")
    assert page.locator("[data-which=edges] svg").count() == 1
    assert all("Failed to load resource" in w for w in page.wrong)
    page.wrong.clear()


def test_an_enter_held_down_confirms_one_part_only(service: Service, sit_down: Sit) -> None:
    ids = [service.put("KX407251"), service.put("KX407252")]
    page = sit_down(f"/review/{ids[0]}")
    settled(page)
    page.keyboard.down("Enter")
    page.wait_for_url(f"**/review/{ids[1]}?*")
    settled(page)
    for _ in range(5):
        page.keyboard.down("Enter")  # as a key held down repeats
    page.keyboard.up("Enter")
    page.wait_for_timeout(200)
    assert service.store.part(ids[1]).state is PartState.REVIEW
    page.keyboard.press("Enter")
    page.wait_for_url("**/review?done=*")
    assert [len(service.store.story(i).reviews) for i in ids] == [1, 1]


def test_a_name_is_asked_for_once_and_skipped_parts_stay(service: Service, sit_down: Sit) -> None:
    ids = [service.put("KX407251"), service.put("KX407252")]
    page = sit_down(f"/review/{ids[0]}", who="")
    settled(page)
    assert page.evaluate("document.activeElement.id") == "who"
    page.keyboard.press("Enter")
    assert service.store.story(ids[0]).reviews == ()
    page.keyboard.type("Grace")
    page.keyboard.press("Enter")  # on to the serial
    assert page.evaluate("document.activeElement.id") == "text"
    page.keyboard.press("Enter")
    page.wait_for_url(f"**/review/{ids[1]}?*")
    assert page.input_value("#who") == "Grace"
    settled(page)
    service.put("KX407253")
    page.keyboard.press("Alt+n")
    page.wait_for_url(lambda url: ids[1] not in url)
    assert service.store.part(ids[1]).state is PartState.REVIEW


def test_an_open_part_is_its_readers_until_the_page_is_left(service: Service, sit_down: Sit) -> None:
    first, second = service.put("KX407251", name="P-1"), service.put("KX407252", name="P-2")
    ada, grace = sit_down("/review"), sit_down("/review", who="Grace")
    settled(ada)
    ada.keyboard.press("Enter")
    ada.wait_for_url(f"**/review/{first}")
    settled(ada)
    grace.reload()
    assert "Ada is at it" in grace.inner_text("main")
    settled(grace)
    grace.keyboard.press("Enter")  # the oldest that is free
    grace.wait_for_url(f"**/review/{second}")
    grace.goto(f"{service.url}/review/{first}")
    assert "Ada is at this part now" in grace.inner_text("#taken")
    ada.goto(f"{service.url}/dashboard")
    wait_until(lambda: first not in service.store.claims())
    grace.reload()
    settled(grace)
    assert not grace.is_visible("#taken")
    assert service.store.claims()[first].who == "Grace"


def test_the_queue_keeps_itself_fresh(service: Service, sit_down: Sit) -> None:
    page = sit_down("", own=True)  # its clock cannot be put back
    page.clock.install()
    page.goto(f"{service.url}/review")
    assert "Nothing waits" in page.inner_text("main")
    service.put("KX407251", name="late")
    page.clock.fast_forward(60_000)
    page.wait_for_selector("text=late", timeout=15_000)
    assert page.inner_text("#waiting") == "1"


LAID_OUT = """() => {
    const seen = (selector) => [...document.querySelectorAll(selector)].filter((e) => e.checkVisibility());
    const box = (element) => element.getBoundingClientRect();
    const inside = (button) => box(button).left >= 0 && box(button).right <= innerWidth;
    const shifted = (table) => [...table.tBodies[0].rows].filter((row) => !row.matches('.more')).flatMap((row) =>
        [...row.cells].filter((cell, k) => Math.round(box(cell).x - box(table.tHead.rows[0].cells[k]).x)));
    const which = (side) => `[data-which=${side}] svg`;
    return {
        wider: document.documentElement.scrollWidth > innerWidth,
        cut: seen('.button').filter((button) => !inside(button)).map((button) => button.innerText),
        shifted: seen('table').flatMap(shifted).map((cell) => cell.innerText),
        below: ['#text', '.button.main', which('photo'), which('edges')].filter((needed) =>
            !seen(needed).length || box(seen(needed)[0]).bottom > innerHeight),
        narrow: ['photo', 'edges'].map(which).filter((picture) =>
            !seen(picture).length || box(seen(picture)[0]).width <= 0.45 * innerWidth),
    }
}"""


def test_pages_fit_their_window(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251", name="a-rather-long-name-as-lines-send-them-0001")
    long_id = service.put("A1B2C3D4E5F6G7H8J9K0L1M2N3P4Q5R6S7T8U9V0", name="forty")
    odd_id = service.put("<b>\"x'&", name="<script>alert(1)</script>", unsure={2: "})|"})
    service.store.review(
        odd_id, action=ReviewAction.CORRECT, text="<i>\"x'&", person=Person("<Ada>"), note="'\"&"
    )
    page = sit_down("")
    pages = {
        "queue": "/review", "part": f"/review/{part_id}", "long": f"/review/{long_id}",
        "odd": f"/review/{odd_id}", "parts": "/parts", "history": f"/parts/{odd_id}", "dashboard": "/dashboard",
        "jobs": "/jobs", "teach": f"/jobs/new?part={part_id}",
    }  # fmt: skip
    windows = ((1280, 900, "light"), (800, 1100, "dark"), (390, 844, "light"))
    for (name, address), (width, height, scheme) in itertools.product(pages.items(), windows):
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(color_scheme=scheme)
        if width == windows[0][0]:  # the others are the same page, made smaller
            page.goto(service.url + address)
            page.wait_for_load_state("load")
        if folder := os.environ.get("MARKS_SCREENSHOTS"):
            page.screenshot(path=f"{folder}/{name}-{width}-{scheme}.png")
        laid_out = page.evaluate(LAID_OUT)
        decided = name == "part" and width > 500  # all that is needed to decide is in sight
        for fault in ("wider", "cut", "shifted", *(("below", "narrow") if decided else ())):
            assert not laid_out[fault], (name, width, fault, laid_out[fault])


def wait_for_value(page: Any, field: str, value: str) -> None:
    """Until a field holds this; looked at from outside, for the page lets no text be run as a program."""
    from playwright.sync_api import expect

    expect(page.locator(field)).to_have_value(value, timeout=30_000)


def test_the_interface_is_shown_without_internet(service: Service, sit_down: Sit) -> None:
    page = sit_down("/docs")
    page.wait_for_selector("#operations-parts-read_part_v1_parts_post", timeout=60_000)
    assert page.locator(".opblock").count() >= 20


def test_a_job_is_taught_by_a_box_and_a_text(service: Service, sit_down: Sit) -> None:
    part_id = service.put("KX407251", name="tray-7/housing-left-0012", around=200)
    page = sit_down(f"/parts/{part_id}")
    page.click("text=Teach a job")
    page.wait_for_load_state("load")
    assert page.input_value("[name=name]") == "housing-left"
    assert (page.input_value("#text"), page.input_value("#format")) == ("KX407251", "AA999999")
    # the box that is drawn, in the middle half of the picture, and the four numbers say the same
    at = page.locator("#drawn-on").bounding_box()
    ends = [(at["x"] + s * at["width"], at["y"] + s * at["height"]) for s in (0.25, 0.75)]
    page.mouse.move(*ends[1])
    page.mouse.down()
    page.mouse.move(*ends[0], steps=3)
    page.mouse.up()
    sides = ("left", "top", "right", "bottom")
    drawn = [float(page.input_value(f"#{side}")) for side in sides]
    assert np.allclose(drawn, [25.0, 25.0, 75.0, 75.0], atol=0.6)  # a pixel of the screen
    # the format follows the text until somebody types one
    page.fill("#text", "KX-4")
    wait_for_value(page, "#format", "AA-9")
    page.fill("#format", "**-9")
    page.fill("#text", "KX-45")
    page.click("text=Save the job")
    assert "is not of the format **-9" in page.inner_text(".flash")
    page.wrong.clear()  # the browser notes the answer's status, 422
    page.fill("#format", "")
    page.click("text=Save the job")
    page.wait_for_url("**/jobs?done=housing-left*")
    settings = service.jobs.settings("housing-left")
    assert settings.format == ("AA-99",)
    assert np.allclose(settings.region, [0.25, 0.25, 0.75, 0.75], atol=0.006)


def test_on_a_phone_the_charts_begin_at_the_newest_hour(service: Service, sit_down: Sit) -> None:
    service.put("KX407251")
    page = sit_down("/dashboard", width=390, height=800)
    left, right, axis = page.evaluate(
        "['.plot', '.axis text'].map((s) => document.querySelector(s).getBoundingClientRect())"
        ".flatMap((box, k) => k ? [box.left] : [box.left, box.right])"
    )
    assert left < 0.0
    assert 300.0 < right <= 390.0
    assert axis >= 0.0  # the numbers at the axis stay in sight

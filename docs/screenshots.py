"""Draw the screenshots of the service with the program as it stands: `python docs/screenshots.py`, some minutes.

It needs playwright and chromium. Parts are stamped and soiled, read by a service of its own, and felt by its stage; the
reader that shadow mode is compared with is wrong about every eighth part.
"""

import csv
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import sync_playwright

from pipeline.cli.main import main
from pipeline.common.records import PartState
from pipeline.service.client import Client
from pipeline.service.process import service_process

FIGURES = Path(__file__).parent / "pages" / "figures"
WIDTH = 1280
FORMAT = "AA999999"


def make_parts(folder: Path, options: str) -> dict[str, str]:
    """Stamp parts and photograph them; texts by name."""
    if status := main(["synth", str(folder), "--format", FORMAT, *options.split()]):
        raise SystemExit(status)
    with (folder / "truth.csv").open(encoding="utf-8", newline="") as table:
        return {row["part"]: row["text"] for row in csv.DictReader(table)}


def live_pages(folder: Path) -> Iterator[tuple[str, str, int]]:
    """Pages of a service that decides: picture, address, height."""
    dirty = make_parts(folder / "dirty", "--parts 2 --dirt 0.9 --seed 3")
    two = make_parts(folder / "two", "--parts 1 --layout two-lines --seed 4")
    stage = ("--stage.device", str(folder / "dirty"), "--format", FORMAT)
    with service_process(folder / "live", *stage) as service, Client(service.url, timeout_s=900.0) as client:
        for name in dirty:
            part = client.read(photo=folder / "dirty" / f"{name}.png", name=name)
            if part.state is PartState.TOUCH_NEEDED:
                part = client.touch(part.id)
            if part.state is PartState.REVIEW:
                yield "review.jpg", f"{service.url}/review/{part.id}", 790
                break
        for name in two:
            part = client.read(photo=folder / "two" / f"{name}.png", name="housing-left-0012")
            yield "teach.jpg", f"{service.url}/jobs/new?part={part.id}", 660


def shadow_page(folder: Path) -> Iterator[tuple[str, str, int]]:
    """The page of a service in shadow mode."""
    parts = make_parts(folder / "parts", "--parts 24 --dirt 0.15 --seed 5")
    with (
        service_process(folder / "shadow", "--shadow", "--format", FORMAT) as service,
        Client(service.url, timeout_s=900.0) as client,
    ):
        for k, (name, text) in enumerate(parts.items()):
            said = text if k % 8 else text[:-1] + str((int(text[-1]) + 1) % 10)
            client.read(photo=folder / "parts" / f"{name}.png", name=name, expected=said)
        yield "shadow.jpg", f"{service.url}/shadow?span=week", 860


def draw(folder: Path) -> None:
    """Draw every page."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        for pages in (live_pages(folder), shadow_page(folder)):
            for name, address, height in pages:
                page = browser.new_page(viewport={"width": WIDTH, "height": height})
                page.goto(address)
                page.wait_for_load_state("networkidle")
                page.screenshot(path=FIGURES / name, type="jpeg", quality=88)
                print(f"drew {FIGURES / name}", flush=True)
        browser.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        draw(Path(temporary))

"""The service at work: dirty parts pass the camera; where it is unsure, the whiskers scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from glyphs.soiling.soiled import Soiling
from pipeline.common.records import PartRecord, PartState
from pipeline.common.texts import same_text
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.service.client import Client
from pipeline.service.process import service_process

FORMAT = "AA999999"
SEVERITIES = (0.0, 0.2, 0.5, 0.7, 0.9, 1.0)
"""How dirty the parts are, one after the other."""
_SEED = 11


@dataclass(frozen=True)
class ServedPart:
    """One part of the demonstration.

    Attributes:
        name: of its files.
        truth: as stamped.
        dirt: severity.
        by_camera: the answer to its photograph.
        by_touch: the answer to its scan; None where the camera was sure.
    """

    name: str
    truth: str
    dirt: float
    by_camera: PartRecord
    by_touch: PartRecord | None = None

    @property
    def last(self) -> PartRecord:
        """The part as it stands."""
        return self.by_touch if self.by_touch is not None else self.by_camera

    @property
    def accepted_wrong(self) -> bool:
        """Whether the service accepted what is not there."""
        return self.last.state is PartState.ACCEPTED and not same_text(self.last.text, self.truth)


def run_service_demo(
    folder: Path,
    *,
    on_part: Callable[[ServedPart], None],
    say: Callable[[str], None],
    stay: Callable[[], None] | None = None,
) -> list[ServedPart]:
    """Make dirty parts, photograph them, start a service and take them through it.

    Args:
        folder: for the parts and the service.
        on_part: called with each when its reading stands.
        say: called with what happens, in lines for a person.
        stay: called while the service still runs, for a look at its page.

    Raises:
        NotServingError: the service does not come up.
        FileError: the folder cannot be written.
        ServiceError: the service refuses a part.
    """
    parts = folder / "parts"
    parts.mkdir(parents=True, exist_ok=True)
    say(f"making {len(SEVERITIES)} parts, from clean to filthy, and their photographs in {parts} ...")
    truths = {}
    for number, severity in enumerate(SEVERITIES):
        spec = SynthSpec(format=FORMAT, seed=_SEED, soiling=Soiling(severity=severity))
        truths[f"part-{number}"] = write_part(spec, parts / f"part-{number}", number, photos=True)
    say("starting the service (the first start on a machine takes longer: it compiles) ...")
    served = []
    folders = ("--stage", str(parts), "--camera", str(parts))
    reading = ("--format", FORMAT, "--font", "gothic", "--height-mm", "5", "--orientation", "upright")
    with service_process(folder / "service", *folders, *reading) as service, Client(service.url) as client:
        say(f"it answers at {service.url}")
        for (name, truth), severity in zip(truths.items(), SEVERITIES, strict=True):
            by_camera = client.read(photo=parts / f"{name}.png", name=name)
            needed = by_camera.state is PartState.TOUCH_NEEDED
            by_touch = client.touch(by_camera.id) if needed else None
            served.append(ServedPart(name, truth, severity, by_camera, by_touch))
            on_part(served[-1])
        if stay is not None:
            say(f"the operator's page is at {service.url}/review; Ctrl-C ends the service")
            stay()
    return served

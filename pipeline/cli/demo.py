"""`tactile-marks demo`: make, scan and read a few parts."""

from __future__ import annotations

import contextlib
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.cli.exit_status import FAILED, UsageError
from pipeline.cli.shared import Flag, SensorsName, Speed
from pipeline.common.settings import ReadSettings

if TYPE_CHECKING:
    from pipeline.common.records import PartRecord

PLATES: dict[str, dict[str, Any]] = {
    "flat-gothic": {"text": "KX407251", "fonts": "gothic", "face": "flat"},
    "sharp-turned": {"text": "8B3S0D26", "fonts": "gothic", "face": "sharp", "line_rotation_deg": 2.0},
    "round-roman": {"text": "TA19R645", "fonts": "timesr", "face": "round", "height_mm": 7.0},
    "raised": {"text": "HM52G793", "fonts": "futural", "face": "flat", "raised": True},
}
SEVERITIES = (0.0, 0.2, 0.5, 0.7, 0.9, 1.0)  # of the dirt on each part that the service reads
FORMAT = "AA999999"
_SEED, _SERVED_SEED = 2024, 11


def demo(
    out: Path = Path("demo-out"),
    *,
    sensors: SensorsName = "real",
    whisker: Path | None = None,
    speed_mm_s: Speed = None,
    service: Flag = False,
    stay: Flag = False,
) -> int:
    """Stamp a few plates, scan them with simulated whiskers, read them, and draw the results.

    The exit status is 1 if a serial was not read correctly.

    Args:
        out: Folder for plates, recordings and overview.png.
        sensors: Sensors and stage: real, or ideal.
        whisker: Whisker file to scan with (default: a whisker for the character height).
        speed_mm_s: Speed of the stage, mm/s (default: the whisker file's, or 10 heights a second up to 50 mm/s).
        service: Show the service instead: its camera photographs dirty parts, and its stage scans those that the camera
            is unsure of. The exit status is then 1 if it accepted a wrong serial.
        stay: With --service: keep it running until Ctrl-C, so that you can see the operator's page.
    """
    if stay and not service:
        raise UsageError("demo: --stay goes with --service")
    from pipeline.common.output_paths import make_folder

    make_folder(out)
    settings = ReadSettings(sensors=sensors, whisker=whisker, speed_mm_s=speed_mm_s)
    return _serve(out, settings, stay=stay) if service else _read(out, settings)


def _read(out: Path, settings: ReadSettings) -> int:
    """The reader knows neither font nor height, only which characters of a serial are letters."""
    from glyphs.part import stamp
    from pipeline.formats.npz import write_npz
    from pipeline.plots.pictures import SheetPart, overview_figure, save_figure
    from pipeline.reading.readers import virtual_array
    from recognition.language.orientation import Orientation
    from recognition.reader import Reader
    from recognition.see.levelling import level
    from recognition.see.virtual_bench import VirtualBench
    from whisker_array.scan.lead_in import calibrate_scan
    from whisker_array.scan.recording import load_scan, save_calibration, save_scan

    print("Stamping plates, scanning them with simulated whiskers, and reading them. The")
    print("reader knows where letters and digits stand, but neither font nor size. The")
    print("first run on a machine takes longer: it compiles.\n")
    print(f"{'part':<13} {'stamped':<9} {'read':<9} {'':<6} {'decision':<9} confidence  font", flush=True)
    parts = []
    for number, (name, stamping) in enumerate(PLATES.items()):
        plate = stamp(**stamping, seed=(_SEED, number))
        write_npz(out / f"{name}.npz", plate.height_map)
        array = replace(virtual_array(settings), seed=_SEED + number)
        scan = VirtualBench(plate.height_map, plate.height_mm, array, part_id=name).mounted().scan()
        recording = out / f"{name}.h5"
        save_scan(scan, recording)
        save_calibration(recording, calibrate_scan(scan).calibration)
        format = "".join("A" if char.isalpha() else "9" for char in stamping["text"])
        reading = Reader(format=format, orientation=Orientation.UPRIGHT).read(load_scan(recording))
        part = SheetPart(name, stamping["text"], reading, level(plate.height_map))
        parts.append(part)
        print(
            f"{name:<13} {part.truth:<9} {reading.text or 'nothing':<9} {'right' if part.right else 'WRONG':<6} "
            f"{reading.decision:<9} {reading.confidence:10.3f}  {reading.font}",
            flush=True,
        )
    overview = out / "overview.png"
    save_figure(overview_figure(parts), overview)
    print(f"\npicture: {overview.resolve()}")
    print(f"in full: tactile-marks inspect {out / next(iter(PLATES))}.h5")
    return 0 if all(part.right for part in parts) else FAILED


def _serve(out: Path, settings: ReadSettings, *, stay: bool) -> int:
    import uvicorn  # noqa: F401 - a missing extra is reported before parts are made

    from glyphs.soiling.soiled import Soiling
    from pipeline.common.output_paths import write_text
    from pipeline.common.parsed import toml_text
    from pipeline.common.records import PartState
    from pipeline.common.texts import same_text
    from pipeline.formats.synth import SynthSpec, write_part
    from pipeline.service.client import Client
    from pipeline.service.process import service_process

    folder = out / "parts"
    folder.mkdir(exist_ok=True)
    print(f"making {len(SEVERITIES)} parts, from clean to filthy, and their photographs in {folder} ...")
    truths = [
        write_part(
            SynthSpec(FORMAT, seed=_SERVED_SEED, soiling=Soiling(severity=severity)),
            folder / f"part-{number}",
            number,
            photos=True,
        )
        for number, severity in enumerate(SEVERITIES)
    ]
    print("starting the service (the first start on a machine takes longer: it compiles) ...", flush=True)
    reading: dict[str, Any] = {
        "format": FORMAT, "font": "gothic", "height_mm": 5.0, "orientation": "upright", "sensors": settings.sensors,
    }  # fmt: skip
    if settings.whisker is not None:
        reading["whisker"] = str(settings.whisker.absolute())
    if settings.speed_mm_s is not None:
        reading["speed_mm_s"] = settings.speed_mm_s
    config = out / "service.toml"
    write_text(config, toml_text(reading))
    options = ("--config", str(config), "--stage.device", str(folder), "--camera.device", str(folder))
    ended: list[tuple[PartRecord, str]] = []
    with service_process(out / "service", *options) as service, Client(service.url) as client:
        print(f"the service answers at {service.url}", flush=True)
        for number, (severity, truth) in enumerate(zip(SEVERITIES, truths, strict=True)):
            name = f"part-{number}"
            print(f"{name}  stamped {truth}, dirt {severity:.1f}")
            part = client.read(photo=folder / f"{name}.png", name=name)
            _print_reading("camera", part)
            if part.state is PartState.TOUCH_NEEDED:
                plan, part = part.plan, client.touch(part.id)
                felt = part.reading
                if plan is not None and felt is not None and felt.stage_s is not None:
                    print(
                        f"    stage   feels {len(felt.passes)} passes in {felt.stage_s:.0f} s of stage time "
                        f"({felt.stopped}); the whole plan takes {plan.passes} in {plan.seconds:.0f} s"
                    )
                _print_reading("touch", part)
            ended.append((part, truth))
        if stay:
            print(f"the operator's page is at {service.url}/review; Ctrl-C ends the service", flush=True)
            with contextlib.suppress(KeyboardInterrupt):
                threading.Event().wait()
    accepted = [(part, truth) for part, truth in ended if part.state is PartState.ACCEPTED]
    review = sum(part.state is PartState.REVIEW for part, _ in ended)
    print(f"{len(ended)} parts: {len(accepted)} accepted, {review} for a person to review")
    return 0 if all(same_text(part.text, truth) for part, truth in accepted) else FAILED


def _print_reading(sense: str, part: PartRecord) -> None:
    if (reading := part.reading) is not None:
        print(
            f"    {sense:<7} {reading.text or 'nothing':<9} confidence {reading.confidence:.3f} in "
            f"{reading.seconds:.1f} s: {part.state.value.replace('_', ' ')}",
            flush=True,
        )

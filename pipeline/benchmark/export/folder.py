"""Export an exam as a folder of files, for readers outside this program. A part's label is written last and holds the
hashes of its files, so that an interrupted export continues."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from glyphs.atomic import replacing
from glyphs.errors import FileError, MarksError
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.export.exported_part import FOLDERS, export_part, label_path
from pipeline.benchmark.export.labels_and_card import CARD, card_of, label_files, page_of
from pipeline.common.output_paths import make_folder, write_json, write_text
from pipeline.common.version import differences, file_sha256
from pipeline.runs.progress import Progress
from pipeline.workers.executors import Executor

MANIFEST, PAGE = "manifest.json", "README.md"
FORMAT_VERSION = 1


class ExportError(MarksError):
    """Some parts could not be made, or a folder does not match its manifest."""


def export(
    parts: DesignedParts,
    folder: Path,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> int:
    """Write the exam, and return the number of parts in the folder; complete parts already there stay. Raises
    ExportError: some parts could not be made. FileError: the folder holds something else, or cannot be written."""
    items = parts.items()
    _prepare(parts, folder)
    labels = {item.part: label for item in items if (label := _whole(folder, item)) is not None}
    if progress:
        progress.start(len(items), len(labels))
    missing = [item for item in items if item.part not in labels]
    failed: list[str] = []
    for outcome in (executor or Executor()).calls(export_part, parts, missing):
        item = outcome.task
        if outcome.result is None:
            failed.append(f"{item.part}: {outcome.error}")
            continue
        labels[item.part], files = outcome.result
        for path in sorted(files, key=label_path(item.part).__eq__):  # the label last
            with replacing(folder / path) as temporary:
                temporary.write_bytes(files[path])
        if progress:
            progress.advance()
    if failed:
        raise ExportError(f"{len(failed)} parts could not be made, the first is {failed[0]}")
    _finish(parts, folder, [labels[item.part] for item in items])
    return len(items)


def check(parts: DesignedParts, folder: Path) -> dict[str, str]:
    """Files missing, changed, or not in the manifest. Raises FileError: it is missing, or of another design."""
    card = _json_of(folder / CARD)
    if card is None or card.get("design") != _design_of(parts):
        raise FileError(folder, "holds no export of this design", "name its folder, or its design")
    manifest = _json_of(folder / MANIFEST)
    if manifest is None or not isinstance(manifest.get("files"), dict):
        raise FileError(folder / MANIFEST, "is missing or damaged", "run the export again")
    there = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {MANIFEST}
    wanted: dict[str, str] = manifest["files"]
    differing = dict.fromkeys(there - wanted.keys(), "not in the manifest")
    for path, hashed in wanted.items():
        if path not in there:
            differing[path] = "missing"
        elif file_sha256(folder / path) != hashed:
            differing[path] = "changed"
    return dict(sorted(differing.items()))


def _design_of(parts: DesignedParts) -> dict[str, Any]:
    design: dict[str, Any] = json.loads(json.dumps(parts.description()))
    return design


def _prepare(parts: DesignedParts, folder: Path) -> None:
    make_folder(folder)
    held, new = _json_of(folder / CARD), card_of(parts, [], design=_design_of(parts))
    if held is not None:
        was, now = ({**(c.get("design") or {}), "program": c.get("program")} for c in (held, new))
        if was != now:
            what = f"holds another export ({differences(was, now)})"
            raise FileError(folder, what, "name another folder")
    elif any(folder.iterdir()):
        raise FileError(folder, "is not empty and holds no export", "name another folder")
    for name in FOLDERS:
        make_folder(folder / name)
    if held is None:
        write_json(folder / CARD, new)


def _whole(folder: Path, item: Item) -> dict[str, Any] | None:
    label = _json_of(folder / label_path(item.part))
    if label is None or not isinstance(label.get("files"), dict):
        return None
    try:
        same = all(file_sha256(folder / path) == hashed for path, hashed in label["files"].items())
    except OSError:
        return None
    return label if same else None


def _finish(parts: DesignedParts, folder: Path, labels: Sequence[dict[str, Any]]) -> None:
    card = card_of(parts, labels, design=_design_of(parts))
    texts = {**label_files(labels), PAGE: page_of(card)}
    write_json(folder / CARD, card)
    for name, text in texts.items():
        write_text(folder / name, text)
    written = [CARD, *texts, *(label_path(label["part"]) for label in labels)]
    hashes = {path: file_sha256(folder / path) for path in written}
    for label in labels:
        hashes |= label["files"]
    write_json(folder / MANIFEST, {"format_version": FORMAT_VERSION, "files": dict(sorted(hashes.items()))})


def _json_of(path: Path) -> dict[str, Any] | None:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return value if isinstance(value, dict) else None

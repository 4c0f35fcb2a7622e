"""`tactile-marks store`: backup, restore and check of the service's store and its files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import FAILED
from pipeline.cli.settings import SERVICE, Config, ServiceOfFile, StoreAddress
from pipeline.cli.tokens import opened_store

if TYPE_CHECKING:
    from pipeline.service.settings import ServiceSettings
    from pipeline.store.check import CheckReport
    from pipeline.store.evidence_folder import EvidenceFolder

_MOST_SHOWN = 20
Folder = Annotated[
    Path | None, Parameter(help="Folder of the service; the one of its settings unless given.")
]


def backup(
    to: Path,
    *,
    previous: Path | None = None,
    folder: Folder = None,
    store: StoreAddress = None,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> int:
    """Copy the store and its files, while the service runs.

    The folder of the backup appears when all is in it. Exit status: 1 where a file of the service's was missing or
    damaged; the backup is made all the same, and says so.

    Parameters
    ----------
    to
        New folder for the backup.
    previous
        Backup on the same disk: files that it has are linked to it, and take no room twice.
    """
    service = _of_folder(service, folder)
    with opened_store(store or service.store_url, "store backup", as_it_is=True) as opened:
        from pipeline.store.backup import back_up

        made = back_up(opened, _evidence(service), to, previous=previous)
    print(f"wrote {to}: {made.rows['parts']:,} parts, {made.files:,} files, {made.n_bytes / 1e6:,.1f} MB")
    print(f"sha256 of its store.db: {made.sha256}")
    return _told_lost(made.lost)


def restore(
    backup: Path,
    *,
    folder: Folder = None,
    store: StoreAddress = None,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> int:
    """Bring a backup back, into a store without any row: SQLite or PostgreSQL, whatever it was taken from.

    Parameters
    ----------
    backup
        Folder that `store backup` has written.
    """
    service = _of_folder(service, folder)
    with opened_store(store or service.store_url, "store restore") as opened:
        from pipeline.common.private import private_folder
        from pipeline.store.backup import restore as bring_back

        private_folder(service.folder)
        back = bring_back(backup, opened, _evidence(service))
    print(f"restored {back.rows['parts']:,} parts as they were on {back.made_at[:16].replace('T', ' ')} UTC")
    return _told_lost(back.lost)


def check(
    *,
    files: bool = True,
    against: Path | None = None,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    folder: Folder = None,
    store: StoreAddress = None,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> int:
    """Look through the store and its files, while the service runs, and say what is wrong and what to do.

    Exit status: 1 where something is to be done.

    Parameters
    ----------
    files
        Read every file, and compare it with its hash; else only see that it is there.
    against
        A backup of this store: whatever it holds must still be there, unchanged.
    json_output
        Print JSON.
    """
    service = _of_folder(service, folder)
    with opened_store(store or service.store_url, "store check", as_it_is=True) as opened:
        from pipeline.store.check import check as look_through

        report = look_through(opened, _evidence(service), read_files=files, against=against)
    print(_as_json(report) if json_output else "\n".join(_lines(report)))
    return 0 if report.well else FAILED


def _of_folder(service: ServiceSettings, folder: Path | None) -> ServiceSettings:
    return service if folder is None else service.model_copy(update={"folder": folder})


def _evidence(service: ServiceSettings) -> EvidenceFolder:
    from pipeline.store.evidence_folder import EvidenceFolder

    return EvidenceFolder(service.evidence_folder)


def _told_lost(lost: object) -> int:
    if not isinstance(lost, list | tuple) or not lost:
        return 0
    print(f"{len(lost)} files were missing or damaged; `tactile-marks store check` names them")
    return FAILED


def _lines(report: CheckReport) -> list[str]:
    from pipeline.store.check import WHAT_TO_DO

    lines = [f"{report.parts:,} parts and {report.files:,} files are as they were written"]
    if report.counts:
        lines = [f"{report.parts:,} parts looked at, {report.files:,} files whole"]
    for fault, n in report.counts.items():
        lines.append(f"{fault.value}: {n:,}; {WHAT_TO_DO[fault]}")
        of_kind = [found for found in report.findings if found.fault is fault]
        lines += [f"  {found.subject}  {found.what}" for found in of_kind[:_MOST_SHOWN]]
        if len(of_kind) > _MOST_SHOWN:
            lines.append("  and more; --json names them")
    return lines


def _as_json(report: CheckReport) -> str:
    from pipeline.store.check import WHAT_TO_DO

    told = {
        "well": report.well,
        "parts": report.parts,
        "files": report.files,
        "counts": report.counts,
        "what_to_do": {fault: WHAT_TO_DO[fault] for fault in report.counts},
        "findings": [{"fault": f.fault, "subject": f.subject, "what": f.what} for f in report.findings],
    }
    return json.dumps(told, indent=1)

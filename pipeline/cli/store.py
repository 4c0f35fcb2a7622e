"""`tactile-marks tokens` and `store`: access tokens of the service; backup, restore and check of its data."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

from pipeline.cli.exit_status import FAILED
from pipeline.cli.settings import SERVICE, Config, ServiceOfFile

if TYPE_CHECKING:
    from pipeline.common.records import TokenRecord
    from pipeline.service.settings import ServiceSettings
    from pipeline.store.check import CheckReport
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store

ScopeName = Literal["read", "write", "review"]
Days = Annotated[int | None, Parameter(validator=Number(gte=1, lte=36_500))]
_MOST_SHOWN = 20


@dataclass(frozen=True)
class StoreOptions:
    """The store of a service.

    Attributes:
        store: Address of the store (default: the one of the service's settings).
        service: Settings of the service.
        config: TOML file with settings (default: tactile-marks.toml in the working folder, if it exists).
    """

    store: str | None = None
    service: ServiceOfFile = SERVICE
    config: Config = None

    @property
    def settings(self) -> ServiceSettings:
        return self.service if self.store is None else self.service.model_copy(update={"store": self.store})

    @contextlib.contextmanager
    def open_store(self, *, as_it_is: bool = False) -> Iterator[Store]:
        """Open the store. Raises StoreError: it cannot be opened."""
        from pipeline.store.store import Store

        with contextlib.closing(Store.open(self.settings.store_url, as_it_is=as_it_is)) as store:
            yield store


@dataclass(frozen=True)
class DataOptions(StoreOptions):
    """The store of a service and its files.

    Attributes:
        folder: Folder of the service (default: the one of its settings).
    """

    folder: Path | None = None

    @property
    def settings(self) -> ServiceSettings:
        settings = super().settings
        return settings if self.folder is None else settings.model_copy(update={"folder": self.folder})

    @property
    def evidence(self) -> EvidenceFolder:
        from pipeline.store.evidence_folder import EvidenceFolder

        return EvidenceFolder(self.settings.evidence_folder)


AtStore = Annotated[StoreOptions, Parameter(name="*")]
AtData = Annotated[DataOptions, Parameter(name="*")]
STORE, DATA = StoreOptions(), DataOptions()


def add(
    name: str,
    /,
    *,
    scope: Annotated[tuple[ScopeName, ...], Parameter(negative="")],
    days: Days = None,
    location: AtStore = STORE,
) -> None:
    """Make a token and print its secret once: the store keeps only its hash.

    Args:
        name: Name of the user or machine, such as line-3; reviews made with the token are signed with it.
        scope: Right that it gives: read, write (send parts) or review. May be repeated.
        days: Days for which it is valid (default: for ever).
    """
    with location.open_store() as store:
        from pipeline.common.records import Scope

        expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)
        secret = store.add_token(name, [Scope(s) for s in scope], expires_at=expires_at)
    # only the secret goes to the standard output, so that it can be piped
    until = "" if expires_at is None else f" until {expires_at:%Y-%m-%d}"
    print(f"token {name} for {', '.join(sorted(set(scope)))}{until}; keep it now:", file=sys.stderr)
    print(secret)


def list_tokens(*, location: AtStore = STORE) -> None:
    """List the tokens, without their secrets."""
    with location.open_store() as store:
        tokens = store.tokens()
    for token in tokens:
        scopes = ", ".join(sorted(token.scopes))
        print(f"{token.name:<24} {scopes:<20} made {token.created_at:%Y-%m-%d}  {_status(token)}")
    if not tokens:
        print("no tokens; make one with `tactile-marks tokens add NAME --scope read`", file=sys.stderr)


def revoke(name: str, /, *, location: AtStore = STORE) -> None:
    """Revoke a token.

    Args:
        name: Name of the user or machine.
    """
    with location.open_store() as store:
        store.revoke(name)
    print(f"token {name} is refused from now on")


def backup(to: Path, /, *, location: AtData = DATA) -> int:
    """Copy the store and its files, while the service runs.

    The folder of the backup appears when it is complete. Exit status: 1 if a file of the service was missing
    or damaged; the backup is still made, and says so.

    Args:
        to: New folder for the backup.
    """
    with location.open_store(as_it_is=True) as store:
        from pipeline.store.backup import back_up

        manifest = back_up(store, location.evidence, to)
    print(
        f"wrote {to}: {manifest.rows['parts']:,} parts, {manifest.files:,} files, {manifest.n_bytes / 1e6:,.1f} MB"
    )
    print(f"sha256 of its store.db: {manifest.sha256}")
    return _report_lost(manifest.lost)


def restore(backup: Path, /, *, location: AtData = DATA) -> int:
    """Restore a backup into an empty store: SQLite or PostgreSQL, whichever it was made from.

    Args:
        backup: Folder that `store backup` has written.
    """
    with location.open_store() as store:
        from pipeline.common.private import private_folder
        from pipeline.store.backup import restore as restore_backup

        private_folder(location.settings.folder)
        manifest = restore_backup(backup, store, location.evidence)
    print(
        f"restored {manifest.rows['parts']:,} parts as they were on {manifest.made_at[:16].replace('T', ' ')} UTC"
    )
    return _report_lost(manifest.lost)


def check(
    *,
    files: bool = True,
    json_output: Annotated[bool, Parameter(name="--json", negative="")] = False,
    location: AtData = DATA,
) -> int:
    """Check the store and its files while the service runs; print problems and remedies.

    Exit status: 1 if there is a problem.

    Args:
        files: Read every file and compare it with its hash; otherwise only check that it exists.
        json_output: Print JSON.
    """
    with location.open_store(as_it_is=True) as store:
        from pipeline.store.check import check as check_store

        report = check_store(store, location.evidence, read_files=files)
    print(_as_json(report) if json_output else "\n".join(_lines(report)))
    return 0 if report.well else FAILED


def _status(token: TokenRecord) -> str:
    if token.revoked_at is not None:
        return f"revoked {token.revoked_at:%Y-%m-%d}"
    if token.expires_at is None:
        return "valid for ever"
    expired = token.expires_at <= datetime.now(UTC)
    return f"{'expired' if expired else 'valid until'} {token.expires_at:%Y-%m-%d}"


def _report_lost(lost: Sequence[object]) -> int:
    if not lost:
        return 0
    print(f"{len(lost)} files were missing or damaged; `tactile-marks store check` names them")
    return FAILED


def _lines(report: CheckReport) -> list[str]:
    lines = [f"{report.parts:,} parts and {report.files:,} files are as they were written"]
    if report.counts:
        lines = [f"{report.parts:,} parts checked, {report.files:,} files intact"]
    for fault, n in report.counts.items():
        lines.append(f"{fault.value}: {n:,}; {fault.todo}")
        of_kind = [finding for finding in report.findings if finding.fault is fault]
        lines += [f"  {finding.subject}  {finding.what}" for finding in of_kind[:_MOST_SHOWN]]
        if len(of_kind) > _MOST_SHOWN:
            lines.append("  and more; --json names them")
    return lines


def _as_json(report: CheckReport) -> str:
    todo = {fault: fault.todo for fault in report.counts}
    return json.dumps({"well": report.well, **vars(report), "what_to_do": todo}, indent=1, default=vars)

"""Stores copied while they are written to, brought back elsewhere, and looked through."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import sqlalchemy as sa

from glyphs.errors import FileError
from pipeline.cli.main import main
from pipeline.common.golden_record import GoldenMeasure, Measured
from pipeline.common.records import EvidenceRecord, PartState, Scope
from pipeline.store.backup import SKIPPED_DELIVERIES, back_up, read_manifest, restore
from pipeline.store.check import CheckReport, Fault, check
from pipeline.store.errors import ConflictError
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store
from pipeline.store.tables import METADATA
from tests.support.store_samples import PHOTO, PLAN, Clock, correct, due, reading, received

Stores = Callable[[str, pytest.FixtureRequest], str]


@pytest.fixture(autouse=True)
def synced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Of a backup, when the disk is made to write; it would write all that the other tests have left, too."""
    done: list[str] = []
    rename = os.rename
    monkeypatch.setattr(os, "sync", lambda: done.append("sync"))
    monkeypatch.setattr(os, "rename", lambda *names: (done.append("rename"), rename(*names)))
    return done


def _keep(folder: EvidenceFolder, content: bytes) -> EvidenceRecord:
    sha256, n_bytes = folder.keep_content(content)
    return replace(PHOTO, sha256=sha256, n_bytes=n_bytes)


def _filled(store: Store, folder: EvidenceFolder) -> None:
    """A row in every table."""
    for k in range(5):
        received(store, text=f"KX{k}", evidence=(_keep(folder, b"photo %d" % k),), targets=("mqtt",))
    key = IdempotencyKey("line:1", "f")
    part = received(store, PartState.TOUCH_NEEDED, name="Größe", plan=PLAN, idempotency=key)
    store.add_readings(part.id, readings=(reading("KX9", "fused", "review"),), state=PartState.REVIEW)
    correct(store, part.id, "KX8", targets=("webhook",))
    store.add_token("line-3", [Scope.WRITE])
    store.add_golden({GoldenMeasure.GAIN: Measured(1.01, 0.001)}, line="press", reference=False)
    store.look_for_alerts(limits={}, window=1, drifts={"": "the parts are duller"})
    store.delivered(due(store)[-1].id)


def _all_rows(store: Store) -> dict[str, list[tuple[Any, ...]]]:
    tables = {}
    with store.read_transaction() as tx:
        for name, table in METADATA.tables.items():
            # leases end with the service that held them
            columns = [c for c in table.c if c.name not in ("owner", "leased_until")]
            rows = tx.execute(sa.select(*columns).order_by(*table.primary_key))
            tables[name] = [tuple(row) for row in rows]
    del tables["sessions"]  # a backup signs nobody in
    return tables


def _contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _files(folder: EvidenceFolder) -> dict[str, bytes]:
    return {name: folder.path(name).read_bytes() for names in folder.hashes() for name in names}


@pytest.fixture
def evidence(tmp_path: Path) -> EvidenceFolder:
    return EvidenceFolder(tmp_path / "service" / "evidence")


@pytest.fixture
def filled(store: Store, evidence: EvidenceFolder) -> Store:
    _filled(store, evidence)
    return store


@pytest.fixture
def backup(filled: Store, evidence: EvidenceFolder, tmp_path: Path) -> Path:
    """A backup of `filled`."""
    back_up(filled, evidence, tmp_path / "backup")
    return tmp_path / "backup"


ON_SQLITE = pytest.mark.parametrize("store_url", ["sqlite"], indirect=True)
INTO_SQLITE = pytest.mark.parametrize("other", ["sqlite"], indirect=True)


@pytest.fixture(params=["sqlite", "postgresql"])
def other(request: pytest.FixtureRequest, empty_stores: Stores, clock: Clock) -> Iterator[Store]:
    """A second, empty store, in one database after the other."""
    with contextlib.closing(Store.open(empty_stores(request.param, request), now=clock)) as opened:
        yield opened


def test_what_is_brought_back_elsewhere_is_what_was_there(
    filled: Store, other: Store, evidence: EvidenceFolder, tmp_path: Path
) -> None:
    """From every database into every one; the files too."""
    store = filled
    cookie = store.open_session(store.add_token("signed-in", [Scope.READ]))
    assert cookie is not None
    manifest = back_up(store, evidence, tmp_path / "backup")
    assert (manifest.rows["parts"], manifest.files, manifest.lost) == (6, 5, [])
    names = ["evidence", "manifest.json", "store.db"]
    assert sorted(p.name for p in (tmp_path / "backup").iterdir()) == names
    before = _contents(tmp_path / "backup")
    back = EvidenceFolder(tmp_path / "elsewhere" / "evidence")
    assert restore(tmp_path / "backup", other, back).lost == []
    assert all(_all_rows(store).values()), "every table has a row to be compared"
    assert _all_rows(other) == _all_rows(store)
    assert store.session_token(cookie) is not None
    assert other.session_token(cookie) is None
    assert _files(back) == _files(evidence)
    assert check(other, back).counts == {}
    assert _contents(tmp_path / "backup") == before
    # it goes on: rows and numbers of deliveries
    last = max(delivery.id for delivery in due(store))
    part = received(other, targets=("mqtt",))
    assert max(delivery.id for delivery in due(other)) > last + SKIPPED_DELIVERIES
    assert other.part(part.id) == part
    with pytest.raises(ConflictError, match="is not empty; restore into a new one"):
        restore(tmp_path / "backup", other, back)
    assert check(other, back).counts == {}


def test_a_backup_taken_while_parts_come_in_is_of_one_moment(
    store: Store, evidence: EvidenceFolder, clock: Clock, tmp_path: Path
) -> None:
    stop, ids = threading.Event(), list[str]()

    def work() -> None:
        while not stop.is_set():
            about = {"evidence": (_keep(evidence, os.urandom(200)),), "targets": ("mqtt",)}
            part = received(store, PartState.REVIEW, "KX4", **about)
            correct(store, part.id, "KX5", targets=("mqtt",))
            ids.append(part.id)

    with ThreadPoolExecutor(2) as pool:
        for _ in range(2):
            pool.submit(work)
        try:
            while len(ids) < 20:
                time.sleep(0.005)
            manifest, known = back_up(store, evidence, tmp_path / "backup"), len(ids)
        finally:
            stop.set()
    assert manifest.lost == []
    assert 20 <= manifest.rows["parts"] <= known + 2
    with contextlib.closing(Store.open(f"sqlite:///{tmp_path}/back.db", now=clock)) as target:
        restore(tmp_path / "backup", target, EvidenceFolder(tmp_path / "back"))
        report = check(target, EvidenceFolder(tmp_path / "back"))
    assert (report.parts, report.findings) == (manifest.rows["parts"], [])


@ON_SQLITE
def test_a_backup_appears_whole_or_not_at_all(
    filled: Store,
    evidence: EvidenceFolder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    synced: list[str],
) -> None:
    taken, calls = EvidenceFolder.take, itertools.count(1)

    def killed(folder: EvidenceFolder, *given: Any, **options: Any) -> Any:
        if next(calls) == 3:
            raise KeyboardInterrupt
        return taken(folder, *given, **options)

    with monkeypatch.context() as patch:
        patch.setattr(EvidenceFolder, "take", killed)
        with pytest.raises(KeyboardInterrupt):
            back_up(filled, evidence, tmp_path / "backup")
    assert not (tmp_path / "backup").exists()
    with pytest.raises(FileError, match="is not a complete backup"):
        read_manifest(tmp_path / "backup.partial")
    assert back_up(filled, evidence, tmp_path / "backup").files == 5
    assert synced == ["sync", "rename"], "all is on the disk before it has its name"
    assert not (tmp_path / "backup.partial").exists()
    with pytest.raises(FileError, match="is there already"):
        back_up(filled, evidence, tmp_path / "backup")


@INTO_SQLITE
def test_a_restore_is_of_a_whole_backup_and_if_killed_is_begun_again(
    filled: Store, backup: Path, other: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    back = EvidenceFolder(tmp_path / "back")
    whole = (backup / "store.db").read_bytes()
    (backup / "store.db").write_bytes(whole[:5000] + b"x" + whole[5001:])
    with pytest.raises(FileError, match="has changed since it was written; take another backup"):
        restore(backup, other, back)
    with pytest.raises(FileError, match="is not a complete backup"):
        restore(tmp_path, other, back)
    (backup / "store.db").write_bytes(whole)

    with monkeypatch.context() as patch:
        patch.setattr("shutil.copy", Mock(side_effect=OSError(28, "No space left on device")))
        with pytest.raises(FileError, match=r"tactile-marks-\w+/store\.db: .*No space left"):
            restore(backup, other, back)

    with monkeypatch.context() as patch:
        patch.setattr("pipeline.store.backup._count_on", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            restore(backup, other, back)
    assert other.parts() == ()
    restore(backup, other, back)
    assert _all_rows(other) == _all_rows(filled)


@INTO_SQLITE
def test_what_retention_takes_meanwhile_is_gone_and_not_lost(
    store: Store, other: Store, evidence: EvidenceFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = received(store, evidence=(_keep(evidence, b"old"), _keep(evidence, b"damaged")))
    old, damaged = (file.sha256 for file in store.evidence(part.id))
    evidence.path(damaged).write_bytes(b"rotten")
    taken = EvidenceFolder.take

    def expired_before(folder: EvidenceFolder, sha256: str, *given: Any, **options: Any) -> Any:
        store.evidence_gone(part.id, old)
        evidence.path(old).unlink(missing_ok=True)
        return taken(folder, sha256, *given, **options)

    with monkeypatch.context() as patch:
        patch.setattr(EvidenceFolder, "take", expired_before)
        manifest = back_up(store, evidence, tmp_path / "backup")
    assert manifest.lost == [damaged]
    back = EvidenceFolder(tmp_path / "back")
    assert restore(tmp_path / "backup", other, back).lost == [damaged]
    assert [file.gone for file in other.evidence(part.id)] == [True, False]
    assert _told(check(other, back), Fault.MISSING) == [damaged]


# check


def _told(report: CheckReport, fault: Fault) -> list[str]:
    return [finding.subject for finding in report.findings if finding.fault is fault]


def test_a_store_that_is_well(filled: Store, evidence: EvidenceFolder) -> None:
    blind = filled.parts(state=PartState.REVIEWED)[0].id
    for who, text in (("Bea", "KX1"), ("Cy", "KX2"), ("Di", "KX2")):  # one has read it otherwise, two agree
        correct(filled, blind, text, who, readers=2)
        assert check(filled, evidence).findings == []
    report = check(filled, evidence)
    assert (report.parts, report.files, report.findings, report.well) == (6, 5, [], True)


TAMPERED = [
    "UPDATE events SET data = '{}' WHERE kind = 'reviewed'",
    "UPDATE events SET data = (SELECT data FROM events WHERE id = 2) WHERE actor = 'fused'",
    "UPDATE parts SET text_folded = 'kx0' WHERE state = 'reviewed'",
    "UPDATE parts SET state = 'accepted' WHERE state = 'reviewed'",
]


@pytest.mark.parametrize(
    ("store_url", "statement"),
    [*(("sqlite", statement) for statement in TAMPERED), ("postgresql", TAMPERED[1])],
    indirect=["store_url"],
)
def test_what_is_changed_behind_the_programs_back_is_found(
    filled: Store, evidence: EvidenceFolder, statement: str
) -> None:
    (reviewed,) = filled.parts(state=PartState.REVIEWED)
    with filled.write_transaction() as tx:
        assert tx.execute(sa.text(statement)).rowcount > 0
    assert _told(check(filled, evidence), Fault.DERIVED) == [reviewed.id]


@ON_SQLITE
def test_files_that_are_missing_damaged_or_nobodys_are_found(filled: Store, evidence: EvidenceFolder) -> None:
    missing, damaged, *_ = sorted(_files(evidence))
    evidence.path(missing).unlink()
    evidence.path(damaged).write_bytes(b"rotten")
    orphan = _keep(evidence, b"nobody's")
    old = time.time() - 3 * 3600
    os.utime(evidence.path(orphan.sha256), (old, old))
    report = check(filled, evidence)
    assert (_told(report, Fault.MISSING), _told(report, Fault.DAMAGED)) == ([missing], [damaged])
    assert (report.files, report.counts[Fault.ORPHANS]) == (3, 1)
    quick = check(filled, evidence, read_files=False)
    assert (_told(quick, Fault.MISSING), _told(quick, Fault.DAMAGED)) == ([missing], [])


def test_what_is_stuck_is_found(store: Store, evidence: EvidenceFolder, clock: Clock) -> None:
    part = received(store, PartState.TOUCH_NEEDED, plan=PLAN, targets=("mqtt",))
    store.postpone(due(store)[0].id, "tests", error="no broker", wait_s=10.0)
    clock.go_on(hours=1)
    assert check(store, evidence).well
    clock.go_on(hours=25)
    report = check(store, evidence)
    assert (_told(report, Fault.STUCK), _told(report, Fault.UNDELIVERED)) == ([part.id], ["mqtt"])
    assert re.search("1 results wait.*no broker", report.findings[-1].what)


def test_the_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["store", "check", "--folder", "nowhere"]) == 1
    assert "there is no store" in capsys.readouterr().err
    with contextlib.closing(Store.open(f"sqlite:///{tmp_path}/tactile-marks-data/store.db")) as store:
        _filled(store, EvidenceFolder(tmp_path / "tactile-marks-data" / "evidence"))
    assert main(["store", "backup", "monday"]) == 0
    out = capsys.readouterr().out
    assert "wrote monday: 6 parts, 5 files" in out
    assert json.loads(Path("monday/manifest.json").read_text())["sha256"] in out
    assert main(["store", "restore", "monday"]) == 1
    assert "is not empty" in capsys.readouterr().err
    assert main(["store", "restore", "monday", "--folder", "elsewhere"]) == 0
    assert "restored 6 parts as they were on" in capsys.readouterr().out
    assert main(["store", "check", "--folder", "elsewhere"]) == 0
    assert capsys.readouterr().out == "6 parts and 5 files are as they were written\n"
    next(Path("elsewhere/evidence/files").glob("*/*")).write_bytes(b"rotten")
    assert main(["store", "check", "--folder", "elsewhere"]) == 1
    out = capsys.readouterr().out
    assert "damaged: 1; copy the file of that name from a backup's evidence/files over the service's" in out
    assert main(["store", "check", "--folder", "elsewhere", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["well"], told["counts"], told["findings"][0]["fault"]) == (False, {"damaged": 1}, "damaged")
    assert main(["store", "check", "--folder", "elsewhere", "--no-files"]) == 0
    assert {p.stat().st_mode & 0o077 for p in (Path("monday"), *Path("elsewhere").rglob("*"))} == {0}

"""What the service keeps on its disk: for its owner alone, and never served when it is not what was kept."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartRecord
from pipeline.service.app import Service, check_folder
from pipeline.service.settings import ServiceSettings
from tests.support.postgres_server import PostgresServer
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import PHOTO, received


def _kept(service: Service) -> tuple[PartRecord, EvidenceRecord]:
    path = service.evidence.incoming / "picture.jpg"
    path.write_bytes(b"as it was")
    sha256, n_bytes = service.evidence.keep(path)
    record = replace(PHOTO, kind=EvidenceKind.PHOTO_PICTURE, sha256=sha256, n_bytes=n_bytes)
    return received(service.store, evidence=(record,)), record


def test_a_damaged_file_is_said_and_not_served(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with inline_service(tmp_path / "service") as (service, client):
        part, record = _kept(service)
        addresses = (f"/v1/parts/{part.id}/pictures/photo", f"/v1/parts/{part.id}/evidence/{record.sha256}")
        for address in addresses:
            whole = client.get(address)
            assert (whole.status_code, whole.content) == (200, b"as it was")
            assert whole.headers["etag"] == f'"{record.sha256}"'
        service.evidence.path(record.sha256).write_bytes(b"as it rots")
        for address in (*addresses, f"/v1/parts/{part.id}/pictures/boxes"):
            damaged = client.get(address)
            assert damaged.status_code == 500, address
            assert damaged.headers["content-type"] == "application/problem+json"
            assert "is damaged on the service's disk; restore it from a backup" in damaged.json()["detail"]
            assert "etag" not in damaged.headers
            assert b"as it rots" not in damaged.content
        assert f"the file {record.sha256} kept as evidence is damaged" in caplog.text
        assert "This picture is damaged" in client.get(f"/parts/{part.id}").text
        assert service.evidence.whole((record.sha256,)) == (), "nor is it read again with touch"
        service.evidence.path(record.sha256).unlink()
        for address in addresses:
            missing = client.get(address)
            assert (missing.status_code, "missing from the service" in missing.json()["detail"]) == (
                404,
                True,
            )


def _modes(folder: Path) -> dict[str, int]:
    return {
        str(path.relative_to(folder.parent)): path.stat().st_mode & 0o777
        for path in (folder, *folder.rglob("*"))
    }


def test_nobody_but_the_owner_reads_what_is_kept(tmp_path: Path) -> None:
    folder = tmp_path / "service"
    check_folder(ServiceSettings(folder=folder))
    with inline_service(folder) as (service, _):
        _kept(service)
        modes = _modes(folder)
    assert modes["service"] == modes["service/evidence"] == modes["service/evidence/files"] == 0o700
    # what stands open within is behind a folder that is not
    kept = {name: mode for name, mode in modes.items() if "evidence" in name or "store.db" in name}
    assert set(kept) >= {"service/store.db", "service/store.db-wal", "service/store.db-shm"}
    assert {name: mode for name, mode in kept.items() if mode & 0o077} == {}


def test_what_stood_open_is_closed_but_to_a_group_that_may_write(tmp_path: Path) -> None:
    folder = tmp_path / "service"
    with inline_service(folder):
        pass
    folder.chmod(0o755)
    (folder / "store.db").chmod(0o664)
    check_folder(ServiceSettings(folder=folder))
    with inline_service(folder):
        modes = _modes(folder)
    assert modes["service"] == 0o700
    assert modes["service/store.db"] == 0o660


def test_services_that_share_a_postgresql_need_one_evidence_folder(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    url = postgres.create(f"shared_{time.monotonic_ns()}")
    with inline_service(tmp_path / "one", store=url), inline_service(tmp_path / "one", store=url):
        pass
    with (
        pytest.raises(
            FileError, match=r"is not the evidence folder of this store; .* the same --folder"
        ) as refused,
        inline_service(tmp_path / "two", store=url),
    ):
        pass
    # it was lost, and a new one is to take its place
    identity = (tmp_path / "one" / "evidence" / "identity").read_text()
    assert identity in str(refused.value)
    (tmp_path / "two" / "evidence" / "identity").write_text(identity)
    with inline_service(tmp_path / "two", store=url):
        pass

"""Files kept by what they hold, and the clock that sweeps of them go by: a leap ahead deletes nothing."""

from __future__ import annotations

import hashlib
import os
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.store.evidence_folder import EvidenceFolder, SweepClock
from pipeline.store.store import Store
from tests.support.store_samples import PHOTO, SCAN, Clock, received

_TWO_HOURS_S = 7200.0


@pytest.fixture
def folder(tmp_path: Path) -> EvidenceFolder:
    return EvidenceFolder(tmp_path / "evidence")


def _upload(folder: EvidenceFolder, content: bytes) -> Path:
    path = folder.new_work_folder() / "upload"
    path.write_bytes(content)
    return path


def _age(path: Path, seconds: float) -> None:
    past = time.time() - seconds
    os.utime(path, (past, past))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20, deadline=None)
@given(st.binary(max_size=3000))
@example(bytes(3_000_001))
def test_a_file_is_found_by_what_it_holds(folder: EvidenceFolder, content: bytes) -> None:
    path = _upload(folder, content)
    sha256, n_bytes = folder.keep(path)
    assert (sha256, n_bytes) == (hashlib.sha256(content).hexdigest(), len(content))
    assert folder.path(sha256).read_bytes() == content
    assert not path.exists()


def test_the_same_twice_is_one_file_and_mends_it_also_at_once(folder: EvidenceFolder) -> None:
    sha256, _ = folder.keep_content(b"photo")
    folder.path(sha256).write_bytes(b"damaged")
    assert folder.keep_content(b"photo") == (sha256, 5)
    assert [p.read_bytes() for p in folder.path(sha256).parent.iterdir()] == [b"photo"]
    uploads = [_upload(folder, b"photo %d" % (k % 7)) for k in range(70)]
    with ThreadPoolExecutor(8) as pool:
        stored = set(pool.map(folder.keep, uploads))
    assert len(stored) == 7
    for sha256, _ in stored:
        assert hashlib.sha256(folder.path(sha256).read_bytes()).hexdigest() == sha256


def test_paths_are_of_hashes_alone(folder: EvidenceFolder) -> None:
    a = "a" * 63
    for wrong in ("", "abc", "../" + a[2:], "A" * 64, a + "/", a + "aa", a + "a\n", "٣" * 64, "a\x00" * 32):
        with pytest.raises(ValueError, match="64 hexadecimal digits"):
            folder.path(wrong)


def test_links_pipes_and_folders_are_no_files(folder: EvidenceFolder, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"secret")
    link, pipe = folder.incoming / "link", folder.incoming / "pipe"
    link.symlink_to(secret)
    os.mkfifo(pipe)
    for path in (link, pipe, folder.new_work_folder(), folder.incoming / "missing"):
        with pytest.raises(FileError):
            folder.keep(path)
    assert secret.exists()
    assert list((folder.root / "files").iterdir()) == []


def test_what_a_crash_has_left_is_swept(folder: EvidenceFolder, store: Store) -> None:
    known, _ = folder.keep_content(b"known")
    orphan, _ = folder.keep_content(b"orphan")
    fresh, _ = folder.keep_content(b"fresh orphan")
    left, writing = _upload(folder, b"left over"), _upload(folder, b"being written")
    for path in (folder.path(known), folder.path(orphan), *folder.incoming.iterdir(), left):
        _age(path, _TWO_HOURS_S)
    received(store, evidence=(replace(PHOTO, sha256=known),))
    assert folder.sweep(store, older_than_s=3600) == 2
    assert [folder.path(sha256).exists() for sha256 in (known, orphan, fresh)] == [True, False, True]
    assert (left.parent.exists(), writing.exists()) == (False, True)
    assert list(folder.incoming.iterdir()) == [writing.parent]
    assert folder.sweep(store, older_than_s=0) == 2
    assert list(folder.incoming.iterdir()) == []


def test_a_file_that_cannot_be_removed_keeps_no_other(
    folder: EvidenceFolder, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    hashes = sorted(folder.keep_content(content)[0] for content in (b"one", b"two", b"three"))
    unlink = Path.unlink

    def refused(path: Path, missing_ok: bool = False) -> None:
        if path.name == hashes[0]:
            raise PermissionError(13, "Permission denied")
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", refused)
    folder.sweep(store, older_than_s=-60)
    assert [folder.path(sha256).exists() for sha256 in hashes] == [True, False, False]


def test_what_was_just_kept_is_young_however_old_the_upload(folder: EvidenceFolder, store: Store) -> None:
    path = _upload(folder, b"photo")
    _age(path, _TWO_HOURS_S)
    sha256, _ = folder.keep(path)
    folder.sweep(store, older_than_s=3600)
    assert folder.path(sha256).exists(), "the store may be about to name it"


def test_sweeping_follows_no_link(folder: EvidenceFolder, store: Store, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "file").write_bytes(b"")
    (folder.incoming / "link").symlink_to(precious)
    (folder.new_work_folder() / "link").symlink_to(precious)
    folder.sweep(store, older_than_s=-60)
    assert (precious / "file").exists()
    assert list(folder.incoming.iterdir()) == []


def test_old_evidence_goes_unless_a_younger_part_needs_it(
    folder: EvidenceFolder, store: Store, clock: Clock
) -> None:
    photo, _ = folder.keep_content(b"photo")
    scan, _ = folder.keep_content(b"scan")
    again, _ = folder.keep_content(b"sent again a minute ago")
    scans = (replace(SCAN, sha256=name) for name in (scan, again, "c" * 64))  # the last is lost from the disk
    old = received(store, evidence=(replace(PHOTO, sha256=photo), *scans))
    clock.go_on(days=31)
    young = received(store, evidence=(replace(PHOTO, sha256=photo),))
    for sha256 in (photo, scan):
        _age(folder.path(sha256), _TWO_HOURS_S)
    assert store.expire_evidence(clock.at) == 4
    assert folder.sweep(store, older_than_s=3600) == 1
    assert [folder.path(sha256).exists() for sha256 in (scan, photo, again)] == [False, True, True]
    assert all(e.gone for e in store.evidence(old.id))
    assert not any(e.gone for e in store.evidence(young.id))
    assert store.expire_evidence(clock.at) == folder.sweep(store, older_than_s=3600) == 0
    assert store.needed_hashes((photo, scan, again)) == {photo}
    told = [event for event in store.story(old.id).events if event.kind == "evidence_expired"]
    assert len(told) == 4
    store.evidence_gone(old.id, scan)  # once more
    assert [event for event in store.story(old.id).events if event.kind == "evidence_expired"] == told


DAY_S = 86_400.0
NOW_S = 2e9


class Times:
    """A clock and the monotonic one beside it."""

    def __init__(self) -> None:
        self.wall_s, self.monotonic_s = NOW_S, 50.0

    def passes(self, seconds: float) -> None:
        self.wall_s += seconds
        self.monotonic_s += seconds


@pytest.fixture
def times() -> Times:
    return Times()


def clock(folder: Path, times: Times) -> SweepClock:
    """The clock of a service that starts now."""
    return SweepClock(folder / "swept", wall_s=lambda: times.wall_s, monotonic_s=lambda: times.monotonic_s)


def test_sweeps_go_on_by_the_hour_and_after_a_month_at_rest(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    for _ in range(3):
        assert sweeps.may_sweep(None)
        times.passes(3600.0)
    times.passes(30 * DAY_S)
    assert clock(tmp_path, times).may_sweep(None)


@pytest.mark.parametrize("swept_before", [True, False])
def test_a_clock_ten_years_ahead_sweeps_nothing_until_it_is_set(
    tmp_path: Path, times: Times, swept_before: bool
) -> None:
    newest = datetime.fromtimestamp(NOW_S, UTC)
    if swept_before:
        assert clock(tmp_path, times).may_sweep(newest)
    times.wall_s += 3650 * DAY_S
    sweeps = clock(tmp_path, times)
    assert not sweeps.may_sweep(newest)
    assert sweeps.trouble == "nothing is deleted: by the clock the last sweep was 3,650 days ago"
    times.passes(3600.0)
    # parts that come meanwhile bear the wrong time, and prove nothing
    assert not sweeps.may_sweep(datetime.fromtimestamp(times.wall_s, UTC))
    times.wall_s -= 3650 * DAY_S
    times.passes(3600.0)
    assert not sweeps.may_sweep(newest)  # it has leapt again
    times.passes(3600.0)
    assert sweeps.may_sweep(newest)
    assert sweeps.trouble == ""


def test_a_person_may_say_that_the_clock_is_right(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    assert sweeps.may_sweep(None)
    times.passes(100 * DAY_S)
    assert not sweeps.may_sweep(None)
    sweeps.file.touch()
    os.utime(sweeps.file, (times.wall_s, times.wall_s))
    assert sweeps.may_sweep(None)


def test_a_leap_of_hours_spares_files_in_the_making_once(tmp_path: Path, times: Times) -> None:
    sweeps = clock(tmp_path, times)
    assert sweeps.may_sweep(None)
    times.wall_s += 2 * 3600.0
    times.passes(3600.0)
    assert not sweeps.may_sweep(None)
    assert "leapt by 7,200 s" in sweeps.trouble
    times.passes(3600.0)
    assert sweeps.may_sweep(None)

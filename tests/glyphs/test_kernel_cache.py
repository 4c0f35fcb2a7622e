"""Kernels on disk: whatever becomes of their files, the kernels compute."""

from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile, NullCache

from glyphs.compiled import kernel, read_only
from glyphs.compiling import COMPILE_EVERY_RUN, show_compiling


def thrice() -> Any:
    """A new dispatcher of one kernel, as another process has it."""

    @kernel()
    def triple(values, out):  # type: ignore[no-untyped-def]
        for i in range(values.size):
            out[i] = 3.0 * values[i]

    return triple


def computed(dispatcher: Any) -> list[float]:
    out = np.empty(2)
    dispatcher(read_only([1.0, 2.5]), out)
    return out.tolist()


def hits(dispatcher: Any) -> int:
    return sum(dispatcher.stats.cache_hits.values())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    return tmp_path


def emptied(content: bytes) -> bytes:
    return b""


def halved(content: bytes) -> bytes:
    return content[: len(content) // 2]


def changed(content: bytes) -> bytes:
    """The middle, where a data file has machine code."""
    middle = len(content) // 2
    return content[:middle] + bytes(255 - b for b in content[middle : middle + 64]) + content[middle + 64 :]


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [emptied, halved, changed])
def test_damaged_files_are_made_again(folder: Path, damage: Callable[[bytes], bytes], suffix: str) -> None:
    assert computed(thrice()) == [3.0, 7.5]
    files = list(folder.rglob(f"*{suffix}"))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    again = thrice()
    assert computed(again) == [3.0, 7.5]
    assert hits(again) == 0
    last = thrice()
    assert computed(last) == [3.0, 7.5]
    assert hits(last) == 1  # the files are whole again


def test_a_full_disk_keeps_no_kernel_from_its_work(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    for name in ("_save_index", "_save_data"):
        with monkeypatch.context() as patch:
            patch.setattr(IndexDataCacheFile, name, full)
            assert computed(thrice()) == [3.0, 7.5]
        assert computed(thrice()) == [3.0, 7.5]


def test_without_a_folder_for_them_kernels_are_compiled_and_that_is_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("numba.core.caching.CacheImpl._locator_classes", [])
    monkeypatch.setattr("glyphs.compiled._Compiling.kept", True)
    one = thrice()
    assert isinstance(one._cache, NullCache)
    lines: list[str] = []
    with show_compiling(lines.append):
        assert computed(one) == [3.0, 7.5]
    assert lines[0] == COMPILE_EVERY_RUN

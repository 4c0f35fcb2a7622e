"""Which parts a command line means."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.formats.find_parts import NothingFoundError, discover


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    names = ("b.npz", "b.png", "a.h5", "a.npz", "c.png", "truth.csv", "d.SUR", ".hidden.npz", "notes.txt")
    for name in names:
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "a.npz").write_bytes(b"x")
    return tmp_path


def test_files_of_one_stem_are_one_part(folder: Path) -> None:
    a, b, d = discover([folder])
    assert (a.name, a.scan, a.height_map, a.photo) == ("a", folder / "a.h5", folder / "a.npz", "")
    assert (b.name, b.scan, b.height_map, b.photo) == ("b", "", folder / "b.npz", folder / "b.png")
    assert d.height_map == folder / "d.SUR"
    assert not any(p.problem for p in (a, b, d))


def test_globs_and_files_keep_their_order_and_stand_once(folder: Path) -> None:
    parts = discover([folder / "d.SUR", str(folder / "*.npz"), folder / "b.npz", folder / "b.png"])
    assert [p.name for p in parts] == ["d", "a", "b"]
    assert parts[2].photo == folder / "b.png"
    assert not any(p.problem for p in parts)


def test_one_stem_in_two_folders_is_two_parts(folder: Path) -> None:
    names = [p.name for p in discover([folder / "a.npz", folder / "deeper"])]
    assert names == [f"{folder.name}/a", "deeper/a"]


def test_as_much_of_the_folders_as_makes_names_unique(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in (".", "x/lot", "y/lot", "y/other"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        Path(folder, "a.npz").write_bytes(b"x")
    Path("y/other/b.npz").write_bytes(b"x")
    parts = discover([".", "x/lot", "y/lot", "y/other"])
    assert [p.name for p in parts] == ["a", "x/lot/a", "y/lot/a", "other/a", "b"]


def test_two_maps_of_one_stem_are_a_problem(folder: Path) -> None:
    (folder / "a.x3p").write_bytes(b"x")
    a = discover([folder])[0]
    assert a.problem is not None
    assert "a.x3p" in str(a.problem)
    assert "a.npz" in str(a.problem)


def test_a_photograph_alone_is_a_part_where_it_is_meant(folder: Path) -> None:
    # beside height maps it may be any picture
    assert "c" not in [p.name for p in discover([folder])]
    assert "c" not in [p.name for p in discover([str(folder / "*")])]
    for given in ([folder / "c.png"], [str(folder / "c.*")]):
        (c,) = discover(given)
        assert (c.photo, c.felt, c.problem) == (folder / "c.png", False, None)
    assert [p.name for p in discover([str(folder / "*.png")])] == ["b", "c"]
    assert [p.name for p in discover([folder], photos=True)] == ["a", "b", "c", "d"]
    first_the_photo = discover([folder / "b.png", folder / "b.npz"])
    assert len(first_the_photo) == 1
    assert first_the_photo[0].problem is None
    assert first_the_photo[0].felt


def test_the_photograph_beside_a_file_named_is_its_own_where_wanted(folder: Path) -> None:
    assert discover([folder / "b.npz"])[0].photo == ""
    (b,) = discover([folder / "b.npz"], beside=True)
    assert (b.height_map, b.photo) == (folder / "b.npz", folder / "b.png")
    (c,) = discover([folder / "c.png"], beside=True)
    assert not c.felt


def test_a_folder_of_photographs_is_parts(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.PNG", "notes.txt"):
        (tmp_path / name).write_bytes(b"x")
    assert [p.name for p in discover([tmp_path])] == ["a", "b"]


def test_two_photographs_of_one_stem_trouble_vision_alone(folder: Path) -> None:
    (folder / "b.jpg").write_bytes(b"x")
    (b,) = discover([str(folder / "b.*")])
    assert b.problem is None
    assert b.felt
    assert b.photo_problem is not None
    assert "b.png" in str(b.photo_problem)
    assert "b.jpg" in str(b.photo_problem)


def test_a_missing_or_unknown_file_is_a_part_to_be_refused_later(folder: Path) -> None:
    missing, notes = discover([folder / "none.npz", folder / "notes.txt"])
    assert missing.height_map == folder / "none.npz"
    assert notes.height_map == folder / "notes.txt"


def test_a_name_that_no_file_can_have_is_a_problem() -> None:
    (part,) = discover(["x" * 5000 + ".npz"])
    assert part.problem is not None
    assert "name" in part.problem.hint


def test_a_name_of_other_bytes_can_be_printed(tmp_path: Path) -> None:
    (tmp_path / os.fsdecode(b"st\xfcck.npz")).write_bytes(b"x")
    (part,) = discover([tmp_path])
    assert part.name.encode() == b"st?ck"
    assert Path(part.height_map).read_bytes() == b"x"


def test_photographs_beside_are_found_by_their_stems(tmp_path: Path) -> None:
    files = [tmp_path / f"{n}.npz" for n in range(3000)]
    for number, file in enumerate(files):
        file.write_bytes(b"x")
        if number % 2:
            file.with_suffix(".jpg").write_bytes(b"x")
    parts = discover(files, beside=True)
    assert [p.photo for p in parts] == [f.with_suffix(".jpg") if n % 2 else "" for n, f in enumerate(files)]


def test_a_folder_that_goes_away_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(path: str) -> None:
        raise PermissionError(13, "Permission denied", path)

    # a mode that forbids it would not keep out root
    monkeypatch.setattr(os, "scandir", forbidden)
    with pytest.raises(FileError, match=r"cannot be listed \(Permission denied\); check its permissions"):
        discover([tmp_path])


@pytest.mark.parametrize("given", [[], ["*.npz"], ["."]])
def test_nothing_found_is_said(given: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(NothingFoundError, match="no height map"):
        discover(given)


def test_numbered_photographs_are_of_one_part(tmp_path: Path) -> None:
    for name in (
        "a.npz",
        "a.light-1.png",
        "a.light-2.jpg",
        "b.exposure-1.png",
        "b.shot-2.png",
        "c.light-x.png",
    ):
        (tmp_path / name).write_bytes(b"x")
    a, b, c = discover([tmp_path], photos=True)
    assert (a.name, a.photo, a.more_photos) == (
        "a",
        tmp_path / "a.light-1.png",
        (tmp_path / "a.light-2.jpg",),
    )
    assert (b.name, len(b.more_photos), b.photo_problem) == ("b", 1, None)
    assert c.name == "c.light-x"
    (beside,) = discover([tmp_path / "a.npz"], beside=True)
    assert len(beside.more_photos) == 1
    two = discover([tmp_path / "b.exposure-1.png", tmp_path / "b.shot-2.png"])
    assert [(p.name, p.more_photos) for p in two] == [("b", (tmp_path / "b.shot-2.png",))]

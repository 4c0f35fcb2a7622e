"""Which parts files, folders, globs, URLs and manifests mean together."""

from __future__ import annotations

import os
import uuid
from collections.abc import Sequence
from pathlib import Path, PureWindowsPath
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.errors import is_url, without_secrets
from pipeline.formats.find_parts import NothingFoundError, discover
from pipeline.formats.part_files import PartFiles, split_name, with_unique_names
from pipeline.formats.touch_file import read_height_map

FILES = ("b.npz", "b.png", "a.h5", "a.npz", "c.png", "truth.csv", "d.SUR", ".hidden.npz", "notes.txt")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Local files."""
    for name in (*FILES, "deeper/a.npz"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


@pytest.fixture
def store() -> str:
    """The same in a store."""
    import fsspec

    root = f"memory://{uuid.uuid4().hex}"
    for name in (*FILES, "deeper/a.npz"):
        with fsspec.open(f"{root}/{name}", "wb") as stream:
            stream.write(b"x")
    return root


@pytest.mark.parametrize(("recurse", "photos"), [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize(
    "inputs",
    [["{}"], ["{}/"], ["{}/*"], ["{}/**"], ["{}/*.npz"], ["{}/a.npz", "{}/deeper"], ["{}/b.png", "{}/b.npz"]],
)
def test_a_store_is_listed_as_a_folder_is(
    folder: Path, store: str, inputs: list[str], recurse: bool, photos: bool
) -> None:
    here = discover([i.format(folder) for i in inputs], recurse=recurse, photos=photos)
    there = discover([i.format(store) for i in inputs], recurse=recurse, photos=photos)
    told = [(p.name, p.files) for p in here]
    root, name = store, store.rpartition("/")[2]
    there_too = [
        (p.name.replace(name, folder.name), [f.replace(root, str(folder)) for f in p.files]) for p in there
    ]
    assert told == [(name, tuple(files)) for name, files in there_too]
    assert told
    assert here.passed_over.counts == there.passed_over.counts


def test_a_file_named_by_a_url_is_not_asked_after() -> None:
    # no such host: names of known kinds are parts without anyone being asked
    names = (
        "https://host.invalid/a.npz?signature=x.y",
        "s3://b/b.h5",
        "gs://b/b.png",
        "https://host.invalid/c",
    )
    parts = discover(names)
    assert [p.name for p in parts] == ["a", "s3/b/b", "gs/b/b", "c"]
    assert [p.files for p in parts] == [(name,) for name in names]


def test_what_cannot_be_listed_is_told_before_the_run(store: str, folder: Path) -> None:
    with pytest.raises(FileError, match=rf"^{store}/none: is not there; check the name"):
        discover([str(folder), f"{store}/none"])
    with pytest.raises(NothingFoundError, match="no height map"):
        discover([f"{store}/none*"])
    with pytest.raises(FileError, match=r"^zip://a::s3://b/c.zip: has an unsupported scheme"):
        discover(["zip://a::s3://b/c.zip"])


def test_manifests_stand_where_they_are_named(folder: Path) -> None:
    (folder / "lot.csv").write_text("part,height_map,expected\nA,a.npz,KB\nB,s3://lots/b.npz,\n")
    (folder / "more.tsv").write_text("scan\tphoto\na.h5\tb.png\n")
    inputs = [str(folder / "d.SUR"), str(folder / "lot.csv"), str(folder / "b.npz")]
    parts = discover(inputs, manifests=[str(folder / "more.tsv")])
    assert [p.name for p in parts] == ["d", "A", "B", "b", "a"]
    assert parts[1].expected == "KB"
    assert parts[4].files == (str(folder / "a.h5"), str(folder / "b.png"))


def test_one_part_found_and_told_stands_once_and_says_all(folder: Path) -> None:
    (folder / "lot.csv").write_text("height_map,expected\nb.npz,KB\n")
    (folder / "also.csv").write_text("height_map,part\nb.npz,other\n")
    for inputs in ([folder / "b.npz", folder / "lot.csv"], [folder / "lot.csv"] * 2 + [folder / "b.npz"]):
        (b,) = discover([str(i) for i in inputs])
        assert (b.name, b.expected) == ("b", "KB")
    # under another name it is another part
    assert len(discover([str(folder / "lot.csv"), str(folder / "also.csv")])) == 2


_STEMS = st.sampled_from(["a", "b", "a (2)", "x/a", "lot/a"])
_FOLDERS = st.sampled_from(["", "/", "lot", "x/lot", "/x/lot", "y/lot", "s3://x/lot", "gs://x/lot"])


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(_FOLDERS, _STEMS), max_size=12))
def test_names_made_apart_are_unique_and_end_as_they_were(files: list[tuple[str, str]]) -> None:
    parts = [
        PartFiles(stem, f"{folder}/{number}.npz" if folder else f"{number}.npz")
        for number, (folder, stem) in enumerate(files)
    ]
    apart = with_unique_names(parts)
    assert len({p.name for p in apart}) == len(parts)
    for part, before in zip(apart, parts, strict=True):
        assert part.files == before.files
        assert before.name in part.name
        if (
            sum(p.name == before.name for p in parts) == 1
            and "/" not in before.name
            and "(" not in before.name
        ):
            assert part.name == before.name
    assert with_unique_names(apart) == apart


def test_what_a_name_says() -> None:
    assert is_url("S3://bucket/key")
    assert is_url("simplecache::s3://bucket/key")
    assert not any(map(is_url, ("a.npz", "/a//b.npz", "C:\\a.npz", "a::b.npz", "://x", "x:/y", "ü://x")))
    assert split_name("s3://bucket/lot/a.npz") == ("s3://bucket/lot", "a.npz")
    assert split_name("s3://bucket") == ("s3://", "bucket")
    assert split_name("https://h/lot/a.npz?list=/x/y.csv#z") == ("https://h/lot", "a.npz")
    assert split_name("s3://b/lot?/a#.npz") == ("s3://b/lot?", "a#.npz")
    assert split_name("/a.npz") == ("/", "a.npz")
    assert split_name(PureWindowsPath(r"C:\lot\tray 7\a.npz")) == ("C:/lot/tray 7", "a.npz")
    assert split_name(PureWindowsPath(r"\\press\lots\a.npz")) == ("//press/lots", "a.npz")
    assert without_secrets("https://me:secret@h/a.npz?X-Signature=secret") == "https://***@h/a.npz"
    assert without_secrets("abfs://box@account/a?b") == "abfs://box@account/a?b"
    with pytest.raises(ValueError, match="without a name"):
        PartFiles("")


def test_tables_of_texts_among_the_files_of_a_folder_are_passed_over(tmp_path: Path) -> None:
    """`read lot/*`: the shell names the truth and an earlier table, too."""
    for name, head in (("truth.csv", "part,text"), ("rows.csv", "part,text,decision")):
        (tmp_path / name).write_text(f"{head}\na,AB12\n")
    (tmp_path / "a.npz").write_bytes(b"x")
    listing = discover([str(p) for p in sorted(tmp_path.iterdir())])
    assert [p.name for p in listing] == ["a"]
    assert [Path(file).name for file in listing.passed_over.files] == ["rows.csv", "truth.csv"]
    with pytest.raises(FileError, match="must name one of"):
        discover([str(tmp_path / "truth.csv")])


def test_a_table_that_the_run_uses_is_not_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a.npz", "order.txt", "notes.txt"):
        (tmp_path / name).write_bytes(b"x")
    monkeypatch.chdir(tmp_path)
    left = discover([tmp_path]).passed_over.without(["order.txt", "a text"])
    assert [Path(file).name for file in left.files] == ["notes.txt"]


# ----------------------------------------------------------------------------------- files of this machine


def named(folder: Path, parts: Sequence[PartFiles]) -> list[tuple[str, ...]]:
    """Name, height map, scan and photograph of each part, by file name."""
    files = [(p.height_map, p.scan, p.photo) for p in parts]
    assert all(not f or Path(f).parent == folder for part in files for f in part)
    return [(p.name, *(Path(f).name for f in part)) for p, part in zip(parts, files, strict=True)]


def test_files_of_one_stem_are_one_part(folder: Path) -> None:
    parts = discover([folder], recurse=False, photos=False)
    whole = [("a", "a.npz", "a.h5", ""), ("b", "b.npz", "", "b.png"), ("d", "d.SUR", "", "")]
    assert named(folder, parts) == whole
    mixed = discover([folder / "d.SUR", str(folder / "*.npz"), folder / "b.npz", folder / "b.png"])
    assert named(folder, mixed) == [whole[2], ("a", "a.npz", "", ""), whole[1]]
    assert not any(p.problem for p in (*parts, *mixed))


def test_a_photograph_alone_is_a_part(folder: Path) -> None:
    for inputs in ([folder / "c.png"], [str(folder / "c.*")]):
        assert named(folder, discover(inputs)) == [("c", "", "", "c.png")]
    assert [p.name for p in discover([str(folder / "*.png")])] == ["b", "c"]
    assert [p.name for p in discover([folder], recurse=False)] == ["a", "b", "c", "d"]
    without = discover([folder], photos=False)
    assert str(folder / "c.png") in without.passed_over.files
    assert "c" not in [part.name for part in without]
    assert named(folder, discover([folder / "b.png", folder / "b.npz"])) == [("b", "b.npz", "", "b.png")]


def test_the_photograph_beside_a_file_named_is_its_own_where_wanted(folder: Path) -> None:
    for beside in (False, True):
        listing = discover([folder / "b.npz"], beside=beside)
        assert named(folder, listing) == [("b", "b.npz", "", "b.png" if beside else "")]
    assert named(folder, discover([folder / "c.png"], beside=True)) == [("c", "", "", "c.png")]


TREE = {
    "lot/0001.jpg": "0001",
    "lot/2026-11-28/0001.jpg": "2026-11-28/0001",
    "lot/2026-11-28/0002.npz": "2026-11-28/0002",
    "lot/2026-11-28/0002.png": "2026-11-28/0002",
    "lot/2026-11-28/night/0001.jpg": "2026-11-28/night/0001",
    "lot/2026-11-29/0001.jpg": "2026-11-29/0001",
}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name in (*TREE, "lot/.trash/0001.jpg", "elsewhere/0009.jpg", "other/2026-11-28/0001.jpg"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "lot" / "latest").symlink_to("2026-11-29")
    return tmp_path


def test_parts_of_subfolders_are_found_and_have_them_in_their_names(tree: Path) -> None:
    parts = discover([tree / "lot"])
    assert {str(Path(file).relative_to(tree)): p.name for p in parts for file in p.files} == TREE
    skipped = {Path(place).name: why for place, why in parts.passed_over.folders.items()}
    assert skipped == {".trash": "hidden", "latest": "a link"}
    assert parts.passed_over.describe() == "passed over 2 folders: .trash (hidden), latest (a link)"


def test_equal_names_below_two_folders_are_told_apart(tree: Path) -> None:
    parts = discover([tree / "other", tree / "lot"])
    assert len({part.name for part in parts}) == len(parts) == 6
    assert "other/2026-11-28/0001" in [part.name for part in parts]
    # a folder named twice, on its own and below another, gives its parts once
    assert len(discover([tree / "lot", tree / "lot" / "2026-11-28"])) == 5
    assert len(discover([str(tree / "lot" / "*")])) == 6  # a glob names the link, as a shell does
    assert len(discover([str(tree / "lot" / "**" / "*.jpg")])) == 5


def test_a_closed_subfolder_is_named_and_does_not_end_the_run(
    tree: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = os.scandir

    def forbidden(path: str) -> Any:
        if path.endswith("2026-11-29"):
            raise PermissionError(13, "Permission denied", path)
        return listed(path)

    monkeypatch.setattr(os, "scandir", forbidden)
    parts = discover([tree / "lot"])
    assert len(parts) == 4
    assert "2026-11-29 (cannot be listed (Permission denied))" in parts.passed_over.describe()


def test_two_photographs_of_one_stem_trouble_vision_alone(folder: Path) -> None:
    (folder / "b.jpg").write_bytes(b"x")
    (b,) = discover([str(folder / "b.*")])
    assert (b.problem, b.felt) == (None, True)
    assert "b.png" in str(b.photo_problem)
    assert "b.jpg" in str(b.photo_problem)


def test_what_is_no_file_or_an_unknown_one_is_a_part_to_be_refused_later(folder: Path) -> None:
    (folder / "lost.npz").symlink_to("none.npz")
    (folder / "loop.npz").symlink_to("loop.npz")
    assert {"lost", "loop"} < {part.name for part in discover([folder])}
    listing = discover([folder / name for name in ("none.npz", "notes.txt", "lost.npz", "loop.npz")])
    assert named(folder, listing[:2]) == [("none", "none.npz", "", ""), ("notes", "notes.txt", "", "")]
    (long,) = discover(["x" * 5000 + ".npz"])
    assert len(long.name) < 100
    missing, unopened = r"is not there; check the name", r"cannot be opened .*; check the name"
    for part, told in ((listing[2], missing), (listing[3], unopened), (long, unopened)):
        with pytest.raises(FileError, match=told):
            read_height_map(part.height_map)


@pytest.mark.parametrize("inputs", [[], ["*.npz"], ["."]])
def test_nothing_found_is_said(inputs: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(NothingFoundError, match="no height map"):
        discover(inputs)


def test_numbered_photographs_are_of_one_part(tmp_path: Path) -> None:
    names = "a.npz a.light-1.png a.light-2.jpg b.exposure-1.png b.shot-2.png c.light-x.png"
    for name in names.split():
        (tmp_path / name).write_bytes(b"x")
    several = {p.name: [Path(f).name for f in p.photos] for p in discover([tmp_path])}
    b = ["b.exposure-1.png", "b.shot-2.png"]
    assert several == {"a": ["a.light-1.png", "a.light-2.jpg"], "b": b, "c.light-x": ["c.light-x.png"]}
    (beside,) = discover([tmp_path / "a.npz"], beside=True)
    assert len(beside.photos) == 2
    (two,) = discover([tmp_path / name for name in b])
    assert (two.name, two.photos, two.photo_problem) == ("b", tuple(str(tmp_path / n) for n in b), None)


def test_folders_that_are_not_searched_are_named(tree: Path) -> None:
    top = discover([tree / "lot"], recurse=False)
    assert [part.name for part in top] == ["0001"]
    assert top.passed_over.folders.keys() == {
        str(tree / "lot" / name) for name in (".trash", "2026-11-28", "2026-11-29", "latest")
    }
    assert top.passed_over.counts["folder"] == 4
    with pytest.raises(NothingFoundError, match=r"passed over 1 folder: 2026-11-28 \(--no-recurse\)"):
        discover([tree / "other"], recurse=False)


def test_folders_of_the_system_and_hidden_files_are_passed_over_and_named(tmp_path: Path) -> None:
    system = ("$RECYCLE.BIN", "System Volume Information", "@eaDir")
    for name in ("a.png", ".x.jpg", "._P6.jpg", *(f"{folder}/z.png" for folder in system)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    folders = "passed over 3 folders: " + ", ".join(f"{name} (of the system)" for name in sorted(system))
    listing = discover([tmp_path])
    assert [part.name for part in listing] == ["a"]
    assert listing.passed_over.describe() == f"passed over 2 hidden files: ._P6.jpg, .x.jpg; {folders}"
    assert listing.passed_over.counts == {"hidden": 2, "folder": 3}
    # a glob names no hidden file, neither here nor expanded by the shell
    for names in ([tmp_path / "*"], [p for p in sorted(tmp_path.iterdir()) if p.name[0] != "."]):
        globbed = discover([str(name) for name in names])
        assert [part.name for part in globbed] == ["a"]
        assert globbed.passed_over.describe() == folders
    # one that the user names alone is searched
    assert [part.name for part in discover([tmp_path / "@eaDir"])] == ["z"]


def test_a_hidden_file_that_is_named_alone_is_named_as_passed_over(tmp_path: Path) -> None:
    (tmp_path / ".x.jpg").write_bytes(b"x")
    with pytest.raises(NothingFoundError, match=r"passed over 1 hidden file: \.x\.jpg"):
        discover([tmp_path / ".x.jpg"])

"""Which parts files, folders, globs, URLs and manifests mean together."""

from __future__ import annotations

import pickle
import sys
import uuid
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.errors import FileError
from pipeline.errors import is_url, without_secrets
from pipeline.formats.find_parts import NothingFoundError, list_parts
from pipeline.formats.names import harmless_name, split_name
from pipeline.formats.part_files import PartFiles, named_apart

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


@pytest.mark.parametrize("photos", [False, True])
@pytest.mark.parametrize(
    "inputs", [["{}"], ["{}/"], ["{}/*"], ["{}/*.png"], ["{}/a.npz", "{}/deeper"], ["{}/b.png", "{}/b.npz"]]
)
def test_a_store_is_listed_as_a_folder_is(folder: Path, store: str, inputs: list[str], photos: bool) -> None:
    here = list_parts([i.format(folder) for i in inputs], photos=photos)
    there = list_parts([i.format(store) for i in inputs], photos=photos)
    told = [(p.name, p.files) for p in here]
    assert told == [
        (
            p.name.replace(store.rpartition("/")[2], folder.name),
            tuple(f.replace(store, str(folder)) for f in p.files),
        )
        for p in there
    ]
    assert told


def test_a_file_named_by_a_url_is_not_asked_after() -> None:
    # no such host: names of known kinds are parts without anyone being asked
    names = [
        "https://host.invalid/a.npz?signature=x.y",
        "s3://b/b.h5",
        "gs://b/b.png",
        "https://host.invalid/c",
    ]
    parts = list_parts(names)
    assert [(p.name, p.files) for p in parts] == [
        ("a", (names[0],)),
        ("s3/b/b", (names[1],)),
        ("gs/b/b", (names[2],)),
        ("c", (names[3],)),
    ]


def test_two_maps_of_one_stem_are_a_problem_in_a_store_too(store: str) -> None:
    import fsspec

    with fsspec.open(f"{store}/a.x3p", "wb") as stream:
        stream.write(b"x")
    a = list_parts([store])[0]
    assert str(a.problem).startswith(f"{store}/a.x3p: stands beside a.npz")
    assert str(pickle.loads(pickle.dumps(a)).problem) == str(a.problem)


def test_what_cannot_be_listed_is_told_before_the_run(store: str, folder: Path) -> None:
    with pytest.raises(FileError, match=rf"^{store}/none: is not there; check the name"):
        list_parts([str(folder), f"{store}/none"])
    with pytest.raises(NothingFoundError, match="no height map"):
        list_parts([f"{store}/none*"])
    with pytest.raises(FileError, match=r"^zip://a::s3://b/c.zip: is of a kind that is not read"):
        list_parts(["zip://a::s3://b/c.zip"])


def test_manifests_stand_where_they_are_named(folder: Path) -> None:
    (folder / "lot.csv").write_text("part,height_map,expected\nA,a.npz,KB\nB,s3://lots/b.npz,\n")
    (folder / "more.tsv").write_text("scan\tphoto\na.h5\tb.png\n")
    inputs = [str(folder / "d.SUR"), str(folder / "lot.csv"), str(folder / "b.npz")]
    parts = list_parts(inputs, manifests=[str(folder / "more.tsv")])
    assert [p.name for p in parts] == ["d", "A", "B", "b", "a"]
    assert parts[1].expected == "KB"
    assert parts[4].files == (str(folder / "a.h5"), str(folder / "b.png"))


def test_one_part_found_and_told_stands_once_and_says_all(folder: Path) -> None:
    (folder / "lot.csv").write_text("height_map,expected\nb.npz,KB\n")
    (folder / "also.csv").write_text("height_map,part\nb.npz,other\n")
    for inputs in ([folder / "b.npz", folder / "lot.csv"], [folder / "lot.csv"] * 2 + [folder / "b.npz"]):
        (b,) = list_parts([str(i) for i in inputs])
        assert (b.name, b.expected) == ("b", "KB")
    # under another name it is another part
    assert len(list_parts([str(folder / "lot.csv"), str(folder / "also.csv")])) == 2


def test_names_of_all_sources_are_made_apart(folder: Path, store: str) -> None:
    (folder / "lot.csv").write_text(
        f"part,height_map\na,deeper/other.npz\nx,{store}/a.npz\n", encoding="utf-8"
    )
    (folder / "same.csv").write_text("part,height_map\na,deeper/third.npz\n")
    parts = list_parts([str(folder), f"{store}/deeper", str(folder / "lot.csv"), str(folder / "same.csv")])
    names = [p.name for p in parts]
    assert len(set(names)) == len(names)
    assert names == [
        f"{folder.name}/a",
        "b",
        "d",
        f"{store[9:]}/deeper/a",
        f"{'/'.join(folder.parts[1:])}/deeper/a",
        "x",
        f"{'/'.join(folder.parts[1:])}/deeper/a (2)",
    ]


_STEMS = st.sampled_from(["a", "b", "a (2)", "x/a", "lot/a"])
_FOLDERS = st.sampled_from(["", "/", "lot", "x/lot", "/x/lot", "y/lot", "s3://x/lot", "gs://x/lot"])


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(_FOLDERS, _STEMS), max_size=12))
def test_names_made_apart_are_unique_and_end_as_they_were(found: list[tuple[str, str]]) -> None:
    parts = [
        PartFiles(stem, f"{folder}/{number}.npz" if folder else f"{number}.npz")
        for number, (folder, stem) in enumerate(found)
    ]
    apart = named_apart(parts)
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
    assert named_apart(apart) == apart


def test_what_a_name_says() -> None:
    assert is_url("S3://bucket/key")
    assert is_url("simplecache::s3://bucket/key")
    assert not any(map(is_url, ("a.npz", "/a//b.npz", "C:\\a.npz", "a::b.npz", "://x", "x:/y", "ü://x")))
    assert split_name("s3://bucket/lot/a.npz") == ("s3://bucket/lot", "a.npz")
    assert split_name("s3://bucket") == ("s3://", "bucket")
    assert split_name("https://h/lot/a.npz?list=/x/y.csv#z") == ("https://h/lot", "a.npz")
    assert split_name("s3://b/lot?/a#.npz") == ("s3://b/lot?", "a#.npz")
    assert split_name("/a.npz") == ("/", "a.npz")
    assert without_secrets("https://me:secret@h/a.npz?X-Signature=secret") == "https://***@h/a.npz"
    assert without_secrets("abfs://box@account/a?b") == "abfs://box@account/a?b"
    with pytest.raises(ValueError, match="without a name"):
        PartFiles("")


@settings(deadline=None)
@given(st.text(max_size=300))
def test_no_name_leads_out_of_its_folder(name: str) -> None:
    harmless = harmless_name(name)
    place = Path("/folder") / harmless
    assert place.parent == Path("/folder")
    assert place.name == harmless
    assert harmless not in ("", ".", "..")
    assert len(harmless.encode()) < 200


def test_a_part_is_words_alone_and_small() -> None:
    part = PartFiles("a", "/maps/a.npz")
    assert pickle.loads(pickle.dumps(part)) == part
    assert not hasattr(part, "__dict__")
    # header, and a word for each of nine fields: a million parts are a hundred megabytes and their names
    assert sys.getsizeof(part) <= 112


def test_tables_of_texts_among_the_files_of_a_folder_are_passed_over(tmp_path: Path) -> None:
    """`read lot/*`: the shell names the truth and an earlier table, too."""
    for name, head in (("truth.csv", "part,text"), ("rows.csv", "part,text,decision")):
        (tmp_path / name).write_text(f"{head}\na,AB12\n")
    (tmp_path / "a.npz").write_bytes(b"x")
    assert [p.name for p in list_parts([str(p) for p in sorted(tmp_path.iterdir())])] == ["a"]
    with pytest.raises(FileError, match="must name one of"):
        list_parts([str(tmp_path / "truth.csv")])

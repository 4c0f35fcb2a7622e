"""Files named by URLs: of a store in memory, a server that speaks S3, and web servers in good order and in bad."""

from __future__ import annotations

import contextlib
import http.server
import pickle
import resource
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import Mock

import pytest

from glyphs.errors import FileError, MissingExtraError
from pipeline.formats import remote
from pipeline.formats.find_parts import discover
from pipeline.formats.kinds import MOST_BYTES
from pipeline.formats.part_files import PartFiles
from pipeline.formats.remote import list_remote, local_copies, local_copy
from pipeline.formats.touch_file import read_height_map
from pipeline.reading.part_reader import load_photos, senses_of

if TYPE_CHECKING:
    from moto.server import ThreadedMotoServer

BOUND_S = 60.0
"""No fault of the network may keep a part busy longer; with the silence allowed cut down to SILENCE_S."""
SILENCE_S = 0.5


@pytest.fixture(autouse=True)
def copies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where copies go; nothing of them is left, whatever a test did."""
    folder = tmp_path / "copies"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


def read(url: str, **more: Any) -> bytes:
    with local_copies(PartFiles("part", height_map=url), **more) as part:
        return Path(part.height_map).read_bytes()


def refused(url: str, told: str) -> FileError:
    """The problem of a URL, which comes in time and names it."""
    began_s = time.monotonic()
    with pytest.raises(FileError, match=told) as caught:
        read(url)
    assert time.monotonic() - began_s < BOUND_S
    assert str(caught.value).startswith(f"{url}: ")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    return caught.value


# -------------------------------------------------------------------------------------------- a store in memory


@pytest.fixture
def memory() -> Callable[[str, bytes], str]:
    """Puts a file into the store, and gives its URL."""
    import fsspec

    store = fsspec.filesystem("memory")

    def put(name: str, data: bytes) -> str:
        store.pipe_file(f"/{name}", data)
        return f"memory://{name}"

    return put


def test_local_files_are_read_where_they_are(tmp_path: Path) -> None:
    (tmp_path / "a b%20.npz").write_bytes(b"x")
    for name in (f"{tmp_path}/a b%20.npz", f"file://{tmp_path}/a b%20.npz"):
        with local_copies(PartFiles("part", height_map=name, photos=("b.png",))) as part:
            assert part == PartFiles("part", height_map=f"{tmp_path}/a b%20.npz", photos=("b.png",))
    with pytest.raises(FileError, match="is not there"), local_copies(PartFiles("p", "none.npz")) as part:
        read_height_map(part.height_map)


def test_a_problem_of_a_copy_is_one_of_its_url(memory: Callable[[str, bytes], str]) -> None:
    listed = PartFiles("part", height_map=memory("lot/bad.npz", b"no map"))
    with pytest.raises(FileError, match=r"^memory://lot/bad.npz: ") as caught, local_copies(listed) as part:
        read_height_map(part.height_map)
    assert tempfile.gettempdir() not in str(caught.value)
    with pytest.raises(FileError, match=r"^other.npz: is odd") as caught_too, local_copies(listed):
        raise FileError("other.npz", "is odd", "correct it")
    assert caught_too.value.__cause__ is None
    with pytest.raises(KeyError), local_copies(listed):
        raise KeyError("a fault of the program stays one")


def test_a_photograph_that_does_not_come_troubles_vision_alone(memory: Callable[[str, bytes], str]) -> None:
    listed = PartFiles("part", height_map=memory("lot/a.npz", b"x"), photos=("memory://lot/none.png",))
    with local_copies(listed) as part:
        assert part.photo_problem is not None
        assert str(part.photo_problem) == "memory://lot/none.png: is not there; check the name"
        assert senses_of(part, "auto") == (True, True)
        with pytest.raises(FileError, match=r"^memory://lot/none.png: is not there"):
            load_photos(part)
    with local_copies(listed, photos=False) as part:
        assert (part.photo, part.photo_problem) == ("", None)
    alone = PartFiles("part", photos=("memory://lot/none.png",))
    with (
        pytest.raises(FileError, match=r"^memory://lot/none.png: is not there"),
        local_copies(alone, photos=False),
    ):
        pass


@pytest.mark.parametrize(
    "name", ["lot/..", "lot/.npz", "lot/..\\..\\x.npz", "lot/~/a\nb\x00c.npz", "lot/" + "ü" * 400]
)
def test_no_object_name_leads_out_of_the_folder(
    name: str, copies: Path, memory: Callable[[str, bytes], str]
) -> None:
    with contextlib.suppress(FileError), local_copy(memory(name, b"x"), most_bytes=10) as path:
        assert path.resolve().parent.parent == copies.resolve()
        assert path.read_bytes() == b"x"


def test_what_is_too_long_is_not_copied(
    memory: Callable[[str, bytes], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(MOST_BYTES, "height_map", 1000)
    assert len(read(memory("lot/a.npz", bytes(1000)))) == 1000
    from fsspec.implementations.memory import MemoryFileSystem

    monkeypatch.setattr(MemoryFileSystem, "get_file", Mock(side_effect=AssertionError("it is copied")))
    refused(memory("lot/b.npz", bytes(1001)), r"is 0\.0 GB long, over the limit of 0\.0 GB; crop it")


def test_a_full_disk_is_told_as_one(memory: Callable[[str, bytes], str]) -> None:
    url = memory("lot/a.npz", bytes(100_000))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        refused(url, "cannot be copied .*; make room in the folder that TMPDIR names")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize(
    "url",
    [
        "zip://a.npz::s3://lots/a.zip",
        "simplecache::s3://lots/a.npz",
        "reference://a",
        "github://o/r/a.npz",
        "odd://a",
    ],
)
def test_chains_and_odd_kinds_are_refused(url: str) -> None:
    refused(url, "has an unsupported scheme; name one of abfs, .* s3")
    with pytest.raises(FileError, match="has an unsupported scheme"):
        list_remote(url, recurse=True)


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "fsspec", None)
        with pytest.raises(MissingExtraError, match=r"needs fsspec; .*tactile-marks\[cluster\]"):
            read("memory://a")
    monkeypatch.setattr("fsspec.get_filesystem_class", Mock(side_effect=ImportError))
    with pytest.raises(MissingExtraError, match=r"needs gcsfs; .*tactile-marks\[gs\]"):
        read("gs://b/a")


# ----------------------------------------------------------------------------------------- a server that speaks S3


@pytest.fixture(scope="module")
def server() -> Iterator[ThreadedMotoServer]:
    """A server of buckets on a free port of this machine."""
    from moto.server import ThreadedMotoServer

    started = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    started.start()
    yield started
    started.stop()


def forget() -> None:
    """The file systems that fsspec keeps open, with their credentials."""
    from s3fs import S3FileSystem

    S3FileSystem.clear_instance_cache()


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[str], None]]:
    """Credentials in the environment and nowhere else; gives what points them to another server."""
    forget()
    for name in ("AWS_PROFILE", "AWS_SESSION_TOKEN"):
        monkeypatch.delenv(name, raising=False)
    none = str(tmp_path / "none")
    known = {"CONFIG_FILE": none, "SHARED_CREDENTIALS_FILE": none, "EC2_METADATA_DISABLED": "true"}
    known |= {"ACCESS_KEY_ID": "tester", "SECRET_ACCESS_KEY": "secret", "DEFAULT_REGION": "us-east-1"}
    for name, value in known.items():
        monkeypatch.setenv(f"AWS_{name}", value)

    def point(url: str) -> None:
        forget()
        monkeypatch.setenv("AWS_ENDPOINT_URL", url)

    yield point
    forget()


OBJECTS = {
    "lot/a.npz": b"map a",
    "lot/a.png": b"photo a",
    "lot/b.npz": b"map b",
    "lot/deeper/c.npz": b"map c",
    "lot/we::ird [1] #?ü.npz": b"odd",
    "lot/notes.txt": b"notes",
    "lot/empty/": b"",
    "lot/list.csv": b"part,height_map,photo\nA,a.npz,a.png\nC,deeper/c.npz,\nD,s3://lots/lot/none.npz,\n",
}


@pytest.fixture
def bucket(server: ThreadedMotoServer, s3: Callable[[str], None]) -> str:
    """A bucket with a lot in it."""
    import boto3

    host, port = server.get_host_and_port()
    s3(f"http://{host}:{port}")
    client = boto3.client("s3")
    client.create_bucket(Bucket="lots")
    for key, data in OBJECTS.items():
        client.put_object(Bucket="lots", Key=key, Body=data)
    return "s3://lots"


def test_buckets_are_listed(bucket: str) -> None:
    lot = f"{bucket}/lot"
    top = [f"{bucket}/{key}" for key in sorted(OBJECTS) if key.count("/") == 1]
    below = [f"{lot}/deeper/c.npz"]
    folders = dict.fromkeys((f"{lot}/deeper", f"{lot}/empty"), "--no-recurse")
    for place in (lot, f"{lot}/"):
        assert list_remote(place, recurse=True) == ([(lot, top + below)], {})
        assert list_remote(place, recurse=False) == ([(lot, top)], folders)
    assert list_remote(f"{lot}/?.npz", recurse=True) == ([("", [f"{lot}/a.npz", f"{lot}/b.npz"])], {})
    deep = sorted(f"{bucket}/{k}" for k in OBJECTS if k.endswith("npz"))
    assert list_remote(f"{lot}/**/*.npz", recurse=True) == ([("", deep)], {})
    assert list_remote(f"{lot}/notes.txt", recurse=True)[0] == [(f"{lot}/notes.txt", [f"{lot}/notes.txt"])]
    assert list_remote(f"{lot}/z*", recurse=True) == ([("", [])], {})
    for missing in (f"{bucket}/none", "s3://nowhere/lot"):
        with pytest.raises(FileError, match=rf"^{missing}: is not there; check the name"):
            list_remote(missing, recurse=True)


def test_every_object_listed_is_fetched(bucket: str) -> None:
    parts = discover([f"{bucket}/lot"])
    assert [p.name for p in parts] == ["a", "b", "we::ird [1] #?ü", "deeper/c"]
    for part in parts:
        with local_copies(part) as local:
            for name, copy in zip(part.files, local.files, strict=True):
                assert Path(copy).read_bytes() == OBJECTS[name.removeprefix("s3://lots/")]


def test_without_credentials(bucket: str, monkeypatch: pytest.MonkeyPatch) -> None:
    forget()
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    refused(f"{bucket}/lot/a.npz", "may not be read .*NoCredentials.*; check the credentials")
    with pytest.raises(FileError, match="may not be read"):
        list_remote(bucket, recurse=True)


def test_a_server_that_is_gone(s3: Callable[[str], None]) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    s3(f"http://127.0.0.1:{port}")
    problem = refused("s3://lots/a.npz", "cannot be fetched .*check the network, the endpoint")
    assert str(port) in problem.what
    with pytest.raises(FileError, match="cannot be fetched"):
        list_remote("s3://lots/lot", recurse=True)


def test_a_server_that_says_nothing(s3: Callable[[str], None], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remote, "_SILENCE_S", SILENCE_S)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen(64)  # connections are taken, and never answered
        s3(f"http://127.0.0.1:{silent.getsockname()[1]}")
        refused("s3://lots/a.npz", "cannot be fetched .*Timeout")
        refused(f"http://127.0.0.1:{silent.getsockname()[1]}/a.npz", "cannot be fetched .*[Tt]imeout")


# ---------------------------------------------------------------------------------------------------- a web server


class _Quiet(http.server.BaseHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Nothing is logged."""

    def head(self, status: int, **headers: str) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()

    def do_HEAD(self) -> None:
        self.do_GET()

    def do_GET(self) -> None:
        raise NotImplementedError


class _Signed(_Quiet):
    """As stores do with addresses that are signed for GET alone."""

    def do_HEAD(self) -> None:
        self.head(403, Content_Length="0")

    def do_GET(self) -> None:
        if self.path != "/lot/a.npz?X-Signature=secret":
            self.head(403, Content_Length="0")
            return
        self.head(200, Content_Length="5")
        self.wfile.write(b"map a")


def _sending(length: int | None, data: bytes, *, endless: bool = False, pause_s: float = 0.0) -> type[_Quiet]:
    """A server that says how long a file is, or does not, and sends other data."""

    class Sending(_Quiet):
        def do_GET(self) -> None:
            self.head(200, **({} if length is None else {"Content_Length": str(length)}))
            with contextlib.suppress(OSError):
                for _ in range(10**6 if endless else 1) if self.command == "GET" else ():
                    self.wfile.write(data)
                    time.sleep(pause_s)

    return Sending


@contextlib.contextmanager
def serving(handler: Any) -> Iterator[str]:
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


def test_a_web_server(tmp_path: Path) -> None:
    lot = tmp_path / "lot"
    (lot / "deeper").mkdir(parents=True)
    for name in ("a.npz", "b.npz", "b.png", "notes.txt"):
        (lot / name).write_bytes(name.encode())

    class Folder(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args, directory=str(tmp_path))

        def log_message(self, *_: object) -> None:
            """Nothing is logged."""

    with serving(Folder) as url:
        parts = discover([f"{url}/lot/"])
        assert [(p.name, p.files) for p in parts] == [
            ("a", (f"{url}/lot/a.npz",)),
            ("b", (f"{url}/lot/b.npz", f"{url}/lot/b.png")),
        ]
        assert parts.passed_over.folders == {f"{url}/lot/deeper": "a folder of a web server"}
        assert [p.name for p in discover([f"{url}/lot/*.npz"])] == ["a", "b"]
        assert read(parts[0].height_map) == b"a.npz"
        refused(f"{url}/lot/none.npz", "is not there; check the name")


def test_a_signed_address_is_fetched_and_not_told() -> None:
    with serving(_Signed) as url:
        listed = PartFiles("a", f"{url}/lot/a.npz?X-Signature=secret")
        with local_copies(listed) as part:
            assert Path(part.height_map).name == "a.npz"
            assert Path(part.height_map).read_bytes() == b"map a"
        with pytest.raises(FileError) as caught:
            read(f"{url}/lot/a.npz?X-Signature=secretly")
        assert "secret" not in str(caught.value)
        assert "may not be read" in caught.value.what


@pytest.mark.parametrize(
    ("handler", "told"),
    [
        pytest.param(
            _sending(None, bytes(100_000), endless=True), "over the limit of 0.0 GB; crop it", id="endless"
        ),
        pytest.param(_sending(100, b"map a"), "cannot be fetched .*check the network", id="cut short"),
        pytest.param(
            _sending(100_000, b"x", endless=True, pause_s=0.05), "is sent too slowly; check", id="dripping"
        ),
    ],
)
def test_a_server_that_sends_badly_is_given_up(
    handler: type[_Quiet], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(MOST_BYTES, "height_map", 20_000_000)
    if "slowly" in told:  # a busy machine may be as slow as this limit
        monkeypatch.setattr(remote, "_START_S", 0.5)
    with serving(handler) as url:
        refused(f"{url}/a.npz", told)

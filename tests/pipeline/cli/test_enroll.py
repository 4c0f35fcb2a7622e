from dataclasses import replace
from datetime import UTC, datetime
from functools import cache

import matplotlib
import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.cli.main import main
from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartState, ReviewAction
from pipeline.common.settings import ReadSettings
from pipeline.formats.glyph_database import load_database
from pipeline.formats.npz import write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.reading.enrolment import MOST_EXEMPLARS, enrol
from pipeline.reading.enrolment_check import check_held_out
from pipeline.reading.readers import open_reader
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.settings import ReaderSettings

pytestmark = pytest.mark.usefixtures("inline")
FOREIGN = f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans-Bold.ttf"
SPEC = SynthSpec(format="9999", font=FOREIGN, seed=5)
SETTINGS = ReadSettings(font=("gothic",), height_mm=5.0)
WHEN = datetime(2026, 3, 1, 8, 30, tzinfo=UTC)


@cache
def stamped(number):
    return make_part(SPEC, number)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Parts of an unknown die, and the table of what a person says of them."""
    path = tmp_path_factory.mktemp("reviewed")
    lines = ["part,text"]
    for k in range(8):
        part = stamped(k)
        write_npz(path / f"part-{k}.npz", part.height_map)
        lines.append(f"part-{k},{part.text}")
    (path / "truth.csv").write_text("\n".join(lines) + "\n")
    return path


def reviewed(folder, *numbers, text=None):
    return [
        PartFiles(f"part-{k}", str(folder / f"part-{k}.npz"), expected=text or stamped(k).text)
        for k in numbers
    ]


@pytest.fixture(scope="module")
def taught(folder, tmp_path_factory):
    """A database that eight parts were enrolled into, and the report."""
    path = tmp_path_factory.mktemp("database") / "press.glyphs"
    report = enrol(reviewed(folder, *range(8)), path, font="press-7", settings=SETTINGS, now=WHEN)
    return path, report


def test_an_unknown_die_is_accepted_once_it_was_enrolled(taught):
    """A part that was not enrolled; before that by templates, for the network reads any font."""
    path, _ = taught
    part, fonts = stamped(1004), tuple(load_database(path).fonts.values())
    settings_of_reader = ReaderSettings(
        format="9999",
        height_mm=5.0,
        orientation=Orientation.UPRIGHT,
    )
    before = Reader(settings_of_reader, fonts=("gothic",), experts=("templates",)).read(part.height_map)
    after = Reader(settings_of_reader, fonts=fonts).read(part.height_map)
    assert before.decision in ("review", "reject")
    assert (after.text, after.decision, after.font) == (part.text, "accept", "press-7")


def test_parts_held_out_show_whether_the_font_helps(taught, folder):
    path, _ = taught
    parts = reviewed(folder, *range(2))
    settings = SETTINGS.model_copy(update={"format": ("9999",), "orientation": "upright"})
    assert check_held_out(parts, path, font="press-7", settings=settings) is None
    held_out = check_held_out(parts, path, font="press-7", settings=settings, fewest_parts=2)
    assert (held_out.parts, held_out.characters) == (2, 8)
    assert held_out.edits <= 8
    assert "warning" not in replace(held_out, edits=1, edits_without=1).describe()
    assert "warning: reading is worse" in replace(held_out, edits=2, edits_without=1).describe()


def test_the_database_holds_exemplars_and_where_they_are_from(taught):
    database = load_database(taught[0])
    assert list(database.fonts) == ["gothic", "press-7"]
    assert database.fonts["press-7"].learned
    assert not database.fonts["gothic"].learned
    first, text = database.exemplars[0], stamped(0).text
    assert (first.char, first.font_name, first.part, first.note) == (text[0], "press-7", "part-0", text)
    assert [e.place for e in database.exemplars if e.part == "part-0"] == [1, 2, 3, 4]
    assert first.enrolled_at == WHEN.isoformat(timespec="seconds")
    assert first.height_mm == pytest.approx(5.0, rel=0.05)
    assert len(first.evidence) == 64


def test_the_same_part_twice_is_enrolled_once(taught, folder):
    path, _ = taught
    before = path.read_bytes()
    # a copy under another name is the same evidence
    copy = path.parent / "copy.npz"
    copy.write_bytes((folder / "part-0.npz").read_bytes())
    renamed = PartFiles("other", str(copy), expected=stamped(0).text)
    again = enrol([*reviewed(folder, 0, 3), renamed], path, font="press-7", settings=SETTINGS)
    assert again.known == ("part-0", "part-3", "other")
    assert again.enrolled == ()
    assert path.read_bytes() == before


def test_a_part_reviewed_anew_replaces_what_it_taught(folder, tmp_path):
    path = tmp_path / "press.glyphs"
    right = stamped(1).text
    wrong = right[:-1] + ("8" if right[-1] != "8" else "3")
    enrol(reviewed(folder, 1, text=wrong), path, font="press-7", settings=SETTINGS)
    report = enrol(reviewed(folder, 1), path, font="press-7", settings=SETTINGS)
    assert report.enrolled == (("part-1", right),)
    assert [e.char for e in load_database(path).exemplars] == list(right)


def test_the_order_of_enrolment_does_not_matter(folder, tmp_path):
    one_file, two = tmp_path / "one.glyphs", tmp_path / "two.glyphs"
    enrol(reviewed(folder, 0, 1), one_file, font="press-7", settings=SETTINGS, now=WHEN)
    for k in (0, 1):
        enrol(reviewed(folder, k), two, font="press-7", settings=SETTINGS, now=WHEN)
    first, second = (load_database(p).fonts["press-7"] for p in (one_file, two))
    felt = [c for c in "0123456789" if not first.glyphs[c].guessed]
    assert felt == [c for c in "0123456789" if not second.glyphs[c].guessed]
    for char in felt:
        # the second part is found by the shapes of the first: places differ by less than a pixel
        assert np.abs(first.glyphs[char].relief - second.glyphs[char].relief).mean() < 0.002


def test_what_cannot_be_enrolled_is_refused_and_the_rest_is_taken(folder, tmp_path):
    flat = tmp_path / "flat.npz"
    write_npz(flat, HeightMap(np.zeros((200, 400), dtype=np.float32), 0.05))
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(b"PK\x03\x04 nothing")
    parts = [
        PartFiles("flat", str(flat), expected="1234"),
        PartFiles("damaged", str(damaged), expected="1234"),
        PartFiles("gone", str(tmp_path / "gone.npz"), expected="1234"),
        PartFiles("photo only", expected="1234"),
        PartFiles("no text", str(folder / "part-0.npz"), expected=" "),
        PartFiles("another text", str(folder / "part-0.npz"), expected="MWMWMWMWMWMW"),
        *reviewed(folder, 0),
    ]
    report = enrol(parts, tmp_path / "press.glyphs", font="press-7", settings=SETTINGS)
    assert [r.part for r in report.refused] == [p.name for p in parts[:-1]]
    assert all(r.why for r in report.refused)
    assert report.enrolled == (("part-0", parts[-1].expected),)


def test_nothing_taken_leaves_no_database(tmp_path):
    path = tmp_path / "press.glyphs"
    report = enrol([PartFiles("photo only", expected="1234")], path, font="press-7", settings=SETTINGS)
    assert report.enrolled == ()
    assert not path.exists()


def test_a_font_that_was_not_learned_is_not_overwritten(taught, folder):
    with pytest.raises(FileError, match=r"font of its own.*gothic-worn"):
        enrol(reviewed(folder, 0), taught[0], font="gothic", settings=SETTINGS)


def test_of_many_exemplars_the_last_are_kept(taught):
    from pipeline.reading.enrolment import _youngest

    exemplar = load_database(taught[0]).exemplars[0]
    many = [exemplar] * (MOST_EXEMPLARS + 5)
    assert len(_youngest(many, "press-7")) == MOST_EXEMPLARS
    assert len(_youngest(many, "another")) == len(many)


def test_the_fonts_of_a_database_are_compared_with_what_is_felt(taught):
    reader = open_reader(ReadSettings(database=taught[0]))
    assert [f.name for f in reader.touch.fonts.fonts] == ["gothic", "press-7"]
    assert reader.touch.fonts.named


def test_the_command_takes_a_table(folder, tmp_path, capsys):
    path, config = tmp_path / "press.glyphs", tmp_path / "c.toml"
    config.write_text('font = ["gothic"]\nheight_mm = 5.0\n')
    parts = folder / "part-2.npz"
    arguments = ("--font", "press-7", "--truth", folder / "truth.csv", "--config", config)
    assert main(["enroll", *map(str, (parts, "--database", path, *arguments))]) == 0
    shown = capsys.readouterr().out
    assert "press-7: 4 characters of 1 parts enrolled" in shown
    assert "held out: too few parts" in shown
    assert path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert "press-7" in load_database(path).fonts


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((), "name parts with --truth"),
        (("x",), "give --truth"),
        (("x", "--from-store"), "name parts with --truth"),
        (("--from-store", "--since=-1"), "Must be > 0"),
    ],
)
def test_the_command_refuses(given, message, tmp_path, capsys):
    assert main(["enroll", *given, "--database", str(tmp_path / "d.glyphs"), "--font", "press-7"]) == 2
    assert message in capsys.readouterr().err


def reviewed_store(folder, root, *, actions):
    """A service's store with a part an action, its evidence kept under hashes; the parts' ids."""
    files = EvidenceFolder(root / "evidence")
    store = Store.open(f"sqlite:///{root / 'store.db'}")
    ids = []
    for k, action in enumerate(actions):
        copy = files.incoming / f"upload-{k}"
        copy.write_bytes((folder / f"part-{k}.npz").read_bytes())
        sha256, n_bytes = files.keep(copy)
        record = EvidenceRecord(EvidenceKind.HEIGHT_MAP, sha256, n_bytes, name=f"../p{k}.npz")
        ids.append(new_part_id())
        read = ReadingRecord("tactile", "0000", "review", 0.5)
        evidence = [record] if k != 3 else []
        store.add_part(part_id=ids[-1], name="", state=PartState.REVIEW, readings=[read], evidence=evidence)
        if action is not None:
            store.review(ids[-1], action=action, text=stamped(k).text, person=Person("Ann"))
    store.close()
    return ids


def test_the_command_takes_reviewed_parts_of_the_store(folder, tmp_path, monkeypatch, capsys):
    """Corrected ones alone: neither those that nobody looked at, nor unreadable ones, nor those never felt."""
    service = tmp_path / "service"
    service.mkdir()
    correct, unreadable = ReviewAction.CORRECT, ReviewAction.UNREADABLE
    ids = reviewed_store(folder, service, actions=[correct, unreadable, None, correct])
    config = tmp_path / "c.toml"
    config.write_text(f'font = ["gothic"]\nheight_mm = 5.0\n[service]\nfolder = "{service}"\n')
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "press.glyphs"
    arguments = ("--font", "press-7", "--from-store", "--since", "1", "--config", str(config))
    assert main(["enroll", "--database", str(path), *arguments]) == 0
    printed = capsys.readouterr().out
    assert "4 characters of 1 parts enrolled" in printed
    assert "1 reviewed parts left out" in printed
    assert [e.part for e in load_database(path).exemplars] == [ids[0]] * 4
    store = Store.open(f"sqlite:///{service / 'store.db'}")
    enrolled = [e for e in store.story(ids[0]).events if e.kind == "enrolled"]
    store.close()
    assert [dict(e.data) for e in enrolled] == [{"font": "press-7", "characters": stamped(0).text}]

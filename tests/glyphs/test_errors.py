from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from glyphs.errors import FileError, MarksError, MissingExtraError, report_damage
from glyphs.surface.maps import MapError


def test_an_error_is_one_line_of_where_what_and_hint() -> None:
    assert (
        str(MarksError("is empty", where="a.npz", hint="record it again"))
        == "a.npz: is empty; record it again"
    )
    assert str(MarksError("a line\nbroken")) == "a line broken"


@pytest.mark.parametrize(
    "error",
    [
        MarksError("is empty", where="a.npz", hint="record it again"),
        FileError("a.npz", "is empty", "record it again"),
        MissingExtraError("MQTT", "paho-mqtt", "mqtt"),
    ],
)
def test_an_error_comes_back_whole_from_another_process(error: MarksError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert vars(again) == vars(error)
    assert str(again) == str(error)


def test_whatever_a_parser_trips_over_names_the_file_and_keeps_the_hint(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    says = r"a\.npz: is damaged or not a \.npz file \(KeyError: 'z'\); copy"
    with pytest.raises(FileError, match=says), report_damage(path, kind=".npz"):
        raise KeyError("z")
    says = r"a\.npz: heights contain infinities; mark bad points as NaN"
    with pytest.raises(FileError, match=says), report_damage(path, kind=".npz"):
        raise MapError("heights contain infinities", hint="mark bad points as NaN")

"""The mode of several lights: the same part from the same place, its photographs read as one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from glyphs.errors import MarksError
from pipeline.benchmark.readers.mode import PartReadings
from pipeline.benchmark.readers.modes import open_mode
from recognition.reader import Reader
from recognition.senses.settings import ReaderSettings
from tests.factories import designed_parts


def test_four_lights_are_read_as_one_and_the_camera_alone_reads_one() -> None:
    parts = designed_parts(parts=1)
    item = parts.items()[0]
    specimen, reader = parts.make(item), Reader(ReaderSettings(format=item.condition.format))
    senses = PartReadings(specimen, reader)
    several, one = (open_mode(name, reader).read(senses)[0] for name in ("lights", "vision"))
    assert (several.photos, one.photos) == (4, 1)
    assert several.text == one.text == specimen.truth
    # what other modes take is not charged to it
    assert {"photographs", "lights", "photograph", "vision"} == senses.seconds.keys()
    folder = PartReadings(replace(specimen, take_lights=None), reader)
    with pytest.raises(MarksError, match="no photographs under several lights"):
        open_mode("lights", reader).read(folder)

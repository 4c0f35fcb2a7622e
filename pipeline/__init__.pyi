from .benchmark.exam.design import Design, design_named
from .benchmark.exam.designed_parts import DesignedParts
from .benchmark.readers.own_reader import Answer, ExamPart
from .benchmark.trials.run import Benchmark, run_benchmark
from .common.reading_records import (
    CandidateRecord,
    CharacterRecord,
    ReadingRecord,
    ReasonRecord,
    RivalRecord,
)
from .common.settings import MapSettings, ReadSettings, SettingsError
from .formats.find_parts import NothingFoundError, discover
from .formats.glyph_database import (
    Exemplar,
    GlyphDatabase,
    load_database,
    save_database,
)
from .formats.npz import write_npz
from .formats.part_files import PartFiles
from .formats.photos import read_photo, write_photo
from .formats.touch_file import read_height_map, read_scan
from .reading.as_record import reading_record
from .reading.part_job import read
from .reading.part_reader import PartReader

__all__ = [
    "Answer",
    "Benchmark",
    "CandidateRecord",
    "CharacterRecord",
    "Design",
    "DesignedParts",
    "ExamPart",
    "Exemplar",
    "GlyphDatabase",
    "MapSettings",
    "NothingFoundError",
    "PartFiles",
    "PartReader",
    "ReadSettings",
    "ReadingRecord",
    "ReasonRecord",
    "RivalRecord",
    "SettingsError",
    "design_named",
    "discover",
    "load_database",
    "read",
    "read_height_map",
    "read_photo",
    "read_scan",
    "reading_record",
    "run_benchmark",
    "save_database",
    "write_npz",
    "write_photo",
]

from .common.records import CandidateRecord, CharacterRecord, ReadingRecord, RivalRecord
from .common.row import Row
from .common.settings import ReadSettings, SettingsError
from .files.parts import Part, discover
from .files.photos import read_photo, write_photo
from .files.touch_file import read_height_map, read_scan
from .reading.any_files import read
from .reading.as_record import reading_record
from .reading.part_reader import Mode, PartReader

__all__ = [
    "CandidateRecord",
    "CharacterRecord",
    "Mode",
    "Part",
    "PartReader",
    "ReadSettings",
    "ReadingRecord",
    "RivalRecord",
    "Row",
    "SettingsError",
    "discover",
    "read",
    "read_height_map",
    "read_photo",
    "read_scan",
    "reading_record",
    "write_photo",
]

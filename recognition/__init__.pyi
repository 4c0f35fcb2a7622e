from .box import Box
from .check_digits import CheckDigit
from .confusions import CharacterState, PlaceState
from .depth_rules import DepthRule, depth_rule, least_depth
from .grade import MarkGrade
from .grammar import Grammar
from .lattice import Lattice
from .reader import Reader
from .reader_settings import ReaderSettings
from .reading import Candidate, CharacterReading, Decision, MarkDepth, Reading, ReadingFlag, ReadingTrace
from .tactile_reader import TactileReader
from .verify import Verdict, Verification, VerifyError
from .vision_frame import LinePlace
from .vision_reader import VisionReader

__all__ = [
    "Box",
    "Candidate",
    "CharacterReading",
    "CharacterState",
    "CheckDigit",
    "Decision",
    "DepthRule",
    "Grammar",
    "Lattice",
    "LinePlace",
    "MarkDepth",
    "MarkGrade",
    "PlaceState",
    "Reader",
    "ReaderSettings",
    "Reading",
    "ReadingFlag",
    "ReadingTrace",
    "TactileReader",
    "Verdict",
    "Verification",
    "VerifyError",
    "VisionReader",
    "depth_rule",
    "least_depth",
]

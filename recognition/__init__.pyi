from .active.active_reader import ActiveReader, ActiveSettings
from .active.active_reading import ActiveReading, StopReason
from .camera import VisionReader
from .decide.decision import Decision, Finding, ReadingFlag
from .decide.depth_rules import DepthRule, depth_rule, least_depth
from .decide.reading import (
    Candidate,
    CharacterReading,
    Reading,
    ReadingTrace,
)
from .decide.verify import Verdict, Verification, VerifyError
from .language.box import Box
from .language.check_digits import CheckDigit
from .language.confusions import CharacterState, PlaceState
from .language.grammar import Grammar
from .language.lattice import Lattice
from .language.orientation import Orientation
from .marks.depth import MarkDepth
from .marks.grade import MarkGrade
from .reader import Reader
from .see.codes import Code
from .see.text_line import TextLine
from .see.view import View
from .settings import ReaderSettings
from .touch import TactileReader

__all__ = [
    "ActiveReader",
    "ActiveReading",
    "ActiveSettings",
    "Box",
    "Candidate",
    "CharacterReading",
    "CharacterState",
    "CheckDigit",
    "Code",
    "Decision",
    "DepthRule",
    "Finding",
    "Grammar",
    "Lattice",
    "MarkDepth",
    "MarkGrade",
    "Orientation",
    "PlaceState",
    "Reader",
    "ReaderSettings",
    "Reading",
    "ReadingFlag",
    "ReadingTrace",
    "StopReason",
    "TactileReader",
    "TextLine",
    "Verdict",
    "Verification",
    "VerifyError",
    "View",
    "VisionReader",
    "depth_rule",
    "least_depth",
]

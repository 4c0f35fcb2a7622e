"""Shape of a test piece or golden part: a TOML of a `Piece`, or its own height map.

kind = "pits"                  or "grooves", "ball", "step"
angle_deg = [30, 45, 60]       walls; lengths in mm: depth_mm, floor_mm, width_mm, radius_mm, land_mm
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.surface.maps import HeightMap
from glyphs.surface.pieces import Piece, PieceKind
from pipeline.common.parsed import Strict, read_toml
from pipeline.errors import naming
from pipeline.formats.touch_file import read_height_map

if TYPE_CHECKING:
    from whisker_array.identification.piece_map import Heights

PITCH_MM = 0.02
"""Distance of samples in the map of a piece."""


class _Written(Strict):
    kind: PieceKind
    angle_deg: tuple[float, ...] = Piece.angle_deg
    depth_mm: float = Piece.depth_mm
    floor_mm: float = Piece.floor_mm
    width_mm: float = Piece.width_mm
    radius_mm: float = Piece.radius_mm
    land_mm: float = Piece.land_mm


def read_piece(path: Path) -> Piece | HeightMap:
    """The piece in a file.

    Raises:
        FileError: the file cannot be used.
    """
    if path.suffix.lower() != ".toml":
        return read_height_map(path)
    with naming(path):
        return Piece(**read_toml(path, _Written).model_dump())


def read_surface(path: Path) -> HeightMap:
    """The height map of the piece in a file.

    Raises:
        FileError: as `read_piece`.
    """
    piece = read_piece(path)
    return piece.height_map(PITCH_MM) if isinstance(piece, Piece) else piece


def heights_of_piece(piece: Piece | HeightMap) -> Heights:
    """Height over the land at places of the piece, mm.

    Raises:
        MapError: a map with holes.
    """
    from recognition.views.levelling import level
    from whisker_array.identification.piece_map import heights_of

    return piece.height_mm if isinstance(piece, Piece) else heights_of(level(piece))

from .camera.appearance import draw_camera, draw_light, photograph
from .camera.photo import Photo
from .camera.pose import Camera
from .camera.shading import Light
from .errors import FileError, MarksError
from .fonts.glyph import Font, FontError, Glyph
from .fonts.outlines import BUILTIN_FONTS, load_font
from .fonts.serials import FormatError, allowed_characters, random_text
from .part import Part, stamp
from .soiling.coat import Look
from .soiling.soil import Soil
from .soiling.soiled import SoiledPart, Soiling, soil_part
from .soiling.soils import SOILS, SoilModel
from .soiling.workshop.mixture import Dirt
from .stamping.database import DatabaseError, Exemplar, GlyphDatabase, load_database, save_database
from .stamping.die import IdealGlyph, ideal_relief
from .stamping.faces import Die, Face, default_die
from .stamping.stamp import StampedPart, stamp_line
from .stamping.variation import PlateVariation, StampError, StampingVariation
from .stamping.wedge import Wedge
from .surface.maps import EdgeMap, HeightMap, MapError, TraceDirection

__all__ = [
    "BUILTIN_FONTS",
    "SOILS",
    "Camera",
    "DatabaseError",
    "Die",
    "Dirt",
    "EdgeMap",
    "Exemplar",
    "Face",
    "FileError",
    "Font",
    "FontError",
    "FormatError",
    "Glyph",
    "GlyphDatabase",
    "HeightMap",
    "IdealGlyph",
    "Light",
    "Look",
    "MapError",
    "MarksError",
    "Part",
    "Photo",
    "PlateVariation",
    "Soil",
    "SoilModel",
    "SoiledPart",
    "Soiling",
    "StampError",
    "StampedPart",
    "StampingVariation",
    "TraceDirection",
    "Wedge",
    "allowed_characters",
    "default_die",
    "draw_camera",
    "draw_light",
    "ideal_relief",
    "load_database",
    "load_font",
    "photograph",
    "random_text",
    "save_database",
    "soil_part",
    "stamp",
    "stamp_line",
]  # fmt: skip

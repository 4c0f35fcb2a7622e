from .camera.appearance import draw_light, photograph
from .camera.photo import Photo
from .camera.pose import Camera, draw_camera
from .camera.shading import Light
from .errors import FileError, MarksError
from .fonts.glyph import Font, FontError, Glyph
from .fonts.outlines import BUILTIN_FONTS, load_font
from .fonts.serials import FormatError, allowed_characters, random_text
from .part import Part, stamp
from .soiling.coat import Coat, Look
from .soiling.soil import Soil
from .soiling.soiled import SoiledPart, Soiling, soil_part
from .soiling.soils import SOILS, SoilModel
from .soiling.workshop.mixture import Dirt
from .stamping.die import IdealGlyph, ideal_relief
from .stamping.dies import DIES
from .stamping.errors import StampError
from .stamping.faces import Die, Face, default_die
from .stamping.forms import PlateForm
from .stamping.layouts import LAYOUTS, Layout
from .stamping.plates import PLATES
from .stamping.stamp import StampedPart, stamp_line
from .stamping.textures import Grinding, Milling, Sand, Turning
from .stamping.variation import PRACTICES, PlateVariation, StampingVariation
from .surface.maps import EdgeMap, HeightMap, MapError, TraceDirection

__all__ = [
    "BUILTIN_FONTS",
    "DIES",
    "LAYOUTS",
    "PLATES",
    "PRACTICES",
    "SOILS",
    "Camera",
    "Coat",
    "Die",
    "Dirt",
    "EdgeMap",
    "Face",
    "FileError",
    "Font",
    "FontError",
    "FormatError",
    "Glyph",
    "Grinding",
    "HeightMap",
    "IdealGlyph",
    "Layout",
    "Light",
    "Look",
    "MapError",
    "MarksError",
    "Milling",
    "Part",
    "Photo",
    "PlateForm",
    "PlateVariation",
    "Sand",
    "Soil",
    "SoilModel",
    "SoiledPart",
    "Soiling",
    "StampError",
    "StampedPart",
    "StampingVariation",
    "TraceDirection",
    "Turning",
    "allowed_characters",
    "default_die",
    "draw_camera",
    "draw_light",
    "ideal_relief",
    "load_font",
    "photograph",
    "random_text",
    "soil_part",
    "stamp",
    "stamp_line",
]  # fmt: skip

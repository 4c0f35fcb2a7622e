import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import Face
from pipeline.plots.font_sheet import sheet_figure


def test_sheet_shows_ink_and_relief_of_every_font():
    fonts = [load_font("gothic"), load_font("timesr")]
    figure = sheet_figure(fonts, die_face=Face.SHARP)
    axes = [a for a in figure.axes if a.get_title(loc="left")]
    assert [a.get_title(loc="left").split()[0] for a in axes] == ["gothic", "timesr"]
    reliefs = [np.asarray(image.get_array()) for a in figure.axes for image in a.get_images()]
    assert len(reliefs) == 2
    assert all(r.min() < -0.1 for r in reliefs)
    assert all(a.collections for a in axes)


def test_sheet_needs_a_font():
    with pytest.raises(ValueError, match="at least one font"):
        sheet_figure([])

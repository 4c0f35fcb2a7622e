import pytest

from glyphs.fonts.outlines import load_font
from pipeline.plots.fonts_picture import sheet_figure


def test_sheet_shows_the_ink_of_every_font():
    figure = sheet_figure([load_font("gothic"), load_font("timesr")])
    assert [a.get_title(loc="left").split()[0] for a in figure.axes] == ["gothic", "timesr"]
    assert all(a.collections for a in figure.axes)


def test_sheet_needs_a_font():
    with pytest.raises(ValueError, match="at least one font"):
        sheet_figure([])

"""Read a part by touch, by photographs, or by both.

`Reader` reads a part in one call; the names below are the vocabulary (listed in `__init__.pyi`, loaded on first use).
The rooms in the order in which a part walks through them::

    see          what is looked at: a scan, a height map or a photograph as layers on one grid
    recogniser   the network that reads a strip, and the posteriors of a line's places
    glyph_match  templates of named fonts, compared with a line
    find         lines are found, read and moved until one is convincing --> the part's lines
    marks        poses, strokes, depths and grades of the characters
    decide       evidence --> text, score and findings --> a Reading: accept, review or reject

`touch`, `surface` and `camera` make the evidence of a part, and `reader` decides on it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

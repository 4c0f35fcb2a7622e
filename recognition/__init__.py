"""Read a part by touch, by photographs, or by both.

`Reader` reads a part in one call; the names below are the vocabulary (listed in `__init__.pyi`, loaded on first use).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

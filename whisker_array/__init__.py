"""Touch: whiskers, contact, the sensor chain, raster scans, and estimates from them.

`trace_scan` runs an array over a height map; `edge_map` and `estimate_relief` recover edges and relief from the scan.
The names below are the vocabulary (listed in `__init__.pyi`, loaded on first use).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Height files as users have them: read with the right heights, rows and scale, or asked about in words that help."""

from __future__ import annotations

import io
import struct
import time
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.io import savemat

from glyphs import HeightMap
from glyphs import MarksError as FileError
from pipeline import MapSettings, read_height_map

PITCH = 0.08
DATA = Path(__file__).parents[1] / "data" / "height_maps"
Heights = NDArray[np.float64]


def plate() -> Heights:
    """A plate of 4.8 x 3.2 mm with an L, 0.2 mm deep, tilted a little and rough to 2 um; mm."""
    x = np.arange(60)
    z = 0.002 * np.random.default_rng(0).standard_normal((40, 60)) + 0.0004 * x
    z[8:32, 10:14] -= 0.2
    z[28:32, 14:30] -= 0.2
    return np.round(z, 5)


Z = plate()


def columns(z: Heights = Z, *, delimiter: str = " ", head: str = "") -> str:
    """x, y upwards and z, a line a point."""
    y, x = np.mgrid[0 : z.shape[0], 0 : z.shape[1]] * PITCH
    stream = io.StringIO()
    rows = np.column_stack([x.ravel(), (y.max() - y).ravel(), z.ravel()])
    np.savetxt(stream, rows, fmt=["%.2f", "%.2f", "%.5f"], delimiter=delimiter)
    return head + stream.getvalue()


def matrix(z: Heights = Z, *, delimiter: str = " ", head: str = "", fmt: str = "%.5f") -> str:
    stream = io.StringIO()
    np.savetxt(stream, z, fmt=fmt, delimiter=delimiter)
    return head + stream.getvalue()


def with_gaps(mark: str) -> str:
    """Columns whose every 50th height is written as a mark."""
    lines = columns().splitlines()
    for n in range(7, len(lines), 50):
        lines[n] = lines[n].rsplit(" ", 1)[0] + " " + mark
    return "\n".join(lines)


def gaps() -> NDArray[np.bool_]:
    missing = np.zeros(Z.size, bool)
    missing[7::50] = True
    return missing.reshape(Z.shape)


def check(
    found: HeightMap, *, missing: NDArray[np.bool_] | None = None, offset: bool = False, atol: float = 2e-5
) -> None:
    assert found.pitch_mm == pytest.approx(PITCH, rel=1e-3)
    assert found.z_mm.shape == Z.shape
    lost = np.zeros(Z.shape, bool) if missing is None else missing
    np.testing.assert_array_equal(np.isnan(found.z_mm), lost)
    expected = Z - np.median(Z[~lost]) if offset else Z
    np.testing.assert_allclose(found.z_mm[~lost], expected[~lost], atol=atol)


ESRI = f"ncols 60\nnrows 40\nxllcorner 0.0\nyllcorner 0.0\ncellsize {PITCH}\nNODATA_value -9999\n"
GWYDDION = "# Channel: Topography\n# Width: 4.8000 mm\n# Height: 3.2000 mm\n# Value units: m\n"
GERMAN = "# Kanal: Topographie\n# Breite: 4,8 mm\n# Höhe: 3,2 mm\n# Einheiten: µm\n"
MORE_COLUMNS = "id,x,y,z,intensity\n" + "".join(
    f"{n},{line},{n % 7}\n" for n, line in enumerate(columns(delimiter=",").splitlines())
)
BROKEN = "\n".join(" ".join(f"{v:.5f}" for v in Z.ravel()[n : n + 10]) for n in range(0, Z.size, 10))
SPIP = (
    "# File Format = ASCII\n# x-pixels = 60\n# y-pixels = 40\n# x-length = 4800000\n# y-length = 3200000\n"
    "# x-unit = nm\n# y-unit = nm\n# z-unit = nm\n# Start of Data:\n"
)
KEYENCE = '"Measurement data"\n"XY calibration","80000.000","nm"\n"Height"\n' + matrix(delimiter=",")
WYKO = (
    "Wyko ASCII Data File Format 0\t0\t1\nX Size\t60\nY Size\t40\nBlock Name\tType\tLength\tValue\n"
    f"Pixel_size\t7\t4\t{PITCH}\nWavelength\t7\t4\t500.0\nMult\t7\t4\t2\nRAW_DATA\t3\t9600\t\n"
)
ZYGO = (
    'Zygo XYZ Data File - Format 1\n0 3 0 0 "x"\n0 0 60 40 1 255\n0 0 60 40\n\n\n\n0 0 6e-07 0.5 1 0 8e-5 1787677163\n'
    + '3 2 0 0 0 666666 0 ""\n0 0 1 33 0 0 0.1 60.4 2 50\n0 1 100 0 0 0 0 0 0 0\n0 ""\n1 5 0\n#\n'
    + "".join(f"{j} {i} {z * 1e3:.3f}\n" for (i, j), z in np.ndenumerate(Z)) + "#\n"
)  # fmt: skip
PCD = (
    "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 2\nTYPE F F F U\nCOUNT 1 1 1 1\n"
    "WIDTH 60\nHEIGHT 40\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2400\nDATA {}\n"
)
NUMBERED = "row,col,height\n" + "".join(f"{i},{j},{z}\n" for (i, j), z in np.ndenumerate(Z))
AXES = np.block([[np.zeros((1, 1)), np.arange(60)[None] * PITCH], [np.arange(40)[::-1, None] * PITCH, Z]])


def obj() -> str:
    """Its points, and two triangles between four of them."""
    k = np.arange(2400).reshape(40, 60) + 1
    a, b, c, d = (k[i, j].ravel() for i in (np.s_[:-1], np.s_[1:]) for j in (np.s_[:-1], np.s_[1:]))
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    points = [f"v {line}" for line in columns().splitlines()]
    return "\n".join([*points, *(f"f {a} {b} {c}" for a, b, c in faces)])


def in_thousands(mark: str, sign: str) -> str:
    """Columns in micrometres, 1,234.50 with these signs."""
    rows = [[f"{float(cell) * 1e3:,.2f}" for cell in line.split()] for line in columns().splitlines()]
    text = "X [µm];Y [µm];Z [µm]\n" + "\n".join(";".join(row) for row in rows)
    return text.replace(",", "T").replace(".", sign).replace("T", mark)


TEXTS: dict[str, tuple[str, str]] = {
    "blanks": ("a.xyz", columns()),
    "blanks in .txt": ("a.txt", columns()),
    "heading and commas": ("a.csv", columns(delimiter=",", head="x,y,z\n")),
    "heading with units": ("a.csv", columns(Z * 1e3, delimiter=";", head="X [mm];Y [mm];Z [µm]\n")),
    "units below the heading": ("a.csv", columns(Z * 1e3, delimiter=";", head="X;Y;Z\nmm;mm;µm\n")),
    "thousandths of an inch": ("a.csv", columns(Z / 0.0254, delimiter=",", head="X (mm),Y (mm),Z (mil)\n")),
    "thousands with points": ("a.csv", in_thousands(".", ",")),
    "thousands with commas": ("a.csv", in_thousands(",", ".")),
    "thousands with apostrophes": ("a.csv", in_thousands("'", ".")),
    "zygo": ("a.xyz", ZYGO),
    "more columns": ("a.csv", MORE_COLUMNS),
    "decimal comma and semicolon": ("a.xyz", columns(delimiter=";").replace(".", ",")),
    "decimal comma and tab": ("a.txt", columns(delimiter="\t").replace(".", ",")),
    "decimal comma and blanks": ("a.asc", columns().replace(".", ",")),
    "count before": ("a.pts", "2400\n" + columns()),
    "comments": ("a.xyz", "# exported\n# by a sensor\n" + columns()),
    "esri": ("a.asc", matrix(head=ESRI)),
    "gwyddion": ("a.asc", matrix(Z * 1e-3, delimiter="\t", head=GWYDDION, fmt="%.8e")),
    "gwyddion in german": ("a.txt", matrix(Z * 1e3, delimiter="\t", head=GERMAN)),
    "two channels": ("a.txt", matrix(Z * 1e-3, head=GWYDDION, fmt="%.8e") + matrix(Z, head=GWYDDION)),
    "esri in broken lines": ("a.asc", ESRI + BROKEN),
    "surfer": ("a.grd", "DSAA\n60 40\n0 4.72\n0 3.12\n-0.3 0.1\n" + matrix(Z[::-1])),
    "spip": ("a.asc", matrix(Z * 1e6, head=SPIP)),
    "keyence": ("a.csv", KEYENCE),
    "quoted": ("a.csv", '"x","y","z"\n"' + columns(delimiter='","').replace("\n", '"\n"')[:-1]),
    "wyko": ("a.asc", matrix(Z[::-1].T * 1e6 / 250.0, delimiter="\t", head=WYKO)),
    "axes": ("a.csv", matrix(AXES, delimiter=",")),
    "axes with a word in the corner": ("a.csv", matrix(AXES, delimiter=",").replace("0.00000", "y\\x", 1)),
    "axes with a gap in the corner": ("a.csv", matrix(AXES, delimiter=";").replace("0.00000", "", 1)),
    "stated pitch": ("a.csv", matrix(delimiter=",", head=f"pitch;{PITCH};mm\n")),
    "pcd": ("a.pcd", PCD.format("ascii") + columns().replace("\n", " 7\n")),
    "obj": ("a.obj", "mtllib none.mtl\n" + obj()),
    "delimiter at the end": ("a.asc", ESRI + matrix(delimiter=";").replace("\n", ";\n")),
}  # fmt: skip


@pytest.mark.parametrize("case", TEXTS)
def test_tables_of_numbers_are_read(case: str, tmp_path: Path) -> None:
    name, text = TEXTS[case]
    (tmp_path / name).write_text(text, encoding="utf-8")
    check(read_height_map(tmp_path / name))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "latin-1"])
def test_encodings_of_tables(encoding: str, tmp_path: Path) -> None:
    text = columns(Z * 1e3, delimiter=";", head="X [mm];Y [mm];Z [µm]\n").replace(".", ",")
    (tmp_path / "a.csv").write_bytes(text.replace("\n", "\r\n").encode(encoding))
    check(read_height_map(tmp_path / "a.csv"))


@pytest.mark.parametrize(
    "mark",
    [*("-99.99", "-9999", "99999", "1e38", "No Data", "NoData", "nan", "NaN", "Bad", "n/a", "#N/A"), "---", "-1.#IND"],
)  # fmt: skip
def test_missing_points_become_dropouts(mark: str, tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_text(with_gaps(mark))
    check(read_height_map(tmp_path / "a.xyz"), missing=gaps())


def test_empty_cells_become_dropouts(tmp_path: Path) -> None:
    lines = columns(delimiter=";").splitlines()
    for n in range(7, len(lines), 50):
        lines[n] = lines[n].rsplit(";", 1)[0] + ";"
    (tmp_path / "a.csv").write_text("x;y;z\n" + "\n".join(lines))
    check(read_height_map(tmp_path / "a.csv"), missing=gaps())


def test_zeros_far_from_all_heights_are_missing_points(tmp_path: Path) -> None:
    """Of a sensor that stands 300 mm above the part and writes 0 where it saw nothing."""
    np.savez(tmp_path / "a.npz", z_mm=np.where(gaps(), 0.0, Z + 300.0), pitch_mm=PITCH)
    check(read_height_map(tmp_path / "a.npz"), missing=gaps(), offset=True, atol=1e-4)
    lines = columns(Z + 300.0).splitlines()
    lines = ["0 0 0" if n % 50 == 7 else line for n, line in enumerate(lines)]
    (tmp_path / "a.xyz").write_text("\n".join(lines))
    check(read_height_map(tmp_path / "a.xyz"), missing=gaps(), offset=True, atol=1e-4)


@pytest.mark.parametrize("offset_mm", [-999.9, 1000.0, 1800.0, -5e4])
@pytest.mark.parametrize("name", ["a.npz", "a.xyz", "a.asc"])
def test_coordinates_of_machines_are_offsets(name: str, offset_mm: float, tmp_path: Path) -> None:
    path = tmp_path / name
    if path.suffix == ".npz":
        np.savez(path, z_mm=Z + offset_mm, pitch_mm=PITCH)
    else:
        path.write_text(columns(Z + offset_mm) if name == "a.xyz" else matrix(Z + offset_mm, head=ESRI))
    check(read_height_map(path), offset=True)


# ------------------------------------------------------------------------------------------------ other files


def save_x3p(
    path: Path,
    z: Heights,
    increment: float,
    *,
    root: str = "p:ISO5436_2",
    folder: str = "",
    more: str = "",
    md5: str = "",
) -> Path:
    space = ' xmlns:p="http://www.opengps.eu/2008/ISO5436_2"' if root.startswith("p:") else ""
    axis = f"<AxisType>I</AxisType><DataType>D</DataType><Increment>{increment}</Increment><Offset>0</Offset>"
    main = f"""<?xml version="1.0" encoding="UTF-8"?>
<{root}{space}><Record1><Revision>ISO5436 - 2000</Revision><FeatureType>SUR</FeatureType><Axes>
<CX>{axis}</CX><CY>{axis}</CY><CZ><AxisType>A</AxisType><DataType>D</DataType></CZ></Axes></Record1>
<Record2><Date>2024-01-01T00:00:00Z</Date><Instrument><Manufacturer>x</Manufacturer><Model>x</Model><Serial>1</Serial>
<Version>1</Version></Instrument><CalibrationDate>2024-01-01T00:00:00Z</CalibrationDate><ProbingSystem>
<Type>NonContacting</Type><Identification>x</Identification></ProbingSystem></Record2>
<Record3><MatrixDimension><SizeX>{z.shape[1]}</SizeX><SizeY>{z.shape[0]}</SizeY><SizeZ>1</SizeZ></MatrixDimension>
<DataLink><PointDataLink>bindata/data.bin</PointDataLink></DataLink>{more}</Record3>
<Record4><ChecksumFile>md5checksum.hex</ChecksumFile></Record4></{root}>"""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{folder}main.xml", main)
        archive.writestr(f"{folder}bindata/data.bin", z.astype("<f8").tobytes())
        if md5:
            archive.writestr(f"{folder}md5checksum.hex", f"{md5} *main.xml")
        if folder:
            archive.writestr("__MACOSX/._part", "x")
    return path


@pytest.mark.parametrize("root", ["p:ISO5436_2", "ISO5436_2", "ISO5436", "p:ISO5436"])
@pytest.mark.parametrize("folder", ["", "part/"])
@pytest.mark.parametrize("md5", ["", "0" * 32])
def test_x3p_as_others_write_it(root: str, folder: str, md5: str, tmp_path: Path) -> None:
    path = save_x3p(tmp_path / "a.x3p", Z[::-1] * 1e-3, PITCH * 1e-3, root=root, folder=folder, md5=md5)
    check(read_height_map(path))


def test_the_origin_of_x3p_says_which_row_is_first(tmp_path: Path) -> None:
    path = save_x3p(tmp_path / "a.x3p", Z * 1e-3, PITCH * 1e-3, more="<Origin>NW</Origin>")
    check(read_height_map(path))


@pytest.mark.parametrize("name", ["csafe-logo.x3p", "testing.x3p"])
def test_x3p_of_x3ptools(name: str) -> None:
    if name == "csafe-logo.x3p":
        found = read_height_map(DATA / name)
        assert (found.z_mm.shape, found.pitch_mm) == ((419, 741), pytest.approx(6.45e-4))
        return
    with pytest.raises(FileError, match=r"27\.5 mm apart.*--unit mm"):
        read_height_map(DATA / name)
    for unit, mm in (("mm", 1.0), ("um", 1e-3)):
        assert read_height_map(DATA / name, MapSettings(unit=unit)).pitch_mm == pytest.approx(
            0.0275 * mm, rel=1e-4
        )


def surfer_6() -> bytes:
    head = struct.pack("<4shh6d", b"DSBB", 60, 40, 1.0, 1.0 + 59 * PITCH, 2.0, 2.0 + 39 * PITCH, -0.3, 0.1)
    return head + np.where(gaps(), 1.70141e38, Z)[::-1].astype("<f4").tobytes()


def surfer_7() -> bytes:
    grid = struct.pack("<ii8d", 40, 60, 1.0, 2.0, PITCH, PITCH, -0.3, 0.1, 0.0, 1e20)
    body = np.where(gaps(), 1e20, Z)[::-1].astype("<f8").tobytes()
    sections = ((b"DSRB", struct.pack("<i", 2)), (b"GRID", grid), (b"DATA", body))
    return b"".join(tag + struct.pack("<i", len(data)) + data for tag, data in sections)


def gwyddion_simple_field() -> bytes:
    head = (
        "Gwyddion Simple Field 1.0\nXRes = 60\nYRes = 40\nXReal = 0.0048\nYReal = 0.0032\n"
        "XYUnits = m\nZUnits = µm\nTitle = Topography\n"
    ).encode()
    return head + b"\0" * (4 - len(head) % 4) + (np.where(gaps(), np.nan, Z) * 1e3).astype("<f4").tobytes()


def pcd() -> bytes:
    rows = [[float(cell) for cell in line.split()] for line in with_gaps("nan").splitlines()]
    return PCD.format("binary").encode() + b"".join(struct.pack("<fffH", *row, 7) for row in rows)


def las() -> bytes:
    """Version 1.2, points with a time after their coordinates; none where there is a gap."""
    rows = [[float(cell) for cell in line.split()] for line in with_gaps("nan").splitlines()]
    points = [row for row in rows if row[2] == row[2]]
    head = bytearray(227)
    head[:4] = b"LASF"
    struct.pack_into("<IIBHI", head, 96, 227, 0, 1, 28, len(points))
    struct.pack_into("<6d", head, 131, 1e-3, 1e-3, 1e-5, 5.0, 6.0, 0.0)
    return bytes(head) + b"".join(
        struct.pack("<iii16x", round((x - 5) * 1e3), round((y - 6) * 1e3), round(z * 1e5))
        for x, y, z in points
    )


def matlab() -> bytes:
    stream = io.BytesIO()
    savemat(
        stream, {"z_mm": np.where(gaps(), np.nan, Z), "pitch_mm": PITCH, "note": "x"}, do_compression=True
    )
    return stream.getvalue()


BINARY = {
    "a.grd": surfer_6,
    "b.grd": surfer_7,
    "a.gsf": gwyddion_simple_field,
    "a.las": las,
    "a.pcd": pcd,
    "a.mat": matlab,
}


@pytest.mark.parametrize("name", BINARY)
def test_binary_grids_and_points(name: str, tmp_path: Path) -> None:
    path, data = tmp_path / name, BINARY[name]()
    path.write_bytes(data)
    check(read_height_map(path), missing=gaps())
    for length in (3, 60, len(data) // 2):
        path.write_bytes(data[:length])
        with pytest.raises(FileError, match=r"damaged|no table of numbers|could not be read"):
            read_height_map(path)


@pytest.mark.parametrize(("name", "data", "message"), [
    ("a.xlsx", b"PK\x03\x04" + bytes(99), "workbook or packed .*as CSV"),
    ("a.xyz.gz", b"\x1f\x8b\x08" + bytes(99), "packed .gzip.; unpack it"),
    ("a.tsv", b"photo\texpected\na.jpg\tBH0193\n" * 9, "if it lists parts, give it with --manifest"),
])  # fmt: skip
def test_what_holds_other_files_is_refused_in_words(
    name: str, data: bytes, message: str, tmp_path: Path
) -> None:
    pytest.importorskip("SurfaceTopography")
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=message):
        read_height_map(tmp_path / name)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_height_images_of_heights(kind: type, tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(bytes(cv2.imencode(".tif", Z.astype(kind))[1]))
    check(read_height_map(tmp_path / "a.tif", MapSettings(height_image=True, pitch_mm=PITCH)))


@pytest.mark.parametrize("name", ["a.png", "a.tiff"])
def test_height_images_of_counts(name: str, tmp_path: Path) -> None:
    Image.fromarray(np.round(Z * 1e5 + 30_000).astype(np.uint16)).save(tmp_path / name)
    found = read_height_map(tmp_path / name, MapSettings(height_image=True, pitch_mm=PITCH, unit="nm"))
    # of 10 nm, read as 1 nm
    np.testing.assert_allclose(np.ptp(found.z_mm), np.ptp(Z) / 10.0, rtol=1e-3)
    assert found.pitch_mm == PITCH


def test_npy(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", Z)
    check(read_height_map(tmp_path / "a.npy", MapSettings(pitch_mm=PITCH)))
    np.save(tmp_path / "b.npy", np.array([line.split() for line in columns().splitlines()], dtype=float))
    check(read_height_map(tmp_path / "b.npy"))


# ------------------------------------------------------------------------------------------------ questions


def save_sur(
    path: Path, *, unit: str = "mm", magic: bytes = b"DIGITAL SURF", step: float = PITCH, scale: float = 1e-5
) -> Path:
    """MountainsMap's format, 16 bits: the surface's own header of 512 bytes."""
    head = bytearray(512)
    head[:12] = magic
    struct.pack_into("<HHHH", head, 12, 0, 1, 1, 2)
    counts = np.round(Z / 1e-5).astype("<i2")
    struct.pack_into("<Hii", head, 98, 16, int(counts.min()), int(counts.max()))
    struct.pack_into("<iiI", head, 108, 60, 40, 2400)
    struct.pack_into("<fff", head, 120, step, step, scale)
    names = ["X", "Y", "Z", "mm", "mm", unit, "mm", "mm", unit]
    head[132 : 132 + 16 * 9] = b"".join(n.encode("latin-1").ljust(16) for n in names)
    struct.pack_into("<fff", head, 276, 1.0, 1.0, 1.0)
    path.write_bytes(bytes(head) + counts.tobytes())
    return path


def scaled(name: str, folder: Path, z: float, xy: float) -> Path:
    """A file whose heights and places are numbers so many times as large."""
    path = folder / name
    if path.suffix == ".x3p":
        return save_x3p(path, Z[::-1] * z, PITCH * xy)
    if path.suffix == ".sur":
        pytest.importorskip("SurfaceTopography")
        return save_sur(path, step=PITCH * xy, scale=1e-5 * z)
    if path.suffix == ".npz":
        np.savez(path, z_mm=Z * z, pitch_mm=PITCH * xy)
    else:
        rows = np.array([line.split() for line in columns(Z * z).splitlines()], dtype=float) * (xy, xy, 1.0)
        np.savetxt(path, rows, fmt="%.7f")
    return path


@pytest.mark.parametrize(("name", "z", "xy", "unit"), [
    ("a.npz", 1e3, 1e3, "um"), ("a.npz", 1e3, 1.0, "um"), ("a.npz", 1.0, 1e3, "um"), ("a.npz", 1e-3, 1e-3, "m"),
    ("a.x3p", 1.0, 1.0, "mm"), ("a.x3p", 1e3, 1e3, "um"), ("a.x3p", 1e3, 1e-3, "um"), ("a.x3p", 1.0, 1e-3, "mm"),
    ("a.x3p", 1e-3, 1.0, "mm"), ("a.xyz", 1e3, 1.0, "um"), ("a.xyz", 1e3, 1e3, "um"),
])  # fmt: skip
def test_numbers_of_no_part_are_asked_about_and_converted(
    name: str, z: float, xy: float, unit: str, tmp_path: Path
) -> None:
    path = scaled(name, tmp_path, z, xy)
    with pytest.raises(FileError, match=rf"; are the \w+ \w+\? then give --unit {unit}$"):
        read_height_map(path)
    check(read_height_map(path, MapSettings(unit=unit)))


@pytest.mark.parametrize("xy", [1.0, 1e3])
def test_a_unit_that_the_file_states_is_not_asked_about(xy: float, tmp_path: Path) -> None:
    path = scaled("a.sur", tmp_path, 1e3, xy)
    with pytest.raises(
        FileError, match=r"\(the file states mm\); if that is wrong, give --unit or --pitch-mm$"
    ):
        read_height_map(path)
    check(read_height_map(path, MapSettings(unit="um")))


@pytest.mark.parametrize("head", ["X [mm];Y [mm];Z [mm]\n", "# unit: mm\n"])
def test_columns_with_a_unit_are_not_asked_about_theirs(head: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(columns(Z * 1e3, delimiter=";", head=head))
    with pytest.raises(
        FileError, match=r"\(the file states mm\); if that is wrong, give --unit or --pitch-mm$"
    ):
        read_height_map(tmp_path / "a.csv")


def test_only_heights_are_asked_about_where_the_unit_of_distances_is_stated(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(matrix(Z * 1e3, delimiter=",", head="XY calibration (nm/pixel),80000\n"))
    with pytest.raises(FileError, match=r"are the heights micrometres\? then give --unit um$"):
        read_height_map(tmp_path / "a.csv")


@pytest.mark.parametrize(("name", "xy"), [("a.sur", 1e-3), ("a.x3p", 1e-6)])
def test_a_map_without_room_for_a_character_is_too_small(name: str, xy: float, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"too small for characters: the map measures 4\.8 um x 3\.2 um"):
        read_height_map(scaled(name, tmp_path, 1e-6, xy))


PROFILES = {
    "two columns": ("a.csv", "x,z\n" + "".join(f"{0.1 * k:.1f},{0.01 * (k % 7)}\n" for k in range(300))),
    "steps that are rounded": ("a.csv", "Scan Data\nLateral um,Raw Micrometer,\n" + "".join(
        f"{0.156 * k:.1f},{0.01 * (k % 7):.5f},,\n" for k in range(3000))),
    "a flag behind": ("a.hfm", "X;Y;valid\n[mm];[mm];[1/0]\n" + "".join(
        f"{8.6 + 5e-4 * k:.6f};{106.6 + 1e-5 * (k % 5):.6f};1\n" for k in range(3000))),
    "a number before": ("a.xyz", "".join(f"{k} {0.1 * k:.1f} {0.01 * (k % 7):.2f}\n" for k in range(300))),
    "y and z": ("a.xyz", "".join(f"{0.01 * (k % 3):.2f} {-0.1 * k:.1f} 0\n" for k in range(300))),
    "a column": ("a.asc", "".join(f"{0.01 * (k % 7):.2f}\n" for k in range(300))),
    "a row": ("a.asc", " ".join(f"{0.01 * (k % 7):.2f}" for k in range(300)) + "\n"),
    "points": ("a.pcd", PCD.format("ascii") + "".join(f"{0.1 * k:.1f} 3 {k % 7} 0\n" for k in range(2400))),
}  # fmt: skip


@pytest.mark.parametrize("case", PROFILES)
def test_profiles_are_no_surfaces(case: str, tmp_path: Path) -> None:
    name, text = PROFILES[case]
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match="holds a profile; measure a surface"):
        read_height_map(tmp_path / name)


def test_points_sorted_by_x_are_a_surface(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    x, y = np.sort(rng.uniform(0, 20, 20_000)), rng.uniform(0, 10, 20_000)
    np.savetxt(tmp_path / "a.xyz", np.stack([x, y, 0.1 * np.sin(x)], axis=1))
    assert read_height_map(tmp_path / "a.xyz").size_mm == pytest.approx((20.0, 10.0), abs=0.2)


# the heights are counts of 0.1 nm, the distances what each head says
COUNTS = (Z * 1e7).round().astype(int)
HEADS = {
    "keyence": 'File name,plate.vk4\n"Pitch (um)",2.0\nXY calibration (nm/pixel),80000.0\n'
    "Z calibration (nm/digit),0.1\nWidth,60\nHeight,40\n\n",
    "counts first": "Width,60\nHeight,40\nXY Calibration;80;um/pixel\nZ Calibration;0.0001;um/digit\n",
    "per pixel": "mm_per_pixel: 0.08\nnm/LSB: 0.1\n",
    "lateral resolution": "Instrument: 5x\nLateral resolution = 80 \u00b5m/px\nZ scale: 0.1 nm\n",
    "each axis": "X pitch(um),80\nY pitch(um),80\nZ factor (nm),0.1\n",
    "pixel size": "Columns: 60\nPixel size X [\u00b5m]: 80\nPixel size Y [\u00b5m]: 80\nheight scale factor=1e-10 m\n",
    "increments": "X_INCREMENT 0.08 mm\nY_INCREMENT 0.08 mm\nZ scaling: 1e-7 mm\n",
    "on a line": "dx=0.08 mm, dy=0.08 mm, height scale=0.1 nm/count\n",
    "axes in brackets": "Step size (x) [micrometers]: 80\nStep size (y) [micrometers]: 80\nz scale (in nm) 0.1\n",
    "laser lines": "X pitch: 0.08 mm\nProfile pitch: 0.08 mm\nZ calibration (mm/count): 1e-7\n",
    "counts of pixels": '"Horizontal","60"\n"Vertical","40"\n"XY calibration","80","um"\nnm per digit: 0.1\n',
    "unit in the key": "pixel_size_um: 80\nz_calibration_nm: 0.1\n",
    "german": "Pixelabstand: 80 \u00b5m\nBreite: 60\nH\u00f6he: 40\nz factor: 0,1 nm\n",
}


@pytest.mark.parametrize("case", HEADS)
@pytest.mark.parametrize("suffix", [".csv", ".asc"])
def test_heads_that_state_the_scales(case: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text(matrix(COUNTS, delimiter=",", head=HEADS[case], fmt="%d"), encoding="utf-8")
    check(read_height_map(path))
    if case == "keyence":  # the unit that is stated, given again
        check(read_height_map(path, MapSettings(unit="nm")))


@pytest.mark.parametrize(
    "head", ["Width,60\nHeight,40\n", "Size: 60 x 40\nResolution: 60\n", "Pitch (um),2\nZ range,9\n"]
)
def test_numbers_of_pixels_are_no_lengths(head: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(matrix(delimiter=",", head=head))
    with pytest.raises(FileError, match="without the distance of its samples"):
        read_height_map(tmp_path / "a.csv")


@pytest.mark.parametrize("line", ["Unit,um", "Z unit: um", "Height [\u00b5m]", "Z-Unit\tmicrometer"])
def test_units_of_heights_in_heads(line: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        matrix(Z * 1e3, delimiter=",", head=f"{line}\npixel size,80 um\n"), encoding="utf-8"
    )
    check(read_height_map(tmp_path / "a.csv"))


def test_a_plate_that_is_tilted_is_said_to_be(tmp_path: Path) -> None:
    tilted = Z.repeat(5, axis=0).repeat(5, axis=1) + np.arange(300) * PITCH * np.tan(np.radians(55))
    np.savez(tmp_path / "a.npz", z_mm=tilted, pitch_mm=PITCH)
    with pytest.raises(FileError, match="tilted by 55 degrees; level the part"):
        read_height_map(tmp_path / "a.npz")


def tmd(
    title: bytes = b"Binary TrueMap Data File v2.0\r\n", comment: bytes | None = b"", *, pad: int = 0
) -> bytes:
    """TrueMap's format; a comment of None is version 1, `pad` the least length of the title and of the comment."""
    head = (title + b"\0").ljust(pad, b"\0") + (
        b"\0" if comment is None else (comment + b"\0").ljust(pad, b"\0")
    )
    offsets = b"" if comment is None else struct.pack("<ff", 1.5, -2.0)
    sizes = struct.pack("<iiff", 60, 40, 60 * PITCH, 40 * PITCH)
    return head + sizes + offsets + np.where(gaps(), np.nan, Z).astype("<f4").tobytes()


TMDS = {
    "truemap 6": tmd(comment=b"Created by TrueMap v6\r\n"),
    "another writer": tmd(b"Binary Truemap Data File v2.0\r\n", b"Created by Truemap v6\r\n"),
    "gelsight": tmd(),
    "version 1": tmd(b"Binary TrueMap Data File\r\n", None),
    "long comment": tmd(comment=b"plate 7, second side; " * 20),
    "without a line end": tmd(b"Binary TrueMap Data File v2.0", b"a comment"),
    "padded": tmd(b"Binary TrueMap Data File v2.0", b"Test TMD File", pad=32),
    "capitals": tmd(b"BINARY TRUEMAP DATA FILE V2.0\n"),
    "bytes behind": tmd(comment=b"x") + b"end of file",
}


@pytest.mark.parametrize("case", TMDS)
def test_truemap_files_of_all_writers(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.tmd").write_bytes(TMDS[case])
    check(read_height_map(tmp_path / "a.tmd"), missing=gaps())
    (tmp_path / "a.tmd").write_bytes(TMDS[case][:3000])
    with pytest.raises(FileError, match="damaged"):
        read_height_map(tmp_path / "a.tmd")


def test_nanofocus(tmp_path: Path) -> None:
    """Heights in um, distances in nm."""
    low, high = Z.min() * 1e3, Z.max() * 1e3
    head = bytearray(3468)
    struct.pack_into("<2d", head, 16, low, high)
    struct.pack_into("<2I2d", head, 1368, 60, 40, PITCH * 1e6, PITCH * 1e6)
    counts = np.round((Z * 1e3 - low) / (high - low) * 65534).astype("<u2")
    (tmp_path / "a.nms").write_bytes(bytes(head) + counts.tobytes())
    check(read_height_map(tmp_path / "a.nms"))


def test_shallow_marks_in_micrometres_below_the_width_of_the_plate_are_asked_about(tmp_path: Path) -> None:
    z = np.random.default_rng(1).normal(0.0, 0.8, (360, 360))
    z[100:200, 100:110] -= 30.0
    np.savez(tmp_path / "a.npz", z_mm=z, pitch_mm=0.1)
    with pytest.raises(
        FileError, match=r"36 mm x 36 mm .*; are the heights micrometres\? then give --unit um"
    ):
        read_height_map(tmp_path / "a.npz")


def test_a_unit_that_is_given_is_not_asked_about_again(tmp_path: Path) -> None:
    """A part on a table that lies 12 mm below it."""
    z = np.vstack([Z, np.full((20, 60), -12.0)]).repeat(5, axis=0).repeat(5, axis=1)
    np.savez(tmp_path / "a.npz", z_mm=z, pitch_mm=PITCH)
    found = read_height_map(tmp_path / "a.npz", MapSettings(unit="mm"))
    assert np.ptp(found.z_mm) == pytest.approx(np.ptp(z), rel=1e-5)


def test_a_mesh_with_the_base_of_its_part_is_not_asked_about(tmp_path: Path) -> None:
    """Letters on a block that stands 20 mm above its base: a mesh has one unit for all its numbers."""
    lines, faces = [], []
    for (x, y, z), size in (((0, 0, 0), 60), ((10, 10, 20), 40), ((20, 20, 20.3), 5)):
        corners = [(x, y), (x + size, y), (x + size, y + size), (x, y + size)]
        faces += [
            f"f {len(lines) + a} {len(lines) + b} {len(lines) + c}" for a, b, c in ((1, 2, 3), (1, 3, 4))
        ]
        lines += [f"v {a} {b} {z}" for a, b in corners]
    (tmp_path / "a.obj").write_text("\n".join(lines + faces))
    assert np.nanmax(read_height_map(tmp_path / "a.obj").z_mm) == pytest.approx(20.3)


def test_a_map_of_160_m_is_refused_with_the_way_out(tmp_path: Path) -> None:
    """As .nms files come out of a library that takes nanometres for millimetres."""
    path = save_sur(tmp_path / "a.sur", unit="µm", step=312.5, scale=1e-2)
    with pytest.raises(FileError, match=r"samples lie 31\d mm apart.*--pitch-mm"):
        read_height_map(path)
    check(read_height_map(path, MapSettings(pitch_mm=PITCH)))


def save_gwy(path: Path, *channels: tuple[str, str, Heights], mask: Heights | None = None) -> Path:
    """Gwyddion's native format: (title, unit of z, values) of each channel."""

    def text(value: str) -> bytes:
        return value.encode() + b"\0"

    def thing(name: str, body: bytes) -> bytes:
        return text(name) + struct.pack("<I", len(body)) + body

    def field(unit: str, z: Heights) -> bytes:
        units = b"".join(
            text(key) + b"o" + thing("GwySIUnit", text("unitstr") + b"s" + text(value))
            for key, value in (("si_unit_xy", "m"), ("si_unit_z", unit))
        )
        sizes = b"".join(text(k) + b"i" + struct.pack("<i", n) for k, n in (("xres", 60), ("yres", 40)))
        real = b"".join(
            text(k) + b"d" + struct.pack("<d", v) for k, v in (("xreal", 4.8e-3), ("yreal", 3.2e-3))
        )
        data = text("data") + b"D" + struct.pack("<I", z.size) + z.astype("<f8").tobytes()
        return thing("GwyDataField", sizes + real + units + data)

    body = b""
    for n, (title, unit, z) in enumerate(channels):
        body += text(f"/{n}/data") + b"o" + field(unit, z) + text(f"/{n}/data/title") + b"s" + text(title)
    if mask is not None:
        body += text("/0/mask") + b"o" + field("", mask)
    path.write_bytes(b"GWYP" + thing("GwyContainer", body))
    return path


def test_channels_and_masks_of_gwyddion(tmp_path: Path) -> None:
    pytest.importorskip("SurfaceTopography")
    marks = (Z < -0.1).astype(float)
    check(read_height_map(save_gwy(tmp_path / "a.gwy", ("Height", "m", Z * 1e-3), mask=marks)))
    image = ("Intensity", "V", np.abs(Z) * 40.0)
    check(read_height_map(save_gwy(tmp_path / "b.gwy", image, ("Topography", "m", Z * 1e-3))))
    misnamed = ("Laser intensity", "m", np.abs(Z))
    check(read_height_map(save_gwy(tmp_path / "c.gwy", misnamed, ("Height", "m", Z * 1e-3))))
    for channels in ((image,), (misnamed,)):
        with pytest.raises(FileError, match=r"holds no heights; its channels are images"):
            read_height_map(save_gwy(tmp_path / "d.gwy", *channels))


@pytest.mark.parametrize(("options", "message"), [
    ({"unit": "LSB"}, r"an image \(z in 'LSB'\), no heights"),
    ({"unit": "V"}, "an image .*, no heights"),
    ({"unit": "%"}, "an image .*, no heights"),
    ({"unit": ""}, "z has no unit of length"),
    ({"magic": b"DSCOMPRESSED"}, "compressed; save it unc"),
])  # fmt: skip
def test_images_and_compressed_files_are_refused_in_words(
    options: dict[str, Any], message: str, tmp_path: Path
) -> None:
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(FileError, match=message):
        read_height_map(save_sur(tmp_path / "a.sur", **options))


@pytest.mark.parametrize(
    "line",
    ["1" * 190_000, "x" + "_" * 90_000 + "a,y,z", ";1" + ",234" * 40_000, "1." * 60_000, "no " * 60_000],
)
def test_no_line_keeps_the_reader_of_tables_busy(line: str, tmp_path: Path) -> None:
    """Expressions that go over a line again and again took minutes."""
    (tmp_path / "a.xyz").write_text(f"{line} 2 3\n" + "1,2,3\n" * 500)
    began_s = time.process_time()
    with pytest.raises(FileError):
        read_height_map(tmp_path / "a.xyz")
    assert time.process_time() - began_s < 10.0


WORDS: dict[str, tuple[str, str, str]] = {
    "matrix without pitch": ("a.csv", matrix(delimiter=","), "without the distance of its samples; .*--pitch-mm"),
    "prose": ("a.txt", "This is a letter.\nIt has no heights.\n", "no format that is read .*x y z.*X3P"),
    "ragged": ("a.asc", matrix(head=ESRI) + "1 2 3\n", "different lengths"),
    "voltage": ("a.asc", matrix(head=GWYDDION.replace("units: m", "units: V")), "no heights.*'V'"),
    "no length": ("a.csv", columns(delimiter=",", head="x [px],y [px],z [grey]\n"), "grey is no unit of length"),
    "places for lengths": ("a.csv", NUMBERED, "without the distance of its samples; .*--pitch-mm"),
    "numbered rows and columns": (
        "a.csv", "," + ",".join(map(str, range(60))) + "\n" + "".join(
            f"{n},{line}\n" for n, line in enumerate(matrix(delimiter=",").splitlines())
        ), "without the distance of its samples; .*--pitch-mm",
    ),
    "half a number": ("a.xyz", with_gaps("0.1.5"), r"says '0\.1\.5' in line 8"),
    "two columns": ("a.xyz", "1 2\n3 4\n5 6\n", "columns x y z"),
}  # fmt: skip


@pytest.mark.parametrize("case", WORDS)
def test_text_that_holds_no_map_is_refused_in_words(case: str, tmp_path: Path) -> None:
    pytest.importorskip("SurfaceTopography")
    name, text, message = WORDS[case]
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match=message):
        read_height_map(tmp_path / name)
    if "--pitch-mm" in message:
        check(read_height_map(tmp_path / name, MapSettings(pitch_mm=PITCH)))

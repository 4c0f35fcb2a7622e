"""Kinds of files: by their suffixes, and pictures by their first bytes, too."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

# may have heights or anything else: read only if named on their own
TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat")
FORMATS_SUFFIXES = (
    *(".al3d", ".apx", ".bcr", ".bcrf", ".datx", ".ezd", ".frt", ".gwy", ".ibw", ".jpk", ".lext", ".mdt"),
    *(".mi", ".mnt", ".nid", ".oir", ".opd", ".opdx", ".os3d", ".plu", ".plux", ".poir", ".qep"),
    *(".spm", ".sur", ".vk3", ".vk4", ".vk6", ".vk7", ".zmg", ".zon"),
)
"""Formats of the extra `formats` whose suffix always means a height map; others are tried when named on their own."""
SCAN_SUFFIXES = (".h5", ".hdf5")
HEIGHT_IMAGE_SUFFIXES = (".png", ".tif", ".tiff")
# size limit of a file
MOST_BYTES = {"height_map": 1_000_000_000, "scan": 4_000_000_000, "photo": 500_000_000}
BYTES_PER_SAMPLE = 24  # most bytes that a file stores for one sample: three coordinates as float64
SPARE_BYTES = 64_000_000  # for whatever a file holds beside its heights: a vendor's files, a trailer
# first bytes of a file that determine its kind
HEAD_BYTES = 16
# at the end of a picture, among which its end mark stands; some cameras write notes behind it
TAIL_BYTES = 65_536
_JPEG_BEGINS = re.compile(rb"\xff[\xc0-\xc4\xda\xdb]")  # markers of a JPEG's frame, tables and scan
_TEMPORARY = re.compile(
    r"\.|~|.*(?:~|\.te?mp\.[^.]+|\.(?:part|partial|filepart|crdownload|opdownload|download|upload|uploading|tmp|temp"
    r"|incomplete|writing|wkdownload|swp|!ut|!qb|!sync|bc!))$",
    re.IGNORECASE,
)
"""Names under which programs write a file before they rename it: FTP and SFTP clients, browsers, editors, rsync."""
_SYSTEM_FOLDERS = {
    *("$recycle.bin", "recycler", "system volume information", "lost+found", "__macosx"),
    # network drives of Synology and QNAP
    *("@eadir", "#recycle", "#snapshot", "@tmp", "@recycle", "@recently-snapshot"),
}
"""Folders of operating systems and network drives for deleted files, previews and snapshots; in lower case."""
OF_SYSTEM = "of the system"  # why such a folder is passed over


@dataclass(frozen=True)
class PhotoKind:
    """A supported kind of picture: Pillow's name, suffixes with the usual one first, and its first bytes."""

    name: str
    suffixes: tuple[str, ...]
    media_type: str
    magic: re.Pattern[bytes]

    @property
    def suffix(self) -> str:
        return self.suffixes[0]


READ = (
    PhotoKind("PNG", (".png",), "image/png", re.compile(rb"\x89PNG\r\n\x1a\n")),
    PhotoKind("JPEG", (".jpg", ".jpeg", ".jpe", ".jfif", ".jif"), "image/jpeg", re.compile(rb"\xff\xd8")),
    PhotoKind("BMP", (".bmp", ".dib"), "image/bmp", re.compile(rb"BM")),
    PhotoKind("TIFF", (".tif", ".tiff"), "image/tiff", re.compile(rb"II\*\0|MM\0\*|II\+\0|MM\0\+")),
    PhotoKind("WEBP", (".webp",), "image/webp", re.compile(rb"RIFF....WEBP", re.DOTALL)),
    PhotoKind("GIF", (".gif",), "image/gif", re.compile(rb"GIF8[79]a")),
    PhotoKind("PPM", (".pgm", ".ppm", ".pnm"), "image/x-portable-anymap", re.compile(rb"P[56]\s")),
)
PHOTO_SUFFIXES = tuple(suffix for kind in READ for suffix in kind.suffixes)
READ_NAMES = "PNG, JPEG, BMP, TIFF, WebP or GIF"
_RECOGNISED = (
    ("PBM", re.compile(rb"P[14]\s")),
    ("text PGM", re.compile(rb"P[23]\s")),
    ("HEIC", re.compile(rb"....ftyp(?:hei[cfmsx]|hev[cmsx]|mif1|msf1)", re.DOTALL)),
    ("AVIF", re.compile(rb"....ftypavi[fs]", re.DOTALL)),
    ("JPEG 2000", re.compile(rb"\0\0\0\x0cjP  |\xff\x4f\xff\x51")),
    ("JPEG XL", re.compile(rb"\xff\x0a|\0\0\0\x0cJXL ")),
    ("Photoshop", re.compile(rb"8BPS")),
    ("PDF", re.compile(rb"%PDF-")),
)
UNREAD_PICTURE_SUFFIXES = (
    *(".heic", ".heif", ".avif", ".jxl", ".jp2", ".j2k", ".psd", ".pdf"),
    *(".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".raf", ".rw2"),
)
"""Unsupported pictures: ignored in folders; if named, refused with a list of supported kinds."""


TEXT_READER, INSTRUMENT_READER = ("text_maps.read_text_map", "text"), "instruments.read_instrument"
READERS = {
    ".npz": ("npz.read_npz", ".npz"),
    ".npy": ("npz.read_npy", ".npy"),
    ".x3p": ("instruments.read_x3p", "X3P"),
    ".sdf": ("instruments.read_sdf", "SDF"),
    ".pcd": ("points.read_pcd", "PCD"),
    ".las": ("points.read_las", "LAS"),
    ".grd": ("binary_grids.read_grd", "GRD"),
    ".gsf": ("binary_grids.read_gsf", "GSF"),
    ".tmd": ("binary_grids.read_tmd", "TMD"),
    ".nms": ("binary_grids.read_nms", "NMS"),
    **dict.fromkeys((".stl", ".ply", ".obj"), ("points.read_mesh", "mesh")),
    **dict.fromkeys((".xyz", ".asc", ".pts"), TEXT_READER),
    **{suffix: (INSTRUMENT_READER, suffix) for suffix in FORMATS_SUFFIXES},
}
"""Reader of height maps by suffix, as module.function of this package, loaded when needed; kind of file in messages. It
is called with the path and the most samples that the file may hold, and raises DataError: the file cannot be used."""
_BY_SUFFIX = {
    **dict.fromkeys(READERS, "height_map"),
    **dict.fromkeys(SCAN_SUFFIXES, "scan"),
    **dict.fromkeys(PHOTO_SUFFIXES, "photo"),
}


def file_kind(suffix: str, *, tables: bool = True) -> str:
    """Kind of a file by its suffix: height_map, scan, photo or empty. Text files (`tables`) may hold heights."""
    suffix = suffix.lower()
    return "height_map" if tables and suffix in TABLE_SUFFIXES else _BY_SUFFIX.get(suffix, "")


def kind_of(head: bytes) -> PhotoKind | None:
    """Kind of a readable picture, from its first `HEAD_BYTES`; None for any other file."""
    return next((kind for kind in READ if kind.magic.match(head)), None)


def is_temporary(name: str) -> bool:
    """Whether a name is hidden, one of unfinished files, or has another ending behind a photograph's, part.jpg.1."""
    stem, suffix = os.path.splitext(name.lower())
    longer = suffix not in PHOTO_SUFFIXES and os.path.splitext(stem)[1] in PHOTO_SUFFIXES
    return longer or _TEMPORARY.match(name) is not None


def is_system_folder(name: str) -> bool:
    """Whether a folder of this name holds the system's own copies of files, not the user's files."""
    return name.lower() in _SYSTEM_FOLDERS


def why_not_searched(name: str) -> str:
    """Why a folder of this name, below one that is searched, is not searched itself; empty if it is."""
    return "hidden" if name.startswith(".") else OF_SYSTEM if is_system_folder(name) else ""


def is_cut_short(picture: Path) -> bool:
    """Whether a picture's end is missing, by its first and last bytes. Raises OSError: it cannot be read."""
    with picture.open("rb") as stream:
        head, n_bytes = stream.read(HEAD_BYTES), os.fstat(stream.fileno()).st_size
        stream.seek(max(0, n_bytes - TAIL_BYTES))
        tail = stream.read()
    if n_bytes < HEAD_BYTES:
        return True
    kind = kind_of(head)
    match kind.name if kind is not None else "":
        case "PNG":
            return b"IEND" not in tail
        case "JPEG":
            # the end of a preview does not count: the picture's own tables and scan begin behind it
            _, end, behind = tail.rpartition(b"\xff\xd9")
            return not end or _JPEG_BEGINS.search(behind) is not None
        case "GIF":
            return not tail.rstrip(b"\0").endswith(b";")
        case "BMP":
            return n_bytes < int.from_bytes(head[2:6], "little")
        case "WEBP":
            return n_bytes < 8 + int.from_bytes(head[4:8], "little")
        case "TIFF" if head[2:3] == b"*" or head[3:4] == b"*":
            return n_bytes <= int.from_bytes(head[4:8], "little" if head[:2] == b"II" else "big")
    return False


def refusal(head: bytes) -> tuple[str, str]:
    """Message and hint for a file that is not a readable picture."""
    if (kind := kind_of(head)) is not None:
        heights = "; heights as TIFF of 32 bit floats" if kind.name == "TIFF" else ""
        hint = f"copy it again, or save it as PNG{heights}"
        return f"is a {kind.name} that is damaged or unusual", hint
    name = next((name for name, magic in _RECOGNISED if magic.match(head)), None)
    if name is None:
        return "is not a picture that can be read", f"copy it again, or save it as {READ_NAMES}"
    return (
        f"is a {name} file, which is not read",
        f"photographs must be {READ_NAMES}; export it as one of these",
    )

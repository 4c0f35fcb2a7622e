"""Which parts a run means, by name alone: no file of theirs is opened.

files, folders, globs --.
URLs of any of these ---+--FoundFiles--> ListedPart, names made unique
manifests --------------'
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from pipeline.formats.listed import ListedPart, has_magic, is_url, is_web, local_name
from pipeline.formats.manifest import is_manifest, names_no_files, read_manifest
from pipeline.formats.part_list import PartList
from pipeline.formats.parts import FoundFiles, NothingFoundError, key_and_kind, named_apart
from pipeline.formats.passed_over import PassedOver
from pipeline.formats.remote import list_remote


class Listing(PartList):
    """Parts, and the files of their folders that are none.

    Attributes:
        passed_over: files that no part is made of.
    """

    def __init__(self, parts: Iterable[ListedPart], passed_over: PassedOver) -> None:
        super().__init__(parts)
        self.passed_over = passed_over


def list_parts(
    inputs: Sequence[str],
    *,
    manifests: Sequence[str] = (),
    photos: bool = False,
    beside: bool = False,
    height_images: bool = False,
) -> Listing:
    """The parts that the inputs name, in the order given.

    A URL that ends as a file of a known kind does is taken for one and not asked after; any other is listed.

    Args:
        inputs: as for `pipeline.formats.parts.discover`; URLs of files, folders and globs; manifests (.csv, .parquet).
        manifests: more manifests, whatever they are called.
        photos: photographs in folders are parts of their own, too, beside height maps and scans.
        beside: photographs of the same stem beside a file named belong to its part (on this machine).
        height_images: .png and .tif are height maps, and no photographs.

    Raises:
        NothingFoundError: no file at all.
        FileError: a manifest that cannot be used, or a folder that cannot be listed.
        MissingExtraError: a library that URLs need is not installed.
    """
    if len(inputs) + len(manifests) == 1 and (manifests or _is_manifest(inputs[0])):
        return Listing(read_manifest((*inputs, *manifests)[0]), PassedOver())
    found = FoundFiles(photos=photos, height_images=height_images)
    for given in inputs:
        name = local_name(given)
        if len(inputs) > 1 and names_no_files(name):
            continue  # of a folder that the shell has spelled out
        if _is_manifest(name):
            found.add_told(read_manifest(name))
        elif is_url(name):
            _add_remote(found, name)
        else:
            found.add_local(name, beside=beside)
    for manifest in manifests:
        found.add_told(read_manifest(manifest))
    parts = found.parts()
    if not parts:
        raise NothingFoundError([*inputs, *manifests], found.passed_over.describe())
    return Listing(named_apart(parts), found.passed_over)


def _is_manifest(given: str) -> bool:
    """Whether an input is a table of parts, and no folder of that name or table of heights."""
    from pipeline.formats.number_table import is_number_table

    name = local_name(given)
    return is_manifest(name) and not os.path.isdir(name) and not is_number_table(Path(name))


def _add_remote(found: FoundFiles, url: str) -> None:
    if not has_magic(url) and not url.endswith("/") and (is_web(url) or key_and_kind(url)[1]):
        found.add([url], named=True)
        return
    files = list_remote(url)
    found.add(files, named=files == [url])

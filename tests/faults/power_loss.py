"""What a folder may look like after a loss of power, from the calls that changed it.

calls --up to the n-th--> names: of a folder that was synced, or not yet     --what arrived of the rest--> a folder
                          data: of a file that was synced, or not yet

Nothing is promised of what was not synced; what a disk has made of it is one of these:

strict   no name and no byte of it is there (a rename is undone, a new file or folder is missing)
names    every name is there, no byte: files of the right name that are empty or short
torn     every name is there, and of every file the first half of what was not synced, the last piece in half
chance   names of each folder up to some call, bytes of each file up to some call; what is written over what is
         there already arrives or does not, each by itself
"""

from __future__ import annotations

import hashlib
import os
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CHOICES = ("strict", "names", "torn", "chance")


@dataclass(frozen=True)
class Call:
    """One record of the shim; see there."""

    op: str
    inode: int
    offset: int
    data: bytes
    path: str
    second: str


@dataclass(eq=False)
class _File:
    synced: bytes = b""
    since: list[Call] = field(default_factory=list)


_Node = _File | None
"""None: a folder."""


@dataclass(frozen=True)
class _Naming:
    """Names that come and go together."""

    gone: tuple[str, ...]
    new: tuple[tuple[str, _Node], ...]


def read_calls(log: Path) -> list[Call]:
    """The calls, in order; one that was broken off is left out."""
    data = log.read_bytes() if log.exists() else b""
    calls, at = [], 0
    while (end := data.find(b"\n", at)) >= 0:
        op, inode, offset, length, path, second = data[at:end].decode().split("\t")
        at = end + 1 + int(length)
        calls.append(Call(op, int(inode), int(offset), data[end + 1 : at], path, second))
    return calls


def acknowledged(calls: Sequence[Call]) -> list[str]:
    """What the program said it had done, in order."""
    return [call.data.decode() for call in calls if call.op == "A"]


class Disk:
    """A folder as its calls leave it: what is on the disk for sure, and what is on the way there."""

    def __init__(self, root: Path) -> None:
        """Take the folder as it stands before the first call; all of it is on the disk."""
        self._root = str(root)
        self._names: dict[str, _Node] = {self._root: None}
        self._inodes: dict[int, _File] = {}
        for path in root.rglob("*"):
            made = None if path.is_dir() else _File(path.read_bytes())
            self._names[str(path)] = made
            if made is not None:
                self._inodes[path.stat().st_ino] = made
        self._synced = dict(self._names)
        self._since: dict[str, list[_Naming]] = defaultdict(list)

    def take(self, call: Call) -> None:
        """Carry out one call."""
        path, names = call.path, self._names
        if call.op in "OM":
            made = _File() if call.op == "O" else None
            if made is not None:
                self._inodes[call.inode] = made
            self._name(_Naming((), ((path, made),)))
        elif call.op in "UX":
            self._name(_Naming((path,), ()))
        elif call.op == "R":
            moved = names.get(path)
            if os.path.dirname(path) == os.path.dirname(call.second):
                self._name(_Naming((path,), ((call.second, moved),)))
            else:
                self._name(_Naming((), ((call.second, moved),)))
                self._name(_Naming((path,), ()))
        elif call.op == "D":
            for naming in self._since.pop(path, []):
                _named(self._synced, naming)
        elif call.op in "WTFL" and call.inode in self._inodes:
            file = self._inodes[call.inode]
            if call.op in "WT":
                file.since.append(call)
                return
            if call.op == "F":
                for one in file.since:
                    file.synced = _changed(file.synced, one)
            file.since.clear()  # of an fsync that failed nothing is known, and the next one does not try again

    def _name(self, naming: _Naming) -> None:
        folders = {os.path.dirname(name) for name in (*naming.gone, *(name for name, _ in naming.new))}
        _named(self._names, naming)
        for folder in folders:
            self._since[folder].append(naming)

    def after_loss(self, choice: str, rng: np.random.Generator) -> dict[str, bytes | None]:
        """Paths below the folder with what is in the files; None: a folder."""
        names = dict(self._synced)
        for namings in self._since.values():
            n = {"strict": 0, "chance": int(rng.integers(len(namings) + 1))}.get(choice, len(namings))
            for naming in namings[:n]:
                _named(names, naming)
        found: dict[str, bytes | None] = {}
        for path, node in sorted(names.items()):
            parent = os.path.dirname(path)
            if path == self._root or (parent != self._root and parent[len(self._root) + 1 :] not in found):
                continue  # nobody finds it without its folder
            found[path[len(self._root) + 1 :]] = None if node is None else _arrived(node, choice, rng)
        return found


def _named(names: dict[str, _Node], naming: _Naming) -> None:
    for name in naming.gone:
        names.pop(name, None)
    names.update(naming.new)


def _changed(data: bytes, call: Call) -> bytes:
    if call.op == "T":
        return data[: call.offset].ljust(call.offset, b"\0")
    data = data.ljust(call.offset, b"\0")
    return data[: call.offset] + call.data + data[call.offset + len(call.data) :]


def _arrived(file: _File, choice: str, rng: np.random.Generator) -> bytes:
    data, since = file.synced, file.since
    if choice in ("strict", "names") or not since:
        return data
    n = len(since) // 2 if choice == "torn" else int(rng.integers(len(since) + 1))
    for one in since[:n]:
        over = one.op == "W" and one.offset + len(one.data) <= len(file.synced)
        if choice == "torn" or not over or rng.random() < 0.5:
            data = _changed(data, one)
    if n < len(since) and since[n].op == "W":
        one = since[n]
        half = one.data[: len(one.data) // 2]
        data = _changed(data, Call("W", one.inode, one.offset, half, one.path, ""))
    return data


def lay_out(found: dict[str, bytes | None], folder: Path) -> None:
    """Make the folder."""
    folder.mkdir(parents=True)
    for name, data in found.items():
        if data is None:
            (folder / name).mkdir()
        else:
            (folder / name).write_bytes(data)


def digest_of(found: dict[str, bytes | None], words: Sequence[str]) -> str:
    """By which the same state, after the same words, is known again."""
    hashed = hashlib.sha256(repr(words).encode())
    for name, data in found.items():
        hashed.update(f"{name}\0{-1 if data is None else len(data)}\0".encode() + (data or b""))
    return hashed.hexdigest()

"""Frames of OPC UA over TCP, as no client would send them."""

from __future__ import annotations

import struct


def message(kind: bytes, body: bytes) -> bytes:
    """A frame: its kind, its length, what it holds."""
    return kind + struct.pack("<I", 8 + len(body)) + body


def hello(url: str) -> bytes:
    """The first frame of a connection."""
    return message(b"HELF", struct.pack("<IIIIII", 0, 65536, 65536, 0, 0, len(url)) + url.encode())

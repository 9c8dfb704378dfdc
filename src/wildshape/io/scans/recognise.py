# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What kind of scan file bytes are: those of a pipe have no name."""

_TEXT_BYTES = 512
_LAS_COMPRESSED_AT = 104  # the point format's byte; LAZ sets its highest bit


def suffix_of(data: bytes) -> str:
    """The suffix that a scan file with this content would have; empty if nothing is recognised.

    A KITTI .bin is bare numbers and cannot be told from damage: it is never guessed.
    """
    if data[:3] == b"ply" and data[3:4].isspace():
        return ".ply"
    if data[:6] == b"\x93NUMPY":
        return ".npy"
    if data[:4] == b"PK\x03\x04":
        return ".npz"
    if data[:4] == b"LASF":
        return ".laz" if data[_LAS_COMPRESSED_AT : _LAS_COMPRESSED_AT + 1] >= b"\x80" else ".las"
    if data.lstrip()[:6].upper().startswith((b"# .PCD", b"VERSIO")):
        return ".pcd"
    return ".xyz" if _is_text(data[:_TEXT_BYTES]) else ""


def _is_text(start: bytes) -> bool:
    """Whether it reads as text with a number in it."""
    text = start.decode("utf-8-sig", errors="ignore")
    lost = len(start) - len(text.encode())
    readable = all(c.isprintable() or c.isspace() for c in text)
    return readable and lost < 4 and any(c.isdigit() for c in text)

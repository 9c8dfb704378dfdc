# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The index of a packed store while it grows: on disk, column by column."""

import hashlib
import json
import shutil
from array import array
from pathlib import Path
from typing import IO

import numpy as np

from wildshape.io.atomic import atomic_write, naming
from wildshape.io.store.layout import DTYPES, EXTRAS, INDEX, INDEX_TENSORS, FileRecord

_CODES = {"int64": "q", "int32": "i", "float64": "d", "uint8": "B"}
_BUFFERED = 1 << 13
_TEXTS_KNOWN = 1 << 16
_KINDS = INDEX | EXTRAS
# The order in which safetensors lays tensors out: what needs most alignment first.
_ORDER = ("I64", "F64", "I32", "U8")


class IndexWriter:
    """The tensors of `INDEX` and `EXTRAS`; memory holds the last values and the last texts."""

    def __init__(self, folder: Path) -> None:
        """Columns that have outgrown their room in memory lie in `folder`, hidden."""
        self.folder = folder
        self._columns = {n: _Column(folder / f".{n}.part", kind) for n, kind in _KINDS.items()}
        self._texts: dict[str, int] = {}
        self.abandon()  # what a writer that was killed left
        for name in ("track_starts", "shard_starts", "text_starts"):
            self.append(name, 0)

    def count(self, name: str) -> int:
        """How many values a column has."""
        return self._columns[name].count

    def append(self, name: str, value: int) -> None:
        """One more value."""
        self._columns[name].append(value)

    def extend(self, name: str, values: np.ndarray) -> None:
        """More values, of any shape."""
        self._columns[name].extend(values)

    def last(self, name: str) -> int:
        """The value that was added last."""
        return self._columns[name].last

    def text(self, text: str) -> int:
        """The number of a text; equal texts that follow each other closely are kept once."""
        number = self._texts.get(text)
        if number is None:
            if len(self._texts) == _TEXTS_KNOWN:
                self._texts.clear()
            number = self._texts[text] = self.count("text_starts") - 1
            self.extend(
                "text_bytes", np.frombuffer(text.encode("utf-8", "surrogateescape"), np.uint8)
            )
            self.append("text_starts", self.count("text_bytes"))
        return number

    def finish(self) -> FileRecord:
        """Write `index.safetensors`, and remove the columns."""
        path = self.folder / INDEX_TENSORS
        with atomic_write(path, flush=True) as file:
            file.write(self._header())
            for name in self._layout():
                self._columns[name].copy_to(file)
        self.abandon()
        return file_record(path)

    def abandon(self) -> None:
        """Remove the columns."""
        for column in self._columns.values():
            column.remove()

    def _header(self) -> bytes:
        header, end = {}, 0
        for name in self._layout():
            count, start = self.count(name), end
            end += count * np.dtype(_KINDS[name]).itemsize
            shape = [count // 12, 3, 4] if name == "poses" else [count]
            dtype = DTYPES[_KINDS[name]]
            header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [start, end]}
        text = json.dumps(header, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 8)
        return len(text).to_bytes(8, "little") + text

    def _layout(self) -> list[str]:
        """The tensors in their order; extras only where there are any."""
        kept = [name for name in _KINDS if name in INDEX or self.count(name)]
        return sorted(kept, key=lambda name: (_ORDER.index(DTYPES[_KINDS[name]]), name))


class _Column:
    """Numbers of one type: the last in memory, those before them in a file."""

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.count, self.last = path, 0, 0
        self._kind = kind
        self._recent = array(_CODES[kind])

    def append(self, value: int) -> None:
        self._recent.append(value)
        self.count, self.last = self.count + 1, value
        if len(self._recent) >= _BUFFERED:
            self._flush()

    def extend(self, values: np.ndarray) -> None:
        values = np.ascontiguousarray(values, self._kind).reshape(-1)
        self._recent.frombytes(values.tobytes())
        self.count += values.size
        self.last = values[-1].item() if values.size else self.last
        if len(self._recent) >= _BUFFERED:
            self._flush()

    def copy_to(self, file: IO[bytes]) -> None:
        if self.path.exists():
            with self.path.open("rb") as older:
                shutil.copyfileobj(older, file, 1 << 20)
        file.write(self._recent.tobytes())

    def remove(self) -> None:
        self.path.unlink(missing_ok=True)

    def _flush(self) -> None:
        with naming(self.path), self.path.open("ab") as file:
            self._recent.tofile(file)
        self._recent = array(_CODES[self._kind])


def file_record(path: Path) -> FileRecord:
    """A finished file as `index.json` lists it."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return FileRecord(path.name, path.stat().st_size, digest)

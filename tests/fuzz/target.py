# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is attacked: a reader, and the valid files that its damaged inputs are made from."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.records import Track

Arrays = Iterable[np.ndarray | None]


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: in tables, and of its folder in corpus/.
        build: writes valid inputs, a folder each, below the folder given.
        read: reads what lies in a folder; yields all numbers that it returns.
        share: of the inputs, beside other targets.
        attacked: which files are damaged; default all.
        writes: the reader changes the folder, which is then made anew for each input.
    """

    name: str
    build: Callable[[Path], None]
    read: Callable[[Path], Arrays]
    share: float = 1.0
    attacked: Callable[[str], bool] = lambda _: True
    writes: bool = False


Tree = dict[str, bytes]
"""Files by their path below a folder."""


def load_tree(folder: Path) -> Tree:
    """All files below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def save_tree(folder: Path, tree: Tree) -> None:
    """Write files below a folder."""
    for name, data in tree.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def numbers_of(track: Track) -> Iterator[np.ndarray | None]:
    """All that a track holds."""
    yield from track.scans
    yield track.shape
    if track.T_sensor_object is not None:
        yield track.T_sensor_object.matrix.numpy()


def only_file(folder: Path) -> Path:
    """The file of an input that is a single one, which may be lost."""
    return next(iter(sorted(folder.iterdir())), folder / "lost.ply")

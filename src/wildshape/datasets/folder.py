# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders (DESIGN, "Track folder") as a source: the way in for anybody's own scans."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.errors import BadInputError
from wildshape.io.points import Unit
from wildshape.io.tracks import NoUsableScanError, read_track_file
from wildshape.records import Track


@dataclass
class Folder:
    """One TRACK folder, or a DATASET folder of them.

    Attributes:
        root: holds `scans/`, or folders that do.
        unit: of the coordinates on disk.
        rejected: see `Source`.
    """

    root: Path
    unit: Unit = "m"
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def tracks(self) -> Iterator[Track]:
        """Tracks in the order of their names.

        Raises:
            BadInputError: no track folder, or a track's poses, shape or track.json is damaged.
        """
        self.rejected = Counter()
        for folder in track_folders(Path(self.root)):
            try:
                read = read_track_file(folder, self.unit)
            except NoUsableScanError as error:
                self.rejected["scan: cannot be used"] += len(error.skipped)
                self.rejected["track: no scan left"] += 1
                continue
            if read.skipped:
                self.rejected["scan: cannot be used"] += len(read.skipped)
            yield read.track


def track_folders(root: Path) -> list[Path]:
    """The track folders at or directly below `root`, sorted by name.

    Raises:
        BadInputError: there is none.
    """
    if (root / "scans").is_dir():
        return [root]
    folders = sorted(scans.parent for scans in root.glob("*/scans") if scans.is_dir())
    if not folders:
        raise BadInputError(f"{root}: no track folder here; a track keeps its scans in scans/.")
    return folders

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a conversion goes: a packed store or track folders, begun, gone on with and finished."""

import shutil
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wildshape.datasets.tracks.conversion import STORE, TRACKS, PartResult
from wildshape.errors import BadInputError
from wildshape.io.atomic import lock_folder, write_json
from wildshape.io.output import (
    MARKER,
    Output,
    begin,
    command_line,
    file_name,
    provenance,
    remove_leftovers,
    unfinished,
    unlike,
)
from wildshape.io.progress import SILENT, Progress
from wildshape.io.store.join import finish_join, is_joining, join_stores
from wildshape.io.store.layout import FORMAT, JOINING_JSON, PARTS, VERSION, WRITING_JSON
from wildshape.io.store.origin import is_begun_by, unfinished_provenance
from wildshape.io.store.writer import check_room
from wildshape.io.tracks import place_track
from wildshape.io.write_tracks import FILES

_COMMAND = "convert"
Done = list[tuple[Path, PartResult]]


def left_out(results: list[PartResult]) -> dict[str, int]:
    """How much was left out of all parts, by reason; what is most comes first."""
    total: Counter[str] = Counter()
    for result in results:
        total.update(result.left_out)
    return dict(sorted(total.items(), key=lambda entry: (-entry[1], entry[0])))


def _told(results: list[PartResult]) -> dict[str, Any]:
    """What an output says of its making."""
    parts = [{k: v for k, v in asdict(r).items() if k != "names"} for r in results]
    return {"left_out": left_out(results), "parts": parts}


@dataclass
class _Folder:
    """What every destination is told; finished parts wait for the others in its folder `PARTS`.

    Attributes:
        settings: JSON values; all that decides the content.
        overwrite: replace what is there.
        progress: is told that an earlier run is gone on with.
    """

    path: Path
    settings: dict[str, Any]
    overwrite: bool
    progress: Progress = SILENT


class PackedStore(_Folder):
    """One packed store; an older one in its place stays until the new one is whole."""

    replaces = False

    def begin(self) -> list[PartResult] | None:
        """Start, or go on; returns the results if there is nothing left to convert.

        Raises:
            BadInputError: something else is there.
        """
        self._made = {**provenance(command_line()), "made_by": _COMMAND, "settings": self.settings}
        if self.path.exists() and not self.path.is_dir():
            raise BadInputError(f"{self.path}: is a file; OUT names a folder to write.")
        lock_folder(self.path)
        if not (self.path / WRITING_JSON).is_file():
            (self.path / JOINING_JSON).unlink(missing_ok=True)  # of a run killed at its very end
        if is_begun_by(self.path, self._made):
            self.progress.say(f"going on with the unfinished store in {self.path}")
            remove_leftovers(self.path)
        else:
            self._make_room()
        if is_joining(self.path):
            made = finish_join(self.path)["provenance"]
            return [PartResult(**part) for part in made["parts"]]
        told = {"format": FORMAT, "version": VERSION, "provenance": self._made}
        write_json(self.path / WRITING_JSON, told)
        _sweep(self.path / PARTS)
        return None

    def finish(self, done: Done) -> None:
        """Put the parts together, in the order given.

        Raises:
            BadInputError: two tracks of one name.
        """
        stores = [place / STORE for place, result in done if result.tracks]
        join_stores(stores, self.path, self._made | _told([result for _, result in done]))

    def abandon(self) -> None:
        """Leave no trace."""
        shutil.rmtree(self.path / PARTS, ignore_errors=True)
        (self.path / WRITING_JSON).unlink(missing_ok=True)
        if not any(self.path.iterdir()):
            self.path.rmdir()

    def _make_room(self) -> None:
        found = unfinished_provenance(self.path)
        if not self.overwrite and found.get("made_by") == _COMMAND:
            raise BadInputError(
                f"{self.path}: holds an unfinished conversion with other settings or of other"
                f" data{unlike(found, self.settings)}; repeat it as it was, pass"
                " --overwrite, or choose another OUT."
            )
        check_room(self.path, overwrite=self.overwrite)
        (self.path / JOINING_JSON).unlink(missing_ok=True)
        shutil.rmtree(self.path / PARTS, ignore_errors=True)


class TrackFolders(_Folder):
    """A DATASET folder; each track appears in it whole, but for what `place_track` says."""

    @property
    def replaces(self) -> bool:
        """Whether an earlier output is set aside until this one is finished."""
        return self._output.replaces

    def begin(self) -> None:
        """Start, or go on; errors as of `PackedStore`."""
        if (self.path / MARKER).is_file() and not unfinished(self.path, _COMMAND):
            shutil.rmtree(self.path / PARTS, ignore_errors=True)  # of a run killed at its very end
        self._output: Output = begin(
            self.path,
            _COMMAND,
            self.settings,
            FILES,
            overwrite=self.overwrite,
            progress=self.progress,
        )
        if not self._output.resumed:
            shutil.rmtree(self.path / PARTS, ignore_errors=True)
        _sweep(self.path / PARTS)

    def finish(self, done: Done) -> None:
        """Give the tracks their names, in the order given; errors as of `PackedStore`."""
        names = [file_name(name) for _, result in done for name in result.names]
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise BadInputError(f"two tracks are named '{twice[0]}'; rename one of them.")
        for place, result in done:
            for number, name in enumerate(result.names):
                made = place / TRACKS / f"{number:06d}"
                if made.exists():  # not moved by an earlier run
                    place_track(made, self.path / name)
        # Finished first: a part without its result, but with its tracks moved, would be made anew.
        self._output.finish(**_told([result for _, result in done]))
        shutil.rmtree(self.path / PARTS, ignore_errors=True)

    def abandon(self) -> None:
        """Leave no trace, or what was set aside."""
        shutil.rmtree(self.path / PARTS, ignore_errors=True)
        self._output.abandon()


def _sweep(parts: Path) -> None:
    """Remove what workers that were killed left unfinished."""
    for leftover in parts.glob(".*"):
        shutil.rmtree(leftover, ignore_errors=True)

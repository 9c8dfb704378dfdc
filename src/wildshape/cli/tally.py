# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `complete` and `register` count while they work."""

from dataclasses import dataclass, field

from wildshape.records import Completion, Track


@dataclass
class Tally:
    """What was done.

    Attributes:
        tracks: written now.
        kept: finished by an earlier, interrupted run.
        scans: written now.
        skipped: what could not be used, with the reason.
        flagged: scans that carry a warning; `example` is the first of them.
    """

    tracks: int = 0
    kept: int = 0
    scans: int = 0
    skipped: list[tuple[str, str]] = field(default_factory=list)
    flagged: int = 0
    example: str = ""

    def add(self, track: Track, scans: list[Completion]) -> None:
        """Count a track."""
        self.tracks += 1
        self.scans += len(scans)
        for name, done in zip(track.scan_names, scans):
            if done.warning:
                self.flagged += 1
                self.example = self.example or f"{track.name}/{name}: {done.warning}"

    @property
    def warning(self) -> str:
        """A sentence on the scans that the model was not made for, or nothing."""
        if not self.flagged:
            return ""
        return f"{self.flagged} scans are flagged with confidence 0, for example {self.example}"

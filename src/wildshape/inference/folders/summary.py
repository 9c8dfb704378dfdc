# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What was done to a folder, in words and as JSON."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wildshape.inference.confidence import ReasonCounts
from wildshape.io.progress import counted, duration
from wildshape.records import Completion, Track


@dataclass
class FolderSummary:
    """What was done.

    Attributes:
        out: the folder written.
        done: the verb: `completed` or `registered`.
        tracks: written now.
        finished_before: tracks of an earlier, interrupted run.
        scans: written now.
        seconds: that it took.
        workers: how many did the work.
        skipped: what could not be used, with the reason.
        dropped: a sentence on points that were not finite, or nothing.
        reasons: which scans' results are not to be trusted.
    """

    out: Path
    done: str
    tracks: int = 0
    finished_before: int = 0
    scans: int = 0
    seconds: float = 0.0
    workers: int = 1
    skipped: list[tuple[str, str]] = field(default_factory=list)
    dropped: str = ""
    reasons: ReasonCounts = field(default_factory=ReasonCounts)

    def add(self, track: Track, scans: list[Completion]) -> None:
        """Count a track."""
        self.tracks += 1
        self.scans += len(scans)
        self.reasons.of((f"{track.name}/{name}" for name in track.scan_names), scans)

    @property
    def sentence(self) -> str:
        """The same in words."""
        earlier = counted(self.finished_before, "track")
        before = f", {earlier} had been finished before" if self.finished_before else ""
        return (
            f"{self.done} {counted(self.scans, 'scan')} of {counted(self.tracks, 'track')}"
            f" in {duration(self.seconds)} with {counted(self.workers, 'worker')}{before};"
            f" see {self.out}"
        )

    @property
    def data(self) -> dict[str, Any]:
        """The same as JSON values."""
        return {
            "out": str(self.out),
            "tracks": self.tracks,
            "tracks_finished_before": self.finished_before,
            "scans": self.scans,
            "skipped": [{"what": what, "reason": reason} for what, reason in self.skipped],
            **self.reasons.data,
            "workers": self.workers,
            "seconds": round(self.seconds, 3),
        }

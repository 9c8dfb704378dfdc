# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a run writes its figures: `log.jsonl`, TensorBoard events, a progress line."""

import json
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from wildshape.io.atomic import naming, write_text


class RunLog:
    """Appends to `log.jsonl` and, where tensorboardX is installed, to TensorBoard events.

    Args:
        folder: of the run.
        step: entries of later steps, left by a run that was killed, are dropped.
    """

    def __init__(self, folder: Path, step: int) -> None:
        self.path = folder / "log.jsonl"
        _keep_until(self.path, step)
        self._file = self.path.open("a", encoding="utf-8")
        self._board = _tensorboard(folder, step)

    def write(self, step: int, values: dict[str, Any]) -> None:
        """One entry; numbers also go to TensorBoard."""
        with naming(self.path):
            self._file.write(json.dumps({"step": step, **values}) + "\n")
            self._file.flush()
        if self._board is not None:
            self._board.add(step, values)

    def __enter__(self) -> "RunLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with naming(self.path):
            self._file.close()
        if self._board is not None:
            self._board.close()


def _keep_until(path: Path, step: int) -> None:
    if not path.exists():
        return
    kept = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            if json.loads(line)["step"] <= step:
                kept.append(line)
        except (ValueError, TypeError, KeyError, RecursionError):  # damaged
            continue
    write_text(path, "".join(f"{line}\n" for line in kept))


class _Board:
    """A file of TensorBoard events, written in this thread.

    `SummaryWriter` writes in another: where that one dies (a full disk, no memory), its queue fills
    and the run waits for ever.
    """

    def __init__(self, folder: Path, step: int) -> None:
        from tensorboardX.event_file_writer import EventsWriter
        from tensorboardX.proto.event_pb2 import (
            Event,  # pyright: ignore[reportAttributeAccessIssue]
            SessionLog,  # pyright: ignore[reportAttributeAccessIssue]
        )
        from tensorboardX.summary import scalar

        self._event, self._scalar = Event, scalar
        folder.mkdir(parents=True, exist_ok=True)
        self._file = EventsWriter(str(folder / "events"))
        # Entries of these steps and later, of a run that was killed, are no longer drawn.
        began = SessionLog(status=SessionLog.START)
        self._file.write_event(Event(step=step, file_version="brain.Event:2"))
        self._file.write_event(Event(step=step, session_log=began))

    def add(self, step: int, values: dict[str, Any]) -> None:
        """Numbers; the rest is left out."""
        for name, value in values.items():
            if isinstance(value, int | float):
                entry = self._scalar(name, value)
                event = self._event(step=step, wall_time=time.time(), summary=entry)
                self._file.write_event(event)
        self._file.flush()

    def close(self) -> None:
        """Write what is left."""
        self._file.close()


def _tensorboard(folder: Path, step: int) -> _Board | None:
    try:
        return _Board(folder / "tensorboard", step + 1)
    except ImportError:
        return None

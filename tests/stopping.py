# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work that is stopped while it removes files, as by Ctrl-C."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def stopped_at_removal(number: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Inside so many files are removed; at the next one KeyboardInterrupt comes, and ends here."""
    real, left = Path.unlink, iter([None] * number)

    def stopped(path: Path, *, missing_ok: bool = False) -> None:
        if next(left, "stop") == "stop":
            raise KeyboardInterrupt
        real(path, missing_ok=missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", stopped)
        with pytest.raises(KeyboardInterrupt):
            yield

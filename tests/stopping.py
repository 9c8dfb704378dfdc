# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work that is stopped while it removes or moves files, as by Ctrl-C."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


class Killed(BaseException):
    """A process is killed here."""


@contextmanager
def stopped_at(
    owner: Any, call: str, number: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Inside so many calls are made; at the next one KeyboardInterrupt comes, and ends here."""
    real, left = getattr(owner, call), iter([None] * number)

    def stopped(*args: Any, **named: Any) -> Any:
        if next(left, "stop") == "stop":
            raise KeyboardInterrupt
        return real(*args, **named)

    with monkeypatch.context() as patch:
        patch.setattr(owner, call, stopped)
        with pytest.raises(KeyboardInterrupt):
            yield

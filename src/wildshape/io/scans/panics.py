# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Libraries written in Rust print a trace when they panic; a user is to see one sentence."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryFile
from threading import Lock

_STDERR = 2
_TRACE = re.compile(
    rb"^\n?thread '[^\n]*panicked at .*?(?:RUST_BACKTRACE[^\n]*\n|\Z)", re.DOTALL | re.MULTILINE
)
_alone = Lock()


@contextmanager
def without_traces() -> Iterator[None]:
    """Leave out the traces of panics inside; all else that any thread writes to stderr follows.

    Rust writes to the file descriptor, so that is what is turned aside, by one thread at a time.
    """
    with _alone, TemporaryFile() as aside:
        try:
            kept = os.dup(_STDERR)
        except OSError:  # there is no stderr
            yield
            return
        os.dup2(aside.fileno(), _STDERR)
        try:
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)
            aside.seek(0)
            rest = _TRACE.sub(b"", aside.read())
            if rest:
                os.write(_STDERR, rest)

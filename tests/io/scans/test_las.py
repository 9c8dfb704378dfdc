# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import os
from pathlib import Path

import pytest

from wildshape.errors import BadInputError
from wildshape.io.guard import reading
from wildshape.io.scans.las import without_traces

_TRACE = (
    b"\nthread '<unnamed>' (77) panicked at src/decoders.rs:91:17:\nmid > len\n"
    b"note: run with `RUST_BACKTRACE=1` environment variable to display a backtrace\n"
)


class PanicException(BaseException):
    """What pyo3 raises when Rust panics."""


def _panic() -> None:
    with reading(Path("a.laz"), "a LAZ file"), without_traces():
        os.write(2, b"of another thread\n")
        os.write(2, _TRACE)
        os.write(2, b"of a third\n")
        raise PanicException("mid > len")


def test_a_panic_is_one_sentence_and_no_trace(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BadInputError, match="mid > len"):
        _panic()
    assert capfd.readouterr().err == "of another thread\nof a third\n"


def test_what_is_no_trace_is_said_afterwards(capfd: pytest.CaptureFixture[str]) -> None:
    with without_traces():
        os.write(2, b"a warning\n")
    os.write(2, b"later\n")
    assert capfd.readouterr().err == "a warning\nlater\n"

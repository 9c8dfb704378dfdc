# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work in several processes: order, errors, and workers that are killed."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from wildshape.errors import BadInputError
from wildshape.parallel.processes import as_done, in_order


def square(number):
    os.write(1, b"a line that is no result\n")
    return number * number


def killed_once(folder, number):
    mark = Path(folder) / f"{number}"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def killed_always(number):
    os.kill(os.getpid(), signal.SIGKILL)


def refuse(number):
    if number == 1:
        raise BadInputError("item 1: refused.")
    raise ZeroDivisionError


def test_results_come_in_order():
    assert list(in_order(square, range(20), 2)) == [i * i for i in range(20)]
    assert sorted(as_done(square, range(20), 2)) == [i * i for i in range(20)]


def test_what_a_killed_worker_held_is_done_again(tmp_path):
    assert list(in_order(partial(killed_once, tmp_path), range(6), 2)) == list(range(6))
    assert (tmp_path / "3").exists()


def test_what_kills_every_worker_is_given_up():
    with pytest.raises(BadInputError, match=r"^7: the process .* ended early 3 times"):
        list(as_done(killed_always, [7], 1))


def test_errors_come_across():
    with pytest.raises(BadInputError, match="item 1: refused"):
        list(as_done(refuse, [1], 1))
    with pytest.raises(ZeroDivisionError):
        list(as_done(refuse, [2], 1))

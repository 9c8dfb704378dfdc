# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Work on several threads comes back in order, and torch keeps its own threads."""

import threading

import pytest
import torch

from wildshape.ops.threads import exact_on, exact_threads, spread


@pytest.fixture(autouse=True)
def two():
    """torch has two threads, unlike in other tests: what changes them is seen."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def test_as_many_as_torch_unless_told():
    assert exact_threads() == 2
    with exact_on(5):
        with exact_on(3):
            assert exact_threads() == 3
        assert exact_threads() == 5
    assert exact_threads() == 2


def test_several_at_once_in_order():
    """Each waits until all are at work: one thread alone would never end."""
    together = threading.Barrier(3, timeout=60)

    def task(item):
        together.wait()
        assert torch.get_num_threads() == 1
        return 10 * item

    with exact_on(3):
        assert spread(task, iter(range(3))) == [0, 10, 20]
    assert torch.get_num_threads() == 2


def test_threads_that_stay_work_alone_whatever_is_set_meanwhile():
    def task(_):
        return torch.get_num_threads()

    with exact_on(4):
        found = spread(lambda item: item, range(8))
        torch.set_num_threads(3)
        assert set(spread(task, range(8))) == {1}
    assert found == list(range(8))


def test_what_one_raises_is_raised():
    with exact_on(2), pytest.raises(ZeroDivisionError):
        spread(lambda item: 1 / item, [2, 1, 0])

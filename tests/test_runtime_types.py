# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is annotated is checked at each call: types, shapes, and that an axis has one size."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from beartype import beartype
from beartype.roar import BeartypeCallHintViolation
from jaxtyping import Float, TypeCheckError
from tests.runtime_types import checked

from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detections import number_of

within = pytest.raises((BeartypeCallHintViolation, TypeCheckError))
Points = Float[np.ndarray, "n 3"]


@checked(typechecker=beartype)
def added(a: Points, b: Points, columns: int = 3) -> Points:
    return (a + b)[:, :columns]


@checked(typechecker=beartype)
def more(a: Points, others: "Points") -> Float[np.ndarray, "m 3"]:
    return np.concatenate((added(a, a), added(others, others)))


@checked(typechecker=beartype)
def rows(points: Points, of: Points) -> Iterator[Points]:
    yield from (points, of)


@checked(typechecker=beartype)
def unknown(names: list["Nobody"]) -> int:  # pyright: ignore[reportUndefinedVariable]
    return len(names)


class Held:
    @checked(typechecker=beartype)
    @property
    def broken(self) -> int:
        return "three"  # pyright: ignore[reportReturnType]

    @checked(typechecker=beartype)
    @staticmethod
    def named(name: str) -> "Unknown":  # pyright: ignore[reportUndefinedVariable]
        return name

    @checked(typechecker=beartype)
    @classmethod
    def made(cls, points: Points) -> "Held":
        return cls()


def test_what_fits_is_let_through():
    assert added(np.zeros((2, 3)), np.ones((2, 3))).sum() == 6
    assert len(list(rows(np.zeros((2, 3)), np.ones((2, 3))))) == 2
    assert unknown(["a"]) == 1
    assert Held.named("a") == "a"
    assert isinstance(Held.made(np.zeros((2, 3))), Held)


def test_each_call_has_axes_of_its_own():
    assert len(more(np.zeros((4, 3)), np.zeros((4, 3)))) == 8
    with within:
        more(np.zeros((4, 3)), np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("function", "given"),
    [
        (added, (np.zeros((2, 4)), np.zeros((2, 4)))),
        (added, (np.zeros((2, 3)), np.zeros((1, 3)))),
        (added, (np.zeros((2, 3)), np.zeros((2, 3)), "all")),
        (added, (np.zeros((2, 3), dtype=int), np.zeros((2, 3), dtype=int))),
        (added, (np.zeros((2, 3)), np.zeros((2, 3)), 2)),
        (rows, (np.zeros((2, 3)), np.zeros((1, 3)))),
        (Held.named, (3,)),
        (Held.made, (np.zeros(3),)),
        (getattr, (Held(), "broken")),
    ],
)
def test_what_does_not_fit_is_refused(function, given):
    with within:
        function(*given)


def test_the_package_is_checked():
    with within:
        SE3.identity().apply(torch.zeros(2, 2))
    with within:
        number_of(3, 4)  # pyright: ignore[reportArgumentType]

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms. `T_a_b` takes points of frame b to frame a; frames cancel in a product."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Real
from torch import Tensor

from wildshape.arguments import expect
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    rotation_angle,
    rotation_from_quaternion,
)

_TOLERANCE = 1e-3
_OF_MATRICES = "SE3.from_matrix makes one of 4x4 matrices"
ROWS = 4096
"""Points moved at once: few enough for the cache, and for BLAS to wake no threads."""


@dataclass(frozen=True, eq=False)
class SE3:
    """A batch of rigid transforms `x -> R x + t`.

    `==` says whether two are the same object; compare their `.matrix` by numbers.

    Attributes:
        rotation: `(..., 3, 3)`, proper rotations.
        translation: `(..., 3)`, metres.
    """

    rotation: Float[Tensor, "*batch 3 3"]
    translation: Float[Tensor, "*batch 3"]

    def __repr__(self) -> str:
        if self.translation.ndim > 1:
            return f"SE3({' x '.join(map(str, self.translation.shape[:-1]))} transforms)"
        moved = ", ".join(f"{value:z.2f}" for value in self.translation.tolist())
        return (
            f"SE3(moves by ({moved}) m, turns by {math.degrees(float(self.angle())):.1f} degrees)"
        )

    @classmethod
    def identity(cls, *batch: int) -> "SE3":
        """Transforms that change nothing, of the given batch shape."""
        eye = torch.eye(3, dtype=torch.float64, device="cpu").repeat(*batch, 1, 1)
        return cls(eye, torch.zeros(*batch, 3, dtype=torch.float64, device="cpu"))

    def where(self, chosen: Bool[Tensor, "*batch"], other: "SE3") -> "SE3":
        """These transforms where they are chosen, the other's elsewhere."""
        rotation = torch.where(chosen[..., None, None], self.rotation, other.rotation)
        return type(self)(
            rotation, torch.where(chosen[..., None], self.translation, other.translation)
        )

    @classmethod
    def from_matrix(cls, matrix: Float[Tensor, "*batch rows 4"] | np.ndarray) -> "SE3":
        """From 3x4 or 4x4 matrices, row-major, metres; a copy in float64.

        Raises:
            BadInputError: it is no array of real numbers, a matrix is of another shape, not
                finite, its left 3x3 block is no rotation, or its last row is not 0 0 0 1 (as when
                it is column-major).
        """
        m = _copied(matrix)
        _check_layout(m)
        rotation, translation = m[..., :3, :3], m[..., :3, 3]
        residual = rotation @ rotation.mT - torch.eye(3, dtype=m.dtype, device=m.device)
        determinant = torch.linalg.det(rotation)
        wrong = (residual.abs().amax((-2, -1)) > _TOLERANCE) | ((determinant - 1).abs() > 0.01)
        if bool(wrong.any()):
            bad = float(determinant[wrong].reshape(-1)[0])
            raise BadInputError(f"a pose is no rotation (determinant {bad:.4f}, should be 1).")
        return cls(rotation, translation)

    @property
    def matrix(self) -> Float[Tensor, "*batch 4 4"]:
        """As 4x4 matrices, row-major."""
        top = torch.cat((self.rotation, self.translation[..., None]), dim=-1)
        bottom = top.new_tensor((0.0, 0.0, 0.0, 1.0)).expand(*top.shape[:-2], 1, 4)
        return torch.cat((top, bottom), dim=-2)

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        """`np.asarray(T)` is the 4x4 matrix."""
        return np.asarray(self.matrix.detach().cpu().numpy(), dtype=dtype)

    def __len__(self) -> int:
        self._check_batch()
        return len(self.translation)

    def __bool__(self) -> bool:
        """False of an empty batch alone, as of a list."""
        return self.translation.ndim == 1 or len(self) > 0

    def __iter__(self) -> Iterator["SE3"]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: int | slice | Tensor) -> "SE3":
        self._check_batch()
        return type(self)(self.rotation[index], self.translation[index])

    def _check_batch(self) -> None:
        """Rows of one transform are none.

        Raises:
            TypeError: it is one.
        """
        if self.translation.ndim == 1:
            raise TypeError("one transform has no length and no parts; index its .matrix.")

    def inverse(self) -> "SE3":
        """`T_b_a` of `T_a_b`."""
        inverse = self.rotation.mT
        return type(self)(inverse, -(inverse @ self.translation[..., None])[..., 0])

    def __matmul__(self, other: "SE3") -> "SE3":
        """Composition: `T_a_c = T_a_b @ T_b_c`, broadcast over the batch.

        Raises:
            BadInputError: `other` is no `SE3`.
        """
        expect(other, SE3, "what follows @", _OF_MATRICES)
        rotation = self.rotation @ other.rotation
        translation = (self.rotation @ other.translation[..., None])[..., 0] + self.translation
        return type(self)(rotation, translation)

    def apply(self, points: Float[Tensor, "*batch n 3"]) -> Float[Tensor, "*batch n 3"]:
        """Carry points `(..., n, 3)` of frame b to frame a."""
        expect(points, Tensor, "points", "apply_numpy takes arrays")
        return points @ self.rotation.mT + self.translation[..., None, :]

    def apply_numpy(self, points: Real[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """`apply` for one array of points, computed in float64, returned in the array's type.

        What this type cannot hold is infinite. Whole numbers become floating ones.
        """
        expect(points, np.ndarray, "points", "np.asarray makes one")
        rotation, translation = self.rotation.double().numpy(), self.translation.double().numpy()
        moved = np.empty(points.shape, np.result_type(points, np.float16))
        for start in range(0, len(points), ROWS):
            part = slice(start, start + ROWS)
            with np.errstate(over="ignore"):
                moved[part] = points[part].astype(np.float64) @ rotation.T + translation
        return moved

    def scaled(self, factor: float) -> "SE3":
        """The same transforms where lengths are so many times as large."""
        return type(self)(self.rotation, self.translation * factor)

    def angle(self) -> Float[Tensor, "*batch"]:
        """Rotation angle in radians."""
        return rotation_angle(self.rotation)

    def to(self, dtype: torch.dtype) -> "SE3":
        """The same transforms in another floating type."""
        return type(self)(self.rotation.to(dtype), self.translation.to(dtype))

    def owned(self) -> "SE3":
        """A copy that autograd takes, too, wherever it was made (`torch.inference_mode`)."""
        with torch.inference_mode(mode=False):
            return type(self)(self.rotation.clone(), self.translation.clone())


def _copied(matrix: Tensor | np.ndarray) -> Tensor:
    if isinstance(matrix, Tensor):
        return matrix.to(torch.float64, copy=True)
    try:
        numbers = np.asarray(matrix)
        if numbers.dtype.kind == "c":
            raise TypeError("its numbers are complex")
        return torch.from_numpy(numbers.astype(np.float64, order="C"))
    except (TypeError, ValueError) as error:
        raise BadInputError(f"a pose is no array of numbers ({error}); give 3x4 or 4x4.") from error


def _check_layout(m: Tensor) -> None:
    if m.ndim < 2 or m.shape[-2:] not in ((3, 4), (4, 4)):
        raise BadInputError(f"a pose is of shape {tuple(m.shape)}, expected 3x4 or 4x4.")
    if not bool(torch.isfinite(m).all()):
        raise BadInputError("a pose holds NaN or infinite numbers.")
    last = m[..., 3:, :]
    if bool(((last - last.new_tensor((0.0, 0.0, 0.0, 1.0))).abs() > _TOLERANCE).any()):
        raise BadInputError("the last row of a pose is not 0 0 0 1; give it row-major.")


def several(transforms: object, name: str) -> SE3:
    """A batch `(n,)` of what is handed in as several transforms.

    Args:
        transforms: a batch, single ones in a list, or matrices `(n, 4, 4)`.
        name: for the error.

    Raises:
        BadInputError: one alone, none, or something else.
    """
    if isinstance(transforms, list | tuple) and all(isinstance(T, SE3) for T in transforms):
        return stack(list(transforms))
    if isinstance(transforms, np.ndarray | Tensor):
        transforms = SE3.from_matrix(transforms)
    found = expect(transforms, SE3, name, _OF_MATRICES)
    if found.translation.ndim != 2:
        raise BadInputError(f"{name}: expected several transforms, found {found!r}.")
    return found


def stack(transforms: Iterable[SE3]) -> SE3:
    """One batch of several transforms.

    Raises:
        BadInputError: none, or something else.
    """
    transforms = [expect(T, SE3, "transforms", _OF_MATRICES) for T in transforms]
    if not transforms:
        raise BadInputError("transforms: expected at least one.")
    return SE3(
        torch.stack([t.rotation for t in transforms]),
        torch.stack([t.translation for t in transforms]),
    )


_NEARLY_EQUAL = 1e-7


def between(start: SE3, end: SE3, share: float) -> SE3:
    """The pose after a share of the way, linear in place and slerp in attitude (Shoemake 1985).

    Args:
        start: `T_a_b` at share 0, one pose.
        end: `T_a_b` at share 1, one pose.
        share: 0 to 1.
    """
    p = quaternion_from_rotation(start.rotation)
    q = quaternion_from_rotation(end.rotation)
    # q and -q are the same attitude; the nearer one is the shorter way.
    cosine = (p * q).sum()
    q, cosine = (-q, -cosine) if cosine < 0 else (q, cosine)
    angle = torch.acos(cosine.clamp(max=1.0))
    if angle < _NEARLY_EQUAL:
        weights = (1.0 - share, share)
    else:
        weights = (torch.sin((1 - share) * angle), torch.sin(share * angle))
    turned = rotation_from_quaternion(weights[0] * p + weights[1] * q)
    return SE3(turned, (1 - share) * start.translation + share * end.translation)

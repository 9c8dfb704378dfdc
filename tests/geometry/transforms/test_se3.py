# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.refusal import refused
from tests.strategies import clouds, poses, rotation_about

from wildshape.geometry.transforms.se3 import SE3, stack


def assert_same(a, b, atol=1e-10):
    torch.testing.assert_close(a.matrix, b.matrix, atol=atol, rtol=0)


@given(poses(), poses(), poses())
def test_associative(a, b, c):
    assert_same((a @ b) @ c, a @ (b @ c))


@given(poses())
def test_identity_and_inverse(T):
    one = SE3.identity()
    assert_same(T @ one, T, atol=0)
    assert_same(one @ T, T, atol=0)
    assert_same(T @ T.inverse(), one)
    assert_same(T.inverse() @ T, one)
    assert_same(T.inverse().inverse(), T)


@given(poses(), poses())
def test_frames_cancel(T_a_b, T_b_c):
    x_c = clouds(0, 7, 3, scale=5.0)
    x_a = T_a_b.apply(T_b_c.apply(x_c))
    torch.testing.assert_close((T_a_b @ T_b_c).apply(x_c), x_a, atol=1e-10, rtol=0)


@given(poses())
def test_rigid(T):
    x = clouds(1, 6, 3, scale=5.0)
    moved = T.apply(x)
    apart = (x[:, None] - x).norm(dim=-1)
    torch.testing.assert_close((moved[:, None] - moved).norm(dim=-1), apart, atol=1e-10, rtol=0)


@given(poses(), st.floats(0.01, 100))
def test_scaled_carries_scaled_points_to_scaled_places(T, factor):
    x = clouds(1, 6, 3, scale=5.0)
    torch.testing.assert_close(T.scaled(factor).apply(x * factor), T.apply(x) * factor)


@pytest.mark.parametrize("held", [np.eye(4), torch.eye(4, dtype=torch.float64)])
def test_a_matrix_changed_afterwards_changes_no_pose(held):
    T = SE3.from_matrix(held)
    held[:3, 3] = 5.0
    assert_same(T, SE3.identity(), atol=0)


def test_poses_of_a_batch_of_identities_are_each_its_own():
    many = SE3.identity(3)
    many.rotation[0, 0, 0] = 7.0
    assert_same(many[1], SE3.identity(), atol=0)


@pytest.mark.parametrize("kind", [">f8", np.float16, np.longdouble, object, int])
def test_a_matrix_of_any_kind_of_numbers_backwards_and_read_only(kind):
    matrix = np.eye(4).astype(kind)[::-1, ::-1]
    matrix.setflags(write=False)
    assert_same(SE3.from_matrix(matrix), SE3.identity(), atol=0)


@pytest.mark.parametrize("matrix", [np.eye(4) * 1j, np.full((4, 4), "a")])
def test_what_is_no_real_number_is_refused(matrix):
    refused(SE3.from_matrix, matrix, match="no array of numbers")


@given(poses())
def test_matrix_round_trip_and_homogeneous_product(T):
    assert_same(SE3.from_matrix(T.matrix), T, atol=0)
    assert_same(SE3.from_matrix(T.matrix[:3].numpy()), T, atol=0)
    x = clouds(2, 5, 3)
    homogeneous = torch.cat((x, torch.ones(5, 1, dtype=x.dtype)), dim=1)
    torch.testing.assert_close(T.apply(x), (homogeneous @ T.matrix.T)[:, :3])


def test_hand_computed():
    T = SE3(rotation_about((0.0, 0.0, 1.0), math.pi / 2), torch.tensor([1.0, 2.0, 3.0]).double())
    x = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)
    torch.testing.assert_close(T.apply(x), torch.tensor([[1.0, 3.0, 3.0]], dtype=torch.float64))
    assert float(T.angle()) == pytest.approx(math.pi / 2)


def test_batches_broadcast_index_and_stack():
    T = stack([SE3(rotation_about((1.0, 0.0, 0.0), a), clouds(i, 3)) for i, a in enumerate((1, 2))])
    assert len(T) == 2
    assert_same((T[1] @ T)[0], T[1] @ T[0])
    x = clouds(5, 2, 4, 3)
    torch.testing.assert_close(T.apply(x)[1], T[1].apply(x[1]))


def test_numpy_keeps_its_type_and_float64_digits():
    T = SE3(rotation_about((0.0, 0.0, 1.0), 1.0), torch.tensor([1e3, -1e3, 0.0]).double())
    x = clouds(6, 20, 3).float().numpy()
    there = T.apply_numpy(x)
    assert there.dtype == np.float32
    exact = T.apply(torch.from_numpy(x).double()).numpy()
    np.testing.assert_array_equal(there, exact.astype(np.float32))
    np.testing.assert_array_equal(np.asarray(T), T.matrix.numpy())


def test_whole_numbers_are_not_cut_off():
    T = SE3(torch.eye(3), torch.tensor([0.5, 0.0, 0.0]))
    assert T.apply_numpy(np.array([[1, 0, 0]])).tolist() == [[1.5, 0.0, 0.0]]


def _with(row, column, value):
    matrix = np.eye(4)
    matrix[row, column] = value
    return matrix


_ROTATED = np.asarray(
    SE3(rotation_about((1.0, 2.0, 3.0), 1.0), torch.tensor([4.0, 5.0, 6.0]).double())
)


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (np.diag([1.0, 1.0, -1.0, 1.0]), "determinant -1"),
        (np.diag([1.1, 1.1, 1.1, 1.0]), "determinant 1.33"),
        (_with(0, 1, 0.5), "no rotation"),
        (np.zeros((3, 4)), "determinant 0"),
        (np.eye(5)[:, :4], "shape"),
        (np.eye(3), "shape"),
        (np.zeros(12), "shape"),
        (_with(0, 0, np.nan), "NaN"),
        (_with(1, 3, np.inf), "infinite"),
        (_ROTATED.T, "last row"),
        (_with(3, 0, -0.5), "last row"),
        (np.stack([np.eye(4), np.diag([1.0, -1.0, 1.0, 1.0])]), "determinant -1"),
    ],
)
def test_no_rigid_transform_is_refused(matrix, said):
    refused(SE3.from_matrix, matrix, match=said)


@given(st.floats(-3e-4, 3e-4))
def test_the_rounding_of_printed_poses_is_accepted(error):
    SE3.from_matrix(_with(0, 1, error))


@pytest.mark.parametrize("take", [len, list, lambda T: T[0], lambda T: T[:2]])
def test_one_transform_has_no_parts(take):
    """It had three, of shapes (3,) and ()."""
    with pytest.raises(TypeError, match="one transform has no"):
        take(SE3.identity())
    take(SE3.identity(2))
    assert SE3.identity()
    assert SE3.identity(1)
    assert not SE3.identity(0)

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""MATLAB's files as scipy writes them come back; damaged ones end in a sentence."""

import random
import struct

import numpy as np
import pytest
from scipy.io import savemat

from wildshape.datasets.shapenet.matlab import read_matrices
from wildshape.errors import BadInputError

ARRAYS = {
    "points": np.random.default_rng(0).normal(size=(5, 3)),
    "floats": np.arange(6, dtype=np.float32).reshape(2, 3),
    "k": np.array([[1]], np.uint8),
    "steps": np.array([[-1, 70_000, 3]]),
    "words": np.array(["a", "bc"]),
    "cells": {"inner": np.ones(3)},
}
NUMBERS = ("points", "floats", "k", "steps")


@pytest.mark.parametrize("packed", [False, True])
def test_arrays_come_back(tmp_path, packed):
    savemat(tmp_path / "a.mat", ARRAYS, do_compression=packed)
    found = read_matrices(tmp_path / "a.mat", (*ARRAYS, "absent"))
    assert set(found) == set(NUMBERS)
    for name in NUMBERS:
        np.testing.assert_array_equal(found[name], ARRAYS[name])
    assert set(read_matrices(tmp_path / "a.mat", ("k",))) == {"k"}


def test_arrays_of_the_other_order_of_bytes(tmp_path):
    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    parts = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 1, 2))
    parts += struct.pack(">I", 1 << 16 | 1) + b"k" + bytes(3)
    parts += element(9, struct.pack(">dd", 0.5, -2))
    (tmp_path / "a.mat").write_bytes(bytes(124) + b"\x01\x00MI" + element(14, parts))
    assert read_matrices(tmp_path / "a.mat", ("k",))["k"].tolist() == [[0.5, -2.0]]


def test_a_type_that_is_none_is_refused(tmp_path):
    """scipy 1.18 ends the program here."""
    path = tmp_path / "a.mat"
    savemat(path, {"points": np.ones((4, 4))})
    data = bytearray(path.read_bytes())
    at = bytes(data).index(struct.pack("<II", 9, 128))
    data[at : at + 4] = bytes(4)
    path.write_bytes(data)
    with pytest.raises(BadInputError, match=r"a\.mat: expected a MATLAB file"):
        read_matrices(path, ("points",))


@pytest.mark.parametrize("packed", [False, True])
def test_damage_anywhere_is_read_or_refused(tmp_path, packed):
    path, rng = tmp_path / "a.mat", random.Random(0)
    savemat(path, ARRAYS, do_compression=packed)
    whole = path.read_bytes()
    refused = 0
    for _ in range(300):
        data = bytearray(whole)
        at = rng.randrange(120, len(data) - 4)
        data[at : at + 4] = rng.choice((b"\xff\xff\xff\x7f", bytes(4), b"\1\0\0\0", b"\0\0\0\1"))
        path.write_bytes(data[: rng.choice((len(data), len(data), at))])
        try:
            read_matrices(path, NUMBERS)
        except BadInputError:
            refused += 1
    assert refused > 50


def test_what_unpacks_to_much_is_refused(tmp_path):
    savemat(tmp_path / "a.mat", {"points": np.zeros((1 << 20, 3))}, do_compression=True)
    with pytest.raises(BadInputError, match="an array of more than"):
        read_matrices(tmp_path / "a.mat", ("points",))


def test_other_versions_are_named(tmp_path):
    savemat(tmp_path / "a.mat", {"k": np.ones(1)}, format="4")
    (tmp_path / "b.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    for name in "ab":
        with pytest.raises(BadInputError, match=r"another version than MATLAB's 5 to 7"):
            read_matrices(tmp_path / f"{name}.mat", ("k",))

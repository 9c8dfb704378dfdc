# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pickled tables are read; what else a pickle wants is refused and not done."""

import gzip
import pickle

import numpy as np
import pytest
from tests.datasets.write_pandas import FRAME, MANAGER, Made, Name, _array, _index, frame, pickled

from wildshape.datasets.pandas_pickle import read_pickled_table
from wildshape.errors import BadInputError


def column(*values):
    made = np.empty(len(values), object)
    made[:] = values
    return made


COLUMNS = {
    "uuid": column("a", "b"),
    "x": np.array([1.5, -2.0]),
    "n": np.array([3, -4]),
    "y": np.array([7.0, 8.0]),
    "still": np.array([True, False]),
    "label": column("Car", float("nan")),
}


def written(tmp_path, data, name="00.pkl.gz"):
    path = tmp_path / name
    path.write_bytes(gzip.compress(data))
    return path


def same(table):
    assert set(table) == set(COLUMNS)
    for name, values in COLUMNS.items():
        assert table[name].dtype == values.dtype
        assert [str(value) for value in table[name]] == [str(value) for value in values]


def test_a_table_of_the_pandas_of_that_time(tmp_path):
    same(read_pickled_table(written(tmp_path, pickled(frame(COLUMNS)))))


def test_a_table_of_a_newer_pandas(tmp_path):
    """As 1.3 to 2.3 write it: blocks of their own, arrays column by column in a buffer."""
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    kind = _array(values).state[2]
    numbers = Made(
        Name("numpy._core.numeric", "_frombuffer"), (values.tobytes(), kind, (2, 2), "F")
    )
    block = Made(Name("pandas._libs.internals", "_unpickle_block"), (numbers, slice(0, 2, 1), 2))
    manager = Made(MANAGER, ((block,), [_index(["x", "y"]), _index([0, 1])]))
    table = Made(FRAME, state={"_mgr": manager, "_typ": "dataframe"}, new=True)
    found = read_pickled_table(written(tmp_path, pickled(table)))
    assert found["x"].tolist() == [1, 3]
    assert found["y"].tolist() == [2, 4]


def refused(path, match):
    with pytest.raises(BadInputError, match=match) as caught:
        read_pickled_table(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("module", "name"),
    [("os", "system"), ("builtins", "eval"), ("builtins", "getattr"), ("pandas", "read_pickle")],
)
def test_a_malicious_pickle_is_not_executed(tmp_path, module, name):
    trace = tmp_path / "trace"
    command = Made(Name(module, name), (f"touch {trace}",))
    hidden = Made(FRAME, state={"_data": command, "_typ": "dataframe"}, new=True)
    for value in (command, hidden):
        refused(
            written(tmp_path, pickled(value)),
            rf"00\.pkl\.gz: this pickle wants to use \w+\.{name}, .* it was not executed",
        )
    assert not trace.exists()


def test_numpy_is_not_given_memory_by_a_pickle(tmp_path):
    """A type that claims to be of objects and brings bytes would be read as addresses."""
    values = _array(column("a", "b"))
    version, shape, kind, order, _ = values.state
    for claimed, data in ((kind, b"\x41" * 16), (Made(kind.by, ("V8", 0, 1)), b"\x41" * 16)):
        array = Made(values.by, values.arguments, (version, shape, claimed, order, data))
        blocks = {"axes": [_index(["x"])], "blocks": [{"values": array, "mgr_locs": slice(0, 1)}]}
        manager = Made(MANAGER, state=([], [], [], {"0.14.1": blocks}), new=True)
        table = Made(FRAME, state={"_data": manager}, new=True)
        refused(written(tmp_path, pickled(table)), r"found a damaged or foreign file")


def test_damaged_and_foreign_files_are_named(tmp_path):
    good = pickled(frame(COLUMNS))
    whole = written(tmp_path, good)
    refused(tmp_path / "no.pkl.gz", r"no\.pkl\.gz: no such file")
    refused(written(tmp_path, good[: len(good) // 2]), r"00\.pkl\.gz: expected a gzipped pickle")
    whole.write_bytes(gzip.compress(good)[:-20])
    refused(whole, r"00\.pkl\.gz: expected a gzipped pickle")
    whole.write_bytes(good)
    refused(whole, r"00\.pkl\.gz: cannot be read as a gzipped pickle")
    refused(written(tmp_path, pickle.dumps({"x": [1]})), r"no data frame")

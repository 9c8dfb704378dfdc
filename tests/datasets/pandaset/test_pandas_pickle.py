# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pickled tables are read; what else a pickle wants is refused and not done."""

import gzip
import pickle

import numpy as np
import pytest
from tests.datasets.write_pandas import FRAME, MANAGER, Made, Name, _array, _index, frame, pickled
from tests.io.limits import allowed, costs
from tests.refusal import refusal_of

from wildshape.datasets.pandaset import pandas_pickle
from wildshape.datasets.pandaset.pandas_pickle import read_pickled_table


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


def of_blocks(axes, *blocks):
    """A data frame of blocks, values and places each."""
    state = {"axes": axes, "blocks": [{"values": v, "mgr_locs": place} for v, place in blocks]}
    manager = Made(MANAGER, state=([], [], [], {"0.14.1": state}), new=True)
    return Made(FRAME, state={"_data": manager}, new=True)


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


refused = refusal_of(read_pickled_table)


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
        table = of_blocks([_index(["x"])], (array, slice(0, 1)))
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


CHANGES = {"__defaults__": ({"data": 1},), "__name__": "changed", "made_with": (1,)}


def imported():
    """All that a pickle may name, and what these objects hold."""
    named = pandas_pickle._NAMES.items()
    own = ("__name__", "__defaults__", "__kwdefaults__")
    return {w: (made, sorted(vars(made)), [getattr(made, o, 0) for o in own]) for w, made in named}


@pytest.mark.parametrize("where", sorted(pandas_pickle._NAMES))
@pytest.mark.parametrize(
    "change",
    [
        pickle.dumps((None, CHANGES), 2)[2:-1] + b"b",
        pickle.dumps(CHANGES, 2)[2:-1] + b"b",
        pickle.dumps(("__name__", "changed"), 2)[3:-3] + b"s",
        b"(X\x01\x00\x00\x00aNu",
        b"Na",
        b"(Ne",
        b"(N\x90",  # ADDITEMS
    ],
)
def test_no_instruction_changes_what_a_pickle_names(tmp_path, where, change):
    before = imported()
    named = f"c{where[0]}\n{where[1]}\n".encode()
    refused(written(tmp_path, b"\x80\x03" + named + change + b"."), "damaged or foreign file")
    assert imported() == before


@pytest.mark.parametrize(
    "program",
    [
        b"X\x01\x00\x00\x00a)R",  # a text is called
        b"c_codecs\nencode\n)\x81",  # a function is made an object of
        b"}((((NtttNu",  # an entry under nested tuples
        b"(inumpy\nndarray\n",
        b"(cnumpy\nndarray\no",
        b"\x82\x01",
        b"Ppersistent\n",
        b"Vtext\np0\n",
        b"N2",
        b"N0",
        b"\x8f",
        b"\x95" + (1 << 40).to_bytes(8, "little"),
        b"\x8e" + (1 << 40).to_bytes(8, "little"),
        b"\x96" + (1 << 40).to_bytes(8, "little"),
    ],
)
def test_what_no_table_needs_is_refused(tmp_path, program):
    refused(written(tmp_path, b"\x80\x05" + program + b"."), "damaged or foreign file")


def test_columns_of_different_lengths_are_refused(tmp_path):
    blocks = ((np.ones((1, n)), slice(n - 1, n)) for n in (1, 2))
    table = of_blocks([_index(["x", "y"]), _index([0])], *blocks)
    refused(written(tmp_path, pickled(table)), "columns of different lengths")


def bombs():
    """Pickles of a few bytes that ask for much; each is gzipped."""
    axes = [_index(["x"]), _index([0])]
    wide = Made(
        Name("numpy.core.multiarray", "_reconstruct"),
        (Name("numpy", "ndarray"), (0,), b"b"),
        (1, (1 << 40, 0), Made(Name("numpy", "dtype"), ("f8", 0, 1), (3, "<")), False, b""),
    )
    text = b"X" + (1 << 20).to_bytes(4, "little") + b"a" * (1 << 20) + b"q\x00"
    return {
        "slice": pickled(of_blocks(axes, (np.ones((1, 1)), slice(0, 60_000_000)))),
        "rows": pickled(of_blocks(axes, (wide, slice(0, 1 << 40)))),
        "memo": b"\x80\x03Nr" + (0x4000000).to_bytes(4, "little") + b".",
        "encode": b"\x80\x03"
        + text
        + b"c_codecs\nencode\nq\x01h\x00\x85R" * 1
        + b"h\x01h\x00\x85R" * 4000
        + b".",
        "lists": b"\x80\x03" + b"]" * 20_000_000 + b".",
        "marks": b"\x80\x03" + b"(" * 5_000_000 + b".",
        "zeros": b"\x80\x03B" + (1 << 30).to_bytes(4, "little") + bytes(1 << 26) + b".",
    }


def test_pickles_that_ask_for_much_keep_to_the_rule(tmp_path):
    paths = [written(tmp_path, data, f"{name}.pkl.gz") for name, data in bombs().items()]
    for path, cost in zip(
        paths, costs("wildshape.datasets.pandaset.pandas_pickle:read_pickled_table", paths)
    ):
        assert cost.is_answer, (path, cost)
        assert cost.error, path
        assert cost.grown < allowed(path), (path, cost)
        assert cost.cpu_s < 5, (path, cost)

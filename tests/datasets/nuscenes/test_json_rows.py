# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A list read a piece at a time is the list read at once."""

import json
import tracemalloc

import pytest

from wildshape.datasets.nuscenes import json_rows as module
from wildshape.datasets.nuscenes.json_rows import json_rows
from wildshape.errors import BadInputError

ROWS = [
    {"token": "a", "text": 'brace } and "quote", bracket ] \\', "list": [1.5, -2e-3]},
    {"token": "\u00fc\U0001f697", "inner": {"deep": [{}, None, True]}},
    {},
    {"number": 123456789},
]


@pytest.mark.parametrize("piece", [1, 2, 3, 7, 64, 1 << 20])
@pytest.mark.parametrize("indent", [None, 0, 2])
@pytest.mark.parametrize("ascii_only", [True, False])
def test_pieces_of_any_length_give_the_same_rows(tmp_path, monkeypatch, piece, indent, ascii_only):
    monkeypatch.setattr(module, "_PIECE", piece)
    path = tmp_path / "table.json"
    path.write_text(json.dumps(ROWS, indent=indent, ensure_ascii=ascii_only), encoding="utf-8")
    assert list(json_rows(path)) == ROWS


def test_an_empty_list_has_no_rows(tmp_path):
    (tmp_path / "table.json").write_text("[]")
    assert list(json_rows(tmp_path / "table.json")) == []


@pytest.mark.parametrize("text", ["", "{}", "[1]", '[{"a": 1}', '[{"a": 1}, {"b"', '[{"a": 1}, x]'])
def test_what_is_no_whole_list_of_objects_is_named(tmp_path, text):
    (tmp_path / "table.json").write_text(text)
    with pytest.raises(BadInputError, match=r"table\.json: expected a list of JSON objects"):
        list(json_rows(tmp_path / "table.json"))


def test_memory_does_not_grow_with_the_table(tmp_path):
    path = tmp_path / "table.json"
    path.write_text(json.dumps([{"token": f"{i:0500d}"} for i in range(20_000)]))
    tracemalloc.start()
    count = sum(1 for _ in json_rows(path))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 20_000
    assert path.stat().st_size > 10e6
    assert peak < 7e6  # a few pieces of a million characters

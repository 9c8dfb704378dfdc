# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Options of `convert`: each belongs to a reader, whose default the help states."""

import math
import re
from dataclasses import fields, is_dataclass

import pytest

from wildshape.cli.commands.convert import _OURS, _TRUTH, Settings
from wildshape.datasets.sources import SOURCES, open_source
from wildshape.datasets.tracks.source import Source


@pytest.fixture
def records(tmp_path):
    """All readers, and the records of settings that they hold."""
    sources = [open_source(name, tmp_path, {}) for name in SOURCES]
    every = [one for source in sources for one in (source, *vars(source).values())]
    return [record for record in every if is_dataclass(record)]


def test_every_source_can_be_opened(tmp_path):
    for name in SOURCES:
        assert isinstance(open_source(name, tmp_path, {}), Source)


def test_every_option_belongs_to_a_source(records):
    known = {name for record in records for name in vars(record)}
    asked = {field.name for field in fields(Settings)} - {*_OURS, *_TRUTH, "keep_ground"}
    assert asked <= known


@pytest.mark.parametrize(
    "name", ["min_points", "largest_m", "margin", "ground", "gap", "views", "pixels", "edge"]
)
def test_help_states_the_defaults_of_the_readers(wildshape, records, name):
    said = " ".join(wildshape("convert", "--help").out.replace("│", " ").split())
    text = said.partition(f" --{name.replace('_', '-')} ")[2].partition(" --")[0]
    own = [vars(record).get(name) for record in records]
    numbers = {f"{value:g}" for value in own if value is not None and math.isfinite(value)}
    assert numbers
    assert numbers <= set(re.findall(r"\d+(?:\.\d+)?", text))

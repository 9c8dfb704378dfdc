# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Curves of a training: means of losses, and truth where it was looked at."""

import json

import numpy as np
import pytest
from experiments.curve_picture import Settings, main, series

from wildshape.errors import BadInputError

TRUTH = {"cd": 0.3, "acc30": 0.9, "rot_median_deg": 4.0, "trans_median_m": 0.1}


def test_points_are_means_of_what_was_measured():
    log = [{"step": i, "observation": 2.0 * i} for i in range(1, 6)] + [{"step": 6}]
    steps, values = series(log, "observation", 2)
    np.testing.assert_array_equal(steps, (1.5, 3.5))
    np.testing.assert_array_equal(values, (3.0, 7.0))


def test_a_log_becomes_a_picture_that_is_always_the_same(tmp_path):
    lines = [{"step": i, "observation": 1 / i, "projection": 2 / i} for i in range(1, 31)]
    held_out = {f"validation/{key}": 0.1 for key in ("observation", "projection")}
    truth = {f"validation/truth_{key}": value for key, value in TRUTH.items()}
    lines += [{"step": step, **held_out, **truth} for step in (10, 20)]
    log = "\n".join(map(json.dumps, lines))
    pictures = []
    for name, cut_off in (("a.svg", ""), ("b.svg", '\n{"step": 31, "obs')):
        (tmp_path / "log.jsonl").write_text(log + cut_off, encoding="utf-8")
        main(Settings(tmp_path, tmp_path / name))
        pictures.append((tmp_path / name).read_text(encoding="utf-8"))
    assert pictures[0] == pictures[1]
    assert "held out: CD, m" in pictures[0]


def test_a_taught_run_shows_what_it_minimised(tmp_path):
    lines = [
        {"step": i, "pose": 1 / i, "coverage": 2 / i, "precision": 3 / i} for i in range(1, 31)
    ]
    (tmp_path / "log.jsonl").write_text("\n".join(map(json.dumps, lines)), encoding="utf-8")
    main(Settings(tmp_path, tmp_path / "taught.svg"))
    drawn = (tmp_path / "taught.svg").read_text(encoding="utf-8")
    assert "coverage, taught" in drawn
    assert "observation" not in drawn


def test_a_run_of_dpc_is_refused(tmp_path):
    line = json.dumps({"step": 25, "silhouette": 80.0, "depth": 0.0, "student": 0.7})
    (tmp_path / "log.jsonl").write_text(line, encoding="utf-8")
    with pytest.raises(BadInputError, match="DPC"):
        main(Settings(tmp_path, tmp_path / "dpc.svg"))

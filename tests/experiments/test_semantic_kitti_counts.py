# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's counts of SemanticKITTI, from labels alone."""

import numpy as np
from experiments.semantic_kitti_counts import main

PARKED, MOVING, LORRY = 7 << 16 | 10, 8 << 16 | 252, 9 << 16 | 18


def test_scans_of_few_points_count_neither_as_scans_nor_in_the_mean(tmp_path, capsys):
    """A parked car of 600, 500 and 50 points, a lorry of 700, and a car that moved."""
    folder = tmp_path / "sequences" / "08" / "labels"
    folder.mkdir(parents=True)
    for frame, (car, lorry) in enumerate(((600, 700), (500, 0), (50, 0))):
        labels = np.repeat(np.array((PARKED, LORRY, MOVING), "<u4"), (car, lorry, 900))
        labels.tofile(folder / f"{frame:06d}.label")
    main(tmp_path)
    said = capsys.readouterr().out
    train, test = said.split("test: the paper has 229 instances, 16299 scans\n")
    assert "sequences missing here: 00 01" in train
    assert "  car, scans of >= 1 points: 0 instances, 0 scans\n" in test
    assert "  car, scans of >= 100 points: 1 instances, 2 scans\n" in test
    assert "  car truck, scans of >= 100 points: 2 instances, 3 scans\n" in test

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One scan is never `1 scans`."""

from wildshape.io.progress import counted
from wildshape.report.page.metrics import of_confidences, of_errors


def test_one_and_many() -> None:
    assert [counted(n, "scan") for n in (0, 1, 2)] == ["0 scans", "1 scan", "2 scans"]
    assert counted(20_000, "point") == "20,000 points"


def test_confidences_below_the_line_are_counted_only_where_there_are_some() -> None:
    (none,), (one,) = of_confidences([0.5, 0.9], 0), of_confidences([0.4, 0.9], 0)
    assert none.endswith("none is below 0.5.")
    assert one.endswith("1 of them (50 %) are below 0.5: look at these first.")


def test_readings_of_several_scans() -> None:
    """Mean and median differ, as do the least error, the median and the largest."""
    sure, doubtful = of_confidences([0.2, 0.3, 0.4, 0.9, 0.95], 1200)
    assert sure.startswith("5 scans completed: a median confidence of 0.40; 3 of them (60 %) are")
    assert doubtful.startswith("Results not to be trusted: 1,200;")
    shape, pose = of_errors([0.2, 0.9, 0.1], [3.0, 30.0, 30.5, 90.0])
    assert shape.endswith("median Chamfer distance of 0.200 m, 0.900 m at worst.")
    assert "of 4 objects: 50 % have a median error of 30° or less" in pose


def test_readings_of_one_scan() -> None:
    said = [*of_confidences([0.5], 0), *of_errors([0.1], [3.0])]
    assert len(said) == 3
    for line, begins in zip(said, ("1 scan completed", "Against the true shape of 1 object:", "")):
        assert line.startswith(begins)
        assert "1 scans" not in line
        assert "1 objects" not in line

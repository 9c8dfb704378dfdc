# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wildshape.errors import BadInputError
from wildshape.report import picture
from wildshape.report.content import Cloud, ReportObject


def _objects() -> list[ReportObject]:
    rng = np.random.default_rng(0)
    whole = (rng.uniform(-1, 1, (900, 3)) * (2.2, 0.9, 0.7) + (12, 4, 0)).astype(np.float32)
    scan = whole[whole[:, 1] < 4]
    both = (Cloud("completed", whole), Cloud("input scan", scan))
    return [ReportObject("a", clouds=both), ReportObject("b", clouds=both[:1])]


def test_columns_are_in_the_order_of_the_work(tmp_path: Path) -> None:
    picture.write_picture(_objects(), tmp_path / "picture.png")
    with Image.open(tmp_path / "picture.png") as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    left, right = np.split(pixels[:, : pixels.shape[1] // 2 * 2], 2, axis=1)
    assert ((left[..., 0] - left[..., 2]) > 60).sum() > 500  # the scan's orange
    assert ((right[..., 2] - right[..., 0]) > 60).sum() > 500  # the completion's blue
    assert ((left[..., 2] - left[..., 0]) > 60).sum() == 0


def test_animation_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture, "_FRAMES", 3)
    path = tmp_path / "picture.webp"
    picture.write_picture(_objects()[:1], path)
    with Image.open(path) as image:
        assert getattr(image, "n_frames", 1) == 3
        first = np.asarray(image.convert("RGB")).astype(int)
        image.seek(1)
        second = np.asarray(image.convert("RGB")).astype(int)
    assert (np.abs(second - first).max(-1) > 60).mean() > 0.01


@pytest.mark.parametrize(("objects", "name"), [([], "a.png"), (_objects(), "a.gif")])
def test_refused(tmp_path: Path, objects: list[ReportObject], name: str) -> None:
    with pytest.raises(BadInputError, match=name):
        picture.write_picture(objects, tmp_path / name)
    assert not list(tmp_path.iterdir())

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: drawn, turned by the mouse, silent, and nothing fetched."""

import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from tests.report.chromium import CHROMIUM, Page, browser, colourful, eventually, moved

from wildshape.report.content import Cloud, Curve, Report, ReportObject
from wildshape.report.page import write_report

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="did not run: no chromium on PATH to open the report with"
)


@pytest.fixture
def page(tmp_path: Path):
    with browser(tmp_path / "profile") as opened:
        yield opened


def _report() -> Report:
    rng = np.random.default_rng(0)
    near = rng.uniform(-1, 1, (800, 3)) * (2.2, 0.9, 0.7) + (14, 5, -1)
    scan = near[near[:, 1] < 5].astype(np.float32)
    whole = near.astype(np.float32)
    both = (Cloud("input scan", scan), Cloud("completed", whole))
    return Report(
        title="In a browser",
        curves=(Curve("Loss", "step", "metres", (("loss", [1, 2, 3], [1.0, 0.5, 0.2]),), True),),
        objects=(ReportObject("a <b>", clouds=both), ReportObject("b", clouds=both[1:])),
    )


def _settled(page: Page, index: int) -> np.ndarray:
    """A panel's picture once it no longer changes by itself."""
    before = [page.picture(index).astype(int)]

    def unchanged(picture: np.ndarray) -> bool:
        share = moved(picture, before[0])
        before[0] = picture.astype(int)
        return share < 0.001

    time.sleep(0.5)
    eventually(lambda: page.picture(index), unchanged, "turns by itself")
    return before[0]


def test_page_draws_turns_and_stays_silent(page: Page, tmp_path: Path) -> None:
    write_report(_report(), tmp_path / "report.html")
    page.open((tmp_path / "report.html").as_uri())
    page.wait("document.querySelectorAll('.plot canvas').length >= 2")
    page.wait("document.querySelectorAll('.curve .main-svg').length >= 1")
    for panel in (0, 1):
        eventually(partial(page.picture, panel), lambda p: colourful(p) > 300, f"{panel} is blank")

    first = _settled(page, 0)
    page.drag(1, across=70)
    eventually(lambda: page.picture(0), lambda p: moved(p, first) > 0.01, "panels are not linked")

    page.ask("document.querySelectorAll('#picker button')[1].click()")
    page.wait("document.querySelectorAll('.panel:not([hidden])').length == 1")
    eventually(lambda: page.picture(0), lambda p: colourful(p) > 300, "the second object is blank")

    assert page.complaints() == []
    assert [url for url in page.loads() if not url.startswith(("file:", "data:", "blob:"))] == []


def test_empty_page_is_silent(page: Page, tmp_path: Path) -> None:
    write_report(Report(title="Nothing yet"), tmp_path / "report.html")
    page.open((tmp_path / "report.html").as_uri())
    page.wait("document.readyState == 'complete'")
    assert page.ask("document.querySelector('#objects').offsetHeight") == 0
    assert page.complaints() == []

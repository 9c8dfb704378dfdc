# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: drawn, turned by the mouse, silent, and nothing fetched."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.report.chromium import CHROMIUM, Page, browser, colourful, eventually, moved

from wildshape.report.content import Cloud, Curve, Report, ReportObject, Table
from wildshape.report.page.html import write_report
from wildshape.report.page.metrics import metrics_table

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="did not run: no chromium on PATH to open the report with"
)


@pytest.fixture
def page(tmp_path: Path):
    with browser(tmp_path / "profile") as opened:
        yield opened


def _metrics() -> dict[str, Any]:
    """Everything that evaluate can say, with deviations: the widest table there is."""
    keys = ("cd", "precision", "coverage", "acc30", "rot_median_deg", "trans_median_m")
    boxes = ("box_iou", "box_bev", "heading30", "heading30_sym")
    figures = dict.fromkeys((*keys, "acc30_sym", "rot_sym_median_deg", *boxes), 0.4444)
    each = {**figures, "std": figures, "scans_counted": {"registration": 12345}}
    names = ("multi-start-icp", "wildshape", "wildshape, seed selected without labels (cars-3)")
    return {"rotate": "yaw", "seeds": [0, 1, 2], "methods": dict.fromkeys(names, each)}


def _index() -> Table:
    """One name is longer than the page is wide: it hid all figures beyond the right edge."""
    names = ("car " + "0123456789" * 25, *(f"car {i}" for i in range(1, 8)))
    rows = tuple((name, f"{i * 7 % 11}.5", "far" if i % 2 else "") for i, name in enumerate(names))
    objects = (0, 1, *[None] * 6)
    return Table("All", ("object", "CD, m", "warning"), rows, sortable=True, objects=objects)


def _distributions() -> Table:
    basis = "object's frame, by truth; all tracks, 174 of 175 scans"
    columns = ("", "counted", "least", "5 %", "median", "95 %", "most", "mean", "from")
    return Table("Distributions", columns, (("range, m", *["12.34"] * 7, basis),))


def _report() -> Report:
    rng = np.random.default_rng(0)
    near = rng.uniform(-1, 1, (800, 3)) * (2.2, 0.9, 0.7) + (14, 5, -1)
    scan = near[near[:, 1] < 5].astype(np.float32)
    whole = near.astype(np.float32)
    both = (Cloud("input scan", scan), Cloud("completed, by the shipped weights", whole))
    scans = Table("Scans", ("scan", "confidence"), (("0", "0.5"), ("1", "0.9")))
    return Report(
        title="In a browser",
        tables=(metrics_table(_metrics()),),
        index=(_index(), _distributions()),
        curves=(
            Curve("Loss", "step", "metres", (("loss", [1, 2, 3], [1.0, 0.5, 0.2]),), log_y=True),
            Curve("Flat", "step", "metres", (("loss", [1, 2], [0.091, 0.0755]),), log_y=True),
            Curve("Of one step", "step", "metres", (("cd", [26], [0.4]),)),
        ),
        objects=(
            ReportObject("a <b>", clouds=both, scans=scans),
            ReportObject("b", clouds=both[1:]),
        ),
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
    page.wait("document.querySelectorAll('.curve .main-svg').length >= 2")
    ticks = "[...document.querySelectorAll('.curve')].map(c => c.querySelectorAll('.ytick').length)"
    assert min(page.ask(ticks)) >= 2
    assert page.ask("document.getElementById('curve2').layout.yaxis.range[0]") == 0  # no -0.5 m
    assert page.ask("document.querySelector('#show_box').offsetParent === null")  # there is none
    page.ask("document.querySelector('#panels').scrollIntoView({ block: 'center' })")
    texts = "s.xaxis.showticklabels || s.xaxis.title.text"  # too small to read, cut off at the edge
    assert not page.ask(f"(s => {texts})(document.querySelector('.plot')._fullLayout.scene)")
    for panel in (0, 1):
        eventually(partial(page.picture, panel), lambda p: colourful(p) > 300, f"{panel} is blank")

    first = _settled(page, 0)
    page.drag(1, across=70)
    eventually(lambda: page.picture(0), lambda p: moved(p, first) > 0.01, "panels are not linked")

    page.ask("document.querySelectorAll('#picker button')[1].click()")
    page.wait("document.querySelectorAll('.panel:not([hidden])').length == 1")
    eventually(lambda: page.picture(0), lambda p: colourful(p) > 300, "the second object is blank")

    _check_tables(page)
    _check_on_a_phone(page)
    _check_on_paper(page)
    assert page.complaints() == []
    assert [url for url in page.loads() if not url.startswith(("file:", "data:", "blob:"))] == []


def _check_tables(page: Page) -> None:
    _resize(page, 1300)
    wide = "[...document.querySelectorAll('main > section > .scroll')]"
    assert page.ask(f"{wide}.every(e => e.scrollWidth <= e.clientWidth)")

    first = "document.querySelector('table.sortable tbody tr:not([hidden])')"
    page.ask("document.querySelectorAll('table.sortable th')[1].click()")
    assert page.ask(f"{first}.cells[1].textContent") == "10.5"
    page.ask("document.querySelectorAll('table.sortable th')[1].click()")
    assert page.ask(f"{first}.cells[1].textContent") == "0.5"
    field = "document.querySelector('.filter input')"
    page.ask(f"{field}.value = 'FAR car'; {field}.dispatchEvent(new Event('input'))")
    assert page.ask("document.querySelector('.filter span').textContent") == "4 of 8"
    page.ask("document.querySelector('tr[data-object=\"0\"]').click()")
    assert page.ask("document.querySelector('#name').textContent") == "a <b>"
    assert page.ask("document.querySelector('#scans table').rows.length") == 3


def _check_on_a_phone(page: Page) -> None:
    _resize(page, 390)
    names = "[...document.querySelectorAll('.panel:not([hidden]) > p span')]"
    assert page.ask(f"{names}.map(e => e.textContent)") == [
        "input scan",
        "completed, by the shipped weights",
    ]
    assert page.ask(f"{names}.every(e => e.scrollWidth <= e.clientWidth)"), "cut off"
    rows = "[...document.querySelectorAll('main table tbody tr')]"
    assert page.ask(f"Math.max(...{rows}.map(e => e.offsetHeight))") < 150  # no word a line


def _check_on_paper(page: Page) -> None:
    _resize(page, 732)  # A4 between its margins, and a scroll bar
    page.call("Emulation.setEmulatedMedia", media="print")
    page.wait("matchMedia('print').matches")
    tables = "[...document.querySelectorAll('main > section > .scroll > table')]"
    assert page.ask(f"{tables}.every(e => e.offsetWidth <= e.parentElement.clientWidth)")


def _resize(page: Page, width: int) -> None:
    page.call(
        "Emulation.setDeviceMetricsOverride",
        width=width, height=900, deviceScaleFactor=1, mobile=False,
    )  # fmt: skip
    page.wait(f"innerWidth == {width}")


def test_without_javascript_the_objects_are_pictures(page: Page, tmp_path: Path) -> None:
    write_report(_report(), tmp_path / "report.html")
    page.open("about:blank")
    page.call("Emulation.setScriptExecutionDisabled", value=True)
    page.call("Page.navigate", url=(tmp_path / "report.html").as_uri())
    page.wait("document.querySelectorAll('.stills img').length == 2")
    assert page.ask("document.querySelector('.stills img').offsetHeight") > 50
    assert page.ask("document.querySelector('#show_box').offsetParent === null")
    assert "JavaScript draws it" in page.ask("document.querySelector('.curve').innerText")


def test_empty_page_is_silent(page: Page, tmp_path: Path) -> None:
    write_report(Report(title="Nothing yet"), tmp_path / "report.html")
    page.open((tmp_path / "report.html").as_uri())
    page.wait("document.readyState == 'complete'")
    assert page.ask("document.querySelector('#objects').offsetHeight") == 0
    assert page.complaints() == []

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildshape.records import Box
from wildshape.report.content import Cloud, Curve, Figure, Report, ReportObject, Table
from wildshape.report.page.html import render, write_report

EVIL = "<script>alert('x')</script> & \"co\" </script>"
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


class Elements(HTMLParser):
    """Every start tag with its attributes, and the text outside script and style."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside not in ("script", "style"):
            self.text += data


def _points(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (rng.uniform(-1, 1, (n, 3)) * (2.3, 0.9, 0.8) + (17, -6, -1)).astype(np.float32)


def _data(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert found
    return json.loads(found[1])


def _decode(cloud: dict[str, Any], low: list[float]) -> np.ndarray:
    q = np.frombuffer(base64.b64decode(cloud["points"]), "<i2").reshape(-1, 3)
    return (q.astype(np.float64) + 32767) * cloud["step"] + low


def _full() -> Report:
    box = Box((17.0, -6.0, -1.0), (4.6, 1.8, 1.6), (1.0, 0.0, 0.0, 0.0))
    clouds = (Cloud("input scan", _points(300)), Cloud("completed", _points(2048, 1)))
    return Report(
        title=f"Title {EVIL}",
        summary=f"Summary {EVIL}\n\nsecond",
        cost=((f"cost {EVIL}", f"value {EVIL}"),),
        tables=(Table(f"table {EVIL}", (EVIL, "CD"), ((EVIL, 0.12345), ("x", None)), EVIL, (0,)),),
        curves=(Curve(f"curve {EVIL}", EVIL, EVIL, ((EVIL, [0, 1], [1.0, float("nan")]),)),),
        objects=(ReportObject(f"object {EVIL}", EVIL, clouds, box, ((EVIL, EVIL),)),),
        notes=(f"note {EVIL}",),
        provenance={EVIL: {EVIL: 1}, "path": Path("a/b")},
        figures=(Figure(f"figure {EVIL}", PNG),),
    )


def test_names_are_shown_as_they_are_and_never_run() -> None:
    page = render(_full())
    elements = Elements(page)
    assert [tag for tag, _ in elements.tags].count("script") == 3  # data, plotly, ours
    for part in ("Title", "Summary", "cost", "value", "table", "curve", "figure", "note"):
        assert f"{part} {EVIL}" in elements.text
    assert _data(page)["objects"][0]["name"] == f"object {EVIL}"
    assert _data(page)["curves"][0]["series"][0]["y"] == [1.0, None]


def test_nothing_is_loaded_from_outside() -> None:
    page = render(_full())
    loading = ("src", "href", "srcset", "data", "poster", "action")
    for tag, attributes in Elements(page).tags:
        for name in loading:
            assert (attributes.get(name) or "data:").startswith("data:"), (tag, name)
    policy = next(a["content"] for _, a in Elements(page).tags if "http-equiv" in a)
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    style = page[page.index("<style>") : page.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style


def test_points_come_back_within_half_a_step() -> None:
    clouds = (Cloud("input scan", _points(300)), Cloud("completed", _points(2048, 1)))
    shown = _data(render(Report("t", objects=(ReportObject("a", clouds=clouds),))))["objects"][0]
    for cloud, packed in zip(clouds, shown["clouds"], strict=True):
        back = _decode(packed, shown["low"])
        assert packed["count"] == len(cloud.points)
        assert np.abs(back - cloud.points).max() <= max(packed["step"]) * 0.51
        assert max(packed["step"]) < 2e-4  # metres


def test_large_clouds_are_thinned_and_the_file_stays_small(tmp_path: Path) -> None:
    objects = tuple(
        ReportObject(f"car {i}", clouds=(Cloud("input scan", _points(60_000, i)),) * 4)
        for i in range(3)
    )
    write_report(Report("t", objects=objects), tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    shown = _data(page)["objects"]
    assert {cloud["count"] for each in shown for cloud in each["clouds"]} == {4096}
    assert 'small::after { content: " drawn"; }' in page  # of 60,000: not all there are
    assert (tmp_path / "report.html").stat().st_size < 10e6
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize(
    "shown",
    [
        ReportObject("no clouds"),
        ReportObject("empty cloud", clouds=(Cloud("input scan", np.zeros((0, 3), np.float32)),)),
        ReportObject("one point", clouds=(Cloud("input scan", np.ones((1, 3), np.float32)),)),
        ReportObject("a camera's", clouds=(Cloud("truth", _points(50)),), sensor="camera"),
        ReportObject("not finite", clouds=(Cloud("x", np.full((9, 3), np.nan, np.float32)),)),
    ],
    ids=lambda shown: shown.name,
)
def test_thin_content_still_gives_a_page(shown: ReportObject) -> None:
    entry = _data(render(Report("t", objects=(shown,))))["objects"][0]
    assert len(entry["clouds"]) == len(shown.clouds)
    assert (np.asarray(entry["high"]) > np.asarray(entry["low"])).all()


def test_report_of_nothing() -> None:
    page = render(Report(title="Nothing yet"))
    assert _data(page) == {"objects": [], "curves": []}
    assert '<section id="objects" hidden>' in page
    assert "<table" not in page


def test_missing_and_infinite_cells_are_dashes() -> None:
    table = Table(
        "t", ("method", "CD"), (("identity", None), ("icp", float("inf")), ("us", 1.23456))
    )
    page = render(Report("t", tables=(table,)))
    cells = re.findall(r"<td[^>]*>(.*?)</td>", page[: page.index('id="data"')])
    assert cells == ["identity", "\N{EN DASH}", "icp", "\N{EN DASH}", "us", "1.23"]

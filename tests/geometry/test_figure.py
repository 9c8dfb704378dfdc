# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A completion shows itself: in a notebook's cell, and in the browser."""

import base64
import gzip
import html
import re
import webbrowser

import numpy as np
import pytest
from tests.report.chromium import CHROMIUM, browser, colourful, eventually

from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Completion

MOST_BYTES = 3_000_000  # most of it plotly's script


@pytest.fixture
def done():
    points = np.random.default_rng(0).uniform(-1, 1, (8192, 3)) * (2.2, 0.9, 0.7) + (14, 5, -1)
    box = Box((14.0, 5.0, -1.0), (4.4, 1.8, 1.4), (1.0, 0.0, 0.0, 0.0))
    warning = "a <b> that & is no markup"
    return Completion(points.astype(np.float32), SE3.identity(), box, 0.5, 0, 0.1, warning=warning)


def unpacked(page):
    (packed,) = re.findall(r'atob\("([^"]+)"\)', page)
    return gzip.decompress(base64.b64decode(packed)).decode()


def test_a_notebook_is_given_one_frame_that_fetches_nothing(done):
    shown = done._repr_html_()
    assert len(shown) < MOST_BYTES
    (srcdoc,) = re.findall(r'<iframe srcdoc="([^"]+)"', shown)
    page = unpacked(html.unescape(srcdoc))
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=", page)
    assert "8192 points" in page
    assert "a <b> that" not in page


def test_show_opens_the_same_page_in_the_browser(done, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    addresses = []
    monkeypatch.setattr(webbrowser, "open", addresses.append)
    path = done.show()
    assert addresses == [path.as_uri()]
    assert path.parent == tmp_path
    assert "8192 points" in unpacked(path.read_text("utf-8"))


@pytest.mark.skipif(CHROMIUM is None, reason="did not run: no chromium on PATH to open pages with")
def test_a_browser_draws_it_and_fetches_nothing(done, tmp_path):
    cell = tmp_path / "cell.html"
    cell.write_text(f"<!DOCTYPE html>{done._repr_html_()}", "utf-8")
    with browser(tmp_path / "profile") as page:
        page.open(cell.as_uri())
        page.wait("!!document.querySelector('iframe')?.contentDocument.querySelector('canvas')")
        eventually(page.shot, lambda picture: colourful(picture) > 3000, "nothing is drawn")
        assert page.complaints() == []
        assert [u for u in page.loads() if not u.startswith(("file:", "data:", "blob:"))] == []

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The viewer in a real browser: drawn, operated, and nothing asked of another host."""

from pathlib import Path

import numpy as np
import pytest
from tests.report.chromium import CHROMIUM, Page, browser, eventually
from tests.report.viewer.shown import source

pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
from wildshape.report.viewer.page import serving

pytestmark = [
    pytest.mark.skipif(
        CHROMIUM is None, reason="did not run: no chromium on PATH to open the viewer with"
    ),
    # websockets, which viser uses, warns of what Python 3.14 will call otherwise
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
_SCENE = {"x": 20.0, "y": 200.0, "width": 740.0, "height": 500.0, "scale": 1}
_OURS = "input[type=checkbox]:not([id^=mantine])"
_PLAY, _SCAN, _COMPLETED, _BOX, _AXES, _FUSED, _TRUTH = range(7)


def _click(tab: Page, box: int) -> None:
    tab.ask(f"document.querySelectorAll('{_OURS}')[{box}].click()")


def _orange(picture: np.ndarray) -> int:
    red, _, blue = np.moveaxis(picture.astype(int), -1, 0)
    return int((red - blue > 60).sum())


def _green(picture: np.ndarray) -> int:
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return int(((green - red > 40) & (green - blue > 20)).sum())


def _press(tab: Page, key: str) -> None:
    tab.ask("document.querySelector('[role=slider]').focus()")
    for kind in ("keyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key=key, code=key)


def test_viewer_draws_obeys_and_asks_nobody_else(tmp_path: Path) -> None:
    def look() -> np.ndarray:
        return tab.shot(clip=_SCENE)

    with serving(source()) as page, browser(tmp_path / "profile") as tab:
        assert page.url.startswith("http://127.0.0.1:")
        tab.open(page.url)
        tab.wait(f"document.querySelectorAll('{_OURS}').length == 7")
        eventually(look, lambda p: _orange(p) > 300, "the scan is not drawn")
        tab.wait("document.body.innerText.includes('car <b>')")

        _press(tab, "ArrowRight")
        tab.wait("document.body.innerText.includes('000003')")
        assert page.panel.wish().scan == 3

        _click(tab, _SCAN)
        _click(tab, _AXES)
        eventually(look, lambda p: _orange(p) == 0, "the scan is still there")
        _click(tab, _FUSED)
        eventually(look, lambda p: _green(p) > 300, "the fused scans are not drawn")
        _click(tab, _COMPLETED)
        _click(tab, _TRUTH)
        tab.wait("document.body.innerText.includes('100 % within 30')")

        own = (f"{page.url}/", f"blob:{page.url}", "data:")
        assert [url[:80] for url in tab.loads() if not url.startswith(own)] == []
        assert tab.complaints() == []

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands on the viewer's page when another track is chosen."""

import time
from dataclasses import replace

import numpy as np
import pytest
from tests.report.viewer.shown import SIZE, source

pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
from wildshape.errors import BadInputError
from wildshape.report.viewer.page import serving
from wildshape.report.viewer.registrations import AFTER, BEFORE

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # viser's
_PATIENCE_S = 60.0


def _wait(page, content):
    deadline = time.monotonic() + _PATIENCE_S
    while content not in page.panel.text.content:
        assert time.monotonic() < deadline, page.panel.text.content
        time.sleep(0.01)


def test_a_track_that_cannot_be_read_does_not_leave_another_in_its_place():
    good = source()

    def track(number):
        if number == 1:
            raise BadInputError("two: holds no scan.")
        return good.track(number)

    with serving(replace(good, track=track)) as page:
        page.opened = True  # nobody looks: nothing is waited for
        _wait(page, "car &lt;b&gt;")
        page.choose(1)
        _wait(page, "two: holds no scan.")
        assert "car" not in page.panel.text.content
        assert page.stage is None
        page.choose(0)
        _wait(page, "car &lt;b&gt;")
        assert page.stage is not None


def test_the_panel_wishes_what_its_controls_say_and_plays_every_scan():
    good = source()
    with serving(good) as page:
        page.opened = True
        _wait(page, "confidence")
        panel = page.panel
        assert (panel.wish().hold, panel.wish().way) == ("sensor", AFTER)
        panel.hold.value, panel.way.value = "the object, by its poses", BEFORE
        assert (panel.wish().hold, panel.wish().way) == ("object", BEFORE)
        panel.play.value = True
        played = []
        for _ in range(5):
            page.play()
            played.append(panel.wish().scan)
        assert played == [3, 4, 0, 1, 2]


def test_the_whole_object_is_looked_at_though_little_of_it_was_seen():
    good = source()
    corner = replace(good.track(0), scans=tuple(scan[:2] for scan in good.track(0).scans))
    with serving(replace(good, track=lambda _: corner)) as page:
        page.opened = True
        _wait(page, "confidence")
        far = np.linalg.norm(page.server.initial_camera.position)
        assert far > max(SIZE)

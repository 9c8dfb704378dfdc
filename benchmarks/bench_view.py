# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The viewer on a track of 200 scans: until the first picture, and whether it stutters.

    python benchmarks/bench_view.py            # plays the whole track
    python benchmarks/bench_view.py --small    # 50 scans of it

A headless Chromium draws it, without a GPU. `page served` is from the start of `wildshape view` to
its address, `first picture` from there to the first orange point of a scan in the browser, which is
open already. While it plays, a scan is due every 120 ms; `pause` is the time between two of them on
the page.
"""

import json
import runpy
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from machine import header, p95
from outcome import Outcome
from turns import begin, options

from wildshape.io.tracks import write_track
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SCANS, DRIVE, PICTURE_BAR_S, PAUSE_BAR_MS, DUE_MS = 200, 20, 3.0, 250.0, 120.0
BROWSER = Path(__file__).parent.parent / "tests" / "report" / "chromium.py"
WAIT_S = 300.0
CLIP = {"x": 20.0, "y": 200.0, "width": 740.0, "height": 500.0, "scale": 1}
# Notes when the number of the scan changes that stands beside the slider.
WATCH = """
window.seen = [];
(function look(last) {
  const now = document.querySelector('[role=slider]').ariaValueNow;
  if (now !== last) window.seen.push(performance.now());
  requestAnimationFrame(() => look(now));
})(null)
"""
PLAY = "document.querySelectorAll('input[type=checkbox]:not([id^=mantine])')[0].click()"


def wildshape(*arguments: object, **how: Any) -> subprocess.Popen:
    command = [sys.executable, "-m", "wildshape.cli", *map(str, arguments)]
    return subprocess.Popen(command, text=True, **how)


def completed_track(folder: Path, count: int) -> Path:
    """So many scans of several drives as one track, and what `complete` made of it."""
    config = SimulationConfig(tracks=count // DRIVE, scans=DRIVE)
    drives = list(simulate_tracks(config, seed=2, workers=1))
    scans = tuple(scan for drive in drives for scan in drive.scans)
    names = tuple(f"{i:06d}" for i in range(len(scans)))
    write_track(folder / "tracks" / "long", Track("long", scans, names))
    assert wildshape("complete", folder / "tracks", "--out", folder / "done").wait() == 0
    return folder / "done"


def orange(picture: np.ndarray) -> bool:
    red, _, blue = np.moveaxis(picture.astype(int), -1, 0)
    return int((red - blue > 60).sum()) > 100


def until(true: Any, what: str) -> None:
    end = time.monotonic() + WAIT_S
    while not true():
        if time.monotonic() > end:
            raise SystemExit(f"never: {what}")


def first_picture(tab: Any, folder: Path) -> tuple[float, float, subprocess.Popen]:
    """Seconds from the start to the address, and from there to a picture; the viewer goes on."""
    began = time.perf_counter()
    order = ("view", folder, "--no-open", "--json", "--port", "0")
    viewer = wildshape(*order, stdout=subprocess.PIPE)
    assert viewer.stdout is not None
    url = json.loads(viewer.stdout.readline())["url"]
    served = time.perf_counter()
    tab.open(url)
    until(lambda: orange(tab.shot(clip=CLIP)), "the first scan is drawn")
    return served - began, time.perf_counter() - served, viewer


def pauses(tab: Any, scans: int) -> list[float]:
    """Milliseconds between scans while it plays."""
    until(lambda: "completing" not in tab.ask("document.body.innerText"), "all scans are there")
    tab.ask(WATCH)
    tab.ask(PLAY)
    until(lambda: tab.ask("window.seen.length") > scans, "the track is played")
    return np.diff(tab.ask("window.seen")[1:]).tolist()


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_view.py"))
    tools = runpy.run_path(str(BROWSER))
    if tools["CHROMIUM"] is None:
        print("not measured: no chromium on PATH to open the viewer with")
        return
    outcome, count = Outcome("view"), DRIVE if arguments.smoke else SCANS
    with TemporaryDirectory() as name, tools["browser"](Path(name) / "profile") as tab:
        folder = completed_track(Path(name), count)
        served, drawn, viewer = first_picture(tab, folder)
        found = pauses(tab, count // 4 if arguments.small else count)
        viewer.terminate()
        viewer.wait()
    start = {"page served": [1e3 * served], "first picture": [1e3 * drawn]}
    outcome.add(f"start, {count} scans", start)
    outcome.add(f"playing, one scan every {DUE_MS:g} ms", {"pause": found})
    first = served + drawn
    outcome.bar("first picture after start, s", first, PICTURE_BAR_S, kind="clock")
    name = f"pause while playing, median {median(found):.0f}, 95 %, ms"
    outcome.bar(name, p95(found), PAUSE_BAR_MS, kind="clock")
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()

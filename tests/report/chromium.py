# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A browser driven by the DevTools protocol: what the tests of pages open them with."""

import base64
import fcntl
import io
import json
import os
import select
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-dev-shm-usage",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe",
    "--window-size=1200,900",
]
SECONDS = 240.0  # patience only: a loaded machine without a GPU draws slowly
BETWEEN_PAGES = "Not attached to an active page"  # while one is put in place of another


class Page:
    """One tab, driven by the DevTools protocol over a pipe."""

    def __init__(self, commands: int, answers: int):
        self.commands, self.answers = commands, answers
        self.buffer, self.count, self.session = b"", 0, ""
        self.events: list[dict[str, Any]] = []

    def open(self, url: str) -> None:
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Runtime", "Network", "Log", "Page"):
            self.call(f"{domain}.enable")
        self.call("Page.navigate", url=url)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        deadline = time.monotonic() + SECONDS
        while "error" in (answer := self._answer(method, params)):
            between = answer["error"]["message"] == BETWEEN_PAGES and time.monotonic() < deadline
            assert between, answer
            time.sleep(0.01)
        return answer["result"]

    def _answer(self, method: str, params: dict[str, Any]) -> dict[str, Any]:
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.commands, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != self.count:
            self.events.append(answer)
        return answer

    def ask(self, expression: str) -> Any:
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)[
            "result"
        ].get("value")

    def wait(self, expression: str) -> None:
        deadline = time.monotonic() + SECONDS
        while not self.ask(expression):
            assert time.monotonic() < deadline, f"never became true: {expression}"
            time.sleep(0.1)

    def panel(self, index: int) -> dict[str, float]:
        """Where a panel's drawing is, CSS pixels."""
        return self.ask(
            f"(({{x, y, width, height}}) => ({{x, y, width, height}}))"
            f"(document.querySelectorAll('.plot')[{index}].getBoundingClientRect())"
        )

    def picture(self, index: int) -> np.ndarray:
        """A panel as pixels."""
        place = self.panel(index)
        scrolled = self.ask("scrollY")  # a clip is placed on the page, not in the window
        return self.shot(clip={**place, "y": place["y"] + scrolled, "scale": 1})

    def shot(self, **how: Any) -> np.ndarray:
        """What is seen, as pixels."""
        from PIL import Image

        shot = self.call("Page.captureScreenshot", **how)["data"]
        with Image.open(io.BytesIO(base64.b64decode(shot))) as image:
            return np.asarray(image.convert("RGB"))

    def drag(self, index: int, across: float) -> None:
        box = self.panel(index)
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        held: dict[str, Any] = {"button": "left", "buttons": 1, "clickCount": 1, "y": y}
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, **held)
        for i in range(1, 5):
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + i * across / 4, **held)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + across, **held)

    def complaints(self) -> list[str]:
        """Uncaught errors, console errors, and everything a policy or a load refused."""
        found = []
        for event in self.events:
            method, params = event.get("method"), event.get("params", {})
            entry = params.get("entry", {})
            if (
                method == "Runtime.exceptionThrown"
                or (method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"))
                or (method == "Log.entryAdded" and entry.get("level") == "error")
            ):
                found.append(json.dumps(params)[:400])
        return found

    def loads(self) -> list[str]:
        wanted = (e for e in self.events if e.get("method") == "Network.requestWillBeSent")
        return [event["params"]["request"]["url"] for event in wanted]

    def _next(self) -> dict[str, Any]:
        deadline = time.monotonic() + SECONDS
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.answers], [], [], deadline - time.monotonic())
            assert ready, "chromium does not answer"
            self.buffer += os.read(self.answers, 1 << 16)
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)


@contextmanager
def browser(profile: Path) -> Iterator[Page]:
    """A tab in a headless Chromium with a fresh profile."""
    assert CHROMIUM is not None
    for_child, commands = os.pipe()
    answers, from_child = os.pipe()
    high = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 20) for end in (for_child, from_child)]
    null = (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)
    chromium = os.posix_spawn(  # the protocol speaks on descriptors 3 and 4
        CHROMIUM,
        [CHROMIUM, *FLAGS, f"--user-data-dir={profile}"],
        os.environ,
        file_actions=[
            null,
            (os.POSIX_SPAWN_DUP2, 1, 2),
            (os.POSIX_SPAWN_DUP2, high[0], 3),
            (os.POSIX_SPAWN_DUP2, high[1], 4),
        ],
        setpgroup=0,
    )
    for end in (for_child, from_child, *high):
        os.close(end)
    try:
        yield Page(commands, answers)
    finally:
        os.kill(chromium, signal.SIGTERM)
        os.waitpid(chromium, 0)
        _end_group(chromium)
        os.close(commands)
        os.close(answers)


def _end_group(leader: int) -> None:
    """Its helpers outlive it for a moment, and write into a profile that is being removed."""
    with suppress(ProcessLookupError):
        for _ in range(200):  # who is dead stays in the group until somebody waits for it
            os.killpg(leader, signal.SIGKILL)
            time.sleep(0.01)


def colourful(picture: np.ndarray) -> int:
    """Pixels that are no shade of grey: points, not grid or ground."""
    return int((np.ptp(picture.astype(int), axis=-1) > 40).sum())


def moved(picture: np.ndarray, before: np.ndarray) -> float:
    """Share of the pixels that changed."""
    return float((np.abs(picture.astype(int) - before).max(-1) > 40).mean())


def eventually(
    take: Callable[[], np.ndarray], holds: Callable[[np.ndarray], bool], what: str
) -> None:
    """Drawing takes its time without a GPU."""
    deadline = time.monotonic() + SECONDS
    while not holds(take()):
        assert time.monotonic() < deadline, what
        time.sleep(0.2)

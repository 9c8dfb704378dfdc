# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The page: a server on this machine alone, a scene, a panel, and a thread that completes."""

import contextlib
import io
import logging
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from html import escape
from typing import TYPE_CHECKING, Protocol, TypeVar, runtime_checkable

import numpy as np

from wildshape.errors import BadInputError, MissingExtraError, load_library
from wildshape.io.progress import counted
from wildshape.report.viewer.allowed_hosts import answering_only, checked_hosts, prove
from wildshape.report.viewer.details import details
from wildshape.report.viewer.panel import Panel
from wildshape.report.viewer.sources import Source
from wildshape.report.viewer.stage import Stage

if TYPE_CHECKING:
    from viser import ViserServer

HOST = "127.0.0.1"
_INSTALL = "pip install 'wildshape[view]' (`wildshape report` draws results without it)"
_LAST_PORT = 65535
_PLAY_SECONDS, _SPEAK_SECONDS, _STOP_SECONDS, _LOOK_SECONDS = 0.12, 0.5, 5.0, 0.05
_PATIENCE_S, _DRAWN_S = 10.0, 1.0  # for a browser to open the page, and to draw it


@runtime_checkable
class Shown(Protocol):
    """A page that is served."""

    def play(self) -> None:
        """Go on by a scan, where that is asked for."""
        ...

    def close(self) -> None:
        """Nothing more is sent."""
        ...


Built = TypeVar("Built", bound=Shown)


class Page:
    """What is on the page now. Controls call it from several threads: a lock keeps the order."""

    def __init__(self, server: "ViserServer", source: Source) -> None:
        """Lay the page out and begin with the first track."""
        self.server, self.source = server, source
        self.lock = threading.RLock()
        self.stage: Stage | None = None
        self.status = ""
        self.turn = 0  # which choice of a track is the latest
        self.workers: list[threading.Thread] = []
        self.opened = self.closed = False  # by a browser; for good
        self.panel = Panel(server, source.labels, self.refresh, self.choose)
        self.choose(0)

    @property
    def url(self) -> str:
        """Its address."""
        return f"http://{HOST}:{self.server.get_port()}"

    def choose(self, number: int) -> None:
        """Show another track: its scans at once, what is made of them as it is made."""
        with self.lock:
            if self.closed:
                return
            self.turn += 1
            turn = self.turn
            worker = threading.Thread(target=self._work, args=(number, turn), daemon=True)
            self.workers = [*(one for one in self.workers if one.is_alive()), worker]
            worker.start()

    def close(self) -> None:
        """Whatever is being made is no longer sent.

        Its threads end, too: one that Python cuts off inside of torch aborts the process.
        """
        with self.lock:
            self.closed = True
            self.turn += 1
            self.stage = None
            workers, self.workers = self.workers, []
        for one in workers:
            one.join(_STOP_SECONDS)

    def refresh(self) -> None:
        """Show what the panel asks for."""
        with self.lock:
            if self.stage is not None:
                wish = self.panel.wish()
                self.stage.show(wish)
                self.panel.text.content = details(self.stage, wish, self.status or self.source.note)

    def play(self) -> None:
        """Go on by a scan, where that is asked for."""
        with self.lock:
            self.panel.step()

    def _work(self, number: int, turn: int) -> None:
        try:
            with self.lock:
                if turn != self.turn:
                    return
                self._clear()  # a track that cannot be read is not to leave another in its place
            track = self.source.track(number)
            with self.lock:
                if turn != self.turn:
                    return
                self._begin(Stage(self.server, track))
            self._make(number, turn)
        except (BadInputError, MissingExtraError) as error:
            self._say(str(error), turn)
        except Exception as error:
            logging.getLogger(__name__).exception("the viewer cannot show this track")
            self._say(f"{type(error).__name__}: {error}", turn)

    def _clear(self) -> None:
        if self.stage is not None:
            self.stage.clear()
        self.stage = None

    def _begin(self, stage: Stage) -> None:
        self.stage = stage
        self.status = "completing ..."
        self.panel.fit(stage.track)
        self._aim(stage)
        self.refresh()

    def _aim(self, stage: Stage) -> None:
        """Show the whole object: as large as its box, or before there is one, as its scan."""
        aim(self.server, np.zeros(3), stage.extent() * np.array((0.75, -0.95, 0.65)))

    def _make(self, number: int, turn: int) -> None:
        """Whatever is made of the scans goes to the scene as it comes, the one shown first."""
        stage = self.stage
        if stage is None:
            return
        spoke = 0.0
        total, shown = len(stage.track.scans), self.panel.wish().scan
        for scan, done in self.source.make(number, stage.track, shown):
            if len(stage.completions) == 1:
                self._let_it_be_drawn(turn)
            with self.lock:
                if turn != self.turn:
                    return
                stage.add(scan, done)
                if len(stage.completions) == 1:
                    self._aim(stage)
                of = counted(total, "scan")
                self.status = f"completed {len(stage.completions)} of {of} ..."
                due = time.monotonic() - spoke > _SPEAK_SECONDS
                if due or scan == self.panel.wish().scan:
                    spoke = time.monotonic()
                    self.refresh()
        self._say("", turn)

    def _let_it_be_drawn(self, turn: int) -> None:
        """A page that opens draws the first scan before all others are sent: twice as soon."""
        patience = time.monotonic() + _PATIENCE_S
        while turn == self.turn and not self.opened and time.monotonic() < patience:
            time.sleep(_LOOK_SECONDS)
            if self.server.get_clients():
                self.opened = True
                time.sleep(_DRAWN_S)

    def _say(self, text: str, turn: int) -> None:
        with self.lock:
            if turn != self.turn:
                return
            self.status = text
            self.refresh()
            if self.stage is None:
                self.panel.text.content = f"<div style='padding:.8em'>{escape(text)}</div>"


def aim(server: "ViserServer", target: np.ndarray, place: np.ndarray) -> None:
    """The camera of new pages and those open."""
    clients = [client.camera for client in server.get_clients().values()]
    for camera in (server.initial_camera, *clients):
        camera.position, camera.look_at = tuple(place.tolist()), tuple(target.tolist())


def serving(
    source: Source, port: int = 0, allowed: Sequence[str] = ()
) -> AbstractContextManager[Page]:
    """The page for as long as the block runs.

    Args:
        source: what it shows.
        port: taken, or the next free one; 0 takes any.
        allowed: names under which it may be asked for beside this machine's (`allowed_hosts.py`).

    Raises:
        BadInputError: an allowed name is none.
        MissingExtraError: viser is not installed, or cannot be told whom to answer.
    """
    return hosting(source.title, lambda server: Page(server, source), port, allowed)


@contextmanager
def hosting(
    title: str,
    build: Callable[["ViserServer"], Built],
    port: int,
    allowed: Sequence[str],
    *,
    dark: bool = False,
) -> Iterator[Built]:
    """A server of this machine and the page built on it; the rest is as of `serving`."""
    if not 0 <= port <= _LAST_PORT:
        raise BadInputError(f"--port {port}: expected 0 to {_LAST_PORT}.")
    others = set(threading.enumerate())
    server = _server(port, checked_hosts(allowed))
    own = set(threading.enumerate()) - others
    page = None
    try:
        server.gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            dark_mode=dark,
        )
        server.gui.main_panel.dock_right()
        server.gui.set_panel_label(f"Wildshape: {title}")
        server.scene.set_up_direction("+z")
        page = build(server)
        yield page
    finally:
        if page is not None:
            page.close()
        with _quiet():
            server.stop()
            for thread in own:
                thread.join(_STOP_SECONDS)


def run_until_interrupted(page: Shown) -> None:
    """Serve, and turn the pages of what is played; Ctrl-C raises KeyboardInterrupt."""
    while True:
        time.sleep(_PLAY_SECONDS)
        page.play()


def _server(port: int, allowed: Sequence[str]) -> "ViserServer":
    viser = load_library("viser", "the viewer needs viser", _INSTALL)
    with _quiet(), answering_only(allowed):
        server = viser.ViserServer(host=HOST, port=port, verbose=False)
    try:
        prove(server.get_port())
    except MissingExtraError:
        with _quiet():
            server.stop()
        raise
    return server


def _quiet() -> contextlib.redirect_stdout:
    """Viser announces its beginning and its end on stdout, which belongs to our answer."""
    return contextlib.redirect_stdout(io.StringIO())

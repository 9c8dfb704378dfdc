# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The controls beside the scene: track, time, what is shown and how."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from wildshape.records import Track
from wildshape.report.viewer.colours import COLOURINGS, WRONG
from wildshape.report.viewer.drawing_frame import Hold
from wildshape.report.viewer.registrations import TRUTH, WAYS
from wildshape.report.viewer.stage import Wish

if TYPE_CHECKING:
    from viser import ViserServer

LAYERS = {
    "scan": "scan (orange)",
    "completed": "completed shape (blue)",
    "box": "oriented box",
    "axes": "pose axes",
    "fused": "all scans fused (green)",
    "truth": "truth (grey)",
}
_SHOWN_FIRST = ("scan", "completed", "box", "axes")
_HOLDS: dict[str, Hold] = {"the sensor's axes": "sensor", "the object, by its poses": "object"}
_LISTED = 2000  # a longer list is slow to open; beyond it tracks are chosen by number


class Panel:
    """The controls; they tell what is wished and nothing else."""

    def __init__(
        self,
        server: "ViserServer",
        labels: tuple[str, ...],
        wished: Callable[[], None],
        chosen: Callable[[int], None],
    ) -> None:
        """Lay the controls out.

        `wished` is called whenever something else is to be shown, `chosen` with a track's number.
        """
        self.gui, self.labels, self.wished = server.gui, labels, wished
        self.picker = self._picker()
        self.picker.on_update(lambda _: chosen(self.track))
        self.time: Any = None
        self.play = self.gui.add_checkbox("play", initial_value=False, order=3)
        self.layers = self._layers()
        with self.gui.add_folder("Compare", order=5):
            self.way = self._choice("fused by", WAYS)
            self.hold = self._choice("held still", tuple(_HOLDS))
            self.colouring = self._choice("colours", COLOURINGS)
        self.text = self.gui.add_html("", order=6)

    @property
    def track(self) -> int:
        """Number of the track chosen."""
        value = self.picker.value
        return self.labels.index(value) if isinstance(value, str) else int(value)

    def wish(self) -> Wish:
        """What is asked for now."""
        return Wish(
            scan=int(self.time.value) if self.time is not None else 0,
            shown=frozenset(name for name, box in self.layers.items() if box.value),
            way=self.way.value,
            hold=_HOLDS[self.hold.value],
            colouring=self.colouring.value,
        )

    def fit(self, track: Track) -> None:
        """Make the controls those of another track, standing at its middle scan."""
        if self.time is not None:
            self.time.remove()
        last = len(track.scans) - 1
        self.time = self.gui.add_slider(
            "scan", min=0, max=last, step=1, initial_value=track.middle, order=2, disabled=last == 0
        )
        self.time.on_update(lambda _: self.wished())
        self.play.disabled = last == 0
        known = track.T_sensor_object is not None
        self.layers["truth"].disabled = not known
        self.way.options = tuple(way for way in WAYS if known or way != TRUTH)
        self.colouring.options = tuple(c for c in COLOURINGS if known or c != WRONG)

    def step(self) -> None:
        """One scan on, from the last to the first, while it plays."""
        if self.play.value and self.time is not None and self.time.max > 0:
            self.time.value = (int(self.time.value) + 1) % (int(self.time.max) + 1)

    def _picker(self) -> Any:
        last = len(self.labels) - 1
        if last < _LISTED:
            return self.gui.add_dropdown("track", self.labels, order=1)
        return self.gui.add_number("track", 0, min=0, max=last, step=1, order=1)

    def _layers(self) -> dict[str, Any]:
        boxes = {}
        with self.gui.add_folder("Show", order=4):
            for name, label in LAYERS.items():
                boxes[name] = self.gui.add_checkbox(label, initial_value=name in _SHOWN_FIRST)
                boxes[name].on_update(lambda _: self.wished())
        return boxes

    def _choice(self, label: str, options: tuple[str, ...]) -> Any:
        choice = self.gui.add_dropdown(label, options)
        choice.on_update(lambda _: self.wished())
        return choice

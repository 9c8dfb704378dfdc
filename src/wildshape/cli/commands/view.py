# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape view`: tracks, shapes, boxes and poses on an interactive page of this machine."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import (
    DEFAULT_FILES,
    DEFAULT_NETWORK,
    AsJson,
    Files,
    Network,
    listed,
    option,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from wildshape.inference.predictor import Predictor
    from wildshape.io.scans.points import Coordinates
    from wildshape.report.viewer.drive_page import DrivePage
    from wildshape.report.viewer.page import Page
    from wildshape.report.viewer.sources import Source

EXAMPLES = (
    "wildshape view completed",
    "wildshape view mytracks --no-open",
    "wildshape view found",
)

Shown = Annotated[
    Path,
    Positional,
    arg(
        metavar="INPUT",
        help="the --out of drive, complete, register or evaluate; or a scan, a TRACK, a DATASET,"
        " a store",
    ),
]
Inputs = Annotated[
    Path | None, option(metavar="INPUT", help="the scans, if they are no longer where they were")
]
Port = Annotated[int, arg(metavar="N", help="port, or the next free one; 0: any free one")]
AllowHost = Annotated[
    tuple[str, ...],
    listed("NAME,NAME"),
    option(help="also answer under these names, as a tunnel's; NAME:PORT: at one port alone"),
]


@dataclass(frozen=True)
class Settings:
    """Show results, or scans completed as they are looked at, on an interactive page.

    The page is served to this machine alone (127.0.0.1), needs no network, and lives until Ctrl-C.
    Pages of other hosts get no answer; for a tunnel under another name or port add --allow-host.

    Attributes:
        open: open it in the browser even where no display is found.
        no_open: do not open it, only print its address.
    """

    input: Shown
    network: Network = DEFAULT_NETWORK
    inputs: Inputs = None
    port: Port = 8080
    allow_host: AllowHost = ()
    open: FlagCreatePairsOff[bool] = False
    no_open: FlagCreatePairsOff[bool] = False
    files: Files = DEFAULT_FILES
    json: AsJson = False


def run(settings: Settings) -> None:
    """Serve the page until Ctrl-C.

    Raises:
        BadInputError: the input is nothing that can be shown.
        MissingExtraError: viser is not installed.
    """
    import webbrowser

    with uncollected():
        from wildshape.cli.terminal import Terminated, answer, say
        from wildshape.report.viewer.page import run_until_interrupted

        page_of, tracks = _page(settings)
    with page_of as page:
        text = f"showing {settings.input} at {page.url} (this machine only); Ctrl-C ends it"
        answer(text, {"url": page.url, "tracks": tracks}, as_json=settings.json)
        if settings.open or (_display() and not settings.no_open):
            webbrowser.open(page.url)
        try:
            run_until_interrupted(page)
        except Terminated:
            raise
        except KeyboardInterrupt:
            say("closed")


def _page(
    settings: Settings,
) -> "tuple[AbstractContextManager[Page] | AbstractContextManager[DrivePage], int]":
    """What to serve, and how many tracks or vehicles that are."""
    from wildshape.drives.writing.folder import is_drive

    if is_drive(settings.input):
        _refuse_for_results(settings)
        from wildshape.drives.writing.finished import read_finished
        from wildshape.report.viewer.drive_page import serving_drive

        found = read_finished(settings.input)
        page = serving_drive(found, settings.port, settings.allow_host, settings.inputs)
        return page, len(found.vehicles)
    from wildshape.report.viewer.page import serving

    source = source_of(settings)
    return serving(source, settings.port, settings.allow_host), len(source.labels)


def source_of(settings: Settings) -> "Source":
    """What the input holds: results as they lie there, or scans and the model.

    Raises:
        BadInputError: it holds neither.
    """
    from wildshape.report.results import METRICS, OBJECTS, find
    from wildshape.report.viewer.sources import from_results

    folder = settings.input
    if folder.is_dir() and find(folder, OBJECTS):
        _refuse_for_results(settings)
        return from_results(folder, settings.inputs)
    if folder.is_dir() and (folder / METRICS).is_file():
        return _evaluated(settings)
    if settings.inputs is not None:
        raise BadInputError(f"--inputs: {folder} holds scans themselves, no results; leave it out.")
    return _scans(settings, folder, settings.files.coordinates)


def _refuse_for_results(settings: Settings) -> None:
    """Refuse options that would change nothing of results, which are shown as they lie there.

    Raises:
        BadInputError: one is given.
    """
    if (settings.network, settings.files) != (DEFAULT_NETWORK, DEFAULT_FILES):
        raise BadInputError(
            f"{settings.input}: holds results, of which --model, --device, --unit and --origin"
            " change nothing; leave them out, or name the scans."
        )


def _scans(settings: Settings, path: Path, coordinates: "Coordinates") -> "Source":
    from wildshape.io.inputs import open_tracks
    from wildshape.records import as_text
    from wildshape.report.viewer.live_completion import from_model

    source = open_tracks(path, coordinates)
    title = as_text(path.resolve().name)
    return from_model(title, source.names, source.__getitem__, lambda: _model(settings))


def _evaluated(settings: Settings) -> "Source":
    """The data of an evaluation, the worst object first, completed once more."""
    from wildshape.io.guard import read_json, reading
    from wildshape.io.inputs import open_tracks
    from wildshape.io.scans.points import SENSOR_METRES
    from wildshape.records import as_text
    from wildshape.report.page.metrics import is_ours
    from wildshape.report.results import METRICS, SCORES, coordinates_of
    from wildshape.report.viewer.live_completion import from_model
    from wildshape.report.viewer.sources import worst_first

    said = read_json(settings.input / METRICS, "what evaluate writes", dict)
    with reading(settings.input / METRICS, "what evaluate writes"):
        asked = (said.get("provenance") or {}).get("settings") or {}
        data = settings.inputs or (Path(asked["data"]) if asked.get("data") else None)
        methods = list(said.get("methods") or {})
        ours = next(filter(is_ours, methods), methods[-1])
    if "folder" in asked:
        raise BadInputError(
            f"{settings.input}: holds figures of a drive; name what `drive` wrote:"
            f" {asked['folder']}."
        )
    if data is None:
        raise BadInputError(f"{settings.input}: does not say which data it is of; add --inputs.")
    here = settings.files.coordinates
    coordinates = coordinates_of(asked) if here == SENSOR_METRES else here
    source = open_tracks(data, coordinates)
    numbers = source.numbers
    ranked = [
        (numbers[name], f"{name}  (CD {cd:.3f} m)")
        for name, cd in worst_first(settings.input / SCORES, ours)
        if name in numbers
    ]
    if not ranked:
        return _scans(settings, data, coordinates)
    return from_model(
        as_text(settings.input.resolve().name),
        [label for _, label in ranked],
        lambda i: source[ranked[i][0]],
        lambda: _model(settings),
        f"Worst object first, by {ours} in this evaluation; scans are shown as recorded, completed"
        f" by {'--model' if settings.network.model else 'the shipped weights'}.",
    )


def _model(settings: Settings) -> "Predictor":
    from wildshape.inference.predictor import load

    return load(settings.network.model, settings.network.device)


def _display() -> bool:
    """Whether a browser could show anything here."""
    import os
    import sys

    named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.platform != "linux" or bool(named)

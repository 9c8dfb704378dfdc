# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The picture of the viewer: a simulated drive past a car, as a headless Chromium shows it.

python experiments/viewer_picture.py docs/viewer.webp
"""

import json
import runpy
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import tyro
from PIL import Image

from wildshape.cli.main import in_a_sentence
from wildshape.errors import MissingExtraError

BROWSER = Path(__file__).parent.parent / "tests" / "report" / "chromium.py"
ALL_COMPLETED = "document.body.innerText.includes('pose error')"
NO_NOTICE = "document.querySelector('.mantine-Notification-closeButton')?.click()"
FADED_S = 3.0  # notices, and the veil of a page that begins


@dataclass(frozen=True)
class Settings:
    """Draw the viewer's page.

    Attributes:
        out: .webp or .png.
        seed: of the drive.
    """

    out: Annotated[Path, tyro.conf.Positional]
    seed: int = 78


def wildshape(*arguments: object, **how: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "wildshape.cli", *map(str, arguments)]
    return subprocess.Popen(command, text=True, stdout=subprocess.PIPE, **how)


def main(settings: Settings) -> None:
    tools = runpy.run_path(str(BROWSER))
    if tools["CHROMIUM"] is None:
        raise MissingExtraError("no chromium on PATH to open the viewer with; install one.")
    with TemporaryDirectory() as name, tools["browser"](Path(name) / "profile") as tab:
        drive = Path(name) / "drive"
        wildshape("simulate", drive, "--tracks", 1, "--seed", settings.seed).wait()
        viewer = wildshape("view", drive, "--no-open", "--json", "--port", 0)
        assert viewer.stdout is not None
        tab.open(json.loads(viewer.stdout.readline())["url"])
        tab.wait(ALL_COMPLETED)
        tab.ask(NO_NOTICE)
        time.sleep(FADED_S)
        Image.fromarray(tab.shot()).save(settings.out)
        viewer.send_signal(signal.SIGINT)
        viewer.wait()


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))

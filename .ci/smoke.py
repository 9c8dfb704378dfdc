# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether an installed wheel works; run by the interpreter it is installed for, from anywhere.

python .ci/smoke.py native|pure SCAN
"""

import json
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from importlib.metadata import distribution
from pathlib import Path

import wildshape
from wildshape.io.scans.ply import read_ply
from wildshape.ops.library import library


def wildshape_command(*arguments: object) -> str:
    """What the installed command prints."""
    program = shutil.which("wildshape", path=sysconfig.get_path("scripts"))
    assert program, "the command is not installed"
    words = [program, *map(str, arguments)]
    run = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    return run.stdout


def main(kind: str, scan: str) -> None:
    """Check where the package comes from, its kernels, its weights, and two commands."""
    package = Path(wildshape.__file__).parent
    assert package.is_relative_to(sys.prefix), f"{package} is not what was installed"
    assert (package / "py.typed").is_file()
    loaded = library()
    assert (loaded is not None) == (kind == "native"), f"{kind}, but kernels are {loaded}"
    assert loaded is None or Path(loaded._name).is_relative_to(package)
    assert distribution("wildshape").version == wildshape.__version__
    assert "complete" in wildshape_command("--help")
    with tempfile.TemporaryDirectory() as folder:
        said = json.loads(wildshape_command("complete", scan, "--out", folder, "--json"))
        (shape,) = Path(folder).glob("*/completed/*.ply")
        points = len(read_ply(shape))
    assert said["scans"] == 1
    assert points >= 1024
    print(f"{package}: {kind}, completed {Path(scan).name} with the weights inside")


if __name__ == "__main__":
    main(*sys.argv[1:])

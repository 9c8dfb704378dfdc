# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Builds the sdist, from it the wheels, installs each in a fresh environment, and tries it.

The fresh environments see the libraries of this interpreter's own (a .pth file names them), so that
nothing is downloaded; the package itself comes from the wheel alone, which smoke.py checks.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
COMPILER = os.environ.get("CC", "cc").split()[0]


def run(*words: object, **settings: str) -> None:
    """A command that must succeed, away from the checkout."""
    environment = {**os.environ, **settings}
    environment.pop("PYTHONPATH", None)
    subprocess.run([str(w) for w in words], check=True, cwd=tempfile.gettempdir(), env=environment)


def sources(folder: Path) -> Path:
    """The sdist, unpacked."""
    hatch = (sys.executable, "-m", "hatchling", "build", "--target", "sdist", "-d", str(folder))
    subprocess.run(hatch, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    (archive,) = folder.glob("*.tar.gz")
    shutil.unpack_archive(archive, folder / "sdist")
    return next((folder / "sdist").iterdir())


def wheel(source: Path, folder: Path, native: str) -> Path:
    """The wheel, with kernels or without."""
    build = ("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder)
    run(*PIP, *build, source, WILDSHAPE_NATIVE=native)
    return next(folder.glob("*.whl"))


def environment(folder: Path, made: Path) -> Path:
    """A fresh environment with the wheel in it; its interpreter."""
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / Path(sysconfig.get_path("scripts")).name / Path(sys.executable).name
    (site,) = folder.glob("**/site-packages")
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    run(*PIP, "--python", python, "install", "--no-deps", "--no-index", "--ignore-installed", made)
    return python


def main() -> None:
    """Both kinds of wheel; the one with kernels where there is a compiler."""
    kinds = {"pure": "0"} if shutil.which(COMPILER) is None else {"native": "1", "pure": "0"}
    with tempfile.TemporaryDirectory() as scratch:
        source = sources(Path(scratch))
        for kind, native in kinds.items():
            folder = Path(scratch) / kind
            made = wheel(source, folder / "wheel", native)
            assert made.name.endswith("-py3-none-any.whl") == (kind == "pure"), made.name
            assert "-py3-none-" in made.name, made.name
            print(f"{made.name}, {made.stat().st_size / 2**20:.1f} MiB")
            python = environment(folder / "environment", made)
            run(python, "-P", ROOT / ".ci" / "smoke.py", kind, ROOT / "examples" / "scan.npy")


if __name__ == "__main__":
    main()

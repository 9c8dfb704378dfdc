# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every benchmark's small form, one after another, and at the end all bars: what `make bench` runs.

    python benchmarks/run.py [NAME ...]
    python benchmarks/run.py --smoke [NAME ...]    # what `make smoke` runs: seconds each

The exit status is 1 if a benchmark failed or has nothing to say, and if a bar is missed that does
not depend on the machine: an exact one, or a ratio of what took turns. Times by the clock are those
of a quiet machine; where one is missed it is listed first and said to be this machine's. The smoke
form judges the exact bars alone, and keeps no results.
"""

import argparse
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from machine import MISSED, MISSED_HERE

HERE = Path(__file__).parent
LEFT_OUT = {
    "bench_overfit.py": "ten minutes",
    "bench_compile.py": "minutes of compiling",
}
# What a benchmark says that has nothing to judge here, and why.
EXCUSES = ("not measured: ", "No GPU here: ")
_ORDER = (MISSED, MISSED_HERE, "size", "met")


class Found(NamedTuple):
    """Of one benchmark: its bars, and why it failed, if it did."""

    script: str
    bars: list[str]
    failed: str


def run(script: Path, form: list[str], *, aside: bool = False) -> Found:
    """One benchmark; what it prints is passed on as it comes, or `aside` others at its end."""
    began, said = time.perf_counter(), [f"\n== {script.name}"]
    if not aside:
        print(said[0], flush=True)
    command = [sys.executable, "-u", str(script), *form]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            said.append(line.rstrip())
            if not aside:
                print(said[-1], flush=True)
    took = f"({time.perf_counter() - began:.0f} s)"
    print("\n".join([*said, took]) if aside else took, flush=True)
    bars = [line for line in said if line.startswith("bar: ")]
    if process.returncode:
        return Found(script.name, bars, f"exit status {process.returncode}")
    excused = any(line.startswith(EXCUSES) for line in said)
    return Found(script.name, bars, "" if bars or excused else "it printed no bar")


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="as in bench_NAME.py; else all")
    parser.add_argument("--smoke", action="store_true", help="whether they run and agree, no more")
    arguments = parser.parse_args()
    wanted = {
        f"bench_{name.removeprefix('bench_').removesuffix('.py')}.py" for name in arguments.names
    }
    left_out = {} if wanted or arguments.smoke else LEFT_OUT
    scripts = [s for s in sorted(HERE.glob("bench_*.py")) if not wanted or s.name in wanted]
    absent = sorted(wanted - {script.name for script in scripts})
    scripts = [script for script in scripts if script.name not in left_out]
    with TemporaryDirectory() as folder:
        if arguments.smoke:  # nothing is timed: two at once
            work = partial(run, form=["--smoke", "--threads", "1", "--out", folder], aside=True)
            with ThreadPoolExecutor(2) as pool:
                found = list(pool.map(work, scripts))
        else:
            found = [run(script, ["--small"]) for script in scripts]
    found += [Found(name, [], "no such benchmark") for name in absent]
    return summarise(found, left_out)


def summarise(found: list[Found], left_out: dict[str, str]) -> int:
    """Print what was found, the worst first; the exit status."""
    bars = [f"{one.script.removeprefix('bench_'):<16}{bar}" for one in found for bar in one.bars]
    failed = [one for one in found if one.failed]
    print("\n== summary")
    for name, why in left_out.items():
        print(f"left out: python benchmarks/{name} ({why})")
    print("\n".join(sorted(bars, key=_place)))
    for one in failed:
        print(f"FAILED: {one.script}: {one.failed}")
    count = [sum(_place(bar) == place for bar in bars) for place in range(len(_ORDER))]
    more = f", {count[2]} not judged at this size" if count[2] else ""
    print(f"{count[3]} of {len(bars)} bars met{more}")
    if count[1]:
        print(f"{count[1]} missed by the clock of this machine: measure them alone on a quiet one")
    return 1 if failed or count[0] else 0


def _place(bar: str) -> int:
    """Where a bar stands in the list: by how it ends."""
    return next(i for i, end in enumerate(_ORDER) if bar.endswith(f" {end}"))


if __name__ == "__main__":
    sys.exit(main())

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every benchmark's small form, one after another, and at the end all bars: what `make bench` runs.

python benchmarks/run.py [NAME ...]
"""

import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
FORMS = {"bench_convert.py": ["--frames", "100"], "bench_store.py": []}  # others: --small
LEFT_OUT = {
    "bench_overfit.py": "ten minutes",
    "bench_compile.py": "minutes of compiling",
}


def run(script: Path) -> tuple[list[str], int]:
    """The benchmark's bars and its exit status; what it prints is passed on as it comes."""
    command = [sys.executable, "-u", str(script), *FORMS.get(script.name, ["--small"])]
    bars: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            bars += [line.strip()] if line.startswith("bar: ") else []
    return bars, process.returncode


def main() -> int:
    wanted = {
        f"bench_{name.removeprefix('bench_').removesuffix('.py')}.py" for name in sys.argv[1:]
    }
    scripts = [s for s in sorted(HERE.glob("bench_*.py")) if not wanted or s.name in wanted]
    found: dict[str, list[str]] = {}
    failed: list[str] = []
    for script in scripts:
        if script.name in LEFT_OUT and not wanted:
            continue
        began = time.perf_counter()
        print(f"\n== {script.name}", flush=True)
        found[script.name], status = run(script)
        failed += [script.name] if status else []
        print(f"({time.perf_counter() - began:.0f} s)", flush=True)
    summarise(found, failed, alone=not wanted)
    return 1 if failed else 0


def summarise(found: dict[str, list[str]], failed: list[str], *, alone: bool) -> None:
    bars = [
        f"{name.removeprefix('bench_'):<16}{bar}" for name, held in found.items() for bar in held
    ]
    met = sum(bar.endswith(" met") for bar in bars)
    print("\n== summary")
    for name, why in LEFT_OUT.items() if alone else ():
        print(f"left out: python benchmarks/{name} ({why})")
    print("\n".join(sorted(bars, key=lambda bar: bar.endswith(" met"))))
    for name in failed:
        print(f"FAILED: {name}")
    print(f"{met} of {len(bars)} bars met")


if __name__ == "__main__":
    sys.exit(main())

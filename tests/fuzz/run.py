# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Feed damaged files to every reader: `python tests/fuzz/run.py --inputs 20000 --workers 2`.

Exit code 1 if any input broke a rule of `judge.py`. What did is written to `--out`, laid out as in
corpus/: copy it there, and it is tried for ever after.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Run it; returns the exit code."""
    options = _parser().parse_args()
    os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    sys.path[0] = str(ROOT)  # of `tests`, as for pytest
    from tests.fuzz.session import Session

    memory = Path("/dev/shm")
    place = memory if memory.is_dir() else None
    with tempfile.TemporaryDirectory(prefix="wildshape-fuzz.", dir=place) as folder:
        session = Session(Path(folder), options)
        if options.replay is not None:
            return session.replay(options.replay)
        return session.run()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Feed damaged files to every reader.")
    parser.add_argument("--inputs", type=int, default=20_000, help="of all readers together")
    parser.add_argument("--each", type=int, default=100, help="of each reader, at least")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=[], help="readers whose names begin so")
    parser.add_argument("--targets", default="tests.fuzz.targets", help="module that lists readers")
    parser.add_argument("--out", type=Path, default=Path("fuzz-failures"))
    parser.add_argument("--state", type=Path, help="a file to go on from if the run is stopped")
    parser.add_argument("--replay", type=int, metavar="NUMBER", help="one input of the --only one")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())

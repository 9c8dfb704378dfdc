# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Faults on `train`, `convert`, `complete` and `simulate`: nothing finished may be lost.

    python -m tests.faults.run --rounds 10             ten of each fault, shared by the commands
    python -m tests.faults.run --only kill --rounds 100
    python -m tests.faults.run --only kill --seed 7 --rounds 1 --command train

Instants are spread over each command's own length: every stretch of it is struck once, at a
random place. A round that breaks a promise is named with what repeats it; the exit code is then 1.
"""

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from shutil import rmtree
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[2] / "src"))  # this checkout, whatever is installed
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # read when torch and numpy are imported: forks want no threads

from tests.faults import inflict  # noqa: E402
from tests.faults.jobs import Job, make_jobs  # noqa: E402
from tests.faults.small import shrink  # noqa: E402

FAULTS: dict[str, inflict.Fault] = {
    "kill": inflict.kill,
    "kill-cold": inflict.kill_cold,
    "term": inflict.terminate,
    "disk-full": inflict.fill,
    "memory": inflict.starve,
    "read-only": inflict.forbid,
    "two-writers": inflict.write_twice,
    "no-home": inflict.homeless,
    "no-compiler": inflict.toolless,
}
COLD = ("kill-cold", "no-home", "no-compiler")  # fresh interpreters: one a command is enough
COMMANDS = ("train", "convert", "complete", "simulate")


def main() -> int:
    """Inflict, count, and say what did not hold."""
    wanted = _arguments()
    began = time.monotonic()
    shrink()
    broken: list[str] = []
    with TemporaryDirectory(prefix="wildshape-faults-") as folder:
        place = Path(folder)
        place.chmod(0o755)
        jobs = [j for j in make_jobs(place / "in") if wanted.command in (None, j.command)]
        for number, job in enumerate(jobs):
            job.measure(place / f"undisturbed-{number}")
            _say(f"{job.label}: {job.seconds:.1f} s undisturbed")
        disk = "a tmpfs" if inflict.mounts(place) else "RLIMIT_FSIZE"
        _say(f"a full disk is {disk}")
        for name in wanted.only or FAULTS:
            rounds = min(wanted.rounds, len(COMMANDS)) if name in COLD else wanted.rounds
            broken += _inflicted(name, jobs, place, rounds, wanted.seed)
    _say(f"{len(broken)} promises broken, {time.monotonic() - began:.0f} s")
    return int(bool(broken))


def _inflicted(name: str, jobs: list[Job], place: Path, rounds: int, seed: int) -> list[str]:
    """So many rounds of a fault; what was broken."""
    broken, outcomes = [], Counter()
    for number, (job, share) in enumerate(_rounds(jobs, rounds, Random(f"{name} {seed}"))):
        room = place / "room"
        room.mkdir()
        random = Random(f"{name} {seed} {number}")
        try:
            outcomes[job.command, FAULTS[name](job, room / "out", random, share)] += 1
        except (inflict.BrokenPromiseError, TimeoutError) as error:
            broken.append(f"{name}, {job.label}, at {share:.3f} of its length: {error}")
            _say(f"BROKEN {broken[-1]}")
        rmtree(room)
    for (command, outcome), count in sorted(outcomes.items()):
        _say(f"{name:12} {command:9} {outcome}: {count}")
    return broken


def _rounds(jobs: list[Job], rounds: int, random: Random) -> Iterator[tuple[Job, float]]:
    """The commands in turn, of each its kinds in turn; instants spread over the whole length."""
    of = {command: [j for j in jobs if j.command == command] for command in COMMANDS}
    of = {command: kinds for command, kinds in of.items() if kinds}
    names = list(of)
    each = -(-rounds // len(names))
    order = {command: random.sample(range(each), each) for command in names}
    for number in range(rounds):
        turn, command = number // len(names), names[number % len(names)]
        share = (order[command][turn] + random.random()) / each
        yield of[command][turn % len(of[command])], share


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=10, help="of each fault")
    parser.add_argument("--only", nargs="+", choices=FAULTS, help="these faults alone")
    parser.add_argument("--command", choices=COMMANDS, help="this command alone")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())

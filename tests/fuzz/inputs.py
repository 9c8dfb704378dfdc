# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Input number n of a target, the same whenever and wherever it is asked for."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.fuzz.formats import bombs_of, mutations_of
from tests.fuzz.mutations import LARGEST, damage, splice
from tests.fuzz.target import Target, Tree, load_tree, save_tree

_CORPUS = Path(__file__).parent / "corpus"
_BOMBS = 0.004
_LOST, _SWAPPED = 0.01, 0.02


@dataclass(frozen=True)
class Input:
    """A valid input and what is laid over it.

    Attributes:
        seed: name of the valid one.
        changed: files that replace its own; None removes one.
    """

    seed: str
    changed: dict[str, bytes | None]


class Inputs:
    """The inputs of a target, made in a folder of their own."""

    def __init__(self, target: Target, seeds: Path, folder: Path) -> None:
        self.target = target
        self.folder = folder
        self.trees = {place.name: load_tree(place) for place in sorted(seeds.iterdir())}
        self._kept = kept_inputs(target.name)
        self._fresh: set[str] = set()

    def make(self, seed: int, number: int) -> Input:
        """Input `number`; the first are those of corpus/. Nothing is written."""
        if number < len(self._kept):
            return self._kept[number]
        rng = Random(f"{seed} {self.target.name} {number}")
        name = rng.choice(sorted(self.trees))
        tree = self.trees[name]
        files = [file for file in tree if self.target.attacked(file)]
        kinds = sorted({suffix_of(file) for file in files})
        changed: dict[str, bytes | None] = {}
        for _ in range(rng.choice((1, 1, 1, 2))):
            kind = rng.choice(kinds)
            file = rng.choice([file for file in files if suffix_of(file) == kind])
            changed[file] = _changed(rng, file, changed.get(file) or tree[file], tree)
        return Input(name, changed)

    def read_valid(self) -> None:
        """Read all that is valid; also, what readers import only when needed is there then."""
        for name in self.trees:
            folder, _ = self.lay(Input(name, {}))
            for _ in self.target.read(folder):
                pass
            self.take_back(Input(name, {}))

    def lay(self, one: Input) -> tuple[Path, int]:
        """Write an input; returns its folder and how many bytes are in it."""
        folder = self.folder / one.seed
        tree = self.trees[one.seed]
        if one.seed not in self._fresh or self.target.writes:
            shutil.rmtree(folder, ignore_errors=True)
            save_tree(folder, tree)
            self._fresh.add(one.seed)
        for name, data in one.changed.items():
            if data is None:
                (folder / name).unlink(missing_ok=True)
            else:
                save_tree(folder, {name: data})
        whole = {**tree, **one.changed}
        return folder, sum(len(data) for data in whole.values() if data is not None)

    def take_back(self, one: Input) -> None:
        """Make the folder valid again."""
        tree = self.trees[one.seed]
        save_tree(
            self.folder / one.seed, {name: tree[name] for name in one.changed if name in tree}
        )


def kept_inputs(target: str) -> list[Input]:
    """Inputs of corpus/TARGET/SEED/NAME/, found wrong once; an empty file there is a lost one."""
    places = sorted((_CORPUS / target).glob("*/*"))
    trees = [(place.parent.name, load_tree(place)) for place in places]
    return [
        Input(seed, {name: data or None for name, data in tree.items()}) for seed, tree in trees
    ]


def suffix_of(name: str) -> str:
    """What tells the kind of a file: all of its suffixes, or its name."""
    base = name.rpartition("/")[2]
    return base[base.find(".") :] if "." in base else base


def _changed(rng: Random, name: str, data: bytes, tree: Tree) -> bytes | None:
    """A file made a bomb, lost, another file, or damaged once or a few times."""
    luck = rng.random()
    bombs = bombs_of(suffix_of(name))
    if luck < _BOMBS and bombs:
        return rng.choice(bombs)()
    if luck < _LOST:
        return rng.choice((None, b"", b"\0"))
    if luck < _SWAPPED:
        return tree[rng.choice(sorted(tree))]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5))):
        data = _damaged(rng, name, data, tree)
    return data[:LARGEST]


def _damaged(rng: Random, name: str, data: bytes, tree: Tree) -> bytes:
    own = mutations_of(suffix_of(name))
    if own and rng.random() < 0.6:
        return rng.choice(own)(rng, data)
    if rng.random() < 0.05:
        others = [other for other in tree if suffix_of(other) == suffix_of(name)]
        return splice(rng, data, tree[rng.choice(others)])
    return damage(rng, data)

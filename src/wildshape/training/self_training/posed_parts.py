# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks as a teacher has posed them so far, kept beside a run: all of them can take an hour.

Files of so many tracks each, in the order of the tracks. They go when the targets are written.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int64
from safetensors import SafetensorError, safe_open
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import atomic_write
from wildshape.method.saved_network import check_numbers, check_sum, packed, unsummed
from wildshape.training.self_training.headings import PosedTrack

Posed = tuple[PosedTrack, Float[Tensor, "V"]]
"""A track, and its scans' heading votes."""
_TRACKS = 64


class PosedParts:
    """Keeps what is posed, and finds what was kept."""

    def __init__(self, folder: Path, identity: dict[str, str]) -> None:
        """`folder`: of the run; `identity`: which tracks, posed by what."""
        self._folder, self._identity = folder, identity

    def found(self, scans_of: Sequence[Int64[np.ndarray, "_"]]) -> list[Posed]:
        """The first of these tracks, as far as whole files of the same identity hold them."""
        known: list[Posed] = []
        for number in range(len(scans_of) // _TRACKS):
            scans = scans_of[number * _TRACKS : (number + 1) * _TRACKS]
            part = self._read(self._path(number), scans)
            if part is None:
                break
            known += part
        return known

    def kept(self, posed: Iterable[Posed], known: int) -> Iterator[Posed]:
        """The same tracks, written whenever a file is full; so many `known` ones come before."""
        waiting: list[Posed] = []
        for number, one in enumerate(posed, start=known + 1):
            waiting.append(one)
            if number % _TRACKS == 0:
                self._write(self._path(number // _TRACKS - 1), waiting)
                waiting = []
            yield one

    def clear(self) -> None:
        """Remove the files."""
        for path in self._folder.glob("posed-*.safetensors"):
            path.unlink(missing_ok=True)  # another process may be first

    def _path(self, number: int) -> Path:
        return self._folder / f"posed-{number:04d}.safetensors"

    def _write(self, path: Path, part: Sequence[Posed]) -> None:
        tensors = {
            "rotation": torch.cat([track.T_sensor_can.rotation for track, _ in part]),
            "translation": torch.cat([track.T_sensor_can.translation for track, _ in part]),
            "votes": torch.cat([votes for _, votes in part]),
            "middle_x": torch.tensor([track.middle_x for track, _ in part], dtype=torch.float64),
        }
        with atomic_write(path, flush=True) as file:
            file.write(packed({k: v.contiguous() for k, v in tensors.items()}, "", self._identity))

    def _read(self, path: Path, scans_of: Sequence[Int64[np.ndarray, "_"]]) -> list[Posed] | None:
        """None if there is no such file, or one that is damaged or of another run."""
        if not path.exists():
            return None
        try:
            with safe_open(path, framework="pt") as file:
                metadata = file.metadata() or {}
                if unsummed(metadata) != self._identity:
                    return None
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            check_numbers(path, tensors)
            check_sum(path, tensors, "", metadata)
            sizes = [len(scans) for scans in scans_of]
            rotation, translation, votes = (
                tensors[name].split(sizes) for name in ("rotation", "translation", "votes")
            )
            poses = [SE3(*parts) for parts in zip(rotation, translation)]
            middles = tensors["middle_x"].tolist()
            each = zip(scans_of, poses, middles, strict=True)
            return list(zip([PosedTrack(*one) for one in each], votes))
        except (SafetensorError, OSError, ValueError, RuntimeError, KeyError, BadInputError):
            return None

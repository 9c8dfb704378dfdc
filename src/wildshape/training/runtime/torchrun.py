# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One process or several under torchrun: the only file that knows."""

import os
import shlex
import sys
from dataclasses import dataclass

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel

from wildshape.io.output import command_line


@dataclass(frozen=True)
class Processes:
    """This process among its peers."""

    rank: int
    count: int
    device: torch.device
    local_rank: int = 0

    @property
    def leads_here(self) -> bool:
        """Whether this process is the first of its machine."""
        return self.local_rank == 0

    @property
    def leads(self) -> bool:
        """Whether this process writes the files."""
        return self.rank == 0

    def wrap(self, module: nn.Module) -> nn.Module:
        """DistributedDataParallel where there are several processes."""
        if self.count == 1:
            return module
        ids = [self.device.index] if self.device.type == "cuda" else None
        return DistributedDataParallel(module, device_ids=ids)

    def wait(self) -> None:
        """Until every process is here."""
        if self.count > 1:
            distributed.barrier()

    def any(self, flag: bool) -> bool:
        """Whether the flag is set in any process; all of them must ask."""
        if self.count == 1:
            return flag
        found = torch.tensor(int(flag), device=self.device)
        distributed.all_reduce(found, distributed.ReduceOp.MAX)
        return bool(found.item())

    def leave(self) -> None:
        """Close the group."""
        if self.count > 1:
            distributed.destroy_process_group()


def launched() -> str:
    """The command line, as a user would type it again on this machine."""
    count = os.environ.get("LOCAL_WORLD_SIZE", "1")
    if os.environ.get("WORLD_SIZE", "1") == "1":
        return command_line()
    # Behind the -- all is ours: torchrun would take --start for an option of its own.
    torchrun = ("torchrun", "--nproc-per-node", count, "-m", "--", "wildshape.cli")
    return shlex.join([*torchrun, *sys.argv[1:]])


def join(device: str) -> Processes:
    """Join torchrun's group if there is one; `device` is cpu or cuda."""
    count = int(os.environ.get("WORLD_SIZE", "1"))
    if count == 1:
        return Processes(0, 1, torch.device(device))
    local = int(os.environ.get("LOCAL_RANK", "0"))
    place = torch.device(device, local) if device == "cuda" else torch.device(device)
    if device == "cuda":
        torch.cuda.set_device(place)
    distributed.init_process_group("nccl" if device == "cuda" else "gloo")
    return Processes(distributed.get_rank(), count, place, local)

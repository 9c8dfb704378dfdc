# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Two CPU processes under torchrun are one process with both batches."""

import os
import shlex
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from tests.training.worker import SEED, SEEING
from torch.distributed.run import get_args_parser

from wildshape.cli.commands import train
from wildshape.training.config import learning_rate
from wildshape.training.loop import setup
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.runtime.torchrun import launched

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def two(car_store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    command += ["--nproc-per-node", "2", "-m", "tests.training.worker"]
    done = subprocess.run(
        [*command, str(car_store.path), str(folder)],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


def one_process(store, folder, ranks):
    """Plain gradient accumulation over the batches that the given processes would draw."""
    run = setup(SEEING, store, folder, seed=SEED)
    objective = WeaklySupervised(run.state.network, SEEING.loss)
    optim = SEEING.optim
    for step in range(optim.steps):
        run.state.optimiser.zero_grad()
        for rank in ranks:
            batch = run.sampler.draw(SEED, step, rank)
            (objective(batch).loss / len(ranks)).backward()
        torch.nn.utils.clip_grad_norm_(run.state.network.parameters(), optim.clip)
        for group in run.state.optimiser.param_groups:
            group["lr"] = learning_rate(step, optim)
        run.state.optimiser.step()
    return {k: v.detach() for k, v in run.state.network.state_dict().items()}


def apart(a, b):
    return max(float((a[k] - b[k]).abs().max()) for k in a)


def test_both_processes_end_with_the_same_weights(two):
    first, second = (load_file(two / f"rank{rank}.safetensors") for rank in (0, 1))
    assert apart(first, second) == 0


def test_two_processes_are_one_with_both_batches(two, car_store, tmp_path):
    found = load_file(two / "rank0.safetensors")
    both = one_process(car_store, tmp_path / "both", ranks=(0, 1))
    alone = one_process(car_store, tmp_path / "alone", ranks=(0,))
    # Six steps of Adam at 1e-3 move weights by some 1e-3; rounding stays a thousandth of it.
    assert apart(found, both) < 2e-5
    assert apart(found, alone) > 5e-4


def test_only_the_leading_process_writes(two):
    assert (two / "model.safetensors").exists()
    assert len((two / "log.jsonl").read_text().splitlines()) == 2


def test_torchrun_leaves_the_options_of_train_to_train():
    (example,) = (line for line in train.EXAMPLES if line.startswith("torchrun"))
    ours = [f"--{field.name}" for field in fields(train.Settings)]
    found = get_args_parser().parse_args([*shlex.split(example)[1:], *ours])
    assert found.training_script == "wildshape.cli"
    assert found.training_script_args[-len(ours) :] == ours


def test_a_run_of_several_processes_is_gone_on_with_by_as_many(monkeypatch):
    """Alone, `--resume` would refuse its state."""
    typed = ["train", "a b.store", "--out", "run", "--start", "shipped"]
    monkeypatch.setattr(sys, "argv", ["wildshape", *typed])
    assert shlex.split(launched()) == ["wildshape", *typed]
    for name in ("WORLD_SIZE", "LOCAL_WORLD_SIZE"):
        monkeypatch.setenv(name, "2")
    program, *said = shlex.split(launched())
    found = get_args_parser().parse_args(said)
    assert program == "torchrun"
    assert (found.nproc_per_node, found.module) == ("2", True)
    assert [found.training_script, *found.training_script_args] == ["wildshape.cli", *typed]

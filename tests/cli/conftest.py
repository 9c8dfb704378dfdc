# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Commands run in this process, on a few simulated tracks and a model that learned little."""

from dataclasses import dataclass

import pytest

from wildshape.cli.main import main

STEPS = 50


@dataclass(frozen=True)
class Outcome:
    """What a command left: exit code, stdout, stderr."""

    code: int
    out: str
    err: str


@pytest.fixture
def wildshape(capsys):
    """Run a command line; paths may be passed as they are."""

    def run(*arguments):
        capsys.readouterr()
        code = 0
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as leaving:
            code = int(leaving.code or 0)
        return Outcome(code, *capsys.readouterr())

    return run


@pytest.fixture
def refused(wildshape):
    """Run a command line that must be refused; returns its one sentence."""

    def run(*arguments):
        found = wildshape(*arguments)
        assert found.code == 2, found
        assert found.out == ""
        assert found.err.startswith("wildshape: ")
        assert found.err.count("\n") == 1, found.err
        return found.err

    return run


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    """Six tracks of six scans, packed."""
    path = tmp_path_factory.mktemp("store") / "cars.store"
    main(["simulate", str(path), "--tracks", "6", "--scans", "6", "--seed", "3", "--workers", "1"])
    return path


@pytest.fixture(scope="session")
def dataset(store, tmp_path_factory):
    """The same tracks as folders; not to be changed."""
    path = tmp_path_factory.mktemp("folders") / "cars"
    main(["convert", "packed", str(store), str(path), "--layout", "folders"])
    return path


@pytest.fixture(scope="session")
def short_run(store):
    """The command line of a short training run into a folder."""

    def arguments(out, steps=STEPS):
        shape = ("--preset", "tiny", "--steps", steps, "--device", "cpu")
        return [str(argument) for argument in ("train", store, "--out", out, *shape)]

    return arguments


@pytest.fixture(scope="session")
def trained(short_run, tmp_path_factory):
    """The folder of a short run that nothing disturbed."""
    path = tmp_path_factory.mktemp("run") / "tiny"
    main(short_run(path))
    return path

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One small street, recorded and found once."""

import pytest
from tests.drives.street import street, write_scans

import wildshape


@pytest.fixture(scope="session")
def truth():
    return street()


@pytest.fixture(scope="session")
def recording(truth, tmp_path_factory):
    folder = tmp_path_factory.mktemp("street") / "recording"
    write_scans(folder, truth.scans)
    return folder


@pytest.fixture(scope="session")
def found(recording, tmp_path_factory):
    return wildshape.drive(recording, tmp_path_factory.mktemp("found") / "out")

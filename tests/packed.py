# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A packed store of some tracks."""

from wildshape.io.store.store import StoreWriter, open_store


def packed(path, tracks):
    with StoreWriter(path, {}) as writer:
        for track in tracks:
            writer.add(track)
    return open_store(path)

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The two ways in which Wildshape refuses: one sentence that names the cause and the cure."""


class BadInputError(ValueError):
    """Input that cannot be used; the message is one sentence naming the file and the cure.

    The command line prints the message alone and exits with code 2.
    """


class MissingExtraError(ImportError):
    """An optional library is absent; the message names the extra that brings it."""

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Bad input is refused: `BadInputError`, in one sentence."""

import pytest

from wildshape.errors import BadInputError


def refused(read, *arguments, match, **options):
    """Check that a reader refuses its arguments, and that its sentence matches."""
    with pytest.raises(BadInputError, match=match) as caught:
        read(*arguments, **options)
    assert "\n" not in str(caught.value)


def refusal_of(read):
    """`refused` of one reader: called with the path, the match, and options of the reader."""

    def check(path, match, **options):
        refused(read, path, match=match, **options)

    return check

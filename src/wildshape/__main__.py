# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`python -m wildshape`, where the command itself is not on the PATH."""

from wildshape.cli.__main__ import main

if __name__ == "__main__":
    main()

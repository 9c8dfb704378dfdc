# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`python -m wildshape.cli`, and `torchrun --nproc-per-node N -m -- wildshape.cli train ...`."""

from wildshape.cli.main import main

if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape`, and `torchrun --nproc-per-node N -m -- wildshape.cli train ...`."""


def main() -> None:
    """The command line, whose imports Ctrl-C may meet, too."""
    try:
        from wildshape.cli.main import main as run
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    run()


if __name__ == "__main__":
    main()

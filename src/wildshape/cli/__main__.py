# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape`, and `torchrun --nproc-per-node N -m -- wildshape.cli train ...`."""

import signal


def main() -> None:
    """The command line, whose imports Ctrl-C may meet, too."""
    try:
        from wildshape.cli.main import main as run
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    try:
        run()
    finally:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, signal.SIG_DFL)  # Python's own end would show a trace


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The command line's door: it imports a command, and with it torch, only when one is named."""

import errno
import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import get_type_hints

from wildshape.cli.commands import module_of
from wildshape.cli.terminal import Terminated, say, terminable
from wildshape.errors import BadInputError, MissingExtraError, lacks_memory
from wildshape.io.atomic import release_folders

COMMANDS = {
    "demo": "the whole way on simulated scans, or on yours, in five minutes on a CPU",
    "drive": "find every vehicle of a raw recording: tracks, boxes, shapes, without labels",
    "simulate": "make tracks of scans, with their truth, by ray casting",
    "convert": "turn a published data set, or your own folders, into tracks",
    "info": "say and draw what tracks hold: points, ranges, viewing angles, lengths",
    "train": "learn completion and pose from tracks, without labels",
    "complete": "complete the object of each scan: shape, pose, box, confidence",
    "register": "align two scans of an object, or all scans of its track",
    "fuse": "join all scans of a track into one cloud",
    "evaluate": "measure models and baselines against known shapes and poses",
    "evaluate-drive": "measure boxes, tracks and trajectory of drives against labels",
    "view": "look at results or scans on an interactive page of this machine",
    "report": "draw what other commands wrote as one HTML page",
    "export": "write a model as one ONNX file, for runtimes without this library",
}
_HELP = ("-h", "--help")
_BAD_INPUT, _FAILED, _INTERRUPTED, _TERMINATED = 2, 1, 130, 143
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_NO_MEMORY = (
    "not enough memory; end other programs, raise the limit (ulimit -v) or hand in less at once;"
    " what is finished stays valid, and the same command goes on from it, `train` with --resume."
)
_RESERVED_BYTES = 1 << 20  # enough to say so, also after a small allocation has failed


def main(argv: Sequence[str] | None = None) -> None:
    """Run one command.

    Raises:
        SystemExit: 2 after bad input or usage, 130 after Ctrl-C, 143 after SIGTERM, 1 where the
            disk is full; always with one sentence on stderr.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    _open_closed_streams()
    # Threads that wait must sleep: where another program has one of two cores, spinning ones made
    # training twenty times slower. Read when torch is imported, hence here.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    with terminable():  # the way out, too
        try:
            with in_a_sentence():
                _obey(arguments)
                sys.stdout.flush()
        finally:
            release_folders()


def _open_closed_streams() -> None:
    """A closed one is None in Python, and the next file that is opened would take its number."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115


def overview() -> str:
    """The help of `wildshape` itself."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:{width}}  {purpose}" for name, purpose in COMMANDS.items()]
    return "\n".join(
        (
            "usage: wildshape COMMAND [...]",
            "",
            "Complete 3D shapes and poses of objects from partial scans, learned without labels.",
            "",
            *lines,
            "",
            "`wildshape COMMAND --help` explains one; `wildshape --version` tells which this is;",
            "`wildshape --print-completion bash` (or zsh) prints what that shell is to source.",
            "",
            "example:",
            "  wildshape complete scan.ply --out completed",
        )
    )


def _print_completion(shell: str = "") -> None:
    from wildshape.cli.shell_completion import SHELLS, script

    if shell not in SHELLS:
        _leave(f"--print-completion {shell}: expected {' or '.join(SHELLS)}.", _BAD_INPUT)
    print(script(shell, COMMANDS), end="")


def _obey(arguments: list[str]) -> None:
    """Run a command, or print what is asked for."""
    if not arguments or arguments[0] in _HELP:
        print(overview())
    elif arguments[0] == "--version":
        from wildshape import __version__

        print(__version__)
    elif arguments[0] == "--print-completion":
        _print_completion(*arguments[1:2])
    elif arguments[0] in COMMANDS:
        module = module_of(arguments[0])
        module.run(_parse(module, arguments[0], arguments[1:]))
    else:
        _leave(f"'{arguments[0]}' is no command; there are {', '.join(COMMANDS)}.", _BAD_INPUT)


@contextmanager
def in_a_sentence() -> Iterator[None]:
    """What a user can cure, and a signal, end the program with one sentence and an exit code."""
    reserved: list[bytearray] = []
    try:
        reserved.append(bytearray(_RESERVED_BYTES))
        with terminable(), _names_checked():
            yield
    except (BadInputError, MissingExtraError) as error:
        _leave(str(error), _BAD_INPUT)
    except Terminated as stopped:
        _leave(str(stopped) or _stopped(), _TERMINATED)
    except KeyboardInterrupt as stopped:
        _leave(str(stopped) or _stopped(), _INTERRUPTED)
    except BrokenPipeError:
        _drop_output()
        sys.stderr.close()  # the reader of our output has gone; nothing is left to say
        raise SystemExit(_FAILED) from None
    except (MemoryError, RuntimeError, ImportError, OSError, SystemError) as error:
        reserved.clear()
        if lacks_memory(error):
            error.__traceback__ = error.__context__ = None  # they hold what filled the memory
            _leave(_NO_MEMORY, _FAILED)
        if not isinstance(error, OSError):
            raise
        _drop_output()
        _leave(_system_sentence(error), _FAILED if error.errno in _NO_ROOM else _BAD_INPUT)


@contextmanager
def _names_checked() -> Iterator[None]:
    """A name that this locale has no letters for, or a link round in a circle, is bad input."""
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("Symlink loop"):  # as Python says it until 3.12
            raise
        raise BadInputError(f"{error}; check the path.") from error
    except UnicodeEncodeError as error:
        if error.encoding == "utf-8":
            raise
        raise BadInputError(
            f"{error.object}: cannot be written in {error.encoding}; set PYTHONUTF8=1."
        ) from error


def _drop_output() -> None:
    """What stdout cannot take: Python would try once more at its end, and exit with 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parse(module: ModuleType, command: str, arguments: list[str]) -> object:
    import tyro

    if any(not word or (word[:2] == "--" and word[-1] == "=") for word in arguments):
        raise BadInputError(
            f"{command}: an argument is empty, and would mean this folder; is a variable of the"
            " shell not set? Name what is meant, or leave it away."
        )
    _refuse_repeated_lists(module, command, arguments)
    said = StringIO()
    try:
        with redirect_stderr(said):
            return tyro.cli(
                module.Settings,
                prog=f"wildshape {command}",
                args=arguments,
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as leaving:
        if leaving.code not in (0, None):
            raise BadInputError(_framed(said.getvalue(), command)) from None
        lines = ("", "examples:", *(f"  {line}" for line in module.EXAMPLES))
        print("\n".join(lines), flush=True)
        raise


def _refuse_repeated_lists(module: ModuleType, command: str, arguments: list[str]) -> None:
    """Of an option that is repeated tyro takes the last: all values before it would be lost."""
    given = [word.partition("=")[0].replace("_", "-") for word in arguments]
    for name, kind in get_type_hints(module.Settings).items():
        option = f"--{name.replace('_', '-')}"
        if "tuple" in str(kind) and given.count(option) > 1:
            raise BadInputError(
                f"{command}: {option} is given more than once; give it once, with commas between"
                " its values."
            )


def _framed(text: str, command: str) -> str:
    """The sentence in the frame that tyro draws: below its title, above its next line."""
    lines = [line.strip("│╭╰╮╯ ") for line in text.splitlines()]
    first = 2 if len(lines) > 1 and _is_rule(lines[1]) else 1  # where a terminal knows ASCII alone
    inside = itertools.takewhile(lambda line: not _is_rule(line), lines[first:])
    return f"{' '.join(filter(None, inside)).rstrip('.')}; see wildshape {command} --help."


def _is_rule(line: str) -> bool:
    return line != "" and set(line) <= set("─-")


def _stopped() -> str:
    return "stopped; what is finished stays, and the same command goes on from there."


def _leads_nowhere(path: Path) -> bool:
    return path.is_symlink() and not path.exists()


def _system_sentence(error: OSError) -> str:
    place = f"{error.filename}: " if error.filename else ""
    reason = (error.strerror or str(error)).lower()
    if error.errno == errno.EEXIST and error.filename and _leads_nowhere(Path(error.filename)):
        return f"{place}is a link that leads nowhere; make what it points to, or choose another."
    if error.errno not in _NO_ROOM:
        return f"{place}{reason}; check the path and its permissions."
    return (
        f"{place}{reason}; what is finished stays valid, and the same command, of train with"
        " --resume, goes on from it."
    )


def _leave(sentence: str, code: int) -> None:
    rank = os.environ.get("RANK", "0")  # of torchrun's processes; what is wrong may be so in one
    who = "wildshape" if rank == "0" else f"wildshape, process {rank}"
    say(f"{who}: {' '.join(sentence.split())}")
    raise SystemExit(code)

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import errno
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
import tyro

from wildshape.baselines.dpc import objective as dpc
from wildshape.cli.commands import module_of, train
from wildshape.cli.main import COMMANDS
from wildshape.cli.options import Format
from wildshape.io.scans.points import SUFFIXES
from wildshape.io.scans.writers import CLOUD_SUFFIXES
from wildshape.training import recipes

ROOT = Path(__file__).parents[2]
MANY_USES = ("complete", "register", "convert", "train", "evaluate", "simulate")
LISTS = {
    "complete": {"boxes"},
    "convert": {"categories", "range_m"},
    "drive": {"boxes"},
    "evaluate": {"model", "baselines"},
    "view": {"allow_host"},
}


NEEDED = {
    "complete": ("in",),
    "convert": ("folder", "in", "out"),
    "drive": ("--out=x", "in"),
    "evaluate": ("--out=x", "in"),
    "view": ("in",),
}
ONE_WORD = {"range_m", "categories", "baselines"}


def settings_of(command, *arguments) -> Any:
    """What the command line's parser makes of the arguments."""
    settings = module_of(command).Settings
    return tyro.cli(settings, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))


def python(program):
    return subprocess.run(
        [sys.executable, "-X", "importtime", "-c", program],
        capture_output=True,
        text=True,
        check=True,
    )


def test_help_lists_every_command_and_imports_nothing_heavy(wildshape):
    found = python("from wildshape.cli.main import main; main(['--help'])")
    for command in COMMANDS:
        assert f"\n  {command} " in found.stdout
    imported = {line.rsplit("|", 1)[-1].strip() for line in found.stderr.splitlines()}
    assert not imported & {"torch", "numpy", "tyro", "rich", "jaxtyping"}
    assert wildshape().out == found.stdout


def test_help_of_no_command_imports_torch():
    names = ", ".join(f"'{name}'" for name in COMMANDS)
    python(
        "import sys\n"
        "from wildshape.cli.main import main\n"
        f"for name in ({names}):\n"
        "    try: main([name, '--help'])\n"
        "    except SystemExit as leaving: assert leaving.code == 0, name\n"
        "    assert not {'torch', 'numpy'} & set(sys.modules), name\n"
    )


@pytest.mark.parametrize("words", [("", "--out", "o"), ("t", "--out", ""), ("t", "--out=")])
def test_an_empty_word_is_no_folder(refused, words, tmp_path, monkeypatch):
    """As of a variable that is not set: it stood for the folder that one is in."""
    monkeypatch.chdir(tmp_path)
    for command in ("complete", "info", "convert"):
        source = ("folder",) if command == "convert" else ()
        assert "an argument is empty" in refused(command, *source, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_ends_with_examples_that_can_be_typed(wildshape, command):
    found = wildshape(command, "--help")
    assert found.code == 0
    help_text, said = found.out.split("\nexamples:\n")
    examples = [shlex.split(line.split(" < ")[0]) for line in said.splitlines()]
    assert len(examples) >= (3 if command in MANY_USES else 1)
    for words in examples:
        assert {"wildshape", "wildshape.cli"} & set(words[: words.index(command)])
        given = words[words.index(command) + 1 :]
        assert settings_of(command, *given) is not None
        assert all(word in help_text for word in given if word.startswith("--"))


@pytest.mark.parametrize("command", COMMANDS)
def test_titles_of_options_are_words_and_not_our_names_of_fields(wildshape, command):
    lines = map(str.strip, wildshape(command, "--help").out.splitlines())
    titles = {line for line in lines if re.fullmatch(r"[\w. ]*(arguments|options)", line)}
    groups = {f"{kind} options" for kind in ("scan", "model", "file", "worker")}
    assert titles - {"positional arguments"} <= {"options"} | groups
    assert "options" in titles


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_no_default_where_there_is_none(wildshape, command):
    said = " ".join(wildshape(command, "--help").out.replace("│", " ").split())
    assert "None" not in said
    assert "(default: )" not in said
    assert "(default: '')" not in said


@pytest.mark.parametrize("command", COMMANDS)
def test_values_of_every_list_may_stand_with_commas_or_spaces(wildshape, command):
    hints = get_type_hints(module_of(command).Settings)
    lists = {name for name, hint in hints.items() if "tuple" in str(hint)}
    lists -= {"origin", "source"}  # always X,Y,Z; positional, several words
    assert lists == LISTS.get(command, set())
    for name in lists:
        option = f"--{name.replace('_', '-')}"
        together = [(option, "2,50"), (option, "2, 50"), (f"{option}=2,50",)]
        apart = [] if name in ONE_WORD else [(option, "2", "50")]
        found = [
            getattr(settings_of(command, *NEEDED[command], *words), name)
            for words in together + apart
        ]
        assert len(found[0]) == 2
        assert set(found) == {found[0]}
        after = ("--overwrite",) if name in ONE_WORD else ()
        first = settings_of(command, *together[0], *NEEDED[command], *after)
        assert getattr(first, name) == found[0], "positionals may follow"
        assert f"{option} " in wildshape(command, "--help").out


@pytest.mark.parametrize(("command", "name"), [(c, n) for c in LISTS for n in sorted(LISTS[c])])
def test_a_list_given_twice_is_refused_not_cut(refused, command, name):
    """Only the last counted: `--model run0 --model run1` measured run1 alone."""
    option = f"--{name.replace('_', '-')}"
    said = refused(command, option, "2,50", f"{option}=3,60", *NEEDED[command])
    assert f"{command}: {option} is given more than once" in said
    assert "is given" in refused(command, f"--{name}", "2,50", option, "3,60", *NEEDED[command])


def test_a_file_whose_name_holds_a_comma_is_one_model(tmp_path):
    (tmp_path / "a,b.safetensors").touch()
    models = (str(tmp_path / "a,b.safetensors"), "car,chair")
    found = settings_of("evaluate", "in", "--out", "x", "--model", *models)
    assert found.model == (Path(models[0]), Path("car"), Path("chair"))


def test_every_preset_of_train_has_a_line_that_explains_it(wildshape):
    said = [line.strip("│ ") for line in wildshape("train", "--help").out.splitlines()]
    presets = {*recipes.PRESETS, *dpc.PRESETS}
    assert set(train.PRESETS) == presets
    for preset in presets:
        assert f"{preset}: {train.PRESETS[preset]}" in said
        assert settings_of("train", "in", "--out", "x", "--preset", preset).preset == preset


def test_every_format_of_clouds_is_offered(wildshape):
    offered = {f".{kind}" for kind in get_args(get_args(Format)[0])} - {".auto"}
    assert offered | {".txt"} == set(SUFFIXES)
    said = wildshape("fuse", "--help").out.replace("│", " ").split()
    assert " ".join(CLOUD_SUFFIXES) in " ".join(said)


@pytest.mark.parametrize("command", ["complete", "drive"])
def test_help_names_a_format_of_boxes_that_is_added(command):
    added = "from wildshape.inference.folders import box_files as b; b.BOX_FORMATS += ('added',)"
    shown = f"from wildshape.cli.main import main; main(['{command}', '--help'])"
    words = python(f"{added}; {shown}").stdout.replace("│", " ").split()
    assert ", added: also write all boxes so" in " ".join(words)


@pytest.mark.parametrize(
    "arguments",
    [
        ("complete", "examples/scan.npy", "--out", "x", "--model", "buss"),
        ("evaluate", "in", "--out", "x", "--model", "car,buss"),
        ("export", "buss"),
    ],
)
def test_an_unknown_model_lists_the_shipped_ones(refused, store, tmp_path, monkeypatch, arguments):
    scan = (ROOT / "examples/scan.npy").read_bytes()
    monkeypatch.chdir(tmp_path)
    Path("examples").mkdir()
    Path("examples/scan.npy").write_bytes(scan)
    Path("in").symlink_to(store)
    said = refused(*arguments)
    assert "buss: no such checkpoint" in said
    assert "airplane, car, chair, default" in said


def test_an_unknown_list_value_names_the_known_ones(refused, store, tmp_path):
    out = ("--out", tmp_path / "x")
    assert "json, kitti, nuscenes, argoverse2" in refused(
        "complete", store, *out, "--boxes", "json,kiti"
    )
    assert "identity, one-scan" in refused("evaluate", store, *out, "--baselines", "identity,icp")


def test_unknown_commands_and_options_are_refused_in_a_sentence(refused):
    assert "'compleet' is no command" in refused("compleet")
    said = refused("complete")
    assert "INPUT" in said
    assert said.endswith("(required); see wildshape complete --help.\n")
    assert "--sped" in refused("train", "x", "--out", "y", "--sped", "3")
    assert "'upside'" in refused("evaluate", "x", "--out", "y", "--rotate", "upside")
    assert "'abc'; see wildshape" in refused("simulate", "x", "--tracks", "abc")


def test_a_locale_that_lacks_the_letters_of_a_name_is_said(tmp_path):
    scan = Path(__file__).parents[2] / "examples/scan.npy"
    (tmp_path / "größe.npy").write_bytes(scan.read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "wildshape", "complete", "größe.npy", "--out", "out"],
        capture_output=True,
        cwd=tmp_path,
        env={**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    )
    assert done.returncode == 2
    assert done.stderr.startswith(b"wildshape: ")
    assert done.stderr.endswith(b"cannot be written in ascii; set PYTHONUTF8=1.\n")
    assert done.stderr.count(b"\n") == 1


def test_version(wildshape):
    assert wildshape("--version").out.strip().count(".") == 2


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        SystemError("error return without exception set"),
        RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes."),
        RuntimeError("can't start new thread"),
        ImportError("libtorch_cpu.so: failed to map segment from shared object"),
    ],
    ids=repr,
)
def test_without_memory_there_is_one_sentence(error, wildshape, monkeypatch):
    """As a library, numpy, torch, a thread or the loader say that memory ran out."""

    def run(settings):
        raise error

    monkeypatch.setattr("wildshape.cli.commands.info.run", run)
    found = wildshape("info", "anything")
    assert found.code == 1
    assert found.err.startswith("wildshape: not enough memory; ")
    assert found.err.count("\n") == 1


def test_other_errors_of_ours_are_not_hidden(wildshape, monkeypatch):
    def run(settings):
        raise RuntimeError("a mistake")

    monkeypatch.setattr("wildshape.cli.commands.info.run", run)
    with pytest.raises(RuntimeError, match="a mistake"):
        wildshape("info", "anything")


def in_a_shell(line):
    """A line of the shell; `wildshape` is this package's, with Python's usual buffers."""
    program = f'w() {{ "{sys.executable}" -m wildshape "$@"; }}; {line}'
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    return subprocess.run(["sh", "-c", program], capture_output=True, text=True, env=environment)


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_swallows_what_is_said(closed):
    """Without stderr every command with progress ended at once, and said nothing of it."""
    scan = shlex.quote(str(ROOT / "examples" / "scan.npy"))
    found = in_a_shell(f"w info {scan} --json {closed}")
    assert found.returncode == 0, found
    assert not found.stdout or json.loads(found.stdout)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("asked", ["--help", "--version", "info --help"])
def test_a_full_disk_under_stdout(asked):
    found = in_a_shell(f"w {asked} > /dev/full")
    assert found.returncode == 1
    assert found.stderr.startswith("wildshape: no space left on device; ")
    assert found.stderr.count("\n") == 1


def test_a_reader_that_has_gone_is_left_in_silence(tmp_path):
    code = tmp_path / "code"
    found = in_a_shell(f"(w --help; echo $? > {shlex.quote(str(code))}) | true")
    assert (code.read_text(), found.stderr) in (("1\n", ""), ("0\n", ""))  # 0: it was not gone yet

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The documents' promises: their Python and their commands run, on little data and few steps.

Blocks are `python`, `bash` or `text`. Those of a page run in order, in one folder. A `bash` block
that begins with `# not run by our tests` is parsed by the command line's own parser instead.
"""

import re
import shlex
import subprocess
import sys
import tomllib
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import pytest
import tyro
import yaml

import wildshape
from wildshape.cli.commands import module_of
from wildshape.cli.main import COMMANDS, main
from wildshape.evaluation.metrics import distance_floor

ROOT = Path(__file__).parent.parent
PAGES = sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("docs/**/*.md"))
WRITTEN = [*PAGES, "README.md", "CONTRIBUTING.md", "CHANGELOG.md"]
SPOKEN = [
    *WRITTEN,
    *sorted(str(path.relative_to(ROOT)) for path in ROOT.glob("benchmarks/**/*.md")),
]
PLACES = [ROOT, ROOT / "src" / "wildshape", ROOT / "benchmarks" / "results"]
NOT_RUN = "# not run by our tests"
# What a page takes for granted, and what of ours stands in for it.
GIVEN = {
    "docs/datasets/folder.md": {"DATASET": "folders"},
    "docs/info.md": {"cars.store": "store"},
    "docs/interfaces.md": {"mytracks": "folders"},
    "docs/limits.md": {"mytracks": "folders"},
}
MOST = {"--tracks": 4, "--scans": 3, "--steps": 2, "--max-scans": 2, "--seeds": 2}
ALWAYS = {
    "simulate": ("--tracks", "4", "--scans", "3", "--workers", "1"),
    "convert": ("--workers", "1"),
    "train": ("--preset", "tiny", "--steps", "2"),
    "evaluate": ("--max-scans", "2"),
}


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and content of each fenced block."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"^```(\w*)\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)


def commands(block: str) -> list[list[str]]:
    """The words of each line, without comments."""
    lines = block.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


RUN = [page for page in PAGES if any(language != "text" for language, _ in blocks(page))]


@pytest.fixture(scope="session")
def given(tmp_path_factory) -> Path:
    """A few tracks, packed and as folders."""
    folder = tmp_path_factory.mktemp("given")
    store, folders = str(folder / "store"), str(folder / "folders")
    main(["simulate", store, "--tracks", "2", "--scans", "3", "--seed", "3", "--workers", "1"])
    main(["convert", "packed", store, folders, "--layout", "folders", "--workers", "1"])
    return folder


@pytest.mark.parametrize("page", WRITTEN)
def test_blocks_say_what_they_are(page):
    languages = {language for language, _ in blocks(page)}
    assert languages <= {"python", "bash", "text"} | ({""} if page == "README.md" else set())


@pytest.mark.parametrize("page", RUN)
def test_a_page_runs(page, given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for name, ours in GIVEN.get(page, {}).items():
        (tmp_path / name).symlink_to(given / ours)
    names: dict[str, Any] = {}
    for language, block in blocks(page):
        if language == "python" and "--8<--" in block:
            assert (ROOT / block.split('"')[1]).is_file()  # tests/test_examples.py runs it
        elif language == "python":
            exec(compile(block, page, "exec"), names)
        elif language == "bash":
            for words in commands(block):
                check(words, run=not block.startswith(NOT_RUN))


def check(words: list[str], *, run: bool) -> None:
    """One line of a shell: ours is parsed, and run; of others, what they name must exist."""
    words = words[: min([words.index(pipe) for pipe in "<>|" if pipe in words], default=None)]
    program, *arguments = words
    if program == "wildshape":
        parse(arguments)
        if run:
            perform(arguments)
    elif program == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        assert all(re.search(f"^{a}:", makefile, re.MULTILINE) for a in arguments if "=" not in a)
    elif program == "pip":
        extras = re.findall(r"\[(\w+)\]", " ".join(arguments))
        assert set(extras) <= set(project()["optional-dependencies"])
    elif program == "python":
        name = arguments[1].replace(".", "/") if arguments[0] == "-m" else arguments[0]
        there = (ROOT / name).exists() or (ROOT / f"{name}.py").exists()
        assert there or (ROOT / "site").name == arguments[-1], words
        if run and name.startswith("examples/"):
            succeed(arguments)
    else:
        assert not run, f"{program} is neither run nor marked"


def parse(arguments: list[str]) -> None:
    """Have the command line's own parser read the arguments."""
    command, *rest = arguments
    settings = module_of(command).Settings
    tyro.cli(settings, args=rest, config=(tyro.conf.FlagCreatePairsOff,))


def perform(arguments: list[str]) -> None:
    """The command in this process, made small."""
    words = list(arguments)
    for i, word in enumerate(words[:-1]):
        if word in MOST:
            words[i + 1] = str(min(MOST[word], int(words[i + 1])))
        if word == "--preset":
            words[i + 1] = "tiny"
    extra = () if "--drive" in words else ALWAYS.get(words[0], ())
    for option, value in zip(extra[::2], extra[1::2], strict=True):
        words += [] if option in words else [option, value]
    if words[0] == "export":  # the tracer cannot see through the checks of shapes in this process
        succeed(["-m", "wildshape.cli", *words, "--scans", "4"])
    else:
        main(words)


def succeed(arguments: list[str]) -> None:
    """A Python process of its own."""
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


def project() -> dict[str, Any]:
    """The table of pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@cache
def options(command: str) -> frozenset[str]:
    """Every option of a command."""
    settings = module_of(command).Settings
    with pytest.raises(SystemExit), redirect_stdout(StringIO()) as said:
        tyro.cli(settings, args=["--help"], config=(tyro.conf.FlagCreatePairsOff,))
    return frozenset(re.findall(r"--[a-z0-9-]+", said.getvalue()))


@pytest.mark.parametrize("page", WRITTEN)
def test_commands_in_the_text_exist_with_their_options(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for command, rest in re.findall(r"`wildshape ([a-z][a-z-]*)([^`]*)`", text):
        assert command in COMMANDS, command
        unknown = set(re.findall(r"--[a-z0-9-]+", rest)) - options(command) - {"--help"}
        assert not unknown, f"wildshape {command} has no {unknown}"


@pytest.mark.parametrize("page", WRITTEN)
def test_links_lead_to_files_of_the_project(page):
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", (ROOT / page).read_text(encoding="utf-8")):
        place = (ROOT / page).parent / target
        assert ":" in target or place.exists() or target.endswith("commands.md"), target


@pytest.mark.parametrize("page", SPOKEN)
def test_links_lead_to_headings_that_there_are(page):
    text = re.sub(r"^```.*?^```$", "", (ROOT / page).read_text("utf-8"), flags=re.S | re.M)
    for target, anchor in re.findall(r"\]\(([^:)#\s]*)#([^)\s]+)\)", text):
        goal = (ROOT / page).parent / target if target else ROOT / page
        assert goal.suffix != ".md" or anchor in anchors(goal), f"{target}#{anchor}"


@cache
def anchors(page: Path) -> frozenset[str]:
    """The names that GitHub and the site give to the headings of a page."""
    heads = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    words = (re.sub(r"[^\w\s-]", "", head.lower()).strip() for head in heads)
    return frozenset(word.replace(" ", "-") for word in words)


@pytest.mark.parametrize("page", SPOKEN)
def test_paths_and_names_in_the_text_exist(page):
    assert not unknown((ROOT / page).read_text(encoding="utf-8"))


def test_a_path_or_name_that_has_moved_is_found():
    moved = {"training/moved.py", "moved/moved.py", "io/moved", "wildshape.io.moved"}
    assert unknown("python experiments/moved.py OUT") == {"experiments/moved.py"}
    here = {"io/scans/", "OUT/any.md", "car.py", "//X", "wildshape.io.scans"}
    assert unknown(" ".join(f"`{name}`" for name in moved | here)) == moved


def unknown(text: str) -> set[str]:
    """Paths between back quotes, and names of modules and what is in them, that there are not."""
    paths = {path for path in re.findall(r"`([\w./-]+)`", text) if is_ours(path)}
    paths |= set(re.findall(r"(?<![\w/.-])((?:src|tests|experiments|examples)/[\w/-]+\.\w+)", text))
    names = set(re.findall(r"\bwildshape(?:\.\w+)+", text)) - {"wildshape.json"}
    return {path for path in paths if not any((place / path).exists() for place in PLACES)} | {
        name for name in names if not is_found(name)
    }


def test_the_stages_of_a_drive_name_their_modules():
    text = (ROOT / "docs/drive.md").read_text(encoding="utf-8").partition("## The stages")[2]
    rows = re.findall(r"^\| \w+ \| (`[^|]+) \|", text, re.MULTILINE)
    named = [name for row in rows for name in re.findall(r"`([\w.]+)`", row)]
    assert len(named) > 10
    assert not [name for name in named if not is_found(f"wildshape.drives.{name}")]


def is_ours(path: str) -> bool:
    """Whether a path is one of this project: of a Python file, or in a folder that there is."""
    folder, slash, _ = path.partition("/")
    inside = any((place / folder).is_dir() for place in PLACES)
    return bool(folder and slash) and (path.endswith(".py") or inside)


def is_found(name: str) -> bool:
    """Whether a dotted name can be imported."""
    try:
        return resolve_name(name) is not None
    except (ImportError, AttributeError):
        return False


@pytest.mark.parametrize("page", SPOKEN)
def test_the_rows_of_a_table_have_as_many_cells_as_its_head(page):
    for table in tables((ROOT / page).read_text(encoding="utf-8")):
        assert len({cells(row) for row in table}) == 1, table[0]


def tables(text: str) -> list[list[str]]:
    """The rows of each table that is not in a block of code."""
    plain = re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    return [found.splitlines() for found in re.findall(r"(?:^\|.*\n)+", plain, re.MULTILINE)]


def cells(row: str) -> int:
    """How many cells a row has; a bar between back quotes parts none."""
    return re.sub(r"`[^`]*`", "", row).strip().count("|") - 1


def test_a_row_with_a_cell_too_many_is_found():
    assert [cells(row) for row in tables("| a | `b|c` |\n| d | e | f |\n")[0]] == [2, 3]


def test_contributors_find_every_room():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+`) \|", text, re.MULTILINE)
    listed = {name.removesuffix(".py") for row in rows for name in re.findall(r"`([\w.]+)`", row)}
    here = {path.stem for path in (ROOT / "src/wildshape").iterdir() if is_room(path)}
    assert listed == here


def test_rooms_say_where_to_start():
    for room in (ROOT / "src/wildshape").rglob("__init__.py"):
        text = room.read_text(encoding="utf-8")
        first = re.search(r"Start\swith\s`([\w.]+)`", text)
        if first is None:
            assert "\nfrom " in text, room  # it holds code itself
        else:
            path = room.parent / first[1].removesuffix(".py").replace(".", "/")
            assert path.exists() or path.with_suffix(".py").exists(), room


def is_room(path: Path) -> bool:
    """A folder with Python files, or a file that is a floor of its own."""
    return (path / "__init__.py").is_file() or (
        path.suffix == ".py" and not path.stem.startswith("__")
    )


def test_sources_cite_no_document_that_is_not_here():
    sections = re.findall(
        r"^## (\d+)\. ", (ROOT / "docs/method.md").read_text("utf-8"), re.MULTILINE
    )
    for path in (ROOT / "src").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        cited = re.findall(r"METHOD (\d+)(?:\.\d)?(?:(?:, | and | to )(\d+))?", text)
        assert {number for pair in cited for number in pair if number} <= set(sections), path
        assert not re.search(r"\b(DESIGN|STYLE|PERFORMANCE)\b", text), path
        assert all((ROOT / page).is_file() for page in re.findall(r"docs/[\w/-]+\.md", text)), path


def test_the_software_and_the_paper_can_be_cited():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    assert (cited["version"], cited["license"]) == (wildshape.__version__, project()["license"])
    (paper,) = cited["references"]
    assert paper["title"] == "Weakly-supervised 3D Shape Completion in the Wild"
    assert paper["authors"][0]["family-names"] == "Gu"


def test_the_changelog_knows_this_version():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(
        rf"^## \[({re.escape(wildshape.__version__)}|Unreleased)\]", text, re.MULTILINE
    )


def test_pages_of_data_sets_say_what_was_checked():
    pages = [page for page in PAGES if page.startswith("docs/datasets/")]
    text = {page: (ROOT / page).read_text(encoding="utf-8") for page in pages}
    said = {page for page in pages if re.search(r"^## Checked|\*\*Tested on", text[page], re.M)}
    assert set(pages) - said == {"docs/datasets/README.md", "docs/datasets/folder.md"}


def test_the_floor_that_evaluation_names_is_that_of_the_tables():
    text = (ROOT / "docs/evaluation.md").read_text(encoding="utf-8")
    (floor,) = re.findall(r"([\d.]+) m for a car of 25 m², 2,048 points and 8,192 true", text)
    assert float(floor) == round(distance_floor(25.0, 2048) + distance_floor(25.0, 8192), 3)


def test_benchmarks_that_are_left_out_are_named():
    left_out = re.search(
        r"^LEFT_OUT = {(.*?)}", (ROOT / "benchmarks/run.py").read_text("utf-8"), re.M | re.S
    )
    assert left_out
    text = (ROOT / "docs/performance.md").read_text(encoding="utf-8")
    assert all(name in text for name in re.findall(r"bench_\w+\.py", left_out[1]))


def test_the_site_lists_every_page():
    listed = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert not [page for page in PAGES if page.removeprefix("docs/") not in listed]


def test_results_name_no_path_of_the_machine_that_made_them():
    """Folders are CAD, KITTI, RUN: what a reader has in their place."""
    path = re.compile(r"[\"= ]/(?:home|mnt|root|tmp|work|Users|private)/")
    files = [*(ROOT / "benchmarks").rglob("*.json"), *(ROOT / "benchmarks").rglob("*.md")]
    assert len(files) > 40
    assert [file.name for file in files if path.search(file.read_text("utf-8"))] == []

# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Completion of commands, options and their words in bash and zsh, from the commands' settings."""

from collections.abc import Mapping
from dataclasses import fields
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from tyro.conf import OmitArgPrefixes, Positional

from wildshape.cli.commands import module_of

SHELLS = ("bash", "zsh")
_ZSH = "autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit\n"
_SCRIPT = """\
_wildshape() {{
  local cur="${{COMP_WORDS[COMP_CWORD]}}" prev="${{COMP_WORDS[COMP_CWORD-1]}}" words=""
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{commands}" -- "$cur"))
    return
  fi
  case "${{COMP_WORDS[1]}} $prev" in
{choices}
    "--print-completion "*) words="{shells}" ;;
    *)
      case "${{COMP_WORDS[1]}} $cur" in
{options}
      esac
      ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$cur"))
}}
complete -o default -o bashdefault -F _wildshape wildshape
"""


def script(shell: str, commands: Mapping[str, object]) -> str:
    """What a shell is to source; file names are completed wherever nothing else fits."""
    choices, options = [], []
    for command in commands:
        found = options_of(module_of(command).Settings)
        options.append(f'        "{command} -"*) words="{" ".join(found)} --help" ;;')
        choices += [
            f'    "{command} {name}") words="{" ".join(words)}" ;;'
            for name, words in found.items()
            if words
        ]
    text = _SCRIPT.format(
        commands=" ".join((*commands, "--help", "--version", "--print-completion")),
        choices="\n".join(choices),
        options="\n".join(options),
        shells=" ".join(SHELLS),
    )
    return _ZSH + text if shell == "zsh" else text


def options_of(settings: type) -> dict[str, tuple[str, ...]]:
    """A command's options, each with the words that it may be followed by, if they are counted."""
    hints = get_type_hints(settings, include_extras=True)
    found = {}
    for field in fields(settings):
        marks = _marks(hints[field.name])
        if OmitArgPrefixes in marks:
            found |= options_of(hints[field.name].__origin__)
        elif Positional not in marks:
            names = (getattr(mark, "name", None) for mark in marks)
            name = next((name for name in names if isinstance(name, str)), field.name)
            found[f"--{name.replace('_', '-')}"] = _words(hints[field.name])
    return found


def _marks(hint: Any) -> tuple[Any, ...]:
    """What a type is annotated with."""
    if get_origin(hint) is not Annotated:
        return ()
    return (*_marks(hint.__origin__), *hint.__metadata__)


def _words(hint: Any) -> tuple[str, ...]:
    """The words of the Literals in a type."""
    if get_origin(hint) is Annotated:
        return _words(hint.__origin__)
    if get_origin(hint) is Literal:
        return tuple(map(str, get_args(hint)))
    if get_origin(hint) in (Union, UnionType):
        return tuple(word for part in get_args(hint) for word in _words(part))
    return ()

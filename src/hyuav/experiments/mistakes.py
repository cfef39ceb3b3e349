"""One line for every mistake on the command line, which says what may have been meant."""

import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep
from hydra.errors import ConfigCompositionException, HydraException, MissingConfigException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

from hyuav._support.errors import (
    InputError,
    brief,
    did_you_mean,
    most_similar,
    one_line,
    rejection,
    require_choice,
)
from hyuav.experiments.quoting import in_quotes

OTHERWISE = {
    "output": "hydra.run.dir",
    "seeds": "learners",
    "learners": "seeds",
    "run": "resume",
    "alternatives_weight": "imitation_weight",
    "action_stretch": "action_scale",
}
"""Words of some recipes or of an earlier version, and what the same is called in others or now."""

SEVERAL = {"-m", "--multirun", "hydra.mode=MULTIRUN"}
"""Words that ask for a job for each of several values."""


def members_of(group: str) -> list[str]:
    """What a group offers, by name."""
    offered = ConfigStore.instance().repo[group]
    return sorted(member.removesuffix(".yaml") for member in offered)


class Vocabulary:
    """The words of a recipe.

    Args:
        node: its defaults, and how Hydra is to treat them.
        groups: Hydra's groups and the member chosen by default.
    """

    def __init__(self, node: Mapping[str, Any], groups: Mapping[str, str]) -> None:
        self._groups, self._once = groups, node["hydra"]["run"]["dir"] == "."
        repository = ConfigStore.instance().repo
        self._members: dict[str, dict[str, Any]] = {
            group: {
                name.removesuffix(".yaml"): OmegaConf.to_container(each.node)
                for name, each in repository[group].items()
                if hasattr(each, "node")  # and is no group within the group
            }
            for group in groups
        }
        said = (word.partition("=") for word in sys.argv[1:])
        known = {name: value for name, _, value in said if value in self._members.get(name, {})}
        chosen = {**groups, **known}
        own = {name: value for name, value in node.items() if name not in ("hydra", "defaults")}
        self._entries = {**own, **{group: self._members[group][chosen[group]] for group in groups}}

    def refuse(self, words: Iterable[str]) -> None:
        """Refuse what Hydra accepts or does not explain.

        Raises:
            InputError: what is no override, or one of what would lie below a single value or a
                list; a group without a member, or with a list of them; several jobs where there is
                no directory for each.
        """
        several = not SEVERAL.isdisjoint(words := list(words))
        if several and self._once:
            raise InputError("-m: this recipe does a single job: leave it out")
        for word in words:
            if word.startswith("-"):
                continue
            name, _, value = word.partition("=")
            entry = name.lstrip("+~")
            if entry in self._groups and (name.startswith("~") or value.startswith("[")):
                require_choice(name, value, members_of(entry))
            self._require_place(word, entry.split("."))
            self._require_override(word, several=several)

    def _require_place(self, word: str, path: list[str]) -> None:
        below: Any = self._entries
        for depth, key in enumerate(path):
            if not isinstance(below, Mapping):
                whole = ".".join(path[:depth])
                raise InputError(f"{brief(word)}: {whole} has no fields: set {whole}=...")
            if key not in below:
                return
            below = below[key]

    def _require_override(self, word: str, *, several: bool) -> None:
        """Accept what Hydra can read, or say how it is written."""
        name, equals, value = word.partition("=")
        entry = name.lstrip("+~")
        if not entry or not (equals or name.startswith("~")):
            raise InputError(f"{brief(word)}: expected NAME=VALUE{self._naming(word)}")
        reason = _reason_not_to_read(word)
        if reason is not None:
            quoted = _with_quotes(name, value)
            hint = f"write it in quotation marks: {shlex.quote(quoted)}" if quoted else reason
            raise InputError(f"{brief(word)}: {hint}")
        parsed = OverridesParser.create().parse_override(word).value()
        if several or not isinstance(parsed, ChoiceSweep) or not parsed.simple_form:
            return
        as_list, as_text = f"{name}=[{value}]", f"{name}={in_quotes(value)}"
        way = f"{shlex.quote(as_list)} is a list, {shlex.quote(as_text)} one text"
        way = "expected one of them" if entry in self._groups else way
        each = "" if self._once else ", and -m does a job for each"
        raise InputError(f"{brief(word)}: {way}{each}")

    def _naming(self, word: str) -> str:
        """A hint at the entry that a bare value may have been meant for."""
        names = [group for group, members in self._members.items() if word in members]
        if "/" in word or Path(word).exists():
            names += [name for name in ("run", "resume", "runs") if name in self._entries]
        return f" (did you mean {f'{names[0]}={word}'!r}?)" if names else ""

    def unknown(self, key: str) -> InputError:
        """The refusal of an entry that there is not, with those that may have been meant."""
        owner, _, word = key.rpartition(".")
        below: Any = self._entries
        for part in owner.split(".") if owner else ():
            below = below.get(part, {}) if isinstance(below, Mapping) else {}
        hint = self._elsewhere(word) or self._elsewhere(OTHERWISE.get(word, ""))
        if owner and word in self._entries:
            hint = f"did you mean {word!r}, without {owner!r} before it?"
        if not hint:
            places = {name.rpartition(".")[2]: name for name in _names(self._entries)}
            similar = most_similar(word, below) or places.get(most_similar(word, places) or "")
            hint = _asking([similar] if similar else []) or f"one of {', '.join(map(str, below))}"
        return InputError(f"{owner or 'configuration'}: unknown field {brief(word)}: {hint}")

    def _elsewhere(self, word: str) -> str:
        """A hint at the places where there is an entry of this very name; empty without any."""
        if word.startswith("hydra.") and not self._once:
            return _asking([word])
        names = [name for name in _names(self._entries) if name.rpartition(".")[2] == word]
        if names:
            return _asking(names)
        for group, members in self._members.items():
            for member, node in members.items():
                for name in _names(node, f"{group}."):
                    if name.rpartition(".")[2] == word:
                        return f"{_asking([name])[:-1]} of {group}={member}?"
        return ""


def _asking(names: Sequence[str]) -> str:
    return f"did you mean {' or '.join(map(repr, names))}?" if names else ""


def _names(entries: Mapping[str, Any], owner: str = "") -> Iterator[str]:
    """The dotted names of all entries."""
    for name, value in entries.items():
        yield f"{owner}{name}"
        if isinstance(value, Mapping):
            yield from _names(value, f"{owner}{name}.")


def _reason_not_to_read(word: str) -> str | None:
    """Why Hydra cannot read an override; None where it can."""
    try:
        OverridesParser.create().parse_override(word)
    except HydraException as error:
        return one_line(str(error).split("\nSee https")[0])
    return None


def _with_quotes(name: str, value: str) -> str | None:
    """The override with text in quotation marks, each of a list's; None where that is no help."""
    if value.startswith("[") and value.endswith("]") and not set(value[1:-1]) & set("[]{}()"):
        parts = [part.strip() for part in value[1:-1].split(",")]
        quoted = [in_quotes(own) if _reason_not_to_read(f"x={own}") else own for own in parts]
        whole = f"{name}=[{','.join(quoted)}]"
    elif value.startswith(("[", "{", "(", "'", '"')):
        return None
    else:
        home = value.startswith("~/")  # which a shell looks up at the beginning of a word alone
        whole = f"{name}={in_quotes(str(Path(value).expanduser()) if home else value)}"
    return None if _reason_not_to_read(whole) else whole


def explain(error: Exception, vocabulary: Vocabulary) -> str:
    """One line that says what was wrong and what is accepted."""
    reason = error.__cause__
    if isinstance(error, MissingConfigException) and error.options is not None:
        group, _, member = str(error.missing_cfg_file).rpartition("/")
        hint = did_you_mean(member, error.options)
        return rejection(group, member, f"one of {', '.join(error.options)}{hint}")
    if isinstance(error, ConfigCompositionException) and isinstance(reason, OmegaConfBaseException):
        known = reason.parent_node
        if reason.full_key is not None and isinstance(known, DictConfig):
            key = reason.full_key.rpartition(".")[2]
            if key not in known:
                return str(vocabulary.unknown(reason.full_key))
        error = reason
    if isinstance(error, MissingMandatoryValue):
        return rejection(str(error.full_key), MISSING, "a value")
    text = str(error).split("\n    full_key")[0].split("\nSee https")[0]
    return one_line(text)

"""Conversion of a YAML file or a mapping to settings, or to one clear line per problem."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from functools import reduce
from pathlib import Path

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from galloping.configuration.keys import RENAMED
from galloping.configuration.schema import allowed, child, item, leaves, names, schema
from galloping.configuration.settings import Settings
from galloping.configuration.yaml_file import ConfigurationError, read, refuse_endless
from galloping.fields import Section, show

# texts by pydantic's type of error, where "is not allowed" would say too little
FAULTS = {
    "float_type": "is not a number",
    "int_type": "is not a whole number",
    "finite_number": "is not finite",
    "string_type": "is not text",
    "tuple_type": "is not a list",
    "dict_type": "is not a section",
    "model_type": "is not a section",
}

MAX_PROBLEMS = 20  # problems listed in a message


def load(mapping: dict) -> Settings:
    """Convert a nested dict to validated settings of a study, with defaults for missing keys.

    Raises ConfigurationError with one line per problem: the key as the user writes it, the
    value, what is allowed and the nearest valid name.
    """
    refuse_endless(mapping)
    try:
        return Settings.model_validate(mapping)
    except ValidationError as error:
        faults = {fault["loc"]: fault for fault in error.errors(include_url=False)}
    # If a name is not allowed, faults below it are not reported.
    bad_names = {location[:-1] for location in faults if location[-1:] == ("[key]",)}
    lines = dict.fromkeys(
        _describe_fault(mapping, fault)
        for location, fault in faults.items()
        if location[-1:] == ("[key]",)
        or not any(location[: len(name)] == name for name in bad_names)
    )
    shown = list(lines)[:MAX_PROBLEMS]
    if more := len(lines) - len(shown):
        shown.append(f"configuration: and {more} more problems")
    raise ConfigurationError("\n".join(shown))


def plain(settings: Section) -> dict:
    """Convert settings to nested dicts and lists of plain values, as for JSON."""
    return settings.model_dump(mode="json")


def load_files(configfiles: Iterable[str | Path]) -> Settings:
    """Load settings from YAML files, the later over the earlier; raise ConfigurationError."""
    files = [read(file) for file in configfiles]
    return load(clean_merged(reduce(_override_sections, files), files))


def _override_sections(mapping: dict, overrides: dict) -> dict:
    """Merge sections and replace all else, as Snakemake does."""
    both = {
        key: _override_sections(section, value)
        for key, value in overrides.items()
        if isinstance(section := mapping.get(key), dict) and isinstance(value, dict)
    }
    return mapping | overrides | both


def clean_merged(mapping: dict, files: Sequence[dict]) -> dict:
    """Sort the keys of a mapping that Snakemake merged from files, and drop cases that are null."""
    mapping = sort_keys(mapping, files)
    cases = mapping.get("cases")
    if isinstance(cases, dict):
        mapping = mapping | {"cases": {k: v for k, v in cases.items() if v is not None}}
    return mapping


def sort_keys(mapping: dict, files: Sequence[dict]) -> dict:
    """Sort the keys of a merged configuration in the order in which the files list them.

    The order of cases and initial states matters, and Snakemake puts the keys of a file that
    overrides before those of the overridden file. Keys that no file names come last.
    """
    keys = dict.fromkeys([*(key for file in files for key in file if key in mapping), *mapping])
    sections = {key: [f[key] for f in files if isinstance(f.get(key), dict)] for key in keys}
    return {
        key: sort_keys(value, sections[key]) if isinstance(value := mapping[key], dict) else value
        for key in keys
    }


def _describe_fault(mapping: dict, fault: ErrorDetails) -> str:
    kind, location = fault["type"], fault["loc"]
    if kind in ("extra_forbidden", "invalid_key"):
        return _describe_unknown_key(location)
    if location[-1:] == ("[key]",):
        return _describe_bad_name(location[:-1])
    if kind == "missing":  # an item of a list of fixed length
        location = location[:-1]
    path, value = _locate_value(mapping, location, default=fault["input"])
    if kind == "invalid":
        return f"{_join_keys(path + fault['ctx']['below'])}: {fault['ctx']['text']}"

    node = _find_node(path)
    is_item = path != location
    limits = item(node) | {"unit": node["unit"]} if is_item else node
    if "enum" in limits:
        noun = str(path[-1]).removesuffix("s" if is_item else "").replace("_", " ")
        options = limits["enum"]
        return (
            f"{_join_keys(path)}: unknown {noun} {show(value)}"
            f"{_suggest_name(value, options) or ';'} allowed: {', '.join(options)}"
        )
    what = FAULTS.get(kind, "is not allowed")
    if isinstance(fault["input"], str) and kind in ("float_type", "int_type"):
        what = "is text, not a number"
    if value is None and what == FAULTS["dict_type"]:
        what += " (write {} for its defaults)"
    must = "each must be" if is_item else "must be"
    return f"{_join_keys(path) or 'configuration'}: {show(value)} {what}; {must} {allowed(limits)}"


def _describe_unknown_key(location: tuple) -> str:
    *parents, key = location
    if new := RENAMED.get(".".join([*_anonymise(parents), str(key)])):
        return f"{_join_keys(location)}: unknown key; is now {new}"
    siblings = names(_find_node(parents))
    elsewhere = {
        ".".join(parts[: parts.index(key) + 1])
        for parts in (path.split(".") for path, _ in leaves())
        if key in parts
    }
    hint = _suggest_name(key, siblings) or (
        f"; did you mean {' or '.join(map(repr, sorted(elsewhere)))}?"
        if elsewhere
        else f"; allowed: {', '.join(siblings)}"
    )
    return f"{_join_keys(location)}: unknown key{hint}"


def _anonymise(path: Iterable) -> list[str]:
    """Return the keys of a path with `<name>` for each name that the user chose."""
    node = schema()
    keys: list[str] = []
    for key in path:
        keys.append(key if key in names(node) else "<name>")
        node = child(node, key)
    return keys


def _describe_bad_name(location: tuple) -> str:
    *parents, name = location
    node = _find_node(parents)
    if options := names(node):
        hint = _suggest_name(name, options) or ";"
        return f"{_join_keys(location)}: unknown name{hint} allowed: {', '.join(options)}"
    return f"{_join_keys(location)}: {show(name)} is not allowed as a name; must be {node['rule']}"


def _suggest_name(name: object, options: list[str]) -> str:
    near = get_close_matches(str(name).lower(), options, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _locate_value(value: object, location: tuple, default: object) -> tuple[tuple, object]:
    """Return the keys of a location without list positions, and the value as the user wrote it."""
    path = []
    for key in location:
        if isinstance(value, dict):
            path.append(key)
            value = value.get(key, default)
        else:
            value = value[key] if isinstance(value, list) else default
    return tuple(path), value


def _find_node(path: Iterable) -> dict:
    node = schema()
    for key in path:
        node = child(node, key)
    return node


def _join_keys(path: Iterable) -> str:
    keys = map(str, path)
    return ".".join(key if key and key.isprintable() else repr(key) for key in keys)

"""Reading of the mapping in a YAML file, or one clear line that says why there is none."""

from pathlib import Path

import yaml
from yaml.nodes import MappingNode, Node

from galloping.fields import show

MAX_NESTING_LEVELS = 20
MAX_VALUES = 100_000  # values in a file
NESTING_MESSAGE = (
    f"lists or sections are nested without end; must be at most {MAX_NESTING_LEVELS} levels deep"
)


class ConfigurationError(ValueError):
    """Error raised for invalid settings, with one line of text per problem."""


def read(path: str | Path) -> dict:
    """Read a mapping in a YAML file as a dict.

    Raises ConfigurationError, with one line that names the file, and its line if known, if the file
    is unreadable, empty, not YAML, not a mapping, nested too deeply or too large, or has a
    duplicate key.
    """
    try:
        content = yaml.load(Path(path).read_text(encoding="utf-8"), Loader=_Loader)
        if content is None:
            raise ConfigurationError("is empty; must be a mapping of keys")
        refuse_endless(content)
        if not isinstance(content, dict):
            raise ConfigurationError(f"{show(content)} is not a mapping of keys")
        return content
    except ConfigurationError as error:
        fault = f": {error}"
    except OSError as error:
        fault = f": {error.strerror}"
    except UnicodeDecodeError:
        fault = ": is not UTF-8 text"
    except yaml.MarkedYAMLError as error:
        fault = f":{error.problem_mark.line + 1}: {error.problem}"
    except (yaml.YAMLError, ValueError) as error:
        fault = f": {' '.join(str(error).split())}"
    except RecursionError:
        fault = f": {NESTING_MESSAGE}"
    raise ConfigurationError(f"{path}{fault}")


def refuse_endless(content: object) -> None:
    """Raise ConfigurationError if lists and dicts are nested without end or hold too much.

    At most MAX_NESTING_LEVELS levels and MAX_VALUES values are allowed. With YAML's anchors
    a short file can contain itself, or a list of 10^9 items.
    """
    level, values, depth = [content], 0, 0
    while level:
        depth, values = depth + 1, values + len(level)
        if depth > MAX_NESTING_LEVELS or values > MAX_VALUES:
            raise ConfigurationError(NESTING_MESSAGE)
        inner: list[object] = []
        for value in level:
            if isinstance(value, dict):
                inner += value.values()
            elif isinstance(value, list | tuple | set):
                inner += value
        level = inner


class _Loader(yaml.SafeLoader):
    """YAML loader that refuses duplicate keys, of which PyYAML keeps the last one."""

    def construct_object(self, node: Node, deep: bool = False) -> object:
        try:
            return super().construct_object(node, deep)
        except (ValueError, LookupError, AttributeError, TypeError):
            # raised by PyYAML for a value that does not fit its tag
            kind = node.tag.rpartition(":")[2]
            raise yaml.MarkedYAMLError(
                problem=f"{show(node.value)} is no {kind}", problem_mark=node.start_mark
            ) from None

    def compose_mapping_node(self, anchor: str | None) -> MappingNode:
        node = super().compose_mapping_node(anchor)
        first: dict[str, int] = {}
        for key, _ in node.value:
            if key.id == "scalar" and key.value in first:
                raise yaml.MarkedYAMLError(
                    problem=f"key {show(key.value)} is given twice, "
                    f"first in line {first[key.value]}",
                    problem_mark=key.start_mark,
                )
            if key.id == "scalar":
                first[key.value] = key.start_mark.line + 1
        return node

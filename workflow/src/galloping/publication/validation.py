"""Whether the description of a publication is what the Workflow Run Crate profile asks for."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from galloping.publication.archive import is_plain
from galloping.publication.crate import METADATA, RO_CRATE

PROFILE = "workflow-run-crate-0.5"
CONTEXT = f"https://w3id.org/ro/crate/{RO_CRATE}/context"
# What the context of 1.1 says otherwise than that of 1.3, which the rocrate library comes with.
TERMS_OF_1_1 = {
    "ComputationalWorkflow": "https://bioschemas.org/ComputationalWorkflow",
    "FormalParameter": "https://bioschemas.org/FormalParameter",
    "input": "https://bioschemas.org/ComputationalWorkflow#input",
    "output": "https://bioschemas.org/ComputationalWorkflow#output",
}
NEEDED = {"Dataset": "root folder", "ComputationalWorkflow": "workflow", "CreateAction": "run"}


def structure(folder: Path) -> Iterator[str]:
    """One line for what the metadata lacks or names in vain; without a validator."""
    try:
        metadata = json.loads((folder / METADATA).read_text(encoding="utf-8"))
        kinds = {str(one["@id"]): _list(one["@type"]) for one in metadata["@graph"]}
        context = metadata["@context"]
    except OSError:
        yield f"{METADATA}: missing"
        return
    except (ValueError, KeyError, TypeError, RecursionError):
        yield f"{METADATA}: not an RO-Crate"
        return
    if context != CONTEXT:
        yield f"{METADATA}: another context than {CONTEXT}"
    for name in (METADATA, "./"):
        if name not in kinds:
            yield f"{METADATA}: does not describe {name}"
    for kind, meaning in NEEDED.items():
        if not any(kind in found for found in kinds.values()):
            yield f"{METADATA}: no {meaning} ({kind})"
    for name, found in kinds.items():
        path = name.removesuffix("/")
        if name == "./" or not {"File", "Dataset"} & set(found):
            continue
        if not is_plain(path):
            yield f"{METADATA}: {name!r} is not a plain path"
        elif not (folder / path).exists():
            yield f"{name}: described in {METADATA} and missing"


def conformance(folder: Path) -> tuple[int, list[str]]:
    """How many required checks of the profile were made, and one line for each that failed.

    Needs no network. Raises ImportError without the package roc-validator.
    """
    from rocrate_validator.models import Severity, ValidationSettings
    from rocrate_validator.services import validate

    with tempfile.TemporaryDirectory() as temporary:
        cache = Path(temporary, "cache")
        _remember_context(cache)
        settings = ValidationSettings(
            rocrate_uri=str(folder),
            profile_identifier=PROFILE,
            requirement_severity=Severity.REQUIRED,
            cache_path=cache,
            offline=True,
        )
        result = validate(settings)
        failed = [
            f"{METADATA}: {issue.message} ({issue.violatingEntity or issue.check.identifier})"
            for issue in result.get_issues()
        ]
        return len(result.executed_checks), sorted(" ".join(line.split()) for line in failed)


def _remember_context(cache: Path) -> None:
    """Put the context into a cache of answers, as if it had been fetched."""
    from requests import Request
    from requests_cache import CachedRequest, CachedResponse, CachedSession
    from rocrate.vocabs import RO_CRATE as vocabulary

    context = {"@context": vocabulary["@context"] | TERMS_OF_1_1}
    with CachedSession(str(cache), backend="sqlite", expire_after=-1) as session:
        request = session.prepare_request(Request("GET", CONTEXT))
        answer = CachedResponse(
            request=CachedRequest.from_request(request),
            status_code=200,
            url=CONTEXT,
            content=json.dumps(context).encode(),
            headers={"Content-Type": "application/ld+json"},
        )
        session.cache.save_response(answer)


def _list(value: object) -> list:
    return value if isinstance(value, list) else [value]

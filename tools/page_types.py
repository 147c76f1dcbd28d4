"""Types of the page, made from those of the server.

python tools/page_types.py --write      write app/src/lib/types.ts
python tools/page_types.py              fail where it is not what the server says
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from pathlib import Path
from typing import Any

from pydantic.json_schema import models_json_schema

import flightid.app
from flightid.app.schemas import Message

TARGET = Path(__file__).resolve().parent.parent / "app" / "src" / "lib" / "types.ts"
HEAD = "// Made by tools/page_types.py from src/flightid/app/*schemas.py; not to be edited.\n"
PLAIN = {
    "string": "string",
    "number": "number",
    "integer": "number",
    "boolean": "boolean",
    "null": "null",
}


def page_types() -> str:
    """The whole file."""
    names = [each.name for each in pkgutil.iter_modules(flightid.app.__path__)]
    subjects = [
        importlib.import_module(f"flightid.app.{name}")
        for name in names
        if name.endswith("schemas")
    ]
    models = {
        each: None
        for subject in subjects
        for each in vars(subject).values()
        if isinstance(each, type) and issubclass(each, Message) and each is not Message
    }
    _, made = models_json_schema([(each, "serialization") for each in models])
    parts = [_interface(name, schema) for name, schema in sorted(made["$defs"].items())]
    return "\n".join([HEAD, *parts])


def _interface(name: str, schema: dict[str, Any]) -> str:
    said = schema.get("description", "")
    fields = [f"  {key}: {_type(each)};" for key, each in schema.get("properties", {}).items()]
    return "\n".join([f"/** {said} */", f"export interface {name} {{", *fields, "}", ""])


def _type(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "enum" in schema:
        return " | ".join(f'"{each}"' for each in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(_type(each) for each in schema["anyOf"])
    made = {"array": _array, "object": _record}.get(str(schema.get("type")))
    return PLAIN.get(str(schema.get("type")), "unknown") if made is None else made(schema)


def _array(schema: dict[str, Any]) -> str:
    if "prefixItems" in schema:
        return f"[{', '.join(_type(each) for each in schema['prefixItems'])}]"
    inner = _type(schema.get("items", {}))
    return f"({inner})[]" if "|" in inner else f"{inner}[]"


def _record(schema: dict[str, Any]) -> str:
    values = schema.get("additionalProperties")
    return f"Record<string, {_type(values) if isinstance(values, dict) else 'unknown'}>"


if __name__ == "__main__":
    text = page_types()
    if "--write" in sys.argv[1:]:
        TARGET.write_text(text, encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != text:
        sys.exit(f"{TARGET.name} is not what the server says: tools/page_types.py --write")

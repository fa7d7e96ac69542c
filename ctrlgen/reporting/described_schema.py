"""JSON Schemas of the files that users write, with the docstring below each key as its description.

pydantic reads such docstrings when a class is made (`use_attribute_docstrings`): half a second of every command's start, for pages alone.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema


class DescribedSchema(GenerateJsonSchema):
    """Generator of schemas for `model_json_schema(schema_generator=DescribedSchema)`."""

    def model_schema(self, schema: Any) -> dict[str, Any]:
        """The schema of a table, its keys described."""
        made = super().model_schema(schema)
        model = schema["cls"]
        for name, field in model.model_fields.items():
            entry = made.get("properties", {}).get(field.alias or name)
            if entry is not None and (text := _described(model, name)):
                entry.setdefault("description", text)
        return made


def _described(model: type[BaseModel], name: str) -> str:
    """The docstring below the declaration of `name`, in `model` or the base that declares it."""
    declaring = [cls for cls in model.__mro__ if name in vars(cls).get("__annotations__", {})]
    return _docstrings(declaring[0]).get(name, "") if declaring else ""


@cache
def _docstrings(cls: type) -> dict[str, str]:
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(body, ast.ClassDef)
    return {
        line.target.id: inspect.cleandoc(below.value.value)
        for line, below in pairwise(body.body)
        if isinstance(line, ast.AnnAssign)
        and isinstance(line.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }

"""Fingerprint of what the results of robustness trials depend on."""

from __future__ import annotations

import ast
import hashlib
from functools import cache
from pathlib import Path

from template_control.robot.biped import Biped

_PACKAGE = Path(__file__).resolve().parents[1]
_LETTERS = 10
WITHOUT = ("cli", "paper", "sweep", "view")  # rooms that no trial's result depends on


def fingerprint(model: Biped, *trials: object) -> str:
    """Ten letters of a digest of the code that a trial runs, the robot's URDF and the trials.

    Comments, docstrings and the rooms ``WITHOUT`` do not count; trials go by their ``repr``.
    """
    digest = hashlib.sha256(model.urdf.encode())
    digest.update(_code(_PACKAGE).encode())
    digest.update(repr(trials).encode())
    return digest.hexdigest()[:_LETTERS]


@cache
def _code(package: Path) -> str:
    """Digest of a package's code and data, but for the rooms ``WITHOUT``."""
    digest = hashlib.sha256()
    for path in sorted((*package.rglob("*.py"), *package.rglob("*.json"))):
        place = path.relative_to(package)
        if place.parts[0] in WITHOUT:
            continue
        digest.update(str(place).encode())
        content = path.read_bytes()
        if path.suffix == ".py":
            tree = _WithoutTexts().visit(ast.parse(content))
            digest.update(ast.dump(tree).encode())
        else:
            digest.update(content)
    return digest.hexdigest()


class _WithoutTexts(ast.NodeTransformer):
    """Takes statements that are texts, such as docstrings, out of a tree."""

    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        is_text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_text else node

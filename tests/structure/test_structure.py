"""The library's structure: who imports whom, how large things are, and what is written down.

``python tests/structure/test_structure.py`` lists the public functions and classes that do not
tell their arguments.
"""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from template_control.slip.automaton.automaton import AUTOMATON, STRIDE_START

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "template_control"
# A room imports from itself and from rooms of earlier stages; those of one stage are independent.
STAGES = (
    ("slip",),
    ("robot",),
    ("whole_body", "estimation"),
    ("embedding",),
    ("plant",),
    ("run",),
    ("sweep",),
    ("robustness",),
    ("view",),
    ("paper",),
    ("cli",),
)
SLIP_STAGES = (
    ("parameters", "automaton"),
    ("dynamics", "similarity"),
    ("maps",),
    ("control",),
    ("gaits",),
    ("lateral", "scenario", "planning", "path"),
)
SHARED = (
    "arrays",
    "checks",
    "cholesky",
    "compiled",
    "deprecated",
    "errors",
    "settings",
    "storage",
    "structured",
    "terminal",
    "version",
    "warm_up",
)  # of the root, what every room may import
MOST_ROOMS = 12
MOST_FILES = 25  # of a folder, its __init__.py included
MOST_LINES = 500  # of a file
MOST_PARAMETERS = 7  # keyword-only ones are free
MOST_POSITIONAL = 7  # arguments of a call; a starred one counts as one
GAIT_NAMES = {*STRIDE_START, *(node.name for node in AUTOMATON.nodes)}
SECTION = re.compile(r"^(?:Args|Attributes).*:\n((?:(?: .*)?\n)*)", re.MULTILINE)
ENTRY = re.compile(r"^    (\w+(?:, \w+)*): ", re.MULTILINE)
# "See :class:`Task`.", "As :meth:`step`, but ...": the name whose docstring tells the arguments.
ELSEWHERE = re.compile(
    r"(?:^(?:See|As)|Arguments as for|The rest as in) (?::\w+:)?`+~?([\w.]+)`", re.MULTILINE
)

Function = ast.FunctionDef | ast.AsyncFunctionDef


def assert_none(found):
    found = list(found)
    assert not found, f"{len(found)} faults:\n" + "\n".join(found)


# ---- who imports whom


def module_of(path, library=LIBRARY):
    """``("slip", "gaits", "gait")``; a package by its folder alone, the root as ``()``."""
    parts = path.relative_to(library).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def sources(library=LIBRARY, suffix=".py"):
    return {module_of(path, library): path for path in sorted(library.rglob(f"*{suffix}"))}


def imports(tree, module, is_package, known, name="template_control"):
    """Modules of the library that ``tree`` imports, with the line, wherever the import stands.

    Imports for type checkers and inside functions count too.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                top, *rest = alias.name.split(".")
                if top == name:
                    yield tuple(rest), node.lineno
        elif isinstance(node, ast.ImportFrom):
            parts = tuple(node.module.split(".")) if node.module else ()
            if node.level:
                package = module if is_package else module[:-1]
                parts = (name, *package[: len(package) - node.level + 1], *parts)
            if parts[:1] != (name,):
                continue
            for alias in node.names:
                inner = (*parts[1:], alias.name)
                yield (inner if inner in known else parts[1:]), node.lineno


@cache
def parsed(path):
    return ast.parse(path.read_text())


@cache
def graph(library=LIBRARY, name="template_control"):
    """By module, the (module, line)s it imports; a package's are those its stub exports."""
    stubs = sources(library, ".pyi")
    files = {**sources(library), **stubs}
    return {
        module: [
            found
            for found in imports(parsed(path), module, path.stem == "__init__", files, name)
            if found[0] != module
        ]
        for module, path in files.items()
    }


def dotted(module):
    return ".".join(("template_control", *module))


def against_the_stages(edges, stages, depth):
    """Imports between the parts at ``depth`` of a path that go sideways or back up."""
    stage = {part: i for i, parts in enumerate(stages) for part in parts}
    for module, targets in edges.items():
        for target, line in targets:
            one, other = module[depth : depth + 1], target[depth : depth + 1]
            if one == other:
                continue
            if not one or not other or stage[other[0]] >= stage[one[0]]:
                yield f"{dotted(module)}:{line} imports {dotted(target)}"


def circles(edges):
    """Groups of modules that import one another, by Tarjan's algorithm."""
    number, low, stack, found = {}, {}, [], []

    def visit(module):
        number[module] = low[module] = len(number)
        stack.append(module)
        for target, _ in edges.get(module, ()):
            if target not in number:
                visit(target)
            if target in stack:
                low[module] = min(low[module], low[target])
        if low[module] == number[module]:
            group = stack[stack.index(module) :]
            del stack[-len(group) :]
            if len(group) > 1:
                found.append(sorted(map(dotted, group)))

    for module in edges:
        if module not in number:
            visit(module)
    return found


def test_a_room_imports_only_from_rooms_before_it():
    edges = {
        module: [found for found in targets if found[0][:1] not in {(s,) for s in SHARED}]
        for module, targets in graph().items()
        if module  # the root's stub exports from every room
    }
    rooms = {module: targets for module, targets in edges.items() if module[0] not in SHARED}
    assert_none(against_the_stages(rooms, STAGES, 0))


def test_shared_modules_import_no_room():
    for module, targets in graph().items():
        if module[:1] in {(s,) for s in SHARED}:
            assert {target[0] for target, _ in targets} <= set(SHARED), module


def test_a_room_of_slip_imports_only_from_rooms_before_it():
    edges = {
        module: [found for found in targets if found[0][0] == "slip"]
        for module, targets in graph().items()
        if module[:1] == ("slip",) and len(module) > 1
    }
    assert_none(against_the_stages(edges, SLIP_STAGES, 1))


def test_of_a_robots_models_only_its_template_knows_slip():
    edges = {m: targets for m, targets in graph().items() if m[:1] == ("robot",) and len(m) > 1}
    assert {m for m, targets in edges.items() if any(t[0] == "slip" for t, _ in targets)} == {
        ("robot", "template")
    }


def test_no_modules_import_one_another():
    assert circles(graph()) == []


# ---- how many, how large


def folders():
    return sorted({path.parent for path in LIBRARY.rglob("*.py")})


def test_there_are_few_rooms_and_no_full_one():
    rooms = [f for f in folders() if f.parent == LIBRARY and f.name not in SHARED]
    assert {folder.name for folder in rooms} == {room for stage in STAGES for room in stage}
    assert len(rooms) <= MOST_ROOMS
    full = {f.name: n for f in folders() if (n := len(list(f.glob("*.py")))) > MOST_FILES}
    assert full == {}


def test_no_file_is_too_long():
    lengths = {p: len(p.read_text().splitlines()) for p in LIBRARY.rglob("*.py")}
    assert {str(path): n for path, n in lengths.items() if n > MOST_LINES} == {}


def functions(tree):
    """Every function, method and lambda of ``tree``, with whether it has self or cls."""
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, Function | ast.Lambda):
                decorators = getattr(child, "decorator_list", ())
                static = any(isinstance(d, ast.Name) and d.id == "staticmethod" for d in decorators)
                yield child, isinstance(node, ast.ClassDef) and not static


def parameters(function, bound):
    """Names of a function's parameters, of every kind, without self or cls."""
    a = function.args
    names = [x.arg for x in (*a.posonlyargs, *a.args)][int(bound) :]
    starred = [x.arg for x in (a.vararg, a.kwarg) if x is not None]
    return [*names, *(x.arg for x in a.kwonlyargs), *starred]


def many_parameters(tree):
    for function, bound in functions(tree):
        keywords = len(function.args.kwonlyargs)
        count = len(parameters(function, bound)) - keywords
        if count > MOST_PARAMETERS:
            yield f"{function.lineno}: {getattr(function, 'name', 'lambda')} has {count} parameters"


def many_positional(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and len(node.args) > MOST_POSITIONAL:
            name = ast.unparse(node.func)
            yield f"{node.lineno}: {name} is called with {len(node.args)} positional arguments"


# ---- other libraries

_OURS = ("template_control", "__future__")


def private_imports(tree):
    """Imports of private modules or names of other libraries."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            if not name.startswith(_OURS) and re.search(r"(^|\.)_[a-z]", name, re.IGNORECASE):
                yield f"{node.lineno}: imports {name}"


# ---- gaits are data


def _names_a_gait(node):
    """Whether an operand is a phase, a kind of stride, a node's name, or a group of these."""
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(map(_names_a_gait, node.elts))
    if isinstance(node, ast.Attribute):
        owner = node.value
        names = (getattr(owner, "id", None), getattr(owner, "attr", None))
        return "Phase" in names or "StrideKind" in names
    if isinstance(node, ast.Constant):
        return node.value in GAIT_NAMES
    return (
        isinstance(node, ast.Subscript)
        and isinstance(node.value, ast.Name)
        and node.value.id == "STRIDE_START"
    )


def gait_branches(tree):
    """Comparisons with a phase, a gait or a node, and tests of how a name begins or ends.

    Those of a module-level assignment are none: that is a table.
    """
    tables = (ast.Assign, ast.AnnAssign)
    for node in (n for s in tree.body if not isinstance(s, tables) for n in ast.walk(s)):
        if isinstance(node, ast.Compare):
            found = any(map(_names_a_gait, (node.left, *node.comparators)))
        elif isinstance(node, ast.MatchValue):
            found = _names_a_gait(node.value)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            ends = {"startswith": str.startswith, "endswith": str.endswith}.get(node.func.attr)
            words = [c.value for a in node.args for c in ast.walk(a) if isinstance(c, ast.Constant)]
            found = ends is not None and any(
                ends(name, word) for name in GAIT_NAMES for word in words if isinstance(word, str)
            )
        else:
            continue
        if found:
            yield f"{node.lineno}: {ast.unparse(getattr(node, 'value', node))}"


# ---- what is written down


def public(body):
    """Public classes, functions and methods of ``body`` with whether they have self or cls."""
    for node in body:
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            yield node, False
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for method, bound in functions(ast.Module([node], [])):
                if method in node.body and not method.name.startswith("_"):
                    yield method, bound


def undocumented(tree):
    for node, _ in public(tree.body):
        if not ast.get_docstring(node):
            yield f"{node.lineno}: {node.name} has no docstring"


@cache
def exported_names():
    """Names in the stubs of the packages."""
    return {
        alias.asname
        for path in sources(suffix=".pyi").values()
        for node in parsed(path).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def exported(tree):
    """Functions and classes of ``tree`` that a stub names, and the bases of these classes."""
    bases = {
        ast.unparse(base)
        for node in tree.body
        if isinstance(node, ast.ClassDef) and node.name in exported_names()
        for base in node.bases
    }
    names = exported_names() | bases
    return [node for node in tree.body if getattr(node, "name", None) in names]


def inner_checks(tree):
    """Functions that check their arguments and are called by the library alone."""
    for owner in set(tree.body).difference(exported(tree)):
        for node in ast.walk(owner):
            if isinstance(node, Function) and "checked" in map(ast.unparse, node.decorator_list):
                yield f"{node.lineno}: {node.name} is not exported: let its callers check"


@cache
def documented_names():
    """Names of the library's classes, functions and methods that have a docstring."""
    return {
        node.name
        for path in sources().values()
        for node in ast.walk(parsed(path))
        if isinstance(node, Function | ast.ClassDef) and ast.get_docstring(node)
    }


def constructor(node):
    """What a class is made from: parameters of its ``__init__``, or fields."""
    for child in node.body:
        if isinstance(child, Function) and child.name == "__init__":
            return parameters(child, True)
    fields = [x for x in node.body if isinstance(x, ast.AnnAssign)]
    names = [x.target.id for x in fields if not ast.unparse(x.annotation).startswith("ClassVar")]
    return [name for name in names if not name.startswith("_")]


def without_arguments(tree):
    """Exported functions and classes with two or more parameters that tell not all of them."""
    for node, bound in public(exported(tree)):
        names = parameters(node, bound) if isinstance(node, Function) else constructor(node)
        text = (ast.get_docstring(node) or "") + "\n"
        entries = ENTRY.findall("".join(SECTION.findall(text)))
        told = {name for entry in entries for name in entry.split(", ")}
        elsewhere = ELSEWHERE.search(text)
        if elsewhere and elsewhere[1].split(".")[-1] in documented_names():
            continue
        if len(names) > 1 and (untold := [name for name in names if name not in told]):
            yield f"{node.lineno}: {node.name} does not tell {', '.join(untold)}"


# ---- the rules, over the sources and over a fault of each kind


def faults(rule, folder):
    return [
        f"{path.relative_to(ROOT)}:{fault}"
        for path in sorted(folder.rglob("*.py"))
        for fault in rule(parsed(path))
    ]


@pytest.mark.parametrize(
    "folder", [LIBRARY, ROOT / "benchmarks", ROOT / "examples"], ids=lambda f: f.name
)
@pytest.mark.parametrize(
    "rule",
    [many_parameters, many_positional, private_imports, inner_checks],
    ids=lambda r: r.__name__,
)
def test_every_file_keeps_the_rule(rule, folder):
    assert_none(faults(rule, folder))


def test_the_controller_compares_with_no_gait():
    assert_none(faults(gait_branches, LIBRARY / "embedding"))


@pytest.mark.parametrize("rule", [undocumented, without_arguments], ids=lambda r: r.__name__)
def test_everything_public_is_documented(rule):
    assert_none(faults(rule, LIBRARY))


@pytest.mark.parametrize(
    ("rule", "text", "count"),
    [
        (private_imports, "import numpy._core\nfrom numba import _dynfunc", 2),
        (private_imports, "from numba.core.caching import _CacheLocator", 1),
        (
            private_imports,
            "from __future__ import annotations\nimport a.b_c",
            0,
        ),
        (many_parameters, "def f(a, b, c, d, e, f, g): ...", 0),
        (many_parameters, "def f(a, b, c, d, e, f, /, g, *, h): ...", 0),
        (many_parameters, "def f(a, b, c, d, e, f, /, g, h, *, i): ...", 1),
        (many_parameters, "def f(a, b, c, d, e, f, *g, **h): ...", 1),
        (many_parameters, "class A:\n def f(self, a, b, c, d, e, f, g): ...", 0),
        (many_parameters, "class A:\n @staticmethod\n def f(a, b, c, d, e, f, g, h): ...", 1),
        (many_parameters, "f = lambda a, b, c, d, e, f, g, h: 0", 1),
        (many_positional, "f(1, 2, 3, 4, 5, 6, *x)", 0),
        (many_positional, "f(1, 2, 3, 4, 5, 6, 7, *x)", 1),
        (gait_branches, "WEIGHTS = {n: n.phase is Phase.SS for n in nodes}", 0),
        (gait_branches, "def f(n):\n return WEIGHTS[n]", 0),
        (gait_branches, "def f(n):\n return 1 if n.phase is Phase.SS else 2", 1),
        (gait_branches, "def f(n):\n return n.phase in (vocabulary.Phase.SS, 3)", 1),
        (gait_branches, "def f(s):\n return s == StrideKind.WALK", 1),
        (gait_branches, "def f(n):\n return n == STRIDE_START['w'] or n == 'w'", 2),
        (gait_branches, "def f(n):\n match n:\n  case Phase.DS: pass\n  case 'DS_sc^w': pass", 2),
        (gait_branches, "def f(n):\n return n.startswith('SS')", 1),
        (gait_branches, "def f(n):\n return n.startswith('left')", 0),
        (inner_checks, "@checked\ndef simulate(a): ...\n@checked\ndef f(a): ...", 1),
        (inner_checks, "class A:\n @checked\n def __init__(self): ...\nclass Record(A): ...", 0),
        (inner_checks, "class A:\n @checked\n def __init__(self): ...", 1),
        (undocumented, "def f(): ...\nclass A:\n def g(self): ...\n def _h(self): ...", 3),
        (undocumented, "class _A:\n def g(self): ...", 0),
        (without_arguments, "def simulate(a, b):\n '''Do.'''", 1),
        (without_arguments, "def simulate(a, b):\n '''Do.\n\n Args:\n     a: one.\n '''", 1),
        (without_arguments, "def simulate(a, b):\n '''Do.\n\n Args:\n     a, b: two.\n '''", 0),
        (
            without_arguments,
            "def simulate(a, *b):\n '''Do.\n\n Args:\n     a: 1.\n     b: 2.\n '''",
            0,
        ),
        (without_arguments, "def simulate(a, b):\n '''Do.\n\n Returns:\n     a, b: two.\n '''", 1),
        (without_arguments, "def simulate(a, b):\n '''See :meth:`.planner.Planner.decide`.'''", 0),
        (without_arguments, "def simulate(a, b):\n '''As ``decide``, but quicker.'''", 0),
        (without_arguments, "def simulate(a, b):\n '''Do as :meth:`decide` does.'''", 1),
        (without_arguments, "def simulate(a, b):\n '''See :func:`nowhere_to_be_found`.'''", 1),
        (without_arguments, "class Record:\n '''A.'''\n def f(self, b):\n  '''Do.'''", 0),
        (without_arguments, "class Record:\n '''A.'''\n def __init__(self, a, b): ...", 1),
        (without_arguments, "class Record:\n '''A.'''\n a: int\n b: int", 1),
        (without_arguments, "class Inner:\n '''A.'''\n a: int\n b: int", 0),
        (
            without_arguments,
            "class Record:\n '''A.\n\n Attributes:\n     a, b: two.\n '''\n a: int\n b: int",
            0,
        ),
    ],
)
def test_the_rules_find_what_they_forbid(rule, text, count):
    assert len(list(rule(ast.parse(text)))) == count


def test_arrows_and_circles_are_found(tmp_path):
    for name, text in {
        "low/__init__.py": "",
        "low/a.py": "def f():\n    from lib.high import b",
        "high/__init__.pyi": "from .b import B as B",
        "high/__init__.py": "",
        "high/b.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import lib.low.a",
        "high/c.py": "from lib.low import a\nfrom lib.high.b import B\nfrom . import b",
    }.items():
        path = tmp_path / "lib" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    edges = graph(tmp_path / "lib", "lib")
    assert edges["high", "c"] == [(("low", "a"), 1), (("high", "b"), 2), (("high", "b"), 3)]
    assert circles(edges) == [["template_control.high.b", "template_control.low.a"]]
    (arrow,) = against_the_stages(edges, (("low",), ("high",)), 0)
    assert arrow == "template_control.low.a:2 imports template_control.high.b"
    assert len(list(against_the_stages(edges, (("low", "high"),), 0))) == 3


if __name__ == "__main__":
    print(*faults(without_arguments, LIBRARY), sep="\n")

"""The solvers of strides: who chooses controls by what the template's strides come to."""

import re
from pathlib import Path

LIBRARY = Path(__file__).resolve().parents[2] / "template_control"
SOLVER = "slip/control/least_squares.py"
PROBLEMS = {
    "slip/control/stride_solver.py": "the free controls of one stride",
    "slip/planning/look_ahead.py": "controls and states of several walking steps",
}
# Of those that evaluate strides in compiled code, with the reason why they are no solver's problem.
OTHERS = {
    "slip/maps/return_map.py": "the map itself",
    "slip/gaits/basin.py": "follows one law from many states, and chooses nothing",
    "slip/control/modified_walking.py": "the paper's controller, with the paper's search",
    "slip/planning/step_search.py": "more states come back than with a plan in its place",
}
GAITS = {"slip/gaits/gait.py": "a gait of a given energy: one root of a function of one number"}


def users(pattern):
    """Files of the package in which a pattern occurs."""
    sources = {p.relative_to(LIBRARY).as_posix(): p.read_text() for p in LIBRARY.rglob("*.py")}
    return {name for name, text in sources.items() if re.search(pattern, text)}


def test_strides_are_solved_for_by_one_method():
    assert users(r"def least_squares\(") == {SOLVER}
    assert users(r"\bleast_squares\((?!problem: Any)") == PROBLEMS.keys()
    assert users(r"\bbounded_step\(") == {SOLVER}
    assert users(r"scipy\.optimize|scipy import optimize") == GAITS.keys()


def test_no_other_compiled_code_tries_strides():
    solved = PROBLEMS.keys() - {"slip/control/stride_solver.py"}
    assert users(r"\b(one_stride|recorded_stride|section_jacobian)\(") == solved | OTHERS.keys()

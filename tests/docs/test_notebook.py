"""The notebook of the paper runs from top to bottom."""

import json

import pytest
from matplotlib.figure import Figure
from places import EXAMPLES

CELLS = json.loads((EXAMPLES / "paper.ipynb").read_text(encoding="utf-8"))["cells"]
CODE = ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == "code"]


def test_it_has_ten_cells_without_outputs():
    assert len(CODE) == 10
    assert not any(cell.get("outputs") for cell in CELLS)


@pytest.mark.slow(seconds=8)
def test_the_paper_in_ten_cells(capsys):
    names = {}
    for source in CODE:
        exec(compile(source, "a cell", "exec"), names)
    text = capsys.readouterr().out
    assert "Table III: errors" in text
    assert "fell" not in text
    assert not names["record"].fell
    assert not names["pushed"].fell
    assert isinstance(names["example"].figures["fig10"], Figure)

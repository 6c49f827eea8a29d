"""The pages of docs/: their index, links, names of files, and programs."""

import re

import pytest
from places import DOCS, EXAMPLES, ROOT

PAGES = sorted(DOCS.rglob("*.md"))
OTHERS = [
    ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "robots/README.md")
]
# Pages whose programs are run from top to bottom. Those of other guides run for minutes.
RUN = (
    "start",
    "guides/architecture",
    "guides/drive",
    "guides/engines",
    "guides/floating_base",
    "guides/learning",
    "guides/options",
    "guides/parameter_study",
    "guides/public_robots",
    "guides/questions",
    "guides/running",
    "guides/your_floating_robot",
    "guides/your_gait",
    "guides/your_planner",
    "guides/your_plant",
    "guides/your_robot",
)
each_page = pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(DOCS).as_posix())


def prose(text):
    """A page without its programs."""
    return re.sub(r"```.*?```", "", text, flags=re.DOTALL)


def anchor(heading):
    """Of a heading, as it is made for links."""
    plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")


def anchors(page):
    return {anchor(h) for h in re.findall(r"^#+ (.*)", prose(page.read_text()), re.MULTILINE)}


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", prose(page.read_text())):
        if link.startswith("http"):
            continue
        path, _, place = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), link
        if place:
            assert place in anchors(target), link


# Words that have to be read twice, and what the field says: reports, next to, assume, lateral,
# accepts, floating base.
AVOIDED = (
    *("told", "tells?", "beside", "reckon(?:s|ed)?", "whoever", "aside", "how sure", "has it"),
    *("comes? to a stand", "free robots?", "nothing holds", "nobody"),
)


@pytest.mark.parametrize(
    "page", [*PAGES, *OTHERS[:2]], ids=lambda p: p.relative_to(ROOT).as_posix()
)
def test_plain_words(page):
    """Names of code, in backquotes, may be what they are."""
    text = re.sub(r"`[^`]*`", "", prose(page.read_text()))
    found = re.findall(rf"\b(?:{'|'.join(AVOIDED)})\b.*", text, re.IGNORECASE)
    assert not found


@each_page
def test_named_sources_are_there(page):
    """``room/file.py``, and with ``: `name``` a function or class of it."""
    names = re.findall(r"`((?:[a-z_]+/)+[a-z_]+\.py)`(?::\s+`([\w.]+)`)?", page.read_text())
    for name, function in names:
        source = ROOT / "template_control" / name
        if not source.is_file():
            source = ROOT / name
        assert source.is_file(), name
        for part in function.split(".") if function else ():
            assert re.search(rf"\b(def|class) {part}\b|^{part}\b", source.read_text(), re.M), part


def test_the_index_names_every_page():
    """In its tables for readers, and in its trees for the site."""
    text = (DOCS / "index.md").read_text()
    pages = {p.relative_to(DOCS).as_posix() for p in PAGES} - {"index.md"}
    assert set(re.findall(r"\]\(([\w/]+\.md)\)", text)) == pages
    trees = "\n".join(re.findall(r"```\{toctree\}(.*?)```", text, flags=re.DOTALL))
    assert sorted(re.findall(r"^([\w/]+)$", trees, re.MULTILINE)) == sorted(p[:-3] for p in pages)


def test_every_picture_is_shown():
    shown = {
        (page.parent / picture).resolve()
        for page in (*PAGES, *OTHERS)
        for picture in re.findall(r"!\[.*?\]\((.*?)\)", page.read_text())
    }
    assert set((DOCS / "images").iterdir()) == shown


@pytest.mark.slow(seconds=14)
@pytest.mark.parametrize("page", RUN)
def test_a_page_runs_as_printed_from_top_to_bottom(page, tmp_path, run_block):
    (tmp_path / "examples").symlink_to(EXAMPLES)
    text = (DOCS / f"{page}.md").read_text()
    found = re.findall(r"```(python|sh)\n(.*?)```", text, flags=re.DOTALL)
    assert found
    for language, block in found:
        assert "fell: True" not in run_block(language, block)

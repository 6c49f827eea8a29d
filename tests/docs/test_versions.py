"""The site has a folder for each release, and every page leads to the others."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
AUTHOR = ("-c", "user.name=a", "-c", "user.email=a@b")


@pytest.mark.slow(seconds=4)
def test_every_release_has_its_site(tmp_path):
    pytest.importorskip("furo")
    clone, site = tmp_path / "clone", tmp_path / "site"
    (clone / "docs" / "guides").mkdir(parents=True)
    for name in ("conf.py", "versions.py", "_templates"):
        copy = shutil.copytree if (DOCS / name).is_dir() else shutil.copy
        copy(DOCS / name, clone / "docs" / name)

    def release(text, *tag):
        (clone / "docs" / "index.md").write_text("# Site\n\n```{toctree}\nguides/walk\n```\n")
        (clone / "docs" / "guides" / "walk.md").write_text(f"# Walk\n\n{text}\n")
        for words in (("init", "-q"), ("add", "."), ("commit", "-qm", text), *tag):
            subprocess.run(["git", *AUTHOR, *words], cwd=clone, check=True)

    release("The old way.", ("tag", "v0.1.0"))
    release("The new way.")
    subprocess.run([sys.executable, "docs/versions.py", str(site)], cwd=clone, check=True)
    assert "url=v0.1.0/index.html" in (site / "index.html").read_text()
    for version, text in (("latest", "The new way."), ("v0.1.0", "The old way.")):
        page = site / version / "guides" / "walk.html"
        assert text in page.read_text()
        found = re.findall(r'href="([^"]*)">\s*(latest|v0\.1\.0)</a>', page.read_text())
        assert [name for _, name in found] == ["latest", "v0.1.0"]
        for link, name in found:
            assert (page.parent / link).resolve() == site / name / "index.html"

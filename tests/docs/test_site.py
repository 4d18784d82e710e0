"""The documentation builds without a warning, reads without a network, and its Python runs.

To build it runs the notebooks, and fails where one of them does.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")])
PYTHON = re.compile(r"```python\n(.*?)```", re.DOTALL)
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


def build(source, target):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, source, target], capture_output=True, text=True, check=False, cwd=ROOT
    )
    return done.returncode, done.stderr


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    target = tmp_path_factory.mktemp("site")
    code, errors = build(DOCS, target)
    assert code == 0, errors
    return target


def test_the_site_has_every_page_in_its_menu(site):
    menu = set(
        re.findall(
            r'toctree-l1[^"]*"><a class="[^"]*" href="([^"]+)"', (site / "index.html").read_text()
        )
    )
    sources = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")]
    pages = {str(page.relative_to(DOCS).with_suffix(".html")) for page in sources}
    assert menu == pages - {"index.html"}


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.stem)
def test_a_page_is_read_in_ten_minutes(page):
    assert len(page.read_text().split()) <= 1500


def test_the_readme_is_read_in_five_and_has_no_greek_before_its_picture():
    text = (ROOT / "README.md").read_text()
    assert len(text.split()) <= 950
    assert not re.search("[α-ωΑ-Ω]", text.partition("![")[0])


@pytest.mark.parametrize("notebook", sorted(DOCS.rglob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_has_pictures(site, notebook):
    page = (site / notebook.relative_to(DOCS).with_suffix(".html")).read_text()
    assert len(re.findall(r'<img [^>]*src="(?:data:image/png|\.\./_images/)', page)) >= 2


def test_the_site_loads_nothing_from_elsewhere(site):
    for page in site.rglob("*.html"):
        loaded = re.findall(
            r"<(?:script|img|link)\b[^>]*?\b(?:src|href)=\"([^\"]+)\"", page.read_text()
        )
        assert loaded
        assert not [a for a in loaded if "//" in a and not a.startswith("data:")]


def test_every_public_name_is_on_the_api_page(site):
    import pns_common

    page = (site / "reference" / "python.html").read_text()
    names = {name for name in pns_common.__all__ if not name.startswith("__")}
    assert {name for name in names if f'id="pns_common.{name}"' not in page} == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_links_to_files_that_exist(page):
    targets = LINK.findall(page.read_text())
    assert [target for target in targets if not (page.parent / target).exists()] == []


@pytest.mark.parametrize(
    "page", [page for page in PAGES if PYTHON.search(page.read_text())], ids=lambda page: page.stem
)
def test_a_pages_python_runs(page, tmp_path):
    """One snippet after the other, as a reader would type them."""
    code = "\n".join(PYTHON.findall(page.read_text()))
    script = tmp_path / "snippets.py"
    script.write_text(code)
    done = subprocess.run(
        [sys.executable, "-W", "error", script],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={"PYTHONPATH": str(ROOT), "PATH": "", "MPLBACKEND": "agg"},
    )
    assert done.returncode == 0, done.stderr

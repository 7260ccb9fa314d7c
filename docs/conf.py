"""The site: `make docs` builds it, and ends at the first warning."""

import re
import shutil
import sys
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import coartic  # noqa: E402  (of this checkout)

project = "coartic"
author = copyright = "The coartic developers"  # noqa: A001
version = release = coartic.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "site_directives"]
exclude_patterns = ["Thumbs.db", ".DS_Store"]
source_suffix = {".md": "myst-nb"}

html_theme = "furo"
html_title = f"coartic {release}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_show_sphinx = False

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "fieldlist"]

# Notebooks are text, and run whenever the site is built: what they show is what came out.
nb_execution_mode = "force"
nb_execution_timeout = 900  # a busy machine is slow
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
toc_object_entries = False
# Names in signatures are short, and two packages may have one: the link goes to the first.
suppress_warnings = ["ref.python"]

_OUTSIDE = re.compile(r"\[([^\]]+)\]\((\.\./[^)#\s]+)(#[^)\s]*)?\)")


def _in_repository(page: Path, text: str) -> str:
    """Links into the repository, which leave the site, as paths."""

    def path_of(link: re.Match[str]) -> str:
        target = (page.parent / link[2]).resolve()
        if target.is_relative_to(DOCS) or link.string[link.start() - 1 : link.start()] == "!":
            return link[0]
        return f"{link[1]} (`{target.relative_to(ROOT)}`)"

    return _OUTSIDE.sub(path_of, text)


def setup(app):
    """Pages are read by repository and site alike."""

    def read(app, name, source):
        source[0] = _in_repository(Path(app.env.doc2path(name)), source[0])

    def bars(app, what, name, thing, options, lines):
        # |x| is a size here, and no name of something to be put in its place.
        lines[:] = [
            re.sub(r"(?<![`\\\w])\|(?=\S)|(?<=\S)\|(?![`\w])", r"\|", line) for line in lines
        ]

    def example(app, error):
        # The player works as it is. The name report.html is that of the page on reports.
        shutil.copy(ROOT / "benchmarks/example/report.html", app.outdir / "example.html")

    app.connect("source-read", read)
    app.connect("build-finished", example)
    app.connect("autodoc-process-docstring", bars)

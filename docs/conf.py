"""Configure Sphinx for the site, which ``make docs`` builds. Warnings are errors."""

import os
import re
import sys
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import coartic  # noqa: E402  (of this checkout)

project = "coartic"
author = copyright = "The coartic developers"  # noqa: A001
version = release = coartic.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "site_directives",
]
source_suffix = {".md": "myst-nb"}
exclude_patterns = ["examples"]

html_theme = "furo"
html_title = f"coartic {release}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_show_sphinx = False

myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline", "colon_fence"]

# Pages that are folded under another page in the navigation.
FOLDED = {
    "findings": ("foreign",),
    "tasks": ("families",),
    "methods": ("beside",),
}

# Pages whose code is run whenever the site is built, so they show what came out.
NOTEBOOKS = {"howto/report", "tutorial"}
nb_execution_mode = "force"
nb_execution_timeout = 900  # a busy machine is slow
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "exclude-members": "model_config, model_post_init"}
autodoc_preserve_defaults = True
napoleon_google_docstring = False  # docstrings have NumPy's blocks
python_use_unqualified_type_names = True
toc_object_entries = False
# Names in signatures are short, and two packages may have one: the link goes to the first.
suppress_warnings = ["ref.python"]

# Pages that are written from files outside this folder whenever the site is built.
READMES = sorted(ROOT.glob("studies/*/README.md"))
WRITTEN = {
    ROOT / "CHANGELOG.md": DOCS / "changelog.md",
    ROOT / "studies" / "README.md": DOCS / "studies" / "index.md",
    **{readme: DOCS / "studies" / f"{readme.parent.name}.md" for readme in READMES},
}
_LINK = re.compile(r"(?<=\]\()([^)#\s:]+)")
_OUTSIDE = re.compile(r"(?<!!)\[([^\]]+)\]\((\.\./[^)#\s]+)(#[^)\s]*)?\)")
_BAR = re.compile(r"(?<![`\\\w])\|(?=\S)|(?<=\S)\|(?![`\w])")

_NOTEBOOK = (
    "---\nfile_format: mystnb\nkernelspec:\n  name: python3\n  display_name: Python 3\n---\n"
)
_FIRST_CELL = '''
import os
import subprocess
from IPython.core.magic import register_cell_magic

os.environ["COLUMNS"] = "80"

@register_cell_magic
def sh(line, cell):
    """Show what a command prints in one piece; IPython shows chunks that end within words."""
    done = subprocess.run(["sh", "-ec", cell], stdout=-1, stderr=subprocess.PIPE, text=True)
    print(done.stdout, end="")
    if done.returncode:
        raise RuntimeError(done.stderr)
'''


def pictures_named(section):
    """Return a section of a page whose pictures have its heading as their alternative text.

    ``section`` is Markdown with code cells. The text is returned with an option in each cell.
    """
    heading, cell = section.partition("\n")[0].strip("# "), "```{code-cell} ipython3\n"
    return section.replace(cell, f'{cell}:mystnb: {{image: {{alt: "{heading}"}}}}\n')


def write_pages():
    """Copy the files of :data:`WRITTEN` to their pages.

    Relative links are changed, because the pages are in other folders. The page of studies also
    gets an index (toctree) of the pages of all studies.
    """
    for source, page in WRITTEN.items():

        def moved(link, source=source, page=page):
            path = source.parent / link[1]
            return os.path.relpath(path, page.parent) if path.exists() else link[1]

        page.parent.mkdir(exist_ok=True)
        page.write_text(_LINK.sub(moved, source.read_text("utf-8")), "utf-8")
    names = "\n".join(readme.parent.name for readme in READMES)
    with WRITTEN[ROOT / "studies" / "README.md"].open("a", encoding="utf-8") as index:
        index.write(f"\n```{{toctree}}\n:hidden:\n\n{names}\n```\n")


write_pages()


def setup(app):
    """Connect the functions that change pages and docstrings while Sphinx builds the site.

    They make pages that are written for the repository work on the site, too.
    """

    def links(app, name, source):
        """Replace links to files outside of ``docs``.

        A link to a file that has a page (:data:`WRITTEN`) becomes a link to this page. Any other
        link becomes its text, followed by the path of the file.
        """
        folder = Path(app.env.doc2path(name)).parent

        def path_of(link):
            target = (folder / link[2]).resolve()
            if page := WRITTEN.get(target):
                return f"[{link[1]}]({os.path.relpath(page, folder)}{link[3] or ''})"
            if target.is_relative_to(DOCS):
                return link[0]
            return f"{link[1]} (`{target.relative_to(ROOT)}`)"

        source[0] = _OUTSIDE.sub(path_of, source[0])

    def fold(app, name, source):
        """Add a toctree of the pages folded under a page (:data:`FOLDED`)."""
        if name in FOLDED:
            source[0] += "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(FOLDED[name]) + "\n```\n"

    def code(app, name, source):
        """Turn blocks of code on a page of :data:`NOTEBOOKS` into code cells.

        A block is a file that is saved (its first line is a comment with the name), commands for a
        shell, or Python code.
        """
        if name not in NOTEBOOKS:
            return
        cell = "```{code-cell} ipython3\n"
        text = re.sub(
            r"```(?:toml|python)\n# (\S+\.(?:toml|py))\n", cell + r"%%writefile \1\n", source[0]
        )
        text = text.replace("```sh\n", cell + "%%sh\n").replace("```python\n", cell)
        text = "".join(map(pictures_named, re.split(r"(?m)^(?=###? )", text)))
        image = 'import IPython\nIPython.display.Image("\\1", width=360)'
        options = ':mystnb: {image: {alt: "\\2"}}\n:tags: [remove-input]'
        text = re.sub(r"<!-- picture (\S+): (.+) -->", f"{cell}{options}\n{image}\n```", text)
        source[0] = f"{_NOTEBOOK}{cell}:tags: [remove-cell]\n{_FIRST_CELL}```\n\n{text}"

    def bars(app, what, name, thing, options, lines):
        """Escape the bars of an absolute value |x| in a docstring.

        In reStructuredText they would mark a substitution.
        """
        lines[:] = [_BAR.sub(r"\|", line) for line in lines]

    def once(app, what, name, thing, skip, options):
        """Leave out the class Parameters as a member of a method's class."""
        return True if (what, name) == ("class", "Parameters") else None

    app.connect("autodoc-skip-member", once)
    app.connect("source-read", links)
    app.connect("source-read", fold)
    app.connect("source-read", code)
    app.connect("autodoc-process-docstring", bars)

"""Define the directive ``{made} NAME``, which puts text made from code into pages.

NAME is a function of this module that yields lines of Markdown, such as a table.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from inspect import getdoc
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import pandas as pd
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import inspect
from sphinx.util.docutils import SphinxDirective

from coartic.analysis import SIGNATURES
from coartic.analysis.methods import title_of
from coartic.benchmarks.registry import built_in
from coartic.method import MODULES, Information, built_in_methods
from coartic.play.page import part_of_page, play_page, player_figure, preset_of, up_or_down
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import Task, shipped_tasks

STORY = {
    "learn": "A trial goes for goal after goal. For each goal the learner chooses a hand and moves "
    "towards the stored target plus noise; where that misses, the corrective process goes on. "
    "After a trial that hit every goal, the postures reached become targets where no earlier trial "
    "with these hands had a higher reward.",
    "_choose": "Mostly the hand with the best value; at times another one.",
    "_explore": "Noise on the joints that the exploration condition names.",
    "correct": "The corrective process: follow the transposed Jacobian until the hand is there.",
    "execute": "How every method's solution is scored: movement after movement, minus the ticks.",
}
"""Maps functions of the slow reference learner to sentences on what they do, in the order of the
page."""
REPLICATION = Path(__file__).parents[1] / "studies" / "replication"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a Markdown table with these headings and rows of cells."""
    yield "| " + " | ".join(heads) + " |"
    yield "| " + " | ".join("---" for _ in heads) + " |"
    for row in rows:
        yield "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in row) + " |"
    yield ""


def bare(kind: Any) -> Any:
    """Return a type without the metadata of ``Annotated``, also within tuples, dicts and unions."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return bare(parts[0])
    if origin in (tuple, dict):
        return origin[tuple(map(bare, parts))]
    if origin in (Union, UnionType):
        return Union[tuple(map(bare, parts))]  # noqa: UP007
    return kind


def claims() -> Iterator[str]:
    """Yield the table of the paper's claims, whose ids are anchors."""
    judged = pd.read_csv(REPLICATION / "claims.csv", index_col=0).fillna("–")

    def goals(name: str, claim: dict[str, Any]) -> str:
        if name.endswith("-in-general"):
            return "random tasks"
        return "reconstructed †" if "fitted" in claim else "published"

    rows = (
        (
            f"[{c['text']}]{{#{name}}} <br>`{name}`",
            goals(name, c),
            f"{c['place']}: “{c['quote']}”",
            f"{c['test'][0].upper()}{c['test'][1:]}.",
            judged.replicates[name],
            judged.more_than_one_selection[name],
        )
        for name, c in tomllib.loads((REPLICATION / "claims.toml").read_text("utf-8")).items()
    )
    heads = "claim", "goals", "the paper says", "how it is judged", "replicates"
    yield from table((*heads, "more than one selection"), rows)


def margins() -> Iterator[str]:
    """Yield the table of the margins of claims, with their reasons and history."""
    entries = tomllib.loads((REPLICATION / "margins.toml").read_text("utf-8"))
    rows = ((f"`{name}`", f"{each['value']:g}", each["reason"]) for name, each in entries.items())
    yield from table(("margin", "value", "reason, and history if it was changed"), rows)


def tasks() -> Iterator[str]:
    """Yield the table of the paper's tasks with their best known rewards."""

    def row(task: Task) -> tuple[str, ...]:
        best = best_shipped(task)
        assert best is not None
        free = [axis for axis in "xy" if axis not in task.locked_base]
        goals = " ".join(f"({x:g}, {y:g})" for x, y in task.goals).replace("-", "−")
        proof = "proven" if best.proven else f"none above {best.bound} is possible"
        lacking = " and ".join(task.reconstructed) or "nothing"
        base = f"from ({task.q0[0]:g}, {task.q0[1]:g}) along {' and '.join(free)}"
        reward = f"{best.reward} ({proof})".replace("-", "−")
        return f"`{task.name}`", " and ".join(task.hands), base, goals, reward, lacking

    heads = "task", "hands", "base", "goals (length units)", "best known reward", "reconstructed"
    yield from table(heads, map(row, shipped_tasks().values()))


def methods(group: str) -> Iterator[str]:
    """Yield the table of the built-in methods of one group.

    ``group`` is ``trials`` (methods that use the reward of each trial), ``formula`` (methods that
    use the reward as a formula) or ``none`` (methods that do not use the reward). A row has the
    summary line of the method's class, and a letter for each kind of information that it uses.
    """
    letters = dict(zip(Information, "GFJATUKNRS", strict=True))

    def group_of(uses: Sequence[Information]) -> str:
        if Information.REWARD_BY_TRIAL in uses:
            return "trials"
        return "formula" if Information.REWARD_FORMULA in uses else "none"

    declared = {name: [*map(Information, info.information)] for name, info in built_in().items()}
    rows = (
        (
            title_of(name),
            f"`{name}`",
            (getdoc(built_in_methods()[name]) or "").partition("\n\n")[0],
            " ".join(sorted(map(letters.get, uses), key="GFJATUKNRS".find)),
        )
        for name, uses in declared.items()
        if group_of(uses) == group
    )
    yield from table(("name", "id", "what it does", "information"), rows)


def baselines() -> Iterator[str]:
    """Yield the directives for the reference of the modules of built-in methods.

    The module of the learner is left out.
    """
    yield "```{eval-rst}"
    for module in MODULES:
        if module.startswith("coartic.baselines."):
            yield f".. automodule:: {module}\n"
    yield "```"


def tuned() -> Iterator[str]:
    """Yield a list of the tasks on which the constants of built-in methods were chosen."""
    names: dict[str, list[str]] = {}
    for name, info in built_in().items():
        names.setdefault(info.tuned_on, []).append(title_of(name))
    yield from (f"- {', '.join(each)}: **{text}**" for text, each in names.items())
    yield ""


def signatures() -> Iterator[str]:
    """Yield a list of the signatures of coarticulation, with their units and definitions."""
    for each in SIGNATURES.values():
        yield f"- `{each.name}` ({each.heading.rpartition('(')[2]}: {each.definition}"
    yield ""


def slowly() -> Iterator[str]:
    """Yield the slow reference learner of the tests, function by function.

    For each function there are a heading, the sentences of :data:`STORY`, and the code.
    """
    text = (Path(__file__).parents[1] / "tests" / "support" / "reference.py").read_text("utf-8")
    parts = {part.name: part for part in ast.parse(text).body if isinstance(part, ast.FunctionDef)}
    for name in ("learn", "_choose", "_explore", "correct", "execute"):
        code = ast.get_source_segment(text, parts[name])
        assert code is not None
        yield f"## `{name}`\n\n{STORY[name]}\n\n```python\n{code}\n```\n"


def columns() -> Iterator[str]:
    """Yield the table of the columns of the database view ``runs``, with their meanings."""
    from coartic.runs.record import COLUMNS

    rows = ((f"`{name}`", meaning) for name, *_, meaning in COLUMNS)
    yield from table(("column", "meaning"), rows)


def play() -> Iterator[str]:
    """Yield the interactive figure as HTML, with styles and a link to its page."""
    yield "```{raw} html"
    yield f"<style>{part_of_page('play.css')}</style>"
    yield player_figure([up_or_down(), *map(preset_of, shipped_tasks().values())], page="play.html")
    yield '<p><a href="play.html">Open this on its own page</a>; with your own task:'
    yield " <code>coartic play TASK</code></p>"
    yield "```"


def first_screen() -> Iterator[str]:
    """Yield the beginning of README, up to the commands, with links for the site."""
    text = (Path(__file__).parents[1] / "README.md").read_text("utf-8")
    _, opening, first, *_ = re.split(r"(?m)^# .*\n|^(?=## )", text)
    text = re.sub(r"(?<=\]\()studies/(\w+)/README\.md", r"studies/\1.md", opening + first)
    text = re.sub(r"(?<=\]\()studies/(?=\w+/\w+\.svg)", "../studies/", text)
    yield re.sub(r"(?m)^## ", "### ", re.sub(r"(?<=\]\()docs/", "", text))


def finish(app: Sphinx, failure: Exception | None) -> None:
    """Finish the site after a build without failure.

    - Headings of the navigation get their level (``aria-level``), which Sphinx leaves out.
    - The page of the interactive figure, ``play.html``, is written beside the index.
    """
    if failure is None:
        for path in Path(app.outdir).rglob("*.html"):
            html = path.read_text("utf-8")
            path.write_text(
                html.replace('role="heading">', 'role="heading" aria-level="2">'), "utf-8"
            )
        home = '<main>\n<p class="soft"><a href="index.html">coartic: findings, how-to</a></p>'
        page = play_page().replace("<main>", home, 1)
        (Path(app.outdir) / "play.html").write_text(page, encoding="utf-8")


class Made(SphinxDirective):
    """Directive that is replaced by the Markdown that a function of this module yields."""

    required_arguments = 1
    optional_arguments = 3

    def run(self) -> list[nodes.Node]:
        """Call the function that the directive names, and return the nodes of its Markdown."""
        function, *arguments = self.arguments
        return self.parse_text_to_nodes("\n".join(globals()[function](*arguments)))


def plainly(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: str
) -> tuple[str, str] | None:
    """Return the signature that autodoc shows.

    A pydantic model gets no signature, because the signature would repeat its fields. Types in any
    other signature are shown without the metadata of ``Annotated``.
    """
    if what == "class" and "__pydantic_fields__" in vars(thing):
        annotations = thing.__annotations__
        fields = thing.__pydantic_fields__.items()
        annotations |= {name: bare(of.annotation) for name, of in fields if name in annotations}
        return "", ""
    if "Annotated[" not in (signature or ""):
        return None
    kinds, shown = get_type_hints(thing), inspect.signature(thing, bound_method=what == "method")
    of = [p.replace(annotation=kinds.get(p.name, p.annotation)) for p in shown.parameters.values()]
    shown = shown.replace(parameters=of)
    return inspect.stringify_signature(shown, show_return_annotation=False), returns


def define(app: Sphinx, page: nodes.document, name: str) -> None:
    """Give links to terms of the glossary their definitions, which browsers show."""
    terms = {
        key: section[1].astext().replace("\n", " ")
        for section in app.env.get_doctree("glossary").findall(nodes.section)
        for key in section["ids"]
        if isinstance(section[1], nodes.paragraph)
    }
    for link in page.findall(nodes.reference):
        place, _, term = link.get("refuri", "").partition("#")
        if place.endswith("glossary.html") and term in terms:
            link["reftitle"] = terms[term]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive, and the functions that change pages and the built site."""
    app.add_directive("made", Made)
    app.connect("autodoc-process-signature", plainly)
    app.connect("doctree-resolved", define)
    app.connect("build-finished", finish)
    return {"parallel_read_safe": True}

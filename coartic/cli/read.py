"""Commands that report, check and cite stored runs, draw, and play in the browser."""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli import completion
from coartic.cli.terminal import Display, complain, say, say_pairs, say_table
from coartic.errors import CoarticError
from coartic.internal.interruption import interruptible
from coartic.internal.limits import MAX_RUNS
from coartic.internal.text import one_line, pluralize

if TYPE_CHECKING:
    from coartic.analysis.study import Study
    from coartic.runs.record import Row


def report(
    folder: given.ResultsFolder,
    out: Annotated[
        Path | None,
        given.file_or_folder(
            "FOLDER", "Folder to write; by default FOLDER/report, or results/shipped/report."
        ),
    ] = None,
    for_paper: Annotated[
        bool, typer.Option("--for-paper", help="Also figures as SVG and PDF, and tables as LaTeX.")
    ] = False,
    width: Annotated[
        float | None,
        given.ranged_option(
            "--width", "Width of these figures in inches: 3.4 for one column.", 2.5, 20
        ),
    ] = None,
    against: Annotated[
        str | None,
        given.option(
            "METHOD",
            "Method to compare all others with, in table differences.",
            words=completion.methods,
        ),
    ] = None,
    own: Annotated[
        list[Path] | None,
        given.option(
            "FILE", "Python file with your own tables and figures; may be repeated.", "--with"
        ),
    ] = None,
    contrasts: Annotated[
        Path | None,
        given.option("FILE", "Questions about these results: a TOML file with [[contrasts]]."),
    ] = None,
    after: given.After = None,
) -> None:
    """Write the report of a results folder."""
    if width is not None and not for_paper:
        raise CoarticError("--width has no effect without --for-paper")
    from coartic.runs.shipped import SHIPPED_SUITES

    if out is None:  # shipped results have no folder; Git ignores `results` in a checkout
        home = Path("results" if str(folder) in SHIPPED_SUITES else "") / folder
        out = home / _report_name(after)
    from coartic.analysis import TABLES
    from coartic.analysis.report.build import write_report
    from coartic.analysis.report.own import own_section
    from coartic.analysis.study import after_trials, load, with_contrasts

    section = own_section(own or [])
    started = time.monotonic()
    with (
        Display() as display,
        interruptible(lambda: one_line(f"{out} may be incomplete; repeat the command.")),
    ):
        display.show(f"Reading {folder}")
        study = load(str(folder), against=against or "")
        study = study if contrasts is None else with_contrasts(study, contrasts)
        study = study if after is None else after_trials(study, after)
        differences = map(TABLES["differences"], study.worlds.values())
        if against and not any(map(len, differences)):
            raise CoarticError(
                f"--against {against} has no effect: there are no tasks on which this method and "
                "another one solved all runs"
            )
        files, failures = write_report(
            study, out, for_paper=for_paper, width=width, own=section, watch=display.show
        )
    counts = Counter(Path(name).suffix for name in files)
    figures = f" and {pluralize(counts['.svg'], 'figure')}" if for_paper else ""
    say(f"{out / 'report.html'}: made in {time.monotonic() - started:.0f} s, with "
        f"{pluralize(counts['.csv'], 'table')}{figures}.")  # fmt: skip
    for part, reason in failures.items():
        if section is not None and part == section.title:
            complain("Error", f"{part} could not be made: {reason}")
        else:
            complain("Error", f"{part} could not be made, because of a bug in coartic: {reason}")
    if failures:
        sys.exit(1)


def _report_name(after: int | None) -> str:
    """Return the name of the folder of a report, of whole runs or after a number of trials."""
    return "report" if after is None else f"report-after-{after}"


def say_ranking(study: Study, folder: Path) -> None:
    """Print the ranking of each world, the answers to contrasts, and the command for a report.

    Each ranking has the name of its world and the number of trials after which the study looks as a
    heading, unless it is of whole runs, all in the paper's world. Contrasts that need executions of
    solutions are left to the report. ``folder`` is the results folder of the study.
    """
    from coartic.analysis.report.sections import left_out
    from coartic.analysis.study import when_of
    from coartic.analysis.tables import answer_lines, needs_executions
    from coartic.analysis.words import capital
    from coartic.runs.plan import world_title

    has_headings = [*study.worlds] != [""]
    for world, of_world in study.worlds.items():
        heading = (world_title(world) if has_headings else "") + when_of(study)
        say(*([f"{capital(heading.removeprefix(', '))}:"] if heading else []))
        _say_ranking_of_world(of_world)
        say(*([""] if has_headings else []))
    quick = [record for record in study.asked if not needs_executions(record.contrast.quantity)]
    lines = answer_lines(replace(study, asked=quick).contrasts) if quick else []
    later = len(study.asked) - len(quick)
    lines += [f"{pluralize(later, 'sentence')} more: see the report"] if later else []
    say_pairs([("" if place else "Questions", line) for place, line in enumerate(lines)])
    say_pairs([("Left out" * (not place), line) for place, line in enumerate(left_out(study))])
    page = folder / _report_name(study.after) / "report.html"
    option = f" --after {study.after}" if study.after else ""
    say_pairs([("Report", f"`coartic report {quote(str(folder))}{option}` writes {page}")])


def _say_ranking_of_world(study: Study) -> None:
    """Print the ranking of the methods in one world, and notes on the ranking.

    The notes say

    - the main finding, if the study varies parameters or no method is ranked;
    - which methods are not ranked, and why;
    - how many neighbours are not separated;
    - to which rewards the gaps refer, and for which tasks this reward is known only from the
      folder, or not at all;
    - how many runs are needed for confidence intervals, if there are too few;
    - how many runs failed, and why;
    - warnings about methods (:attr:`.Study.marks`).

    ``study`` is a study of one world, a value of :attr:`.Study.worlds`.
    """
    from coartic.analysis.report.sections import SECTIONS, finding, limits
    from coartic.analysis.standings import neighbours, ranked_tasks, reference, standings
    from coartic.analysis.words import interval, listed, number
    from coartic.estimates import MIN_VALUES

    methods, notes = standings(study), limits(study)
    has_others = bool(methods.built_in.any())
    names = [
        row.title
        if row.built_in
        else ("> " if has_others else "")
        + (row.title if row.title.startswith(row.method_id) else f"{row.method_id}: {row.title}")
        for _, row in methods.iterrows()
    ]
    methods = methods.assign(name=names)
    ranked, unranked = methods[methods.why == ""], methods[methods.why != ""]
    columns: dict[str, Iterable[str]] = {
        "method": ranked.name,
        "place": ranked.place,
        "gap (%)": [interval(row, "gap", scale=100) for row in ranked.to_dict("records")],
        "share (%)": [interval(row, "share", 0, 100) for row in ranked.to_dict("records")],
        "runs": map(number, ranked.runs),
        "note": ranked.note,
    }
    empty = {name for name in ("place", "note") if not any(ranked[name])}
    shown = {name: [*texts] for name, texts in columns.items() if name not in empty}
    say_table([*shown], [*zip(*shown.values(), strict=True)])
    has_answer = not (len(ranked) and study.varied.empty)
    answer = finding(study, SECTIONS[0]) if has_answer else []
    pairs = [("" if place else "Answer", sentence) for place, sentence in enumerate(answer)]
    brief = unranked.title.where(unranked.built_in.astype(bool), unranked.index)
    pairs += [
        ("Not ranked", f"{why}: {'; '.join(brief[of_reason.index])}")
        for why, of_reason in unranked.groupby("why", sort=False)
    ]
    if sentence := neighbours(study):
        pairs.append(("Places", sentence))
    if len(ranked):
        known = f"gaps are to the {reference(study, ranked_tasks(study))}"
        known += " in this world" if study.world else ""
        pairs.append(("Reference", known))
    if notes["own"]:
        known = f"for {listed(notes['own'])} only the best reward of this folder is known"
        if searches := notes["searches"]:
            known += (
                f"; to search for the optimum, add `{searches[0]}` to the command's `--methods`"
            )
            known += f", or `--methods '*,{searches[0]}'` if it has none"
        pairs.append(("", known))
    if notes["unknown"]:
        pairs.append(("", f"for {listed(notes['unknown'])} no reward is known"))
    stochastic = study.methods.stochastic
    counts = [len(of) for (_, label), of in study.cells.items() if stochastic[label]]
    if notes["failed"] < notes["runs"] and min(counts, default=MIN_VALUES) < MIN_VALUES:
        enough = max(MIN_VALUES, *counts)  # fewer would leave out runs of this folder
        pairs.append(("Intervals", f"too few runs to test: make {enough} (--runs {enough})"))
    if notes["failed"]:
        reasons = "; ".join(notes["reasons"])
        pairs.append(
            ("Failed", f"{notes['failed']} of {pluralize(notes['runs'], 'run')}: {reasons}")
        )
    pairs += [("‡", sentence) for sentence in notes["late"]]
    say_pairs(pairs)


def verify(
    folder: given.ResultsFolder,
    again: Annotated[
        int, given.ranged_option("--again", "Also perform N runs again.", 0, MAX_RUNS)
    ] = 0,
    run: Annotated[
        list[str] | None,
        given.option(
            "ID",
            "Only perform this run again; ID is the beginning of its id.",
            "--run",
            words=completion.runs,
        ),
    ] = None,
    noise: Annotated[
        bool,
        typer.Option(
            "--noise", help="Execute all solutions with motor noise, not only one of each cell."
        ),
    ] = False,
    method_file: given.MethodFiles = None,
) -> None:
    """Check stored runs by executing their solutions again.

    Exits with code 1 if a result differs, or if the folder lacks runs. With --run, only the runs
    that it names are performed again, and nothing else is checked.
    """
    from coartic.analysis.verify import check_runs
    from coartic.benchmarks.reproduce import execute_with_noise_again
    from coartic.runs.shipped import open_results, unpacked
    from coartic.runs.store import explain_errors

    if again and run:
        raise CoarticError("--again has no effect with --run, which performs one run again")
    if noise and run:
        raise CoarticError("--noise has no effect with --run")
    if method_file and not (again or run):
        raise CoarticError("--method-file has no effect without --again or --run")
    is_right = True
    if not run:
        with Display() as display, open_results(folder), explain_errors(folder):
            display.show(f"Executing the solutions of {folder}")
            with unpacked(folder) as place:
                report = check_runs(place)
            executed, wrong = 0, report.wrong
            if not wrong:
                display.show(f"Executing solutions of {folder} with motor noise")
                executed, wrong = execute_with_noise_again(folder, every=noise)
        is_right = not (wrong or report.unfinished)
        say(
            f"{pluralize(report.runs, 'run')} checked, "
            f"{pluralize(report.movements, 'movement')} executed.",
            *(
                [f"{pluralize(executed, 'solution')} executed with motor noise."]
                if executed
                else []
            ),
            *(wrong or ["Nothing differs."]),
            *report.unfinished,
        )
    differing = _perform_again(folder, again, run, method_file) if again or run else 0
    if differing or not is_right:
        sys.exit(1)


def _perform_again(
    folder: Path, count: int, run_ids: list[str] | None, method_file: list[Path] | None
) -> int:
    """Perform stored runs again, print the differences, and return how many runs differ.

    Parameters
    ----------
    folder : Path
        Results folder.
    count : int
        Largest number of runs to select (:func:`.some_runs`). It is used only if ``run_ids`` is
        empty or None.
    run_ids : list of str or None
        Beginnings of the ids of the runs to perform again. These runs are also described.
    method_file : list of Path or None
        Files with methods of the user.
    """
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.reproduce import compare_again, find_run, some_runs
    from coartic.runs.shipped import open_results

    registered = registry(method_file or [])
    if run_ids:
        runs = [find_run(run_id, folder) for run_id in run_ids]
        methods = [run.cell.method.name for run in runs]
        if missing := [name for name in methods if name not in registered]:
            raise CoarticError(
                f"method {missing[0]!r} is unknown here: pass the file that defines it, "
                "--method-file FILE"
            )
    else:
        runs = some_runs(folder, count, registered)
        with open_results(folder) as store:
            methods = [job.cell.method.name for job in store.plan()]
    given.check_used(method_file, registered, methods)
    for run in runs if run_ids else ():
        _describe_run(run, registered[run.cell.method.name].code)
    differing = 0
    with Display() as display:
        display.show(f"Performing {pluralize(len(runs), 'run')} again")
        for number, (stored, differences) in enumerate(compare_again(runs, registered), 1):
            differing += bool(differences)
            for difference in differences:
                say(f"Run {stored['run_id']}, performed again: {difference}")
            display.show(f"Performed {number} of {pluralize(len(runs), 'run')} again")
    say(
        f"{pluralize(len(runs), 'run')} performed again: {differing or 'none'} with another result."
    )
    return differing


def _describe_run(run: Row, code: str) -> None:
    """Print what a run did: its method, task, parameters, seed and result.

    ``code`` is the present version of the method or, for a method from a file, the present hash of
    its code. If another version or other code made the run, this is printed, too.
    """
    from coartic.analysis.methods import title_of
    from coartic.analysis.words import number
    from coartic.internal.text import describe_parameters

    cell, result = run.cell, f"{run['status']}: {run['reason']}"
    if run["reward"] is not None:
        result = f"reward {number(run['reward'])}, hands {run['hands']}"
    elif run["mean_ticks"] is not None:
        result = f"mean ticks {number(run['mean_ticks'])}, hands {run['hands']}"
    world = [("World", cell.world)] if cell.world else []
    say_pairs(
        [
            (
                "Run",
                f"{run['run_id']}: {cell.task.label}, {title_of(cell.method)}, run {run['run']}",
            ),
            ("Seed", str(run["seed"])),
            ("Parameters", describe_parameters(cell.parameters)),
            *world,
            ("Result", result),
        ]
    )
    if code != cell.method.code:
        say(
            f"The run was made by version {cell.method.code} of the method; its version here is "
            f"{code}."
        )


def cite(
    folder: Annotated[
        Path | None,
        typer.Argument(
            parser=given.results_folder,
            metavar="FOLDER",
            help="Results folder, or the word 'shipped'; by default all built-in methods.",
        ),
    ] = None,
    analysis: Annotated[
        bool,
        typer.Option("--analysis", help="Also cite works on statistics, signatures and theories."),
    ] = False,
) -> None:
    """Print BibTeX entries of coartic, the paper and the methods."""
    from coartic.analysis.citations import bibliography
    from coartic.benchmarks.registry import built_in
    from coartic.runs.shipped import open_results

    if folder is None:
        text = bibliography(built_in(), analysis=analysis)
    else:
        with open_results(folder) as store:
            plan, made_with, imports = store.plan(), store.made_with(), store.imports()
            versions = store.versions()
        declared = {job.cell.method.name: job.cell.method for job in plan}
        worlds = [*dict.fromkeys(job.cell.world for job in plan)]
        text = bibliography(
            declared,
            analysis=analysis,
            environment=made_with,
            imports=imports,
            worlds=worlds,
            versions=versions,
        )
    say(*text.rstrip("\n").split("\n"))


_PICTURED = 12
"""Largest number of tasks in one picture."""


def draw(
    tasks: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TASK",
            help="Tasks, task files, or long/v1/i000..i003. With --run: a results folder.",
            autocompletion=completion.tasks,
        ),
    ] = None,
    run: Annotated[
        list[str] | None,
        given.option(
            "ID",
            "Run to film. Give it twice for two runs side by side.",
            "--run",
            words=completion.runs,
        ),
    ] = None,
    initial: Annotated[
        bool, typer.Option("--initial", help="Also film the corrective process, next to the run.")
    ] = False,
    width: Annotated[
        int | None,
        given.ranged_option("--width", "Width of the film in pixels; by default 800.", 200, 3840),
    ] = None,
    out: Annotated[
        Path | None,
        given.file_or_folder(
            "FILE", "Picture (.png, .svg, .pdf), film of runs (.gif, .mp4), or folder for tasks."
        ),
    ] = None,
    replace: given.Replace = False,
) -> None:
    """Draw tasks, or film runs.

    If --out is a folder, the files of the tasks are written there, too.
    """
    from coartic import builtin_tasks

    if run:
        if len(tasks := tasks or []) != 1:
            raise CoarticError("--run needs one results folder: `coartic draw FOLDER --run ID`")
        film, folder = out or Path("film.gif"), given.results_folder(tasks[0])
        if tasks[0] in builtin_tasks() and not folder.exists():
            raise CoarticError(f"--run needs a results folder; {folder} is a task")
        return _film(folder, run, film, initial, width or 800, replace)
    without = (["--initial"] if initial else []) + (["--width"] if width is not None else [])
    if without:
        has = "have" if without[1:] else "has"
        raise CoarticError(f"{' and '.join(without)} {has} no effect without --run")
    from coartic import load_task
    from coartic.benchmarks.suites import check_kind
    from coartic.internal.files import check_ending, check_output, publish, write_output
    from coartic.runs.plan import tasks_by_name
    from coartic.runs.shipped import SHIPPED_SUITES, open_results
    from coartic.tasks.families import named_by
    from coartic.tasks.task import task_text

    for name in tasks or ():
        if name in SHIPPED_SUITES or (name not in builtin_tasks() and Path(name).is_dir()):
            with open_results(given.results_folder(name)):  # explains what another folder lacks
                raise CoarticError(
                    f"{name} is a results folder, not a task. `coartic draw {quote(name)} --run "
                    f"ID` films a run, and `coartic list {quote(name)}` lists the ids."
                )
        check_kind(name, "task", "family")
    out = out or Path("tasks.svg")
    if replace and not out.suffix:
        raise CoarticError(
            "--replace has no effect on a folder, whose pictures are always replaced"
        )
    names = [name for text in tasks or builtin_tasks() for name in named_by(text)]
    chosen = [*tasks_by_name(map(load_task, names)).values()]
    from coartic.analysis.figures.drawings import picture_of_tasks
    from coartic.analysis.figures.plot import FORMATS, picture  # slow imports, after the checks

    if out.suffix:
        check_ending(out, FORMATS)
        check_output(out, replace=replace)
    drawing = picture_of_tasks(chosen[:_PICTURED])
    if out.suffix:
        write_output(out, picture(drawing, out.suffix.lower()), replace=replace)
    else:
        files = {f"{task.name}.toml": task_text(task).encode() for task in chosen}
        files |= {"tasks.svg": picture(drawing, ".svg")}
        publish(out, files, r"[^/]+\.toml|tasks\.svg")
    drawn = f"; the first {_PICTURED} are drawn" if len(chosen) > _PICTURED else ""
    return say(f"{out}: {pluralize(len(chosen), 'task')}{drawn}.")


def _film(
    folder: Path, run_ids: Sequence[str], out: Path, initial: bool, width: int, replace: bool
) -> None:
    """Write a film of one or two stored runs, side by side.

    Parameters
    ----------
    folder : Path
        Results folder.
    run_ids : sequence of str
        Beginnings of the ids of the runs.
    out : Path
        File to write.
    initial : bool
        True to show the corrective process alone beside a single run.
    width : int
        Width of the film in pixels. The width of an MP4 is even, and can be up to 2 pixels less.
    replace : bool
        True to replace an existing file.

    Raises
    ------
    CoarticError
        There are more than two movements to show, a run is unknown or has no solution, the
        corrective process does not complete the task, or the film cannot be written.
    """
    from coartic import corrective_trial, initial_hands, trajectory
    from coartic.analysis.methods import title_of
    from coartic.benchmarks.reproduce import find_run, trajectory_of
    from coartic.pictures.film import write_film

    if len(run_ids) + initial > 2:
        raise CoarticError("a film shows at most two runs, or one run with --initial")
    movements = []
    for run_id in run_ids:
        stored = find_run(run_id, folder)
        movement = trajectory_of(stored)
        world = stored.cell.world
        subject = movement.task.label + (f", {world}" if world else "")
        title = f"{subject}\n{title_of(stored.cell.method)}, run {stored['run']}"
        movements.append((title, movement))
    if initial:
        task, model = stored.cell.arena, stored.cell.model.without_noise()
        trial = corrective_trial(task, initial_hands(task, model=model), model=model)
        alone = trajectory(task, trial.movements, model)
        movements.insert(0, (f"{subject}\ncorrective process alone", alone))
    frames, ticks_a_second = write_film(movements, out, width=width, replace=replace)
    say(f"{out}: {frames} frames, {ticks_a_second:.0f} ticks a second.")


def play(
    task: Annotated[
        str | None,
        typer.Argument(
            metavar="TASK",
            help="First task of the page, or a task file (.toml).",
            autocompletion=completion.tasks,
        ),
    ] = None,
    out: given.Out = None,
    show: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in the browser.")
    ] = True,
    replace: given.Replace = False,
) -> None:
    """Play in the browser: move goals, and watch the learner learn."""
    import webbrowser

    from coartic import load_task
    from coartic.internal.files import check_ending, check_output, write_output
    from coartic.play.page import play_page

    if replace and out is None:
        raise CoarticError("--replace has no effect without --out")
    if out is not None:
        check_ending(out, [".html"])
        check_output(out, replace=replace)
    page = play_page(*map(load_task, [task] if task else [])).encode()
    out = out or Path(tempfile.mkdtemp(prefix="coartic-"), "play.html")
    write_output(out, page, replace=replace)
    opened = show and webbrowser.open(out.absolute().as_uri())
    say(f"{out}: {len(page) // 1000} kB" + ("." if opened else "; open it in a browser."))

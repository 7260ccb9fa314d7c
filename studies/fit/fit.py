"""Fit the learner, and five other models, to the trials of people.

    python studies/fit/fit.py two-armed-1 FILE.csv [--condition EC4] [--noise 0.01]

reads the files, one for each person, one by one, and prints for each subject which model explains
the trials, and the parameters of the learner with 95 % profile intervals.
"""

import argparse
import os
import sys
import warnings
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # more are slower on a machine that others use

import numpy as np
import pandas as pd
from check import compare, misfits, refuse_without_null_space, why_not
from evidence import DRIFTS, NODES, evidence_in
from models import condition_for, trials_of
from scipy import optimize, stats
from sentences import CLEAR, LEARNERS, MODELS, sentence

from coartic import CONDITIONS, CoarticError, load_task
from coartic.analysis import hits_from_markers, read_hits
from coartic.analysis.hits import checked_hits
from coartic.estimates import Estimate

SIMULATED = 8
"""Number of simulations from which the bias of an estimate is found."""


def interval(log_likelihood, best, step, low, high):
    """Return ``best``, the maximum of ``log_likelihood``, and the ends of the 95 % profile interval
    around it, within bounds, shape ``(3,)``; ends are sought in increments of ``step``."""
    drop = stats.chi2.ppf(0.95, 1) / 2
    least = log_likelihood(best) - drop
    ends = []
    for bound, sign in ((low, -1), (high, 1)):
        end = best
        while log_likelihood(end) > least and end != bound:
            end = (max if sign < 0 else min)(end + sign * step, bound)
        if log_likelihood(end) < least:
            inner = end - sign * step if sign * (end - best) > step else best
            end = optimize.brentq(lambda x: log_likelihood(x) - least, inner, end, xtol=1e-4)
        ends.append(end)
    return np.array([best, *ends])


def maximum(function, low, high):
    """Return the place and the value of the maximum of a function between bounds."""
    done = optimize.minimize_scalar(lambda x: -function(x), bounds=(low, high), method="bounded",
                                    options={"xatol": 1e-3})  # fmt: skip
    return done.x, -done.fun


def most_likely(evidence, noise):
    """Return log σ and κ of highest likelihood, shape ``(2,)``, and the log likelihood."""
    nodes = [[np.log(evidence.rough_sigma(kappa)), kappa] for kappa in NODES]
    start = max(nodes, key=lambda x: evidence.log_likelihood(np.exp(x[0]), x[1], 0.0))
    simplex = np.add(start, [[0, 0], [0.1, 0], [0, 0.1]])
    done = optimize.minimize(
        lambda x: -evidence.log_likelihood(np.exp(x[0]), x[1], noise), start, method="Nelder-Mead",
        options={"xatol": 1e-3, "fatol": 1e-3, "initial_simplex": simplex},
    )  # fmt: skip
    return done.x, -done.fun


def bias(task, condition, trials, log_sigma, kappa):
    """Return the bias of log σ and κ, shape ``(2,)``: landings are not linear in the target.

    It is the mean error of estimates from hits simulated with the tables of the subject.
    """
    simulated = np.exp(log_sigma), kappa, SIMULATED
    evidence = evidence_in(task, condition, trials, "informed", simulated=simulated)
    each = [most_likely(replace(evidence, nodes=nodes), 0.0)[0] for nodes in evidence.nodes]
    return np.mean(each, axis=0) - [log_sigma, kappa]


def with_intervals(evidence, noise, log_sigma, kappa, off):
    """Return ``sigma`` and ``kappa`` with the ends ``_low`` and ``_high`` of their 95 % profile
    intervals, a dictionary; ``noise``: SD of motor noise; ``off``: what :func:`bias` returns, which
    is taken off."""

    def value(log_sigma, kappa):
        return evidence.log_likelihood(np.exp(log_sigma), kappa, noise)

    def of_sigma(x):
        return maximum(lambda y: value(x, y), kappa - 1, kappa + 1)[1]

    def of_kappa(x):
        return maximum(lambda y: value(y, x), log_sigma - 1, log_sigma + 1)[1]

    sigmas = np.exp(interval(of_sigma, log_sigma, 0.2, -12.0, 3.0)) / np.exp(off[0])
    kappas = interval(of_kappa, kappa, 0.1, -2.0, 4.0) - off[1]
    return Estimate(*sigmas).columns("sigma") | Estimate(*kappas).columns("kappa")


def fit_subject(task, condition, trials, *, noise, intervals=True):
    """Fit all models to the trials of a subject; a dictionary of numbers, ``misfit`` in words, and
    ``model`` and ``others`` as of :func:`judge`. ``sigma``, ``epsilon`` and ``kappa`` are of *keep
    the best, informed*; ``bic_`` of each model. With ``intervals``, σ and κ have intervals, and
    their bias is taken off. ``noise`` as of :func:`fit`."""
    row, fitted = {}, {}
    for model in MODELS:
        if model not in LEARNERS[1:]:  # which have the same tables
            evidence = evidence_in(task, condition, trials, model)
        count = int(evidence.sizes.sum()) + len(evidence.follows)
        free, total, epsilon, kappa = 1, 0.0, 0.0, 0.0
        if len(condition.hands) > 1:
            epsilon, total = maximum(evidence.hands, 0.0, 1.0)
            free += 1
        if model == "informed":
            (log_sigma, kappa), best = most_likely(evidence, noise)
            free += 1
            row |= {"sigma": np.exp(log_sigma), "kappa": kappa}
            if intervals:
                off = bias(task, condition, trials, log_sigma, kappa)
                row |= with_intervals(evidence, noise, log_sigma, kappa, off)
            if len(condition.hands) > 1:
                epsilons = interval(evidence.hands, epsilon, 0.1, 0.0, 1.0)
                row |= Estimate(*epsilons).columns("epsilon")
        else:
            middle = np.log(evidence.rough_sigma(0.0))

            def postures(log_sigma, of=evidence, model=model):
                if model == "drawn":
                    return of.drawn(np.exp(log_sigma), noise)
                return of.log_likelihood(np.exp(log_sigma), 0.0, noise)

            log_sigma, best = maximum(postures, middle - 3.0, middle + 1.5)
            kappa = float(np.mean(DRIFTS)) if model == "drawn" else 0.0
        row[f"bic_{model}"] = free * np.log(count) - 2 * (total + best)
        fitted[model] = np.exp(log_sigma), epsilon, kappa
    model, others = judge(row)
    ratios = {}
    for name in (model, *others):  # one of those that BIC cannot distinguish may fit
        each = compare(task, condition, trials, name, fitted[name], noise)
        ratios = ratios or each
        if not misfits(each):
            ratios = each
            break
    row |= {f"check_{name}": value for name, value in ratios.items()}
    words = {"misfit": "; ".join(misfits(ratios)), "model": model, "others": " ".join(others)}
    return row | words


def judge(row):
    """Return the model of least BIC, and a list of the models that are not clearly worse, best
    first, from a row of :func:`fit_subject`."""
    bic = {model: row[f"bic_{model}"] for model in MODELS}
    ordered = sorted(bic, key=bic.get)
    return ordered[0], [model for model in ordered[1:] if bic[model] - bic[ordered[0]] < CLEAR]


def check_noise(noise, name="noise"):
    """Raise CoarticError, which calls the value ``name``, for what is no SD of motor noise."""
    if not 0 <= noise <= 1:
        raise CoarticError(f"{name} is {noise:g}; needed is an SD from 0 to 1, in rad")


def fit(frame, task, *, condition=None, noise=0.0, implausible="refuse"):
    """Fit all models to the trials of all subjects.

    ``frame``: rows of :func:`coartic.analysis.read_hits`, which are checked in the same way, with
    ``implausible``; ``noise``: SD of the motor noise in recorded postures, length unit and rad.
    Returns a row for each subject that can be fitted, with what :func:`fit_subject` finds,
    ``trials``, ``lost`` trials, ``missing`` hits of the others, ``unfinished`` trials of the frame,
    and ``improved``, the number of trials after the first that were better than all before.
    """
    condition, rows = condition or condition_for(task), []
    check_noise(noise)
    refuse_without_null_space(task, condition)
    if idle := {*condition.hands} - {*task.hands}:
        raise CoarticError(
            f"{condition.id} uses the {idle.pop()} hand, task {task.name!r} does not"
        )
    frame = checked_hits(frame, task, implausible=implausible)
    if other := {*frame.hand} - {*condition.hands}:
        raise CoarticError(f"{condition.id} does not use the {other.pop()} hand, the data do")
    for subject, of_subject in frame.groupby("subject", sort=False):
        trials = trials_of(of_subject, task)
        hits = (trials.hands >= 0).sum(axis=1)
        rewards = trials.rewards[np.isfinite(trials.rewards)]
        row = {
            "subject": subject, "noise": noise, "trials": len(hits), "lost": int((hits == 0).sum()),
            "missing": int((len(task.goals) - hits[hits > 0]).sum()),
            "unfinished": frame.attrs.get("unfinished", 0),
            "improved": int((np.diff(np.maximum.accumulate(rewards)) > 0).sum()),
        }  # fmt: skip
        if why := why_not(task, condition, trials):
            warnings.warn(f"subject {subject} is left out: {why}", stacklevel=2)
            continue
        rows.append(row | fit_subject(task, condition, trials, noise=noise))
    return pd.DataFrame(rows)


def printable(text):
    """Return text whose characters that do not print, such as escape codes, are shown as ``?``."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in str(text))


def main():
    """Read a file, fit, and print a sentence for each subject."""
    parser = argparse.ArgumentParser(description="Fit the learner to the trials of people.")
    parser.add_argument("task", help="name or file of the task")
    parser.add_argument("csv", nargs="+", help="files with a row for each hit, or of markers")
    parser.add_argument("--markers", choices=("left", "right", "both"),
                        help="arm with markers: the files have their places over time")  # fmt: skip
    parser.add_argument("--condition", choices=CONDITIONS, help="hands and explored joints")
    parser.add_argument("--noise", type=float, default=0.0, help="SD of motor noise in postures")
    parser.add_argument("--ticks-per-unit", type=float, help="ticks in a duration of 1")
    parser.add_argument("--implausible", choices=("refuse", "drop"), default="refuse",
                        help="hits that nobody can have made")  # fmt: skip
    given = parser.parse_args()
    warnings.showwarning = lambda text, *_: print(printable(f"warning: {text}"), file=sys.stderr)
    warnings.filterwarnings("ignore", "the frame")  # checked by fit again
    try:
        check_noise(given.noise, "--noise")
        task = load_task(given.task)
        condition, files, people = CONDITIONS.get(given.condition), {}, []
        options = {"implausible": given.implausible}
        if given.ticks_per_unit is not None:
            options["ticks_per_unit"] = given.ticks_per_unit
        for path in given.csv:
            if given.markers:
                people.append(hits_from_markers(path, task, given.markers, **options))
            else:
                people.append(read_hits(path, task, **options))
            for name in people[-1].subject.unique():
                if files.setdefault(name, path) != path:
                    raise CoarticError(f"subject {name} is in {files[name]} and in {path}; needed "
                                       "is one file, with trials numbered through")  # fmt: skip
        table = pd.concat(
            fit(each, task, condition=condition, noise=given.noise) for each in people
        )
    except CoarticError as error:
        print(printable(f"error: {error}"), file=sys.stderr)
        raise SystemExit(2) from None
    if not len(table):
        print("error: no subject can be fitted", file=sys.stderr)
        raise SystemExit(2)
    for _, row in table.iterrows():
        print(printable(sentence(row)))


if __name__ == "__main__":
    main()

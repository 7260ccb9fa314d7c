"""What holds over instances of families: planted runs, and a small folder through a report."""

import math
from collections import defaultdict
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic import load_task
from coartic.analysis.claims import CLAIMS, Claim, Finding, evidence, judge
from coartic.analysis.claims.catalogue import family_sizes
from coartic.analysis.claims.data import MissingError
from coartic.analysis.claims.power import seen_over_instances
from coartic.analysis.generality import sample
from coartic.analysis.generality.exploration import budgets, contrasts
from coartic.analysis.generality.precision import RUNS, needed, variance_shares
from coartic.analysis.generality.presence import Signs, presence, recruitment
from coartic.analysis.generality.properties import properties, what_pays
from coartic.analysis.generality.scaling import scaling, size
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL
from coartic.analysis.report.build import build
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.tables.families import family_tables
from coartic.analysis.results.folder import Results
from coartic.analysis.results.optima import KnownOptimum
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.study import Study
from coartic.analysis.words import true_minus
from coartic.families import names_in
from tests.support.made_up import MadeUp, manifest_for, row
from tests.support.reports import changed_columns, document_of, undrawn, without_figures
from tests.support.suites import paper_cells, run_and_write, suite_of

ONE, TWO = ("one-armed/v1",), ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
COUNT = 5
BEST, ALONE = -500, -600
NOISE = (-4, -2, 0, 2, 4)


def hands_of(name, letter="R"):
    return letter * len(load_task(name).goals)


def runs_of(name, label, centre, *, hands=None, noise=NOISE, **more):
    return [
        row(
            label, round(centre) + off, task=name, run=k, trials=10_000, initial_reward=ALONE,
            replay_reward=round(centre) + off, hands=hands or hands_of(name),
            initial_hands=hands_of(name), failed_trials=0,
            **{"run_id": f"{name} {label} {k}", **more},
        )
        for k, off in enumerate(noise)
    ]  # fmt: skip


def study_of(
    tmp_path, centres, *, families=ONE + TWO, split="i", optima=True, count=COUNT, **parts
):
    """Rewards of conditions by label: a number, or a function of the instance's number."""
    rows, tasks, known = [], [], {}
    for family in families:
        for number, name in enumerate(names_in(f"{family}/{split}000..{split}{count - 1:03d}")):
            tasks.append(load_task(name))
            known[name, "free"] = KnownOptimum(
                BEST, hands_of(name), BEST if number % 2 else BEST + 50
            )
            for label, centre in centres.items():
                if (label == EC1) == (family in ONE) or label == INITIAL:
                    value = centre(number) if callable(centre) else centre
                    noise = (0,) if label == INITIAL else NOISE
                    rows += runs_of(name, label, value, noise=noise)
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    sequences = pd.DataFrame(
        {"task": task.name, "hands": hands_of(task.name), "reward": ALONE} for task in tasks
    )
    results = Results(tmp_path, manifest_for(tasks, runs), runs, sequences)
    return MadeUp(results, **({"optima": known} if optima else {}), **parts)


@pytest.fixture
def fewer_resamples(monkeypatch):
    """Where a p-value is near a level: a hundred times as many as elsewhere take long."""
    monkeypatch.setattr(evidence, "MANY", 29_999)


RISING = {INITIAL: ALONE, EC1: -540, EC2: -560, EC3: -550, EC4: -540}


def test_gaps_are_between_the_best_known_and_the_bound(tmp_path):
    sample = study_of(tmp_path, RISING).instances
    name = "two-armed/v1/i000"
    np.testing.assert_allclose(sample.gap(name, EC4).mean(), 40 / 500)
    np.testing.assert_allclose(sample.gap(name, EC4, to_bound=True).mean(), 90 / 450)
    assert not sample.references[name].proven
    assert sample.references["two-armed/v1/i001"].proven
    assert sample.gap(name, EC1) is None
    assert sample.splits == {"test": 25}
    assert list(sample.families) == [*ONE, *TWO]


def test_a_method_that_beats_the_search_makes_the_best_known(tmp_path):
    """Never a gap below 0, and it is counted."""
    study = study_of(tmp_path, {**RISING, EC4: lambda n: -480 if n == 2 else -540})
    sample = study.instances
    assert sample.references["long/v1/i002"].best == -476
    assert sample.references["long/v1/i002"].searched == BEST
    assert sample.gap("long/v1/i002", EC4).min() == 0
    assert sum(of.best > of.searched for of in sample.references.values()) == 4
    without = study_of(tmp_path, RISING, optima=False).instances
    assert without.references["long/v1/i002"].searched is None
    assert without.gap("long/v1/i002", EC4, to_bound=True) is None


def test_planted_contrasts(tmp_path):
    """EC4 over EC3: 10 of 500 on all instances but the last of each family, where it loses 20."""
    study = study_of(tmp_path, {**RISING, EC4: lambda n: -540 if n < 4 else -570})
    found = {(c.first, c.second, c.family): c for c in contrasts(study.instances)}
    mixed = found[EC4, EC3, "aligned/v1"]
    assert mixed.difference.estimate == pytest.approx((4 * 0.02 - 0.04) / 5)
    assert (mixed.better, mixed.worse, mixed.instances, mixed.told) == (4, 1, 5, 5)
    assert mixed.difference.low < 0 < mixed.difference.high
    rising = found[EC3, EC2, ""]
    assert rising.difference.estimate == pytest.approx(0.02)
    assert (rising.instances, rising.better) == (20, 20)
    assert found[EC1, INITIAL, "one-armed/v1"].difference.estimate == pytest.approx(0.12)
    assert (EC3, EC2, "one-armed/v1") not in found


def test_what_hands_make_of_a_contrast(tmp_path):
    """EC2 learns hands with which nobody gets beyond -560, EC4 those of the best known."""
    study = study_of(tmp_path, RISING)
    runs = study.results.runs
    of_two = runs.method == EC2
    runs.loc[of_two, "hands"] = [hands_of(task, "L") for task in runs.task[of_two]]
    (found,) = [
        c for c in contrasts(study.instances) if (c.first, c.second, c.family) == (EC4, EC2, "")
    ]
    assert (found.difference.estimate, found.median) == (pytest.approx(0.04), pytest.approx(0.04))
    assert found.hands.estimate == pytest.approx((-536 + 556) / 500)  # the best run of either


def test_learning_curves_are_read_at_budgets(tmp_path):
    study = study_of(tmp_path, {EC3: -540, EC4: -530}, families=TWO[:1])
    curve = np.concatenate([np.full(1_000, -600.0), np.full(9_000, -540.0)])
    ends = {EC3: 0.0, EC4: 10.0}
    runs = study.results.runs
    rewards = {
        str(run): curve + (np.arange(10_000) >= 1_000) * ends[label]
        for run, label in zip(runs.run_id, runs.method, strict=True)
    }
    object.__setattr__(study.results, "rewards", lambda: rewards.items())
    found = {(b.label, b.second, b.trials): b.value.estimate for b in budgets(study.instances)}
    assert found[EC3, "", 1_000] == found[EC4, "", 1_000] == pytest.approx(0.2)
    assert found[EC4, "", 10_000] == pytest.approx(0.06)
    assert found[EC4, EC3, 10_000] == pytest.approx(0.02)
    assert max(trials for _, _, trials in found) == 10_000


def test_variance_and_precision(tmp_path):
    """Instances as hard as planted, methods as far apart, one seed's noise; no interaction."""
    hard = (0, -20, -40, -60, -80)
    centres = {EC2: -560, EC3: -550, EC4: -540}
    study = study_of(
        tmp_path,
        {label: (lambda n, c=centre: c + hard[n]) for label, centre in centres.items()},
        families=TWO[:2],
    )
    for found in variance_shares(study.instances):
        assert (found.methods, found.instances) == (3, 5)
        assert found.components.instance == pytest.approx(np.var(hard, ddof=1) / 500**2, rel=0.01)
        assert found.components.method == pytest.approx(100 / 500**2, rel=0.01)
        assert found.components.seed == pytest.approx(10 / 500**2)
        assert found.components.interaction == 0
    pair = next(n for n in needed(study.instances) if (n.first, n.second) == (EC3, EC4))
    assert pair.difference == pytest.approx(0.02)
    assert pair.between == 0
    assert pair.within == pytest.approx(math.sqrt(20) / 500)
    assert list(pair.needed) == sorted(pair.needed, reverse=True)
    assert len(pair.needed) == len(RUNS)
    assert pair.needed[-1] == 3


def test_properties_are_those_of_the_task_alone():
    known = properties(load_task("ascending"))
    assert known == {
        "distance": pytest.approx(1.95 / 4), "spread": pytest.approx(0.05 / 4), "goals": 3,
        "redundancy": 2, "base": 2,
    }  # fmt: skip
    assert properties(load_task("two-armed-1"))["base"] == 1


def test_a_planted_property_pays(tmp_path):
    """Rewards of the best known rise by 2 % of it for each goal; nothing else pays."""
    study = study_of(tmp_path, RISING, count=7)
    goals = {name: len(task.goals) for name, task in study.tasks.items()}
    sequences = study.results.sequences
    sequences["reward"] = [BEST * (1 + 0.02 * goals[name]) for name in sequences.task]
    found = {(p.outcome, p.name): p for p in what_pays(study.instances)}
    assert found["worth", "goals"].effect.estimate == pytest.approx(0.02)
    assert found["worth", "distance"].effect.estimate == pytest.approx(0, abs=1e-9)
    assert found["learned", "goals"].effect.estimate == pytest.approx(0.02, abs=0.01)
    assert found["worth", "goals"].explained == pytest.approx(1)


def test_planted_growth_is_found_apart_for_goals_and_joints(tmp_path):
    """Evaluations grow as goals² and joints³; seconds not at all; gaps by 2 % for each goal."""
    study = study_of(tmp_path, RISING)
    sizes = [size(study.tasks[name]) for name in study.runs.task]
    cost = np.array([10.0 * goals**2 * joints**3 for goals, joints in sizes])
    study.runs["forward_kinematics"], study.runs["jacobians"] = 0.75 * cost, 0.25 * cost
    study.runs["reward"] = [round(BEST * (1 + 0.02 * goals)) for goals, _ in sizes]
    found = {(g.label, g.what): g for g in scaling(study.instances)}
    evaluations, seconds = found[EC4, "kinematics"], found[EC4, "solve_s"]
    assert (evaluations.goals.estimate, evaluations.joints.estimate) == (
        pytest.approx(2), pytest.approx(3),
    )  # fmt: skip
    assert evaluations.goals.low == pytest.approx(2)
    assert (evaluations.instances, evaluations.explained) == (20, pytest.approx(1))
    assert seconds.goals.estimate == pytest.approx(0)
    gap = found[EC4, "gap"]
    assert (gap.goals.estimate, gap.joints.estimate) == (pytest.approx(0.02), pytest.approx(0))


def test_joints_are_those_that_move_one_hand():
    assert size(load_task("ascending")) == (3, 6)
    assert size(load_task("two-armed-1")) == (4, 5)


def made_up_signs(study, hand=1.0, waiting=0.3):
    found = {}
    for name in study.tasks:
        for label in (EC1, EC2, EC3, EC4):
            if (name, label) in study.cells:
                number = int(name[-3:])
                values = {
                    "arm": np.array([2.0, 3.0 + 0.1 * number]),
                    "first": np.array([5.0, 6.0 + 0.1 * number]),
                    "whole": np.array([9.0, 8.0 + 0.1 * number]),
                }
                if label != EC1:
                    values["hand"] = np.array([hand, hand, hand - 0.1 * (number == 0)])
                    values["other arm"] = np.array([waiting + 0.01 * number])
                own = hands_of(name)
                sequences = (own,) * 4 + (hands_of(name, "L"),)
                found[name, label] = Signs(values, sequences, own, (own,))
    return found


def test_presence_and_hands(tmp_path):
    study = study_of(tmp_path, RISING)
    signs = made_up_signs(study, waiting=0.07)
    found = {(p.sign, p.label, p.family): p for p in presence(study.instances, signs)}
    waiting = found["other arm", EC4, "long/v1"]
    assert waiting.value.estimate == pytest.approx(0.09)
    assert (waiting.instances, waiting.there) == (5, 1)  # the last beyond a tenth of the way
    assert found["hand", EC4, ""].there == 20
    assert ("hand", EC1, "one-armed/v1") not in found
    hands = {(r.label, r.family): r for r in recruitment(study.instances, signs)}
    own = hands[EC3, "aligned/v1"]
    assert (own.leaves_initial, own.as_corrective, own.consistent, own.both_hands) == (
        0,
        5,
        5,
        0.0,
    )
    assert own.as_best_known == 0  # nobody of these runs reached it


def unseen(data):
    raise MissingError("it is not asked")


def verdicts(study, *names):
    """Of some claims, among all others, which nobody judges; without names of all of them."""
    claims = [claim for claim in CLAIMS if claim.families]
    asked = [claim if claim.id in names else replace(claim, judge=unseen) for claim in claims]
    judged = judge(study, asked) if names else study.judged
    return {entry.claim.id: entry for entry in judged}


@pytest.mark.usefixtures("fewer_resamples")
def test_p_near_a_level_is_of_more_resamples():
    near = np.array([-0.4, 0.5, 2.0, 3.0, 1.5, 0.8])
    for values, resamples in ((near, 29_999), (-near, 29_999), (near - 1.2, 9_999)):
        assert f"{resamples} resamples" in evidence.exceeds(values, 0.0, sure=True).method
        assert "9999 resamples" in evidence.exceeds(values, 0.0).method


@pytest.mark.usefixtures("fewer_resamples")
def test_claims_of_generality(tmp_path):
    study = study_of(tmp_path, {**RISING, EC4: lambda n: -540 - n})
    vars(study)["signs"] = made_up_signs(study)
    found = verdicts(study)
    assert all(entry.claim.families for entry in found.values())
    for name in (
        "learning-improves",
        "proficiency-rises",
        "other-arm-coarticulation",
        "arm-coarticulation",
    ):
        entry = found[f"{name}-in-general"]
        assert entry.verdict == "supported", entry.evidence
        assert entry.adjusted_p < 0.05
    ensured = found["corrective-ensures-in-general"]
    assert ensured.verdict == "supported"
    assert "0 of 3250000 trials" in ensured.evidence
    jerk = found["beats-inaccurate-in-general"]
    assert jerk.verdict == "cannot tell"
    assert "fewer than 3 instances of one-armed/v1" in jerk.evidence


def test_hands_are_learned_where_they_differ_from_the_closest(tmp_path):
    """EC2 hits with the slower hand as often as hands are drawn: what counts is EC4 beyond it."""
    study = study_of(tmp_path, RISING)
    name = "hand-coarticulation-in-general"

    def judged(more):
        signs = made_up_signs(study)
        for (task, label), own in signs.items():
            if label in (EC2, EC4):
                shift = (more + 0.01 * int(task[-1])) * (label == EC4)
                own.values["hand"] = np.array([0.4, 0.6]) + shift  # noqa: PD011
        return verdicts(MadeUp(study.results, optima=study.optima, signs=signs), name)[name]

    more = judged(0.1)
    assert more.verdict == "supported"
    assert "12.0" in more.evidence
    assert judged(-0.2).verdict == "not supported"
    assert judged(-0.02).verdict == "cannot tell"


@pytest.mark.usefixtures("fewer_resamples")
def test_a_hypothesis_that_fails_in_one_family_does_not_hold_in_general(tmp_path):
    falling = study_of(tmp_path, {**RISING, EC4: lambda n: -570 - n})
    arm, rises, hands = (
        f"{name}-in-general"
        for name in ("other-arm-pays", "proficiency-rises", "random-hands-pay")
    )
    found = verdicts(falling, arm, rises, hands)
    assert {found[name].verdict for name in (arm, rises, hands)} == {"not supported"}
    mixed = study_of(tmp_path, {**RISING, EC4: lambda n: -540 if n % 2 else -560})
    assert verdicts(mixed, arm)[arm].verdict == "cannot tell"


def test_development_instances_are_not_judged(tmp_path):
    study = study_of(tmp_path, RISING, split="d", signs={})
    assert study.instances.splits == {"development": 25}
    assert {entry.verdict for entry in study.judged} == {"cannot tell"}


@pytest.mark.usefixtures("fewer_resamples")
def test_claims_of_generality_change_no_verdict_of_the_paper(tmp_path):
    """They are a family of their own, and stand in reports of instances alone."""
    assert family_sizes() == {"paper": 23, "beside": 7, "families": 10}
    study = study_of(tmp_path, RISING, families=TWO[:1])
    vars(study)["signs"] = made_up_signs(study)
    here = [claim for claim in CLAIMS if claim.families]
    assert [entry.claim for entry in study.judged] == here
    test = Inference(1.0, (20,), "planted", p=0.02)
    paper = Claim(
        *("p", "It is so.", "General", "tested", "planted"),
        lambda data: Finding(True, "planted", (test,)),
        place="here",
    )
    assert [judge(study, claims)[0].adjusted_p for claims in ([paper], [paper, *here])] == [
        0.02
    ] * 2
    assert not any(claim.fitted for claim in here)


def test_effect_that_instances_show():
    """By experiments: at the effect named, all tests find it in four of five."""
    rng = np.random.default_rng(0)
    many = rng.normal(0, 2, 200)
    visible = seen_over_instances([many, many], 10)
    drawn = rng.normal(visible, many.std(ddof=1), (4000, 2, 200))
    t = drawn.mean(axis=2) / drawn.std(axis=2, ddof=1) * math.sqrt(200)
    assert (t > stats.t.isf(0.005, 199)).all(axis=1).mean() == pytest.approx(0.8, abs=0.03)
    assert seen_over_instances([many, many[:20]], 10) > 2 * visible
    assert math.isnan(seen_over_instances([np.zeros(10)], 10))


BLOCKS = (
    'tasks = ["one-armed/v1/i000..i002"]\n'
    'methods = ["dual-process/EC1", "corrective-alone/given"]',
    'tasks = ["two-armed/v1/i003", "two-armed/v1/i006", "two-armed/v1/i009"]\n'
    'methods = ["dual-process/EC2", "dual-process/EC3", "dual-process/EC4", '
    '"corrective-alone/given"]',
    'tasks = ["two-armed/v1/i003"]\nmethods = ["optimum/dynamic-programming"]\n'
    "parameters = { nodes = 10, graphs = 1, chains = 1 }",
)


OWN_FIGURES = ("gaps-by-family", "exploration-by-family")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    home = tmp_path_factory.mktemp("families")
    return run_and_write(home / "out", suite_of(home, *BLOCKS), runs=3, trials=40)


@pytest.fixture(scope="module")
def study(folder):
    return Study(folder)


def test_a_small_folder_through_a_report(study):
    with undrawn(), without_figures(but=OWN_FIGURES):
        document = build(study).document
    assert [figure.id for figure in document.figures()] == list(OWN_FIGURES)
    (section,) = [s for s in document.sections if s.id == "families"]
    assert document.sections.index(section) == 1
    lead = section.finding
    assert lead.startswith("On 6 random tasks (6 test; one-armed 3, two-armed 3)")
    assert "the learner (EC1 on one arm, EC4 on two) stays" in lead
    tables = {table.id: table for table in document.tables()}
    assert {"family-gaps", "family-exploration", "family-references", "family-hands"} <= set(
        tables
    )
    gaps = {row.key: row for row in tables["family-gaps"].rows}
    (shown,) = (value for value in gaps[EC4].values[2:3])  # noqa: PD011
    own = study.instances.gaps(EC4)["two-armed/v1"]
    assert shown.value == pytest.approx(np.mean([runs[0].mean() for runs in own]))
    page = true_minus(markdown(document))
    assert "## Beyond the paper" in page
    assert "claim-proficiency-rises-in-general" in {s.id for s in document.walk()}
    assert "claim-proficiency-rises" not in {s.id for s in document.walk()}


def test_columns_over_instances_say_what_they_rest_on(tmp_path):
    """With other best known rewards those change that say that they rest on them."""
    planted = study_of(
        tmp_path, {**RISING, EC1: lambda n: -510 - 10 * n, EC4: lambda n: -498 - 3 * n}
    )
    still = defaultdict(lambda: SimpleNamespace(learns=False, solved=True))
    parts = {"best_so_far": still, "signs": made_up_signs(planted)}
    others = {
        key: replace(
            best, reward=best.reward + 9 + n % 3, bound=best.bound + 20 + n % 2,
            searches=(("optimum/any", best.reward - 3 * n),),
        )
        for n, (key, best) in enumerate(planted.optima.items())
    }  # fmt: skip
    before, after = (
        list(family_tables(MadeUp(planted.results, optima=known, **parts)))
        for known in (planted.optima, others)
    )
    saying = {(t.id, c.name) for t in before for c in t.columns if "optimum" in c.rests_on}
    changed = changed_columns(before, after)
    assert changed - saying == set()
    assert len(changed) > 20


def test_many_instances_alone_are_reported_together(folder, monkeypatch):
    monkeypatch.setattr(sample, "MOST_INSTANCES", 1)
    study = Study(folder)
    assert study.signatures.empty
    document = document_of(study)
    assert any(table.id == "family-gaps" for table in document.tables())
    assert not any(table.id.startswith("main-signatures") for table in document.tables())


def test_a_folder_without_instances_has_no_such_section(tmp_path):
    study = Study(run_and_write(tmp_path, paper_cells(tasks=["ascending"]), runs=1, trials=3))
    assert study.instances is None
    assert study.contrasts == []
    with without_figures(but=OWN_FIGURES):
        sections = {section.id for section in build(study).document.walk()}
        assert (list(study.figures), study.figures.skipped) == ([], {})
    assert "families" not in sections
    assert "claim-proficiency-rises" in sections
    assert not any("in-general" in name for name in sections)


def test_figures_of_families(study):
    gaps, exploration = (study.figures[f"{name}-by-family"] for name in ("gaps", "exploration"))
    assert [axes.get_title(loc="left")[-9:] for axes in gaps.axes] == ["one-armed", "two-armed"]
    assert len(exploration.axes) == 3

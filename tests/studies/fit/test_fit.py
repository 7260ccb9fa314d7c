"""Study fit: the reader, the simulator, and fits of people whom other code simulates."""

import math
import re
import sys
import warnings
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import CONDITIONS, CoarticError, learn, load_task
from coartic.analysis import SIGNATURES, solutions_of
from coartic.analysis.solutions import Solutions
from tests.support import reference
from tests.support.processes import ROOT, programs
from tests.support.strategies import metres_task

FOLDER = ROOT / "studies" / "fit"
RECORDINGS = ROOT / "docs" / "examples" / "recordings"
PROTOCOLS, FIT, STUDY, PLAIN, NEEDED = programs(
    "fit", "protocols", "fit", "study", "plain_person", "needed"
)
TASK = load_task("two-armed-1")


@pytest.fixture(autouse=True)
def fewer_simulated(monkeypatch):
    """The check simulates a third of the study's number of people, or as many as a test asks."""

    def simulate(number):
        monkeypatch.setattr(sys.modules["check"], "SIMULATED", number)

    simulate(19)
    return simulate


@pytest.fixture(scope="module")
def people():
    return PROTOCOLS.simulate(TASK, "informed", 0.04, 0.3, 0.4, seeds=[1], trials=20)


@pytest.mark.parametrize(("name", "condition"), [("ascending", "EC1"), ("two-armed-1", "EC2")])
def test_the_simulated_learner_is_the_packages(name, condition):
    people = PROTOCOLS.simulate(load_task(name), "best", 0.05, 0.2, seeds=[7, 8], trials=30,
                      condition=CONDITIONS[condition])  # fmt: skip
    for number, person in people.groupby("subject"):
        run = learn(name, condition, seed=7 + number, trials=30)
        assert (person.groupby("trial").ticks.sum() == -run.rewards).all()


def test_the_planner_is_at_every_goal_with_its_hand():
    for goal, hand, q in zip(TASK.goals, *sys.modules["models"].plan_for(TASK), strict=True):
        place = TASK.robot.forward_kinematics(q, ("left", "right")[hand])
        assert np.hypot(*(place - goal)) <= TASK.radius


def test_parameters_of_the_plain_learner_are_found():
    """Its movements, tables and null spaces share no code with the package's kernels."""
    truth = {"sigma": 0.03, "epsilon": 0.25, "kappa": 0.5}
    fields = {"noise_sd": 0.03, "epsilon": 0.25, "drift": 0.5}
    condition = replace(CONDITIONS["EC4"], **fields)
    people = reference.hits_of(TASK, condition, trials=60, seed=5, subject="a")
    fitted = FIT.fit(people, TASK).iloc[0]
    assert (fitted.model, fitted.others) == ("informed", "")
    for name, value in truth.items():
        assert fitted[f"{name}_low"] < value < fitted[f"{name}_high"]
    assert fitted.kappa_high - fitted.kappa_low < 0.1
    for of_row, words in (
        ({"noise": 0.02}, "Motor noise is more"),
        ({"lost": 1}, "A trial with lost hits may have been the best: intervals can be too narrow"),
        ({"model": "walk", "bic_walk": -1e4}, "a walk (keep the last) (other models: BIC"),
        ({"model": "walk", "bic_walk": -1e4, "lost": 1}, "been the best: the model can be wrong."),
        ({"misfit": "x", "missing": 1}, "may have been the best: the model can be wrong."),
        ({"others": "walk", "lost": 1}, "may have been the best: the model can be wrong."),
    ):
        assert words in FIT.sentence(pd.Series({**fitted, **of_row}))


def rough(people, noise=0.0):
    """The row of one subject, without intervals, which take long."""
    trials, condition = FIT.trials_of(people, TASK), FIT.condition_for(TASK)
    return FIT.fit_subject(TASK, condition, trials, noise=noise, intervals=False)


@pytest.mark.parametrize("model", ["drawn", "walk", "memoryless", "planner"])
def test_model_of_simulated_people_is_preferred(model):
    """The others are found above, and on the page of the how-to, below."""
    people = PROTOCOLS.simulate(TASK, model, 0.04, 0.3, seeds=[3], trials=10)
    assert rough(people)["model"] == model


def test_people_of_another_model_are_none_of_the_six():
    """Of averages, how-to's p2 is an example."""
    people = PROTOCOLS.simulate(TASK, "decays", 0.04, 0.3, seeds=[1], trials=30)
    assert "grow or shrink with practice" in rough(people)["misfit"]


def test_motor_noise_is_a_parameter(people):
    noisy, joints = people.copy(), [*TASK.robot.joint_names]
    noisy[joints] += 0.03 * np.random.default_rng(0).standard_normal(noisy[joints].shape)
    given = rough(noisy, 0.03)
    assert given["sigma"] == pytest.approx(0.04, rel=0.1)
    assert given["kappa"] == pytest.approx(0.4, abs=0.05)
    assert given["misfit"] == ""


def test_where_two_models_explain_the_trials_no_parameters_are_given():
    """A learner that has found nothing better is one without memory."""
    people = PROTOCOLS.simulate(load_task("ascending"), "best", 0.05, 0.2, seeds=[2], trials=12)
    fitted = FIT.fit(people, load_task("ascending")).iloc[0]
    assert {"best", "memoryless"} <= {fitted.model, *fitted.others.split()}
    assert "cannot distinguish" in FIT.sentence(fitted)
    assert "κ" not in FIT.sentence(fitted)


def test_signatures_of_recorded_trials_are_of_what_was_recorded():
    task = load_task("two-armed-2")
    people = PROTOCOLS.simulate(task, "best", 0.05, 0.2, seeds=[4], trials=20)
    run = learn(task, "EC4", seed=4, trials=20)
    recorded, best = solutions_of(task, people), Solutions(task, "learner", (run.execute(),))
    for each in (signature.each for signature in SIGNATURES.values()):
        assert each(recorded)[run.best_trial] == pytest.approx(each(best)[0], nan_ok=True)
    assert len(solutions_of(task, people.drop(index=[0, 5])).runs) == 18
    assert len(solutions_of(task, people.sort_values("goal", ascending=False)).runs) == 20


def test_degenerate_trials_are_left_out_with_the_reason(people):
    first = people[people.trial == 1]
    degenerate = {
        "two trials": first,
        "postures are equal": pd.concat(
            first.assign(trial=n, ticks=first.ticks + n) for n in range(1, 31)
        ),
        "take 2000 ticks, as by a met": people.assign(ticks=495 + 2 * people.goal),
    }
    every = pd.concat([of.assign(subject=why) for why, of in degenerate.items()])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")  # also of trials that are copied
        assert not len(FIT.fit(every, TASK))
    left_out = [words for each in said if "is left out: " in (words := str(each.message))]
    for why, words in zip(degenerate, left_out, strict=True):
        assert words.count(why) == 2  # as the subject's name, and as the reason


def test_what_cannot_be_fitted_is_refused(people):
    with pytest.raises(CoarticError, match="EC1 does not use the left hand"):
        FIT.fit(people, TASK, condition=CONDITIONS["EC1"])
    with pytest.raises(CoarticError, match="2 coordinates move for the right hand.*null space"):
        FIT.fit(people, metres_task())


@pytest.mark.parametrize(("subject", "simulated"), [("s2", 5), ("p1", 5), ("p2", 39)])
def test_how_to_shows_what_the_command_prints(
    subject, simulated, tmp_path, monkeypatch, capsys, fewer_simulated
):
    fewer_simulated(simulated)
    if subject == "p2":  # of whom no parameters are given
        monkeypatch.setattr(FIT, "bias", lambda *_: None)
        monkeypatch.setattr(FIT, "with_intervals", lambda *_: {})
    task, recorded, options = "two-armed-1", "example.csv", []
    if subject != "s2":
        task, recorded = str(RECORDINGS / "metres.toml"), "metres.csv"
        options = ["--ticks-per-unit", "100", "--noise", "0.005"]
    lines = (RECORDINGS / recorded).read_text("utf-8").splitlines(keepends=True)
    file = tmp_path / recorded
    file.write_text("".join(line for line in lines if line.startswith(("subject", subject))))
    monkeypatch.setattr("sys.argv", ["fit.py", task, str(file), *options])
    FIT.main()
    page = (ROOT / "docs" / "howto" / "people.md").read_text("utf-8").splitlines()
    shown = [line for line in page if line.startswith(f"{subject}, trials")]
    assert capsys.readouterr().out.splitlines() == shown


def test_a_hit_of_zeros_is_no_posture_of_the_fit(people):
    gap = people.copy()
    gap.loc[20, [*TASK.robot.joint_names]] = 0.0
    with pytest.raises(CoarticError, match="row 20: all angles of the"):
        FIT.fit(gap, TASK)
    with pytest.raises(CoarticError, match="seeds are .*one is there twice"):
        PROTOCOLS.simulate(TASK, "best", 0.04, 0.3, seeds=[3, 4, 3], trials=1)
    with pytest.raises(CoarticError, match="EC4 uses the left hand, task 'ascending' does not"):
        FIT.fit(people, load_task("ascending"), condition=CONDITIONS["EC4"])


@pytest.mark.filterwarnings("always")
def test_a_person_in_two_files_is_refused_and_several_files_are_fitted(
    people, tmp_path, monkeypatch, capsys
):
    still = pd.concat([people[people.trial == 1].assign(trial=trial) for trial in (1, 2)])
    paths = [tmp_path / name for name in ("a.csv", "b.csv", "c.csv")]
    for path, name in zip(paths, "xyx", strict=True):
        still.assign(subject=name).to_csv(path, index=False)
    for files, words in ((paths[:2], "subject y is left out"), (paths, r"x is in .*a.csv and in")):
        monkeypatch.setattr("sys.argv", ["fit.py", "two-armed-1", *map(str, files)])
        with pytest.raises(SystemExit, match="2"):
            FIT.main()
        printed = capsys.readouterr().err
        assert re.search(words, printed)
        assert printed.count("trials are equal to others") == len(files)  # once for each


@pytest.mark.parametrize("noise", ["-1", "nan", "inf", "9999"])
def test_a_noise_that_cannot_be_is_refused(noise, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["fit.py", "two-armed-1", "no file", "--noise", noise])
    with pytest.raises(SystemExit, match="2"):
        FIT.main()
    assert capsys.readouterr().err.startswith("error: --noise")


def test_recordings_are_of_a_simulator_without_the_package(tmp_path):
    assert "coartic" not in (FOLDER / "plain_person.py").read_text("utf-8").split('"""')[2]
    (tmp_path / "markers").mkdir()
    PLAIN.main(tmp_path, 20)
    for name in ("markers/m1.csv", "markers/m2.csv"):
        assert (tmp_path / name).read_bytes() == (RECORDINGS / name).read_bytes()
    stored = (RECORDINGS / "metres.csv").read_text("utf-8").splitlines()
    first = [line for line in stored[1:] if int(line.split(",")[1]) <= 20]
    assert (tmp_path / "metres.csv").read_text("utf-8").splitlines() == [stored[0], *first]


@pytest.mark.filterwarnings("always")
def test_a_recording_of_markers_is_fitted(monkeypatch, capsys, fewer_simulated):
    fewer_simulated(9)
    options = ["--markers", "right", "--noise", "0.007"]
    task, file = str(RECORDINGS / "metres.toml"), str(RECORDINGS / "markers" / "m1.csv")
    monkeypatch.setattr("sys.argv", ["fit.py", task, file, *options])
    FIT.main()
    printed = capsys.readouterr()
    begin = "m1, trials 1 to 12 (lost: 1; hits missing in others: 0; unfinished: 1): keep the best"
    assert printed.out.startswith(begin)
    assert re.search("right_2: a gap is bridged.*\n.*1 of 12 trials are unfinished", printed.err)


def test_people_needed_are_those_of_the_table(capsys):
    assert NEEDED.people_needed(140, 140) == 1
    share = 0.025**0.1  # lower end for 10 of 10
    majority = {n: sum(math.comb(n, k) * share**k * (1 - share) ** (n - k)
                       for k in range(n // 2 + 1, n + 1)) for n in (15, 17)}  # fmt: skip
    assert majority[15] < 0.95 < majority[17]
    assert NEEDED.people_needed(10, 10) == 17
    NEEDED.main()
    assert capsys.readouterr().out in (ROOT / "docs" / "howto" / "people.md").read_text("utf-8")


def planted(true, fitted, kappa=(0.0, 0.0), off=1.0, misfit="", replaced=0.5):
    """A simulated person: true model, model that is fitted, and true and estimated parameters."""
    person = {"task": "two-armed-1", "trials": 100, "data": "complete", "true": true}
    sigma = epsilon = 0.03 + 0.1 * kappa[0]
    person |= {"true_sigma": sigma, "sigma": off * sigma}
    person |= {"true_epsilon": epsilon, "epsilon": epsilon}
    person |= {"true_kappa": kappa[0], "kappa": kappa[1]}
    person |= {f"{name}_{end}": person[name] + (0.05 if end == "high" else -0.05)
               for name in STUDY.PARAMETERS for end in ("low", "high")}  # fmt: skip
    person |= {f"bic_{model}": 10.0 * (model != fitted) for model in FIT.MODELS}
    return person | {"misfit": misfit, "replaced": replaced}


def test_tables_count_whom_the_fit_recovers():
    raw = pd.DataFrame([
        planted("best", "best"), planted("best", "informed", off=np.e),
        planted("informed", "informed", (0.4, 0.5)), planted("informed", "informed", (0.6, 0.7)),
        planted("informed", "informed", (0.3, 0.31)), planted("walk", "walk"),
        planted("walk", "walk"), planted("averages", "best", misfit="steps"),
        planted("averages", "best", replaced=0.0),
    ])  # fmt: skip
    people = STUDY.measure_people(raw)
    row = STUDY.tabulate(people).loc["two-armed-1 100 complete"]
    assert (row.people, row.informed) == (7, 3)
    assert (row.right, row.wrong, row.decided) == pytest.approx((6 / 7, 1 / 7, 1.0))
    assert (row.kappa_bias, row.kappa_cover) == pytest.approx((0.07, 1 / 3))
    confusion = STUDY.confuse(people)
    assert confusion.loc["two-armed-1 100 complete walk", "walk"] == 2
    assert confusion.loc["two-armed-1 100 complete best"].to_list() == [1, 1, 0, 0, 0, 0]
    answers = STUDY.answer(people)
    assert answers.loc["complete two averages", "none"] == 1
    assert answers.loc["complete two averages nothing", "best"] == 1
    assert answers.to_numpy().sum() == len(raw)
    outliers = STUDY.outliers(people).loc["complete"]
    assert (outliers.people, outliers.sigma_bias) == pytest.approx((5, 0.2))


def test_a_cell_of_the_recovery_has_a_row_for_each_person(monkeypatch):
    monkeypatch.setattr(PROTOCOLS, "PEOPLE", ("best", "walk"))
    people = STUDY.measure_people(PROTOCOLS.recover(("ascending", 30, "lossy", 0)))
    assert people.columns[: len(PROTOCOLS.COLUMNS)].to_list() == PROTOCOLS.COLUMNS
    assert people.true.to_list() == people.model.to_list() == ["best", "walk"]
    assert (people.misfit == "").all()

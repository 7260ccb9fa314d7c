"""The rules of study people on planted data, its refusals, and its table from made-up files."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from tests.support.processes import ROOT, programs

RULES, MAKE_TABLE = programs("people", "rules", "make_table")
FOLDER = ROOT / "studies" / "people"
TARGETS = (1, 9, 11)


def noise(rng, *shape, carried):
    """Noise of 0.05 rad at start, end and next posture, of which a share is carried on."""
    fresh = 0.05 * rng.normal(size=(*shape, 3, 4))
    for k in (1, 2):
        fresh[..., k, :] = (
            carried * fresh[..., k - 1, :] + (1 - carried**2) ** 0.5 * (fresh[..., k, :])
        )
    return fresh


def directions(rng, *shape):
    vectors = rng.normal(size=(*shape, 4))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def planted(rng, studies, lean=0.0, drift=0.0, shift=0.0, people=7, repeats=3, carried=0.7):
    """Contexts of studies, each with targets and people of its own: a way of 0.6 rad for each
    target; ``drift``: SD of an offset of each block at the start, which is carried on;
    ``shift``: length of an offset of the end posture alone, in a random direction, which is carried
    on to the next posture."""
    contexts = {}
    for target in range(studies * len(TARGETS)):
        way, base = 0.6 * directions(rng), rng.normal(size=(3, 4))
        ahead = np.array([way, 0 * way])  # of both contexts
        means = base + np.stack([0 * ahead, lean * ahead, ahead], axis=1)
        blocks = np.repeat(means[None], people, axis=0)  # people, contexts, 3, 4
        faded = np.array([1, carried, carried**2])[:, None]
        blocks += faded * drift * rng.normal(size=(people, 2, 1, 4))
        blocks[:, :, 1:] += faded[:2] * shift * directions(rng, people, 2, 1)
        runs = blocks[:, :, None] + noise(rng, people, 2, repeats, carried=carried)
        first = people * (target // len(TARGETS))
        contexts[target] = dict(enumerate(runs, first))
    return contexts


def values_of(contexts, people=7, **options):
    """The values of people, shape (studies, people)."""
    found = RULES.people(RULES.leans(contexts, **options))
    return found.more.to_numpy().reshape(-1, people)


def share_rejected(values):
    return np.mean([RULES.sign_flips(each) <= RULES.LEVEL for each in values])


def test_without_a_lean_the_test_keeps_its_level():
    """Level 6/128; of 80 studies at most 11.8 % (three standard errors). What a person carries on
    counts with n of the same person, and not with n of others."""
    contexts = planted(np.random.default_rng(7), 80, drift=0.1, shift=0.2)
    values = values_of(contexts)
    assert values.shape == (80, 7)
    assert abs(values.mean()) < 0.02
    assert share_rejected(values) < 0.118
    pairs = planted(np.random.default_rng(7), 60, shift=0.4, people=2)
    assert abs(values_of(pairs, people=2).mean()) < 0.1
    few = {target: contexts[target] for target in range(60)}
    own = values_of(few, own=True)
    assert own.mean() > 0.05
    assert share_rejected(own) > 0.118


def test_a_planted_lean_is_found():
    values = values_of(planted(np.random.default_rng(3), 30, lean=0.3))
    half = 2.447 * values.std(axis=1, ddof=1) / np.sqrt(7)  # t with 6 degrees of freedom
    assert 0.28 < values.mean() < 0.31
    assert np.mean(np.abs(values.mean(axis=1) - 0.3) <= half) > 0.83  # 95 %, three standard errors
    assert share_rejected(values) == 1.0


def test_sign_flips_are_exact():
    assert RULES.sign_flips([1, 2, 3, 4, 5, 6, 7]) == 1 / 128
    assert RULES.sign_flips([-1, 2, 3, 4, 5, 6, 7]) == 2 / 128
    assert RULES.sign_flips([1, -1]) == 3 / 4
    assert RULES.power(0.0, 7, 4000) == pytest.approx(RULES.LEVEL, abs=0.012)
    assert RULES.power(RULES.smallest_shift(7), 7) >= 0.9


def stored():
    return pd.read_csv(FOLDER / "postures.csv", dtype={"context": str})


def written(table, folder):
    table.to_csv(folder / "postures.csv", index=False)
    return RULES.read(folder / "postures.csv")


def test_a_table_without_contexts_is_refused(tmp_path):
    table = stored()
    with pytest.raises(ValueError, match="column context is missing"):
        written(table.drop(columns="context"), tmp_path)
    with pytest.raises(ValueError, match="no person and target with two contexts"):
        RULES.contexts_of(written(table[table.context == "R"], tmp_path))
    with pytest.raises(ValueError, match="target 1 has the contexts"):
        RULES.contexts_of(written(table.replace({"target": {9: 1}}), tmp_path))
    table.loc[3, "end_2"] = np.nan
    with pytest.raises(ValueError, match="line 5 lacks"):
        written(table, tmp_path)


def test_a_person_with_a_single_repeat_is_left_out(tmp_path):
    table = stored()
    single = table[(table.person != 3) | (table.repeat == 1)]
    assert RULES.people(RULES.leans(RULES.contexts_of(written(single, tmp_path)))).shape[0] == 6
    with pytest.raises(ValueError, match="no person and target with two contexts"):
        RULES.contexts_of(written(table[table.repeat == 1], tmp_path))


def test_angles_in_another_unit_are_refused_or_seen(tmp_path):
    """In rad they are too near for a lean; in minutes of arc they are 60 times as far apart."""
    table = stored()
    angles = [name for name in table if name[-2] == "_"]
    small = table.assign(**np.radians(table[angles]))
    with pytest.raises(ValueError, match="degrees"):
        RULES.people(RULES.leans(RULES.contexts_of(written(small, tmp_path))))
    minutes = written(table.assign(**60 * table[angles]), tmp_path)
    large = RULES.people(RULES.leans(RULES.contexts_of(minutes)))
    usual = RULES.people(RULES.leans(RULES.contexts_of(written(table, tmp_path))))
    assert large.more.to_numpy() == pytest.approx(usual.more.to_numpy())
    assert large.apart.min() > 50 > 2 > usual.apart.max()


def test_copies_and_other_movements_do_not_count():
    table = RULES.read(FOLDER / "postures.csv")
    why = RULES.left_out(table)
    assert why.value_counts()[["copy", "other movement"]].tolist() == [7, 1]
    assert table.person[why != ""].isin([3, 4, 7]).all()


def test_the_table_comes_from_files(tmp_path):
    """Two repeats of four tasks, whose samples say where they are from; the second lacks task 1."""
    tasks = np.empty((2, 4), dtype=object)
    for repeat in range(2):
        for task in range(4):
            motions = np.empty((8, 1), dtype=object)
            for motion in range(8):
                first = 1000 * repeat + 100 * (task + 1) + 10 * (motion + 1)
                motions[motion, 0] = np.array([[first, 0, first + 1]] * 4, dtype=float)
            tasks[repeat, task] = motions
    tasks[1, 0] = np.empty((0, 0))
    for person in range(1, 8):
        savemat(tmp_path / f"S{person:02d}_trajs.mat", {"tasks": tasks})
    table = MAKE_TABLE.make_table(tmp_path).reset_index()
    of_first = table[table.person == 1].set_index(["target", "context", "repeat"])
    assert len(of_first) == 11
    assert of_first.loc[(9, "11", 2), ["start_1", "end_4", "next_2"]].tolist() == [1240, 1241, 1251]
    assert of_first.loc[(1, "R", 1), ["start_1", "end_4", "next_2"]].tolist() == [410, 411, 421]
    (tmp_path / "S05_trajs.mat").unlink()
    with pytest.raises(SystemExit, match=r"S05_trajs.mat does not exist\. Get .* from https://"):
        MAKE_TABLE.make_table(tmp_path)


def test_the_guide_has_the_plan_of_the_study():
    """How many repeats a lab needs is a table of the how-to, too."""
    page = (ROOT / "docs" / "howto" / "people.md").read_text("utf-8")
    rows = re.findall(r"\| (\d+) \| (\d+) % \| (\d+) \| (\d+) \|", page)
    plan = pd.read_csv(FOLDER / "plan.csv").assign(lean=lambda table: 100 * table.lean)
    assert np.array(rows, float) == pytest.approx(plan.to_numpy(float))


def reaches(rng, studies, share=0.0, block=0.0, shared=0.0, people=7, repeats=3):
    """Contexts of carry-over in studies with three contrasts, as of ``carried``.

    The starts of contexts A and B are 1 rad apart, and ends keep ``share`` of it. ``block`` is the
    SD of an offset of each block of a person that start and end share; the first two contrasts have
    the same block from rest. ``shared`` is the length of an offset of the end in context A along
    the way that all people share.
    """
    contexts, rest = {}, (0.0, 0.0)
    for contrast in range(3 * studies):
        way, start, end = directions(rng), rng.normal(size=4), rng.normal(size=4)
        means = np.array([[start + way, end + (share + shared) * way], [start, end]])
        offsets = block * rng.normal(size=(people, 2, 1, 4))
        noises = 0.05 * rng.normal(size=(people, 2, repeats, 2, 4))
        if contrast % 3 == 1:
            offsets[:, 1], noises[:, 1] = rest
        rest = offsets[:, 1], noises[:, 1]
        runs = (means + offsets)[:, :, None] + noises  # people, contexts, repeats, 2, 4
        both = np.stack([0 * runs[..., 0, :], runs[..., 1, :], runs[..., 0, :]], axis=-2)
        contexts[contrast] = dict(enumerate(both, people * (contrast // 3)))
    return contexts


def test_without_carry_over_the_test_keeps_its_level():
    """Level 6/128 with a shift between blocks that start and end share; of 400 studies at most
    7.9 % (three standard errors). With a person's own starts the shift is carry-over."""
    contexts = reaches(np.random.default_rng(17), 400, block=0.2)
    values = values_of(contexts)
    assert values.shape == (400, 7)
    assert abs(values.mean()) < 0.01
    assert 0.015 < share_rejected(values) < 0.079
    few = {contrast: contexts[contrast] for contrast in range(300)}
    own = values_of(few, own=True)
    assert own.mean() > values.mean() + 0.02
    assert share_rejected(own) > 0.079


def test_a_planted_carry_over_is_found_and_a_shift_that_all_share_as_well():
    """The second is a limit of the study: no sign flip sees it."""
    for planted_share in ({"share": 0.1}, {"shared": 0.1}):
        values = values_of(reaches(np.random.default_rng(5), 40, block=0.05, **planted_share))
        assert 0.09 < values.mean() < 0.11
        assert share_rejected(values) > 0.9


def test_power_follows_the_length_of_the_way():
    """Twice as far apart, the repeats hide half as much."""
    near = reaches(np.random.default_rng(9), 1, repeats=10)
    far = {
        name: {person: both * [[[1.0], [1.0], [2.0]]] for person, both in of_people.items()}
        for name, of_people in near.items()
    }
    first, second = (RULES.tabulate_carry_over_power(each) for each in (near, far))
    assert (second.length / first.length).to_numpy() == pytest.approx(2.0)
    assert (first.smallest / second.smallest).to_numpy() == pytest.approx(2.0)


def carry_over_by_hand(table, person, target, before):
    """Carry-over of a person at a target, in own code on a table in rad."""
    starts, ends = ([f"{kind}_{joint}" for joint in range(1, 5)] for kind in ("start", "end"))
    of_target = table[(table.target == target) & table.context.isin([before, "R"])]
    means = of_target.groupby(["person", "context"])[starts + ends].mean()
    apart = means.xs(before, level="context") - means.xs("R", level="context")
    way = apart.loc[apart.index != person, starts].mean().to_numpy()
    return apart.loc[person, ends].to_numpy() @ way / (way @ way)


def test_stored_carry_over_is_that_of_own_code():
    table = RULES.read(FOLDER / "carry_over_postures.csv")
    counted = table[RULES.left_out(table) == ""]
    made = pd.read_csv(FOLDER / "carry_over.csv")
    assert len(made) == 7 * 3
    for row in made.itertuples():
        target, _, before = row.contrast.split()
        expected = carry_over_by_hand(counted, row.person, int(target), before)
        assert row.carry_over == pytest.approx(expected, abs=1e-6)
    tests = pd.read_csv(FOLDER / "carry_over_tests.csv", index_col=0)
    values = made.groupby("person").carry_over.mean()
    assert tests.more["judged"] == pytest.approx(values.mean(), abs=1e-6)
    assert tests.p["judged"] == pytest.approx(RULES.sign_flips(values), abs=1e-6)


def test_starts_that_are_too_near_have_no_carry_over():
    contexts = reaches(np.random.default_rng(2), 1)
    for both in contexts[0].values():
        both[:, :, 2] *= 0.05
    rows = RULES.leans(contexts)
    assert rows.more.isna().groupby(rows.target).mean().to_dict() == {0: 1.0, 1: 0.0, 2: 0.0}
    assert (RULES.people(rows).targets == 2).all()


def test_the_joints_of_methods_stand_beside_people():
    """Means over tasks from the shipped runs, in own code: people's form has one start."""
    runs = pd.read_csv(FOLDER / "runs.csv.xz").query("method == 'dual-process/EC1'")
    joints = {kind: [f"{kind}_{joint}" for joint in range(1, 5)] for kind in ("at", "next")}
    leans = []
    for _, of_task in runs.groupby("task"):
        sides = []
        for even in (0, 1):
            p, n = (
                np.subtract(*(
                    of_task[of_task.context == context].iloc[parity::2][joints[kind]].mean()
                    for context in ("goal", "back")
                ))
                for kind, parity in (("at", even), ("next", 1 - even))
            )  # fmt: skip
            sides.append(p.to_numpy() @ n.to_numpy() / (n.to_numpy() @ n.to_numpy()))
        leans.append(np.mean(sides))
    results = pd.read_csv(FOLDER / "results.csv", index_col=0).loc["learner"]
    assert results["lean"] == pytest.approx(np.mean(leans), abs=1e-5)
    assert results["median"] == pytest.approx(np.median(leans), abs=1e-5)

"""Does practice on other tasks lengthen the horizon?

    coartic run studies/practice/suite.toml --method-file studies/practice/policy.py \\
        --family-file studies/practice/eight.v1.toml
    python studies/practice/study.py results/practice

writes results.csv, repeats.csv, claims.csv, figure.svg and the page, README.md; without a folder
figure and page, of the stored tables. Each of the 25 agents practises for half a minute, once.

The suite lets the planner plan three times, with numbers of postures (``nodes``) 1 % apart. Before
these repeats were run we expected that with all goals in view it is no longer worse than with four.
Time allowed repeats with four goals ahead and with all: the stored repeats.csv has these, the other
tables first plans. The stored again.csv has the claims of agents that practised later, on another
machine.
"""

import sys
from dataclasses import replace
from pathlib import Path

import pandas as pd
from scipy import stats

from coartic.analysis import all_of, figures, judge, load, mean, mean_beyond, means, write_study

WHOSE = {
    "practice/policy": "agents",
    "receding-horizon": "planner",
    "corrective-alone/given": "corrective process",
}
EARLY, LATER, ALL = 20_480, 81_920, 327_680
"""Trials of practice after which agents are tested: a sixteenth, a quarter, all."""
AHEAD = ["0", "1", "2", "3", "4"]
KEYS, NUMBERS = ["who", "practice", "ahead"], ["practice", "ahead", "agent"]
GAIN = 1.0
"""Points, set before the runs: by how much more agents should be behind the planner."""
UNLEARNED = 10.0
"""Points of the gap. Agents that end so far behind the planner with the same view where there is no
goal ahead have not learned the movement itself; then nothing follows from goals ahead."""
HOW = "one-tailed tests over random tasks (bootstrap) and over agents (Student): "


def measure_gaps(study):
    """Gaps to the best known run, as shares, a row for each run on a random task.

    ``who`` it is, after how many trials of ``practice``, how many goals ``ahead`` it sees.
    """
    runs = study.runs[study.runs.family.notna() & study.runs.gap.notna()]
    runs = runs.assign(who=runs.method.map(WHOSE), ahead=runs.ahead.fillna(runs.horizon))
    runs = pd.concat([runs[runs.who == who] for who in WHOSE.values()])
    return runs.fillna(dict.fromkeys(NUMBERS, 0)).astype(dict.fromkeys(NUMBERS, int))


def tabulate(gaps):
    """Gaps by practice and goals ahead, with the best and the worst agent.

    ``gain``: what the last goal in view gains a movement that has it, as G - ``ahead`` of G do.
    """
    tasks = gaps.groupby([*KEYS, "task", "goals"], sort=False).gap.mean().reset_index()
    shorter = tasks.assign(ahead=tasks.ahead + 1).drop(columns="goals")
    tasks = tasks.merge(shorter, "left", [*KEYS, "task"], suffixes=("", "_before"))
    share = (tasks.goals - tasks.ahead) / tasks.goals
    table = means(tasks.assign(gain=(tasks.gap_before - tasks.gap) / share), KEYS, ["gap", "gain"])
    agents = gaps[gaps.who == "agents"].groupby([*KEYS, "agent"]).gap.mean().groupby(KEYS)
    agents = agents.agg(best_agent="min", worst_agent="max").reset_index()
    table = table.merge(agents, "left", KEYS).rename(columns={"rows": "tasks"})
    table.insert(2, "h", table.pop("ahead").map(lambda h: str(h) if h < 5 else "all"))
    trials = table.practice.map(" {}".format).where(table.who == "agents", "")
    table.index = (table.who + trials + " h=" + table.h).rename("row")
    gain = ["gain", "gain_low", "gain_high"]
    return table[[*table.columns.drop(gain), *gain]]


def why_silent(points):
    """Why nothing follows from the agents; empty where they have learned.

    They have where without a goal ahead they come near enough to the planner, one goal ahead gains,
    and each is better than the corrective process.
    """
    none, after = points["agents", ALL, 0], points["agents", ALL]
    behind = mean(none.sub(points["planner", 0, 0, 0], axis=0).mean(axis=1))
    gained = mean((none - after[1]).mean(axis=1))
    worst, before = after.mean().max(), points["corrective process", 0, 0, 0].mean()
    if not behind.high < UNLEARNED:
        return f"without a goal ahead they end {behind.value:.1f} points behind"
    if not gained.low > 0:
        return f"a goal ahead gains {gained.value:.1f} points"
    if not worst < before:
        return f"one ends {worst:.1f} points from the best, {before:.1f} before"
    return ""


def beyond(bound, parts):
    """Finding whether the means of all parts are above a bound, over tasks and over agents.

    ``parts`` are values with a row for each task and a column for each agent, by sentences.
    """
    seen, against = [], []
    for sentence, values in parts.items():
        values = values.dropna()
        finding = mean_beyond(sentence, values.mean(axis=1), bound)
        agents = values.mean()
        over_agents = [
            replace(mean(agents - bound), p=stats.ttest_1samp(agents, bound, alternative=side)[1])
            for side in ("greater", "less")
        ]
        span = f" (agents {agents.min():.2f} to {agents.max():.2f})".replace("-", "−")
        evidence = finding.evidence.rpartition(" (")[0] + span
        tests = (*finding.tests, over_agents[0])
        seen.append(replace(finding, evidence=evidence, tests=tests))
        against += [*finding.against, over_agents[1]]
    return replace(all_of(*seen), against=tuple(against))


def judge_claims(gaps):
    """The claims, as they were registered before the random tasks were run."""
    gaps = gaps[gaps.split != "development"]
    points = 100 * gaps.pivot_table("gap", "task", [*KEYS, "agent"])
    early, later, after = (points["agents", trials] for trials in (EARLY, LATER, ALL))
    behind = [after[h].sub(points["planner", 0, h, 0], axis=0) for h in range(5)]
    claims = {
        "larger-views-gain-more-by-practice": (
            "From a sixteenth of practice on, agents gain more with two goals ahead than with "
            "none.",
            f"from {EARLY:,} trials on the gap falls by more with two goals ahead than with none",
            beyond(0, {"practice gains {} points more with two goals ahead than with none":
                       (early[2] - after[2]) - (early[0] - after[0])}),
        ),
        "larger-views-gain-longer": (
            "In the last three quarters of practice, agents gain more with four goals ahead than "
            "with none.",
            f"from {LATER:,} trials on the gap falls by more with four goals ahead than with none",
            beyond(0, {"the last three quarters gain {} points more with four goals ahead than "
                       "with none": (later[4] - after[4]) - (later[0] - after[0])}),
        ),
        "practice-lengthens-the-horizon": (
            "The second, third and fourth goal ahead together gain more after all practice than "
            "after a sixteenth.",
            "from one goal ahead to four the gap falls by more after all practice than after "
            f"{EARLY:,} trials",
            beyond(0, {"the second to fourth goals ahead gain {} points more after practice":
                       (after[1] - after[4]) - (early[1] - early[4])}),
        ),
        "first-goal-ahead-gains-agents-most": (
            "After all practice, goals beyond the first ahead still help agents, but gain less "
            "together than the first.",
            "after all practice the gap falls from one goal ahead to four, and by more from none "
            "to one",
            beyond(0, {
                "the second to fourth goals ahead gain {} points together": after[1] - after[4],
                "the first {} more": (after[0] - after[1]) - (after[1] - after[4]),
            }),
        ),
        "agents-behind-planner": (
            "With two, three and four goals ahead, agents end more than 1 % behind the planner "
            "with the same view.",
            "with two, three and four goals ahead the gap of agents after all practice is higher "
            f"by more than {GAIN:g} points than that of the planner that sees as much",
            beyond(GAIN, {
                "with two goals ahead agents are {} points behind": behind[2],
                "with three {}": behind[3],
                "four {}": behind[4],
            }),
        ),
    }  # fmt: skip
    if silent := why_silent(points):
        no = {"holds": None, "evidence": f"the agents have not learned: {silent}"}
        claims = {
            name: (statement, test, replace(finding, **no, tests=(), against=None))
            for name, (statement, test, finding) in claims.items()
        }
    return judge({name: (claim[0], HOW + claim[1], claim[2]) for name, claim in claims.items()})


@figures.styled
def draw(table):
    """a: gap of agents by practice, from the corrective process on. b: beside the planner.

    Dots in b are the best and the worst agent.
    """
    figure, (left, right) = figures.panels((1, 2), (figures.TWO, 2.8), sharey=True)
    counts, views = [0, EARLY, LATER, ALL], [*AHEAD, "all"]
    before = table[table.who == "corrective process"]
    rows = pd.concat([*(before.assign(h=h) for h in AHEAD), table[table.who == "agents"]])
    rows = rows.assign(place=rows.practice.map(counts.index)).sort_values(["h", "practice"])
    figures.means(left, rows, x="place", y="gap", by="h", scale=100, shift=0.06, bars=0.9)
    last = table[(table.practice == ALL) | (table.who == "planner")]
    last = last.assign(place=last.h.astype(str).map(views.index))
    for who, color in (("agents", figures.PALETTE[0]), ("planner", figures.PALETTE[3])):
        rows = last[last.who == who]
        figures.means(right, rows, x="place", y="gap", scale=100, bars=0.9, color=color, label=who)
        ends = 100 * rows[["best_agent", "worst_agent"]]
        right.plot(rows.place + 0.15, ends, ".", color=color, markersize=3)
    left.set_xticks(range(4), [f"{count:,}".replace(",", " ") for count in counts])
    left.set_xlabel("trials of practice")
    left.set_ylabel("gap (%)")
    left.set_ylim(bottom=0)
    left.legend(title="goals ahead", loc="lower left", ncols=2)
    right.set_xticks(range(6), views)
    right.set_xlabel("goals ahead")
    right.legend(loc="lower left")
    figures.letters((left, right))
    return figure


def repeat_plans(study):
    """Ticks of the planner with four goals ahead and with all, by task and number of postures."""
    plans = study.runs[(study.runs.method == "receding-horizon") & study.runs.horizon.isin([4, 7])]
    ticks = -plans.pivot_table("reward", ["task", "nodes"], "horizon")
    ticks = ticks.reindex(columns=[4, 7]).dropna().astype(int)
    return ticks.set_axis(["four", "all"], axis=1).reset_index("nodes")


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    gaps = measure_gaps(study)
    return {
        "results": tabulate(gaps),
        "repeats": repeat_plans(study),
        "claims": judge_claims(gaps),
    }


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)

"""A good task file, and task files with one thing wrong each."""

GOOD = """
name = "mine"
goals = [[5.0, 1.0], [5.0, 2.0]]
initial_hands = "RR"

[start]
base = [0.0, 0.0]
left = [0.0, 0.0, 0.0, 0.0]
right = [0.0, 0.0, 0.0, 0.0]
"""


def _task(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


TASKS = {
    "nan": (_task("[5.0, 2.0]", "[nan, 2.0]"), "goals[1][0] is nan; it must be a finite number"),
    "infinite": (_task("base = [0.0,", "base = [inf,"), "start.base[0] is inf"),
    "no goal": (_task("[[5.0, 1.0], [5.0, 2.0]]", "[]"), "goals is empty"),
    "out of reach": (
        'locked_base = ["x"]\n' + _task("[5.0, 2.0]", "[5.0, 20.0]").replace('["x"]', '["x", "y"]'),
        "out of reach",
    ),
    "unknown key": ("goal = 1\n" + GOOD, "goal"),
    "hands for other goals": (_task('"RR"', '"RRR"'), "3 hands for 2 goals"),
    "a hand that is none": (_task('"RR"', '"RX"'), "initial_hands"),
    "joints for another arm": (
        _task("right = [0.0, 0.0, 0.0, 0.0]", "right = [0.0, 0.0]"),
        "start.right",
    ),
    "no start": (GOOD.partition("[start]")[0], "start"),
    "a name that names no file": (_task('"mine"', '"my task"'), "name"),
    "title in two lines": ('title = "a\\nb"' + GOOD, "title should be one line of printable text"),
    "no TOML": (_task("goals = [[", "goals = [[["), "line"),
}
"""Task files by what is wrong, with words of the complaint."""

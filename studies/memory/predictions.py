"""The predictions, with their bounds and tests."""

from dataclasses import replace

from cells import MEASURES, groups_of
from scales import BOUNDS, KEEPS, MOST, Scale

from coartic.analysis import all_of, judge, mean_beyond


def judge_claims(cells):
    """The predictions, as they were registered before any test instance was run."""
    scales = {(measure, keep): Scale(cells, measure, keep, groups_of(cells, measure)["all"])
              for measure in MEASURES for keep in KEEPS}  # fmt: skip
    signatures = [measure for measure in MEASURES if measure != "gain"]
    words = {measure: label.partition(" (")[0] for measure, label in MEASURES.items()}

    def rises(keep):
        return all_of(*(
            mean_beyond(f"{words[measure]} by {{}} for each factor of ten", scale.slopes())
            for (measure, kept), scale in scales.items() if kept == keep
        ))  # fmt: skip

    def within(values, measure):
        bound = BOUNDS[measure]
        above = mean_beyond(f"{words[measure]} {{}}", values, -bound)
        both = all_of(above, mean_beyond("{}", values, bound, "less"))
        return replace(both, evidence=above.evidence)

    def same(first, second, measures, which=scales):
        return all_of(*(
            within(which[measure, "postures"].more(first, second), measure)
            for measure in measures
        ))  # fmt: skip

    families = [name for name in groups_of(cells, "gain")["all"] if name != "long"]
    but_long = {("gain", "postures"): Scale(cells, "gain", "postures", families)}
    test = "one-tailed bootstrap tests over random tasks, family as a factor"
    bounds = (
        f"{test}: within ± {BOUNDS['gain']:g} ticks (gain), ± {BOUNDS['arm']:g} ticks and "
        f"± {BOUNDS['other arm']:g}"
    )
    targets = {measure: scales[measure, "targets"] for measure in MEASURES}
    both = {measure: targets[measure].by_task(
        (targets[measure].table[MOST] - scales[measure, "postures"].table[MOST]).dropna()
    ) for measure in MEASURES}  # fmt: skip
    return judge({
        "rises-with-postures": (
            "With postures kept, gain and each signature rise with the number of parts.",
            f"{test}: slope by log r above 0",
            rises("postures"),
        ),
        "rises-with-targets": (
            "With targets kept, gain and each signature rise with the number of parts.",
            f"{test}: slope by log r above 0",
            rises("targets"),
        ),
        "level-from-a-hundred": (
            "With postures kept, a hundred parts gain and show what a thousand do.",
            bounds,
            same(100, MOST, MEASURES),
        ),
        "learner-at-the-level": (
            "By each signature the learner is at the level of a thousand parts with postures kept.",
            bounds,
            same("learner", MOST, signatures),
        ),
        "learner-gains-the-level": (
            "In all families but long the learner gains what a thousand parts with postures kept "
            "do.",
            bounds,
            same("learner", MOST, ["gain"], but_long),
        ),
        "targets-gain-more": (
            f"With targets kept a thousand parts gain over {BOUNDS['gain']:g} ticks more than with "
            "postures.",
            f"{test}: above {BOUNDS['gain']:g} ticks",
            mean_beyond("gain {} ticks", both["gain"], BOUNDS["gain"]),
        ),
        "targets-slow-more": (
            f"With targets kept a thousand parts slow the first movement over {BOUNDS['first']:g} "
            "ticks more than with postures.",
            f"{test}: above {BOUNDS['first']:g} ticks",
            mean_beyond("first movement slower by {} ticks", both["first"], BOUNDS["first"]),
        ),
        "targets-pass-the-learner": (
            "With targets kept thirty parts gain more than the learner.",
            f"{test}: above 0",
            mean_beyond("gain {} ticks", targets["gain"].more(30, "learner")),
        ),
        "one-place": (
            "With targets kept the learner lies between ten and a hundred parts, by gain and by "
            "each signature.",
            f"{test}: above ten, below a hundred",
            all_of(*(
                finding for measure in MEASURES for finding in (
                    mean_beyond(f"{words[measure]} {{}} above ten",
                                targets[measure].more("learner", 10)),
                    mean_beyond("{} below a hundred", targets[measure].more(100, "learner")),
                )
            )),
        ),
    })  # fmt: skip

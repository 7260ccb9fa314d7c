"""The predictions, with their bounds and tests."""

import tomllib
from dataclasses import replace
from pathlib import Path

from cells import MEASURES, groups_of
from scales import BOUNDS, KEEPS, MOST, Scale

from coartic.analysis import all_of, judge, mean_beyond

CLAIMS = tomllib.loads(Path(__file__).with_name("claims.toml").read_text("utf-8"))


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
    targets = {measure: scales[measure, "targets"] for measure in MEASURES}
    both = {measure: targets[measure].by_task(
        (targets[measure].table[MOST] - scales[measure, "postures"].table[MOST]).dropna()
    ) for measure in MEASURES}  # fmt: skip
    findings = {
        "rises-with-postures": rises("postures"),
        "rises-with-targets": rises("targets"),
        "level-from-a-hundred": same(100, MOST, MEASURES),
        "learner-at-the-level": same("learner", MOST, signatures),
        "learner-gains-the-level": same("learner", MOST, ["gain"], but_long),
        "targets-gain-more": mean_beyond("gain {} ticks", both["gain"], BOUNDS["gain"]),
        "targets-slow-more": mean_beyond(
            "first movement slower by {} ticks", both["first"], BOUNDS["first"]
        ),
        "targets-pass-the-learner": mean_beyond(
            "gain {} ticks", targets["gain"].more(30, "learner")
        ),
        "one-place": all_of(*(
            finding for measure in MEASURES for finding in (
                mean_beyond(f"{words[measure]} {{}} above ten",
                            targets[measure].more("learner", 10)),
                mean_beyond("{} below a hundred", targets[measure].more(100, "learner")),
            )
        )),
    }  # fmt: skip
    return judge({name: (*CLAIMS[name].values(), found) for name, found in findings.items()})

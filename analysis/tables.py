"""The tables of the report, each a function of a study: ``tables.ranking(study)``."""

from collections.abc import Callable, Mapping

import pandas as pd

from coartic.analysis.study import Study
from coartic.analysis.topics.coarticulation.tables import contexts, signatures
from coartic.analysis.topics.costs import runtimes
from coartic.analysis.topics.families.random_tasks import exploration, family_gaps, family_signs
from coartic.analysis.topics.learning import learning
from coartic.analysis.topics.paper.hands import hands
from coartic.analysis.topics.paper.rewards import published
from coartic.analysis.topics.paper.verdicts import claims
from coartic.analysis.topics.ranking import against_learner, ranking
from coartic.analysis.topics.scores import methods
from coartic.analysis.topics.settings import settings
from coartic.analysis.topics.tasks import tasks

TABLES: Mapping[str, Callable[[Study], pd.DataFrame]] = {
    "settings": settings,
    "contexts": contexts,
    "published": published,
    "claims": claims,
    "ranking": ranking,
    "against-learner": against_learner,
    "runtimes": runtimes,
    "hands": hands,
    "learning": learning,
    "signatures": signatures,
    "family-gaps": family_gaps,
    "exploration": exploration,
    "family-signs": family_signs,
    "tasks": tasks,
    "methods": methods,
}
"""Every table by its id. One that no section of the page shows is a CSV file beside it."""

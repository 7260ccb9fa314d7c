"""The sampler TPE of Optuna."""

import optuna

from coartic import Optimiser

optuna.logging.set_verbosity(optuna.logging.WARNING)


class TPE(Optimiser):
    name = "tpe"
    title = "TPE (Optuna)"
    citation = "J. Bergstra et al. (2011). Algorithms for hyper-parameter optimization. NeurIPS."

    def optimise(self, objective, rng):
        study = optuna.create_study(
            sampler=optuna.samplers.TPESampler(seed=int(rng.integers(2**31)))
        )
        study.enqueue_trial({f"x{i}": x for i, x in enumerate(objective.x0)})
        while True:  # until the objective ends it
            trial = study.ask()
            bounds = enumerate(objective.bounds)
            study.tell(trial, objective([trial.suggest_float(f"x{i}", *b) for i, b in bounds]))

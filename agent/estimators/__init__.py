"""Policy gradient estimators.  Each file holds one: its settings and its loss, nothing else."""

from agent.estimators.exact import Exact
from agent.estimators.reinforce import Reinforce

Estimator = Exact | Reinforce

__all__ = ["Estimator", "Exact", "Reinforce"]

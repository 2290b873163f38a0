"""Policy gradient estimators.  Each file holds one: its settings and its equation, nothing else.

What those that fly episodes have in common stands in :mod:`agent.learning.estimators.sampling`.

An estimate is a mean over episodes of ``sum_t w_t grad log pi(a_t | s_t)``; estimators differ in
the weight ``w_t`` that they give to a step:

==============  ==========================================  ========================================
estimator       weight                                      source
==============  ==========================================  ========================================
``reinforce``   ``G_t``, the return from t on               Williams 1992
``a2c``         ``A_t``, from a learned critic              Mnih et al. 2016, Schulman et al. 2016
``ppo``         ``rho_t A_t`` where it is not clipped       Schulman et al. 2017
==============  ==========================================  ========================================

:class:`~agent.learning.estimators.exact.Exact` samples nothing and asks the task's model.
``weight`` is arithmetic alone, so it takes NumPy arrays and torch tensors alike; with tensors the
loss whose gradient this is reads ``-(estimator.weight(rho.detach(), gain) * log_pi).sum()``.
"""

from agent.learning.estimators.a2c import A2C
from agent.learning.estimators.exact import Exact
from agent.learning.estimators.ppo import PPO
from agent.learning.estimators.reinforce import Reinforce

ActorCritic = A2C | PPO
Sampled = Reinforce | ActorCritic
Estimator = Exact | Sampled

__all__ = ["A2C", "PPO", "ActorCritic", "Estimator", "Exact", "Reinforce", "Sampled"]

"""Which learner a swarm file asks for.

Torch is imported for networks only: an agent with a table stays small.
"""

from agent.config.experiment import SwarmFile
from agent.learning.learner import Learner
from agent.learning.moments import MixedMoments
from agent.learning.policies import Tabular
from agent.learning.tabular import TabularLearner


def build_learner(config: SwarmFile, agent: str) -> Learner:
    """The learner of one agent; whoever builds it closes it.

    Raises:
        TaskError: the agent's task cannot be built or does not fit the policy.
    """
    learner: Learner
    if isinstance(config.policy, Tabular):
        learner = TabularLearner(config, agent)
    else:
        from agent.learning.neural import NeuralLearner  # noqa: PLC0415

        learner = NeuralLearner(config, agent)
    return MixedMoments(learner) if config.mixes_moments else learner

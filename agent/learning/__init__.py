"""How one agent learns: networks, estimators, rollouts, optimizers."""

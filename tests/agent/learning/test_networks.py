"""Policy networks: their size, what they see, what fits."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from torch import nn

from agent.errors import TaskError
from agent.learning.networks import Pictures, build, c3f2
from agent.learning.policies import C3F2, Network, Neural

DRONE = spaces.Box(0, 255, (103, 103, 3), np.uint8)
EXACT = C3F2(compute="float32")


def size(policy: Neural, space: spaces.Box, actions: int, critic: bool = False) -> int:
    network = build(policy, space, spaces.Discrete(actions), critic, seed=0)
    return sum(p.numel() for p in network.parameters())


def test_c3f2_has_the_papers_number_of_parameters() -> None:
    assert size(C3F2(), DRONE, 25) == 1_280_025


def test_a_critic_shares_the_trunk() -> None:
    assert size(C3F2(), DRONE, 25, critic=True) == 1_280_025 + 1_025


def test_relu_may_stand_after_pooling() -> None:
    trunk = c3f2()
    before = nn.Sequential(*[trunk[i] for i in (0, 2, 1, 3, 5, 4, 6, 7, 8, 9, 10)])
    pictures = torch.randn(2, 3, 103, 103)
    assert torch.equal(trunk(pictures), before(pictures))


def test_pictures_are_standardised_one_by_one() -> None:
    pictures = torch.randint(0, 255, (3, 20, 30, 3), dtype=torch.uint8)
    pictures[2] = 7
    seen = Pictures(torch.float32)(pictures)
    assert seen.shape == (3, 3, 20, 30)
    assert torch.allclose(seen[:2].mean((1, 2, 3)), torch.zeros(2), atol=1e-5)
    assert torch.allclose(seen[:2].var((1, 2, 3), correction=0), torch.ones(2), atol=1e-4)
    assert torch.equal(seen[2], torch.zeros(3, 20, 30))


def test_the_first_policy_is_nearly_uniform() -> None:
    network = build(EXACT, DRONE, spaces.Discrete(25), critic=False, seed=3)
    logits, values = network(torch.randint(0, 255, (4, 103, 103, 3), dtype=torch.uint8))
    assert torch.softmax(logits, -1).max() < 0.06
    assert torch.equal(values, torch.zeros(4))


def test_the_same_seed_draws_the_same_network() -> None:
    def weights(seed: int) -> torch.Tensor:
        network = build(EXACT, DRONE, spaces.Discrete(25), critic=True, seed=seed)
        return torch.cat([p.flatten() for p in network.parameters()])

    assert torch.equal(weights(1), weights(1))
    assert not torch.equal(weights(1), weights(2))


@pytest.mark.parametrize(
    ("space", "shape"),
    [
        (spaces.Box(-1, 1, (4,), np.float32), (5, 4)),
        (spaces.Box(-1, 1, (2, 3), np.float64), (5, 2, 3)),
        (spaces.Box(0, 255, (84, 84, 3), np.uint8), (5, 84, 84, 3)),
        (spaces.Box(0, 255, (16, 16), np.uint8), (5, 16, 16)),
    ],
)
def test_there_is_a_network_for_any_box(space: spaces.Box, shape: tuple[int, ...]) -> None:
    network = build(Network(), space, spaces.Discrete(3), critic=True, seed=0)
    seen = np.stack([space.sample() for _ in range(shape[0])])
    logits, values = network(torch.from_numpy(seen))
    assert logits.shape == (shape[0], 3)
    assert values.shape == (shape[0],)


@pytest.mark.parametrize(
    ("policy", "seen", "acts", "words"),
    [
        (Network(), spaces.Discrete(4), spaces.Discrete(2), "expected a Box"),
        (Network(), DRONE, spaces.Box(-1, 1, (2,)), "expected a Discrete"),
        (C3F2(), spaces.Box(0, 255, (84, 84, 3), np.uint8), spaces.Discrete(2), "(103, 103, 3)"),
    ],
)
def test_what_does_not_fit_is_named(
    policy: Neural, seen: spaces.Space[object], acts: spaces.Space[object], words: str
) -> None:
    with pytest.raises(TaskError, match=words.replace("(", r"\(").replace(")", r"\)")):
        build(policy, seen, acts, critic=False, seed=0)

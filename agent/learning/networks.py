"""Policy networks: from observations, as the environment gives them, to logits and a value.

Interface: :func:`build`.  A network takes its observations raw: pictures as (N, H, W, C) bytes,
which it brings to mean 0 and deviation 1 each, so that whoever exports a network exports all of it.
The policy's head is drawn a hundredth of the usual size: at first all actions are about as likely.

ReLU stands after max-pooling.  Both orders give the same function, for the maximum of rectified
values is the rectified maximum, and this one rectifies and differentiates a ninth of the values.
"""

from collections.abc import Sequence
from typing import cast

import torch
from gymnasium import spaces
from msgspec.structs import replace
from torch import Tensor, nn

from agent.errors import TaskError
from agent.learning.policies import C3F2, Neural

CHANNELS = 4  # at most, of one picture; that many rows are none
WIDE = 36  # pixels; the smallest picture that the strided convolutions can take


class Pictures(nn.Module):
    """(N, H, W, C) or (N, H, W) bytes -> (N, C, H, W), every picture standardised."""

    def __init__(self, dtype: torch.dtype) -> None:
        super().__init__()
        self.dtype = dtype

    def forward(self, pictures: Tensor) -> Tensor:
        if pictures.ndim == 3:
            pictures = pictures.unsqueeze(-1)
        flat = pictures.flatten(1).float()
        mean = flat.mean(1, keepdim=True)
        power = torch.linalg.vector_norm(flat, dim=1, keepdim=True).square() / flat.shape[1]
        deviation = (power - mean.square()).clamp_min(1.0).sqrt()  # a blank picture stays blank
        even = flat.sub_(mean).div_(deviation).to(self.dtype)
        return even.view(pictures.shape).permute(0, 3, 1, 2)


class Vectors(nn.Module):
    """(N, ...) numbers -> (N, d)."""

    def __init__(self, dtype: torch.dtype) -> None:
        super().__init__()
        self.dtype = dtype

    def forward(self, numbers: Tensor) -> Tensor:
        flat = numbers.flatten(1) if numbers.ndim > 1 else numbers.unsqueeze(1)
        return flat.to(self.dtype)


class PolicyNetwork(nn.Module):
    """A trunk with a head for the policy and, for actor-critics, one for the value.

    Args:
        eyes: from raw observations to the trunk's input.
        trunk: from there to features (N, d).
        features: d.
        actions: number of actions.
        critic: whether there is a value head; its parameters are the last.
    """

    def __init__(
        self, eyes: nn.Module, trunk: nn.Module, features: int, actions: int, critic: bool
    ) -> None:
        super().__init__()
        self.eyes, self.trunk = eyes, trunk
        self.policy = nn.Linear(features, actions)
        self.value = nn.Linear(features, 1) if critic else None

    def forward(self, observations: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, A) and values (N,), both float32; zeros where there is no critic."""
        features = self.trunk(self.eyes(observations))
        logits = self.policy(features).float()
        if self.value is None:
            return logits, torch.zeros_like(logits[:, 0])
        return logits, self.value(features).float().squeeze(-1)


def c3f2() -> nn.Sequential:
    """Trunk of C3F2: (N, 3, 103, 103) -> (N, 1024)."""
    return nn.Sequential(
        nn.Conv2d(3, 96, 7, stride=4),
        nn.MaxPool2d(3, stride=2),
        nn.ReLU(),
        nn.Conv2d(96, 64, 5),
        nn.MaxPool2d(2, stride=2),
        nn.ReLU(),
        nn.Conv2d(64, 64, 3, padding=1),
        nn.ReLU(),
        nn.Flatten(),
        nn.Linear(1024, 1024),
        nn.ReLU(),
    )


def convolutions(channels: int, small: bool) -> nn.Sequential:
    """Three convolutions (Mnih et al. 2015), unstrided ones for small pictures."""
    sizes = ((32, 3, 1), (64, 3, 2), (64, 3, 1)) if small else ((32, 8, 4), (64, 4, 2), (64, 3, 1))
    layers: list[nn.Module] = []
    for width, kernel, stride in sizes:
        layers += [nn.Conv2d(channels, width, kernel, stride, padding=1 if small else 0), nn.ReLU()]
        channels = width
    return nn.Sequential(*layers, nn.Flatten())


def perceptron(inputs: int, hidden: Sequence[int], activation: type[nn.Module]) -> nn.Sequential:
    """Fully connected layers."""
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [nn.Linear(inputs, width), activation()]
        inputs = width
    return nn.Sequential(*layers)


def is_picture(space: spaces.Space[object]) -> bool:
    """Whether observations are pictures: bytes in two or three dimensions, channels last."""
    return isinstance(space, spaces.Box) and space.dtype == "uint8" and len(space.shape) in {2, 3}


def compute_type(policy: Neural, pictures: bool) -> torch.dtype:
    """Type of the arithmetic."""
    if policy.compute != "auto":
        return torch.bfloat16 if policy.compute == "bfloat16" else torch.float32
    fast = policy.device == "cuda" or torch.cpu._is_avx512_bf16_supported()
    return torch.bfloat16 if pictures and fast else torch.float32


def available(policy: Neural) -> Neural:
    """The policy, on the CPU where this machine has no other device: for who only acts."""
    if policy.device == "cuda" and not torch.cuda.is_available():
        return replace(policy, device="cpu")
    return policy


def build(
    policy: Neural,
    observations: spaces.Space[object],
    actions: spaces.Space[object],
    critic: bool,
    seed: int,
) -> PolicyNetwork:
    """The network of a policy for a task, the same for the same seed.

    Raises:
        TaskError: the spaces do not fit.
    """
    if not isinstance(actions, spaces.Discrete):
        raise TaskError(f"actions are {actions}: expected a Discrete space")
    if not isinstance(observations, spaces.Box) or 0 in observations.shape:
        raise TaskError(
            f"observations are {observations}: expected a Box space "
            "(gymnasium.wrappers.FlattenObservation makes one of most others)"
        )
    pictures = is_picture(observations)
    if pictures and observations.shape[0] <= CHANNELS < observations.shape[-1]:
        raise TaskError(
            f"observations are pictures of {observations.shape}: expected channels last, "
            f"{(*observations.shape[1:], observations.shape[0])}"
        )
    dtype = compute_type(policy, pictures)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = _assemble(policy, observations, int(actions.n), critic, dtype)
        _draw(network)
    network = network.to(dtype=dtype, device=policy.device)
    for module in network.modules():
        if isinstance(module, nn.Conv2d):  # the layout that the kernels like best
            weight = module.weight.data.contiguous(memory_format=torch.channels_last)
            module.weight.data = weight
    return network


def _assemble(
    policy: Neural, space: spaces.Box, actions: int, critic: bool, dtype: torch.dtype
) -> PolicyNetwork:
    if isinstance(policy, C3F2):
        if not is_picture(space) or space.shape != (103, 103, 3):
            raise TaskError(
                f'policy.kind = "c3f2" sees {space.shape} {space.dtype}: '
                "expected pictures of (103, 103, 3) uint8"
            )
        return PolicyNetwork(Pictures(dtype), c3f2(), 1024, actions, critic)
    if not is_picture(space):
        inputs = int(torch.tensor(space.shape).prod())
        trunk = perceptron(inputs, policy.hidden, nn.Tanh)
        return PolicyNetwork(Vectors(dtype), trunk, (inputs, *policy.hidden)[-1], actions, critic)
    eyes = Pictures(torch.float32)
    channels = 1 if len(space.shape) == 2 else space.shape[2]
    seeing = convolutions(channels, small=min(space.shape[:2]) < WIDE)
    with torch.no_grad():
        inputs = seeing(eyes(torch.zeros(1, *space.shape))).shape[1]
    trunk = nn.Sequential(*seeing, *perceptron(inputs, policy.hidden, nn.ReLU))
    eyes.dtype = dtype
    return PolicyNetwork(eyes, trunk, (inputs, *policy.hidden)[-1], actions, critic)


def _draw(network: PolicyNetwork) -> None:
    """Orthogonal weights, zero biases: usual for actor-critics (Andrychowicz et al. 2021)."""
    for module in network.modules():
        if isinstance(module, nn.Linear | nn.Conv2d):
            gain = 2**0.5
            if module is network.policy:
                gain = 0.01
            elif module is network.value:
                gain = 1.0
            nn.init.orthogonal_(module.weight, gain)
            nn.init.zeros_(cast(Tensor, module.bias))

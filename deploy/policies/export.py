"""A learned policy as an ONNX file, for whoever flies without us.

Input ``observations``: (N, ...) raw, as the environment gives them: pictures are (N, H, W, C)
bytes and are standardised inside.  Output ``logits``: (N, A) float32; the greedy action is their
argmax.  The arithmetic is float32, whatever the policy was trained with.
"""

import logging
import warnings
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from agent.learning.pilot import Pilot
from swarm.errors import ConfigError


class _Logits(nn.Module):
    """The policy's head alone."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self._network = network

    def forward(self, observations: Tensor) -> Tensor:
        logits: Tensor = self._network(observations)[0]
        return logits


def write_onnx(pilot: Pilot, path: Path) -> None:
    """Write ``path``.

    Raises:
        ConfigError: the packages of the extra ``onnx`` are missing.
    """
    policy = msgspec.structs.replace(pilot.form.policy, compute="float32", device="cpu")
    exact = Pilot(msgspec.structs.replace(pilot.form, policy=policy), pilot.theta)
    kind = torch.uint8 if pilot.form.dtype == "uint8" else torch.float32
    example = torch.zeros((2, *pilot.form.shape), dtype=kind)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it misses torchvision; we do not
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # of torch about torch
            program = torch.onnx.export(
                _Logits(exact.flat.network).eval(),
                (example,),
                input_names=["observations"],
                output_names=["logits"],
                dynamic_shapes=({0: torch.export.Dim("N")},),
                dynamo=True,
                verbose=False,
            )
    except ModuleNotFoundError as error:
        raise ConfigError(
            f'this needs {error.name}, which is not installed: pip install "dcpg-swarm[onnx]"'
        ) from None
    assert program is not None
    draft = path.with_suffix(".draft")
    program.save(draft, external_data=False)
    draft.replace(path)

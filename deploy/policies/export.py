"""A learned policy as an ONNX file, for whoever flies without us.

Input ``observations``: (N, ...) raw, as the environment gives them: pictures are (N, H, W, C)
bytes and are standardised inside.  Output ``logits``: (N, A) float32; the greedy action is their
argmax.  The arithmetic is float32, whatever the policy was trained with.
"""

import logging
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec
import torch
from torch import Tensor, nn

from agent.learning.pilot import Pilot
from agent.storage.files import drafted
from deploy.policies.header import notes
from deploy.policies.provenance import describe
from swarm.errors import ConfigError

FORMATS = ("safetensors", "onnx")


class _Logits(nn.Module):
    """The policy's head alone."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self._network = network

    def forward(self, observations: Tensor) -> Tensor:
        logits: Tensor = self._network(observations)[0]
        return logits


def destination(source: Path, form: str | None, to: Path | None) -> tuple[str, Path]:
    """In which format, and where to.  Looks before anything takes its time.

    Args:
        source: run folder, or exported file.
        form: one of :data:`FORMATS`; None: as ``to`` ends.
        to: None: in the run folder; of a file, here.

    Raises:
        ConfigError: there is no such format, the name ends as another one, or nothing can be
            written there.
    """
    expected = " or ".join(FORMATS)
    named = to.suffix.removeprefix(".") if to is not None else ""
    form = form if form is not None else named or FORMATS[0]
    if form not in FORMATS and named == form:
        raise ConfigError(f'--to "{to}": expected a name that ends in .{" or .".join(FORMATS)}')
    if form not in FORMATS:
        raise ConfigError(f'--format "{form}": expected {expected}')
    if named in FORMATS and named != form:
        raise ConfigError(f'--to "{to}" with --format {form}: expected a name in .{form}')
    if to is None:
        to = (source if source.is_dir() else Path()) / f"policy.{form}"
    if to.is_dir():
        raise ConfigError(f'--to "{to}" is a folder: expected the name of a file')
    if not to.parent.is_dir():
        raise ConfigError(f'--to "{to}": there is no folder "{to.parent}"')
    if not os.access(to.parent, os.W_OK):
        raise ConfigError(f'--to "{to}": nothing can be written in "{to.parent}"')
    return form, to


def export(source: Path, agent: str | None, form: str, path: Path, licence: str = "") -> Path:
    """Write the policy of ``source`` to ``path``, with its header; its path.

    Raises:
        ConfigError: no run folder, no such agent, a tabular run, or packages are missing.
        CheckpointError: no checkpoint, or one that does not read.
    """
    pilot = Pilot.load(source, agent)
    header = describe(source, agent, pilot.form, licence)
    about = notes(header) if header else {}
    if form == "onnx":
        write_onnx(pilot, path, about)
    else:
        pilot.save(path, about)
    return path


def write_onnx(pilot: Pilot, path: Path, about: Mapping[str, str] = MappingProxyType({})) -> None:
    """Write ``path``.

    Args:
        pilot: what acts.
        path: where to.
        about: the model's properties.

    Raises:
        ModuleNotFoundError: the packages of the extra ``onnx`` are missing.
    """
    policy = msgspec.structs.replace(pilot.form.policy, compute="float32", device="cpu")
    exact = Pilot(msgspec.structs.replace(pilot.form, policy=policy), pilot.theta)
    kind = torch.uint8 if pilot.form.dtype == "uint8" else torch.float32
    example = torch.zeros((2, *pilot.form.shape), dtype=kind)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it misses torchvision; we do not
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
    assert program is not None
    program.model.metadata_props.update(about)
    with drafted(path) as draft:
        program.save(draft, external_data=False)

"""Where a policy comes from: its header, made of a run folder.

Interface: :func:`describe` for ``swarm export``, :func:`header_of_run` for who knows more.
"""

from collections.abc import Mapping
from datetime import date as calendar
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import gymnasium
import msgspec
from gymnasium.envs.registration import load_env_creator

from agent.config.experiment import SwarmFile, load
from agent.learning.pilot import Form
from agent.storage import checkpoint
from agent.storage.runfolder import RunFolder, open_run
from deploy.policies.evaluation import Cell, Evaluation
from deploy.policies.header import Header, header_of
from swarm.errors import ConfigError

PACKAGE = "dcpg-swarm"


def describe(source: Path, agent: str | None, form: Form, licence: str) -> Header | None:
    """What the exported policy will say about itself.

    Args:
        source: run folder, or a file, whose header is kept.
        agent: whose parameters of a run folder; None for the mean of all.
        form: of the policy.
        licence: of the policy; empty: that of the file, or none.

    Raises:
        ConfigError: ``eval.json`` does not read.
        CheckpointError: the file does not.
    """
    if source.suffix == ".safetensors":
        kept = header_of(source)
        return msgspec.structs.replace(kept, licence=licence or kept.licence) if kept else None
    folder = open_run(source)
    config = load(folder.config)
    last = [[report.steps for report in folder.reports(member)][-1:] for member in config.members]
    measure, flights = measured(folder, config, agent)
    return header_of_run(
        config,
        form,
        agent=agent,
        steps=sum(sum(steps) for steps in last),
        licence=licence,
        date=calendar.today().isoformat(),
        software=_software(),
        measure=measure,
        flights=flights,
    )


def header_of_run(
    config: SwarmFile,
    form: Form,
    *,
    agent: str | None,
    steps: int,
    licence: str,
    date: str,
    software: str,
    measure: str,
    flights: dict[str, list[Cell]],
) -> Header:
    """The header of a policy that was learned by a swarm file."""
    task = config.agents[0].task
    says = _words_of(task.env)
    shape = " x ".join(str(n) for n in form.shape)
    seen = f"({shape}) {form.dtype}"
    meaning = says.get("actions", f"as {task.env} numbers them")
    return Header(
        swarm=config.name,
        estimator=str(config.estimator.__struct_config__.tag),
        agent=agent,
        worlds=tuple(entry.task for entry in config.agents),
        observations=f"{seen}: {says['observations']}" if "observations" in says else seen,
        actions=f"0 to {form.actions - 1}: {meaning}",
        seed=config.seed,
        rounds=config.rounds,
        steps=steps,
        licence=licence,
        date=date,
        software=software,
        measure=measure,
        flights=flights,
    )


def measured(
    folder: RunFolder, config: SwarmFile, agent: str | None
) -> tuple[str, dict[str, list[Cell]]]:
    """What ``swarm eval`` found of just these parameters: the measure, and flights by world.

    Raises:
        ConfigError: ``eval.json`` does not read.
    """
    if not folder.evaluation.exists():
        return "m", {}
    try:
        found = msgspec.json.decode(folder.evaluation.read_bytes(), type=Evaluation)
    except (OSError, msgspec.MsgspecError) as error:
        raise ConfigError(
            f'"{folder.evaluation}" does not read: {error}; expected what swarm eval writes'
        ) from None
    when = folder.evaluation.stat().st_mtime
    for member in config.members:
        kept = folder.checkpoints(member)
        newest = checkpoint.path_of(kept, checkpoint.rounds_in(kept)[-1])
        if newest.stat().st_mtime > when:
            return "m", {}  # it has learned more since
    return (found.measure, found.cells) if found.agent == agent else ("m", {})


def _words_of(env: str) -> Mapping[str, str]:
    """What the class of an environment says of its observations and actions, in its metadata."""
    module, _, name = env.rpartition(":")
    if module:
        import_module(module)
    spec = gymnasium.spec(name)
    assert spec.entry_point is not None
    maker = (
        load_env_creator(spec.entry_point)
        if isinstance(spec.entry_point, str)
        else spec.entry_point
    )
    return getattr(maker, "metadata", {})


def _software() -> str:
    try:
        return f"{PACKAGE} {version(PACKAGE)}"
    except PackageNotFoundError:
        return PACKAGE

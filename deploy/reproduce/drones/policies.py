"""Writes what was measured into the headers of the swarms' policies, the files of the library.

``python -m deploy.reproduce.drones.policies FILE``, with the ``drones.json`` of
``swarm reproduce drones``.  A policy that is exported from its run folder has all this from there;
this is for files that outlive it.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import msgspec

from agent.config.experiment import load
from agent.learning.pilot import Form, Pilot
from deploy.library import POLICIES, SWARMS, find
from deploy.policies.header import Header, notes
from deploy.policies.provenance import PACKAGE, header_of_run
from deploy.reproduce.drones.record import Record, read
from deploy.reproduce.drones.runs import SWARM

LICENCE = "Apache-2.0"


def header(estimator: str, record: Record, form: Form) -> Header:
    """Of the swarm's policy of an estimator.

    Raises:
        ConfigError: the record has no run of the swarm.
    """
    run = record.run(SWARM, record.seeds[0])
    config = load(find(Path(name_of(estimator)), SWARMS))
    config = msgspec.structs.replace(config, rounds=run.rounds, seed=run.seed)
    assert record.made is not None  # read() sees to it
    return header_of_run(
        config,
        form,
        agent=None,
        steps=run.steps,
        licence=LICENCE,
        date=record.made.date,
        software=f"{PACKAGE} {version(PACKAGE)}, commit {record.made.commit}",
        measure="m",
        flights=run.flights,
    )


def name_of(estimator: str) -> str:
    """Of a swarm file, and of the policy that it learned."""
    return f"drones-{estimator}"


def main() -> None:
    """Write the headers of all estimators that the file has."""
    for estimator, record in read(Path(sys.argv[1])).items():
        path = find(Path(name_of(estimator)), POLICIES)
        pilot = Pilot.load(path)
        pilot.save(path, notes(header(estimator, record, pilot.form)))
        print(path)


if __name__ == "__main__":
    main()

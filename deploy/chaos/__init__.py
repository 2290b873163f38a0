"""Faults on purpose: one file of ``[[fault]]`` tables drives the launcher, the tests, the studies.

::

    [[fault]]
    at = "30%"          # of the run's rounds; or [s] after every agent has reported: at = 2.0
    kind = "freeze"
    agents = ["drone1"]
    seconds = 5.0

``round = 500`` stands for a certain round.  ``agents`` are ids, or places in the swarm file that
every swarm has: ``"@first"``, ``"@last"``, ``"@half"`` (the first half of them), ``"*"`` (all).
With ``until = "80%"`` they come one after the other, evenly, from ``at`` to then.  What would come
when the run is over, or names an agent that there is not, is refused before anything starts.

============  ===================================================================================
kind          what happens to ``agents``
============  ===================================================================================
``kill``      SIGKILL; the launcher starts them again from their checkpoints
``restart``   SIGTERM; likewise
``freeze``    SIGSTOP, and SIGCONT after ``seconds``
``slow``      stopped for all but one ``factor``-th of the time, for ``seconds``
``partition`` cut off from all other agents for ``seconds``
``loss``      each packet that reaches them is dropped with ``probability``, for ``seconds``
``rate``      they send at most ``kbit`` kilobits a second, for ``seconds``
``clock``     their wall clock jumps ``by`` seconds, forward or (negative) back, and stays there
============  ===================================================================================

``partition``, ``loss`` and ``rate`` need agents in network namespaces of their own (``namespace``
in the swarm file) and root; ``clock`` needs libfaketime.  ``deploy/library/faults/`` has a file a
fault; ``swarm reproduce network`` runs them all and prints what each costs.

Rooms: :mod:`deploy.chaos.faults` the file, :mod:`deploy.chaos.actions` what a fault consists of,
:mod:`deploy.chaos.clocks` clocks that jump, :mod:`deploy.chaos.runner` carries it out.
"""

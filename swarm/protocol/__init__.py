"""The protocol, pure: events in, actions out.  No clock, thread, socket or arithmetic on vectors.

One :class:`~swarm.protocol.machine.Machine` is one agent's side.  Zenoh drives it
(:mod:`swarm.exchange`), and so do thousands of schedules of faults on a virtual clock
(``tests/swarm/simulation``).

**Terms.**  A *run* is one experiment from its first round on; nothing of another run is used.  A
*life* is one process of an agent; lives of one id are ordered, the later one takes part and the
earlier ends itself.  A *fellow* is a member that is here and in the same run; the topology over the
fellows gives each agent its *neighbours*.

**Phases.**  *starting*: every :attr:`~swarm.protocol.timing.Timing.resend` an agent asks all who
are here for their header, until all members, or after a while a quorum, are fellows
(:mod:`~swarm.protocol.membership`).  *playing*: rounds.  *finished*: it shows its last parameters
until its neighbours have them.

**A round.**  ``begin``: the vector goes to the neighbours with a header that names round, run, life
and, for each edge, what this end used of it lately (:mod:`~swarm.protocol.accounts`).  Then the
round waits for those neighbours whose vector of it may still come: not for who is gone, further on,
plays this round with others, or let a deadline pass and has not been heard since.  Then it mixes
what both ends of an edge may use, takes back what turned out to be used by one end only, and goes
on to the next round, or to where at least two fellows are (one, if there is only one).  With fewer
neighbours than the quorum it goes on for ``quorum.patience`` and then waits.

**Joining.**  :mod:`~swarm.protocol.transfer`: a state is taken from a member in its present life
whose run, round and norm another member confirms.

**What holds**, in every schedule of the simulation, each with a mutant that breaks it:

* both ends of an edge keep a round or neither does, and their duals cancel, so the mean moves by
  the steps alone and exact rules find the optimum of those who are there;
* after the faults every edge is used again within 20 rounds, at any latency;
* a fault costs every other agent at most one deadline, and no wait is without a cause;
* no message of one member carries an agent to another round or to its end, or hands it a state;
* nothing of another run, round or life is mixed;
* nobody trains alone for longer than its patience without saying so;
* of every member the two newest vectors are kept, and nothing of strangers.

**What a traitor can do**: send parameters that are wrong but not absurd, with the weight of its own
edges (see :mod:`swarm.mixing.robust`); make each neighbour wait for ``timing.round`` once in 17
rounds, by signs of life without parameters; in a swarm of two, move the other as far as time
allows, for there is nobody else to ask; tell different members different runs, so that they do not
agree on the graph, and mix over the edges that both ends see.
"""

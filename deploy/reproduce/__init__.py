"""The paper's tabular statements, printed again; and what lies beyond the paper.

One file a study.  Each states its claims (:mod:`deploy.reproduce.claims`), runs swarms in
:mod:`deploy.simulate.simulator` and draws a figure; ``swarm reproduce`` prints, keeps and judges.
"""

"""What a swarm looks like in Rerun: live, or from a run folder.

Interface: :func:`view` and :func:`record_run`.  One way through, whatever the origin::

    reports -> moments.Moment -> drawing.Track -> recorder.Recorder -> file or viewer
               pure              pure             send_columns

``worlds`` draws the tasks; a kind of world that is not in there has no view of its own, the other
views show it all the same.  Only this package imports Rerun.
"""

from deploy.viewer.session import record_run, view

__all__ = ["record_run", "view"]

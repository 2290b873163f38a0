"""What a swarm looks like in Rerun: live, or from a run folder.

Interface: :func:`view`, :class:`Output` and :func:`record_run`.  One way through, whatever the
origin::

    reports -> moments.Moment -> drawing.Scene --+
    flight samples -> trails.Trail --------------+-> rows.Row -> recorder.Recorder -> outputs
                      theory.Theory -------------+   pure        send_columns          window, web,
                                                                                       file, picture

``tasks`` and ``rooms`` draw the tasks; a kind of world that is not in there has no view of its
own, the other views show it all the same.  Only this package imports Rerun.
"""

from deploy.viewer.outputs import Output
from deploy.viewer.session import record_run, view

__all__ = ["Output", "record_run", "view"]

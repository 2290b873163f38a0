"""A quadrotor that speaks MAVLink: rigid body, cascaded control, autopilot, links.

Read from the inside out: ``frames``, ``airframe`` (parameters), ``dynamics``, ``control``,
``quadrotor`` (they together); ``flavours``, ``setpoints``, ``parameters``, ``missions``,
``commands``, ``telemetry``, ``inbox``, ``autopilot`` (decides; no input or output); ``codec``,
``links``, ``server`` (bytes, sockets, time), ``lockstep`` (the other end, for training).

World frame: NED.  Body frame: FRD.  Quaternions: (w, x, y, z).
"""

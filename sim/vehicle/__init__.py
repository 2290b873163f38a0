"""A quadrotor that speaks MAVLink: rigid body, cascaded control, autopilot, links.

Read from the inside out: ``frames``, ``airframe`` (parameters), ``dynamics``, ``control``,
``quadrotor`` (they together), ``rooms`` (what it bumps into); ``flavours``, ``parameters``,
``setpoints``, ``missions``, ``guidance``, ``inbox``, ``command``, ``commands``, ``orders``,
``arming``, ``steering``, ``watch``, ``telemetry``, ``autopilot`` (decides; no input or output);
``codec``, ``links``, ``server`` (bytes, sockets, time); ``lockstep`` (the other end), ``fleet`` (a
process of vehicles), ``bodies`` (what ``IndoorFlight-v0`` flies).

World frame: NED.  Body frame: FRD.  Quaternions: (w, x, y, z).
"""

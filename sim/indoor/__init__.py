"""Indoor flight: worlds with a camera, thousands of frames a second on one core.

    env = gymnasium.make("sim:IndoorFlight-v0", scene="indoor-cloud")
    envs = gymnasium.make_vec("sim:IndoorFlight-v0", num_envs=16, scene=[...])

From plan to picture: ``scenes/`` describe, ``plan`` and ``furniture`` build faces (``shapes``,
``textures``, ``patterns``), ``assembly`` makes them a ``Mesh``, ``lighting`` bakes it, ``scene``
keeps it; ``raster`` finds what each pixel sees, ``shade`` colours it (``camera``); ``collision``
and ``reward`` judge; ``flights`` puts a step together; ``env`` and ``vector`` are its Gymnasium
covers.
"""

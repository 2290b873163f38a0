"""Flying through a world: bodies, reward, the Gymnasium environments."""

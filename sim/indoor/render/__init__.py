"""From a pose to a picture: camera, rays, rasters, shading and baked light."""

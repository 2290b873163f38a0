"""The colour of every pixel: texture (mip-mapped) times baked light, once per pixel that is seen.

Runs of pixels with the same triangle in a row share their set-up.  The mip level is chosen so that
a texel is about as large as a pixel's footprint on the surface (the root of its area, which keeps
floors sharp at grazing angles); light is interpolated between the four nearest lightmap texels.
"""

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.geometry.mesh import Doubles, Floats, Mesh, Words
from sim.indoor.render.raster import Canvas

Picture = npt.NDArray[np.uint8]

CHUNK = 16  # pixels that share a mip level and a gradient of the light
INVERSE = np.array([0] + [-(-65536 // n) for n in range(1, CHUNK)])  # of the steps in a chunk
ONE = np.uint64(1)
LAST = np.uint64(CHUNK - 1)
VOID = np.float32(np.inf)  # depth where nothing is


@compiled(fastmath={"contract", "nsz"})
def _mix(low: np.integer, high: np.integer, share: float) -> np.int64:
    """Two packed colours, blended; red and blue at once."""
    weight = np.int64(share * np.float32(256.0))
    first, second = np.int64(low), np.int64(high)
    red_blue = (first & 0xFF00FF) * (256 - weight) + (second & 0xFF00FF) * weight
    green = (first & 0x00FF00) * (256 - weight) + (second & 0x00FF00) * weight
    return ((red_blue >> 8) & 0xFF00FF) | ((green >> 8) & 0x00FF00)


@compiled(fastmath={"contract", "nsz"})
def _glow(
    light: Words,
    g: Floats,
    s: np.integer,
    z: np.float32,
    xf: np.float32,
    yf: np.float32,
    at: np.integer,
    columns: np.integer,
    rows: np.integer,
) -> tuple[np.int64, np.int64, np.int64]:
    """The light on a pixel at depth `z`, between its four nearest texels; 1 << 24 is one."""
    a = g[s, 11] + z * (g[s, 8] * xf + g[s, 9] * yf + g[s, 10])
    b = g[s, 15] + z * (g[s, 12] * xf + g[s, 13] * yf + g[s, 14])
    a = min(max(a, np.float32(0.0)), np.float32(columns - 1) - np.float32(0.001))
    b = min(max(b, np.float32(0.0)), np.float32(rows - 1) - np.float32(0.001))
    ia, ib = np.int64(a), np.int64(b)
    fa = np.int64((a - np.float32(ia)) * np.float32(256.0))
    fb = np.int64((b - np.float32(ib)) * np.float32(256.0))
    here = np.uint64(at + ib * columns + ia)
    below = here + np.uint64(columns)
    w00, w01 = (256 - fa) * (256 - fb), fa * (256 - fb)
    w10, w11 = (256 - fa) * fb, fa * fb
    c00, c01 = np.int64(light[here]), np.int64(light[here + ONE])
    c10, c11 = np.int64(light[below]), np.int64(light[below + ONE])
    red = (c00 & 255) * w00 + (c01 & 255) * w01 + (c10 & 255) * w10 + (c11 & 255) * w11
    green = (
        (c00 >> 8 & 255) * w00
        + (c01 >> 8 & 255) * w01
        + (c10 >> 8 & 255) * w10
        + (c11 >> 8 & 255) * w11
    )
    blue = (c00 >> 16) * w00 + (c01 >> 16) * w01 + (c10 >> 16) * w10 + (c11 >> 16) * w11
    return red + (red >> 8), green + (green >> 8), blue + (blue >> 8)


@compiled(fastmath={"contract", "nsz"})
def _prepare(canvas: Canvas, mesh: Mesh, slots: int, m: Doubles, w: Doubles, eye: Doubles) -> None:
    """Surface coordinates over the picture, for every triangle drawn (see ``Canvas.surface``)."""
    paint, shine, plane, surface = mesh.paint, mesh.shine, canvas.plane, canvas.surface
    # the area of a pixel in the plane one metre ahead, for the mip level
    pixel_area = np.sqrt(
        (m[0, 0] ** 2 + m[1, 0] ** 2 + m[2, 0] ** 2) * (m[0, 1] ** 2 + m[1, 1] ** 2 + m[2, 1] ** 2)
    )
    for s in range(slots):
        t = canvas.triangle[s]
        period = float(1 << mesh.texture[t, 1])
        for k in range(4):
            f, row = (paint, k) if k < 2 else (shine, k - 2)
            f0, f1, f2 = f[t, row, 0], f[t, row, 1], f[t, row, 2]
            for axis in range(3):
                surface[s, 4 * k + axis] = f0 * m[0, axis] + f1 * m[1, axis] + f2 * m[2, axis]
            here = f0 * eye[0] + f1 * eye[1] + f2 * eye[2] + f[t, row, 3]
            if k < 2:  # small numbers are exact numbers
                here -= np.floor(here / period) * period
            surface[s, 4 * k + 3] = here
        # texels a square metre
        ux, uy, uz = paint[t, 0, 0], paint[t, 0, 1], paint[t, 0, 2]
        vx, vy, vz = paint[t, 1, 0], paint[t, 1, 1], paint[t, 1, 2]
        cross_x, cross_y, cross_z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        density = np.sqrt(cross_x**2 + cross_y**2 + cross_z**2)
        # 1/depth = plane . q: its gradient in the world is one over the plane's distance
        slope = 0.0
        for axis in range(3):
            slope += (
                plane[s, 0] * w[0, axis] + plane[s, 1] * w[1, axis] + plane[s, 2] * w[2, axis]
            ) ** 2
        surface[s, 16] = density * pixel_area * np.sqrt(slope)


@compiled(fastmath={"contract", "nsz"})
def shade(
    canvas: Canvas,
    mesh: Mesh,
    slots: int,
    world_from_pixel: Doubles,
    pixel_from_world: Doubles,
    eye: Doubles,
    smooth: bool,
    rgb: Picture,
    depth: Floats,
) -> None:
    """Colour what ``see`` has found in its `slots`.

    ``world_from_pixel`` (3, 3) has the columns right, down (one pixel each) and corner ray.
    """
    _prepare(canvas, mesh, slots, world_from_pixel, pixel_from_world, eye)
    height, width = depth.shape
    inverse, owner, triangle, g = canvas.inverse, canvas.owner, canvas.triangle, canvas.surface
    texels, light, texture, chart = mesh.texels, mesh.light, mesh.texture, mesh.chart
    one = np.float32(1.0)
    texel = np.empty(CHUNK, np.int64)  # of the pixels of a chunk
    for y in range(np.uint64(height)):
        yf = np.float32(y)
        x = 0
        while x < width:
            s = owner[y, x]
            if inverse[y, x] == 0.0:
                rgb[y, x, 0] = rgb[y, x, 1] = rgb[y, x, 2] = 0
                depth[y, x] = VOID
                x += 1
                continue
            stop = x + 1
            while stop < width and owner[y, stop] == s and inverse[y, stop] > 0.0:
                stop += 1
            t = triangle[s]
            base, side = np.int64(texture[t, 0]), np.int64(texture[t, 1])
            first, columns, rows = chart[t, 0], chart[t, 1], chart[t, 2]
            while x < stop:
                end = min(x + CHUNK, stop)
                # footprint area = depth^3 / distance of the plane; a level has a quarter of texels
                z = one / inverse[y, (x + end) >> 1]
                area = g[s, 16] * z * z * z
                level = 0
                shrink = one
                while area > one and level < side:
                    area *= np.float32(0.25)
                    shrink *= np.float32(0.5)
                    level += 1
                log_width = np.uint64(side - level)
                start = np.uint64(
                    base + ((1 << (2 * side + 2)) - (1 << (2 * (side - level) + 2))) // 3
                )
                mask = np.uint64((1 << (side - level)) - 1)
                u0, du = (g[s, 1] * yf + g[s, 2]) * shrink, g[s, 0] * shrink
                v0, dv = (g[s, 5] * yf + g[s, 6]) * shrink, g[s, 4] * shrink
                u_here, v_here = g[s, 3] * shrink, g[s, 7] * shrink

                z = one / inverse[y, x]
                red, green, blue = _glow(light, g, s, z, np.float32(x), yf, first, columns, rows)
                red_step = green_step = blue_step = 0
                if end - x > 1:
                    z = one / inverse[y, end - 1]
                    r, gr, b = _glow(light, g, s, z, np.float32(end - 1), yf, first, columns, rows)
                    share = INVERSE[end - 1 - x]
                    red_step = ((r - red) * share) >> 16
                    green_step = ((gr - green) * share) >> 16
                    blue_step = ((b - blue) * share) >> 16
                if smooth:
                    for column in range(np.uint64(x), np.uint64(end)):
                        z = one / inverse[y, column]
                        depth[y, column] = z
                        u = u_here + z * (du * np.float32(column) + u0) - np.float32(0.5)
                        v = v_here + z * (dv * np.float32(column) + v0) - np.float32(0.5)
                        floor_u, floor_v = np.floor(u), np.floor(v)
                        iu, iv = np.uint64(np.int64(floor_u)), np.uint64(np.int64(floor_v))
                        above = start + ((iv & mask) << log_width)
                        beneath = start + (((iv + ONE) & mask) << log_width)
                        left, right = iu & mask, (iu + ONE) & mask
                        fu = u - floor_u
                        texel[column & LAST] = _mix(
                            _mix(texels[above + left], texels[above + right], fu),
                            _mix(texels[beneath + left], texels[beneath + right], fu),
                            v - floor_v,
                        )
                else:
                    for column in range(np.uint64(x), np.uint64(end)):
                        z = one / inverse[y, column]
                        depth[y, column] = z
                        u = u_here + z * (du * np.float32(column) + u0)
                        v = v_here + z * (dv * np.float32(column) + v0)
                        iu, iv = np.uint64(np.int64(np.floor(u))), np.uint64(np.int64(np.floor(v)))
                        at = start + ((iv & mask) << log_width) + (iu & mask)
                        texel[column & LAST] = texels[at]
                for column in range(np.uint64(x), np.uint64(end)):
                    tone = texel[column & LAST]
                    rgb[y, column, 0] = ((tone & 255) * red) >> 24
                    rgb[y, column, 1] = ((tone >> 8 & 255) * green) >> 24
                    rgb[y, column, 2] = ((tone >> 16 & 255) * blue) >> 24
                    red += red_step
                    green += green_step
                    blue += blue_step
                x = end

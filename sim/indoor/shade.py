"""The colour of every pixel: texture (mip-mapped) times baked light, once per pixel that is seen.

Runs of pixels with the same triangle in a row share their set-up.  The mip level is chosen so that
a texel is about as large as a pixel's footprint on the surface (the root of its area, which keeps
floors sharp at grazing angles); light is interpolated between the four nearest lightmap texels.
"""

import numpy as np
import numpy.typing as npt

from sim.indoor.compiled import compiled
from sim.indoor.mesh import Doubles, Floats, Mesh, Words
from sim.indoor.raster import Canvas

Picture = npt.NDArray[np.uint8]

CHUNK = 8  # pixels that share a mip level and a gradient of the light
INVERSE = np.array([0] + [-(-65536 // n) for n in range(1, CHUNK)])  # of the steps in a chunk
ONE = np.uint64(1)
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
    light: Words, g: Floats, inverse: float, x: int, y: int, chart: int, columns: int, rows: int
) -> tuple[np.int64, np.int64, np.int64]:
    """The light on a pixel, between its four nearest texels; 1 << 24 is one."""
    z = np.float32(1.0) / inverse
    xf, yf = np.float32(x), np.float32(y)
    a = g[2, 3] + z * (g[2, 0] * xf + g[2, 1] * yf + g[2, 2])
    b = g[3, 3] + z * (g[3, 0] * xf + g[3, 1] * yf + g[3, 2])
    a = min(max(a, np.float32(0.0)), np.float32(columns - 1) - np.float32(0.001))
    b = min(max(b, np.float32(0.0)), np.float32(rows - 1) - np.float32(0.001))
    ia, ib = np.int64(a), np.int64(b)
    fa, fb = np.int64((a - np.float32(ia)) * 256), np.int64((b - np.float32(ib)) * 256)
    at = np.uint64(chart + ib * columns + ia)
    below = at + np.uint64(columns)
    w00, w01 = (256 - fa) * (256 - fb), fa * (256 - fb)
    w10, w11 = (256 - fa) * fb, fa * fb
    c00, c01 = np.int64(light[at]), np.int64(light[at + ONE])
    c10, c11 = np.int64(light[below]), np.int64(light[below + ONE])
    red = (c00 & 255) * w00 + (c01 & 255) * w01 + (c10 & 255) * w10 + (c11 & 255) * w11
    green = (
        (c00 >> 8 & 255) * w00 + (c01 >> 8 & 255) * w01
        + (c10 >> 8 & 255) * w10 + (c11 >> 8 & 255) * w11
    )  # fmt: skip
    blue = (c00 >> 16) * w00 + (c01 >> 16) * w01 + (c10 >> 16) * w10 + (c11 >> 16) * w11
    return red + (red >> 8), green + (green >> 8), blue + (blue >> 8)


@compiled(fastmath={"contract", "nsz"})
def shade(
    canvas: Canvas,
    mesh: Mesh,
    world_from_pixel: Doubles,
    pixel_from_world: Doubles,
    eye: Doubles,
    smooth: bool,
    rgb: Picture,
    depth: Floats,
) -> None:
    """``world_from_pixel`` (3, 3) has the columns right, down (one pixel each) and corner ray."""
    height, width = depth.shape
    inverse, owner, texels, light = canvas.inverse, canvas.owner, mesh.texels, mesh.light
    paint, shine = mesh.paint, mesh.shine
    m, w = world_from_pixel, pixel_from_world
    # the area of a pixel in the plane one metre ahead, for the mip level
    pixel_area = np.sqrt(
        (m[0, 0] ** 2 + m[1, 0] ** 2 + m[2, 0] ** 2) * (m[0, 1] ** 2 + m[1, 1] ** 2 + m[2, 1] ** 2)
    )
    last = -1
    g = np.empty((4, 4), np.float32)  # u, v, a, b: slope in x, slope in y, constant, at the eye
    side = base = columns = rows = chart = 0
    coarse = np.float32(0.0)
    for y in range(height):
        x = 0
        while x < width:
            if inverse[y, x] == 0.0:
                rgb[y, x, 0] = rgb[y, x, 1] = rgb[y, x, 2] = 0
                depth[y, x] = VOID
                x += 1
                continue
            slot = owner[y, x]
            stop = x + 1
            while stop < width and owner[y, stop] == slot and inverse[y, stop] > 0.0:
                stop += 1
            if slot != last:
                last = slot
                t = canvas.triangle[slot]
                base, side = mesh.texture[t, 0], mesh.texture[t, 1]
                chart, columns, rows = mesh.chart[t, 0], mesh.chart[t, 1], mesh.chart[t, 2]
                period = float(1 << side)
                for k in range(4):
                    f = paint[t, k] if k < 2 else shine[t, k - 2]
                    for axis in range(3):
                        g[k, axis] = f[0] * m[0, axis] + f[1] * m[1, axis] + f[2] * m[2, axis]
                    here = f[0] * eye[0] + f[1] * eye[1] + f[2] * eye[2] + f[3]
                    if k < 2:
                        here -= np.floor(here / period) * period
                    g[k, 3] = here
                # texels per metre (root of the area) times the footprint at depth one
                du, dv = paint[t, 0], paint[t, 1]
                cross_x = du[1] * dv[2] - du[2] * dv[1]
                cross_y = du[2] * dv[0] - du[0] * dv[2]
                cross_z = du[0] * dv[1] - du[1] * dv[0]
                density = np.sqrt(cross_x**2 + cross_y**2 + cross_z**2)
                p = canvas.plane[slot]
                # 1/depth = p . q: its gradient in the world is one over the plane's distance
                slope = 0.0
                for axis in range(3):
                    slope += (p[0] * w[0, axis] + p[1] * w[1, axis] + p[2] * w[2, axis]) ** 2
                coarse = np.float32(density * pixel_area * np.sqrt(slope))
            while x < stop:
                end = min(x + CHUNK, stop)
                # footprint area = depth^3 / distance of the plane; level = log4 of texels in it
                z = np.float32(1.0) / inverse[y, (x + end) >> 1]
                area = coarse * z * z * z
                level = 0
                while area > 1.0 and level < side:
                    area *= np.float32(0.25)
                    level += 1
                log_width = np.uint64(side - level)
                start = np.uint64(
                    base + ((1 << (2 * side + 2)) - (1 << (2 * (side - level) + 2))) // 3
                )
                mask = np.uint64((1 << (side - level)) - 1)
                shrink = np.float32(1.0 / (1 << level))
                u0, du = (g[0, 1] * y + g[0, 2]) * shrink, g[0, 0] * shrink
                v0, dv = (g[1, 1] * y + g[1, 2]) * shrink, g[1, 0] * shrink
                u_here, v_here = g[0, 3] * shrink, g[1, 3] * shrink

                red, green, blue = _glow(light, g, inverse[y, x], x, y, chart, columns, rows)
                red_step = green_step = blue_step = 0
                if end - x > 1:
                    r, gr, b = _glow(
                        light, g, inverse[y, end - 1], end - 1, y, chart, columns, rows
                    )
                    share = INVERSE[end - 1 - x]
                    red_step = ((r - red) * share) >> 16
                    green_step = ((gr - green) * share) >> 16
                    blue_step = ((b - blue) * share) >> 16
                for column in range(x, end):
                    z = np.float32(1.0) / inverse[y, column]
                    depth[y, column] = z
                    u = u_here + z * (du * np.float32(column) + u0)
                    v = v_here + z * (dv * np.float32(column) + v0)
                    if smooth:
                        u -= np.float32(0.5)
                        v -= np.float32(0.5)
                        fu, fv = u - np.floor(u), v - np.floor(v)
                        iu, iv = np.uint64(np.int64(np.floor(u))), np.uint64(np.int64(np.floor(v)))
                        iu0, iv0 = iu & mask, iv & mask
                        iu1, iv1 = (iu + ONE) & mask, (iv + ONE) & mask
                        r0, r1 = start + (iv0 << log_width), start + (iv1 << log_width)
                        texel = _mix(
                            _mix(texels[r0 + iu0], texels[r0 + iu1], fu),
                            _mix(texels[r1 + iu0], texels[r1 + iu1], fu),
                            fv,
                        )
                    else:
                        iu, iv = np.uint64(np.int64(np.floor(u))), np.uint64(np.int64(np.floor(v)))
                        texel = np.int64(texels[start + ((iv & mask) << log_width) + (iu & mask)])
                    rgb[y, column, 0] = ((texel & 255) * red) >> 24
                    rgb[y, column, 1] = ((texel >> 8 & 255) * green) >> 24
                    rgb[y, column, 2] = ((texel >> 16 & 255) * blue) >> 24
                    red += red_step
                    green += green_step
                    blue += blue_step
                x = end

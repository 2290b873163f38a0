"""Light, baked once: lamps with soft shadows and two bounces between the surfaces.

The light on a texel is what the lamps send it, plus what it receives from the surfaces around,
gathered by a fan of rays over the hemisphere (cosine-weighted, stratified, the same in every run).
Texels inside furniture or walls (most of their rays see back faces or nothing) take the light of
their neighbours, so that no dark rim creeps out.  The result is exposed and gamma encoded, so that
the renderer multiplies bytes.
"""

from dataclasses import dataclass

import numpy as np

from sim.indoor.compiled import compiled
from sim.indoor.content.assembly import Charts
from sim.indoor.content.textures import GAMMA
from sim.indoor.geometry.mesh import Doubles, Floats, Ints, Mesh, Words
from sim.indoor.render.raster import Flags
from sim.indoor.render.rays import cast

GATHER = 32  # rays a texel and bounce
SHADOW = 4  # rays a texel and lamp
LIFT = 0.01  # m; rays start this far above their surface
INSET = 0.03  # m; and this far inside the border of their chart
FAINT = 2e-3  # light below which a lamp is not worth its shadow rays


@dataclass(frozen=True)
class Lamps:
    """Small bright balls."""

    place: Doubles  # (L, 3) [m, NED]
    power: Doubles  # (L, 3) RGB; a power of one lights a surface at one metre with one
    radius: float = 0.15  # m


@compiled
def _fraction(value: float) -> float:
    return float(value - np.floor(value))


@compiled
def _stand(
    charts: tuple[Doubles, Doubles, Doubles, Doubles],
    c: int,
    i: int,
    j: int,
    columns: int,
    rows: int,
    out: Doubles,
) -> None:
    """The place from which texel (row j, column i) of a chart looks at the world."""
    origin, across, downward, normal = charts
    width = np.sqrt((across[c] ** 2).sum()) * (columns - 1)
    height = np.sqrt((downward[c] ** 2).sum()) * (rows - 1)
    inset_a, inset_b = min(INSET / width, 0.25), min(INSET / height, 0.25)
    a = min(max(i / (columns - 1), inset_a), 1 - inset_a) * (columns - 1)
    b = min(max(j / (rows - 1), inset_b), 1 - inset_b) * (rows - 1)
    for axis in range(3):
        out[axis] = (
            origin[c, axis] + a * across[c, axis] + b * downward[c, axis] + LIFT * normal[c, axis]
        )


@compiled(nogil=True)
def _lamps(
    corner: Floats,
    box: Floats,
    link: Ints,
    charts: tuple[Doubles, Doubles, Doubles, Doubles],
    size: Ints,
    lamps: Doubles,
    power: Doubles,
    radius: float,
    out: Doubles,
) -> None:
    """Light that comes straight from the lamps."""
    here = np.empty(3, np.float64)
    normal = charts[3]
    for c in range(len(size)):
        first, columns, rows = size[c]
        for k in range(columns * rows):
            _stand(charts, c, k % columns, k // columns, columns, rows, here)
            for lamp in range(len(lamps)):
                dx, dy, dz = (
                    lamps[lamp, 0] - here[0],
                    lamps[lamp, 1] - here[1],
                    lamps[lamp, 2] - here[2],
                )
                square = dx * dx + dy * dy + dz * dz
                cosine = (dx * normal[c, 0] + dy * normal[c, 1] + dz * normal[c, 2]) / np.sqrt(
                    square
                )
                strength = cosine / (square + radius * radius)
                if strength * power[lamp].max() < FAINT:
                    continue
                seen = 0
                for s in range(SHADOW):
                    # a point of the ball, another for every texel
                    jitter = _fraction((first + k) * 0.7548776662 + s * 0.569840290998)
                    z = 2 * ((s + jitter) / SHADOW) - 1
                    turn = 2 * np.pi * _fraction((first + k) * 0.618033988 + s * 0.7548776662)
                    flat = np.sqrt(max(1 - z * z, 0.0)) * radius
                    tx = dx + flat * np.cos(turn)
                    ty = dy + flat * np.sin(turn)
                    tz = dz + z * radius
                    _, blocker = cast(
                        corner, box, link, 0, here[0], here[1], here[2], tx, ty, tz, 0.97, True
                    )
                    seen += blocker < 0
                for channel in range(3):
                    out[first + k, channel] += power[lamp, channel] * strength * seen / SHADOW


@compiled(nogil=True)
def _gather(
    corner: Floats,
    box: Floats,
    link: Ints,
    shine: Floats,
    chart: Ints,
    albedo: Doubles,
    charts: tuple[Doubles, Doubles, Doubles, Doubles],
    size: Ints,
    sent: Doubles,
    out: Doubles,
    lost: Flags,
) -> None:
    """Light that comes from the other surfaces, which send `sent` times their colour."""
    here = np.empty(3, np.float64)
    normals = charts[3]
    for c in range(len(size)):
        first, columns, rows = size[c]
        nx, ny, nz = normals[c]
        # a frame around the normal
        if abs(nz) < 0.9:
            ux, uy, uz = -ny, nx, 0.0
        else:
            ux, uy, uz = 0.0, -nz, ny
        scale = 1.0 / np.sqrt(ux * ux + uy * uy + uz * uz)
        ux, uy, uz = ux * scale, uy * scale, uz * scale
        vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
        for k in range(columns * rows):
            _stand(charts, c, k % columns, k // columns, columns, rows, here)
            bad = 0
            for r in range(GATHER):
                lift = (r + _fraction((first + k) * 0.7548776662)) / GATHER
                turn = 2 * np.pi * _fraction(r * 0.618033988 + (first + k) * 0.569840290998)
                flat, up = np.sqrt(lift), np.sqrt(1 - lift)
                a, b = flat * np.cos(turn), flat * np.sin(turn)
                dx, dy, dz = (
                    ux * a + vx * b + nx * up,
                    uy * a + vy * b + ny * up,
                    uz * a + vz * b + nz * up,
                )
                distance, t = cast(
                    corner, box, link, 0, here[0], here[1], here[2], dx, dy, dz, np.inf, False
                )
                if t < 0:
                    bad += 1
                    continue
                e1, e2 = corner[t, 1] - corner[t, 0], corner[t, 2] - corner[t, 0]
                facing = (
                    (e1[1] * e2[2] - e1[2] * e2[1]) * dx
                    + (e1[2] * e2[0] - e1[0] * e2[2]) * dy
                    + (e1[0] * e2[1] - e1[1] * e2[0]) * dz
                )
                if facing > 0.0:
                    bad += 1
                    continue
                px, py, pz = (
                    here[0] + dx * distance,
                    here[1] + dy * distance,
                    here[2] + dz * distance,
                )
                g, h = shine[t, 0], shine[t, 1]
                i = int(
                    min(max(g[0] * px + g[1] * py + g[2] * pz + g[3] + 0.5, 0.0), chart[t, 1] - 1.0)
                )
                j = int(
                    min(max(h[0] * px + h[1] * py + h[2] * pz + h[3] + 0.5, 0.0), chart[t, 2] - 1.0)
                )
                at = chart[t, 0] + j * chart[t, 1] + i
                for channel in range(3):
                    out[first + k, channel] += sent[at, channel] * albedo[t, channel] / GATHER
            lost[first + k] = bad > GATHER // 4


@compiled(nogil=True)
def _settle(size: Ints, value: Doubles, lost: Flags) -> None:
    """Smooth each chart a little and fill its lost texels from their neighbours."""
    for c in range(len(size)):
        first, columns, rows = size[c]
        count = columns * rows
        for sweep in range(max(columns, rows) + 2):
            before = value[first : first + count].copy()
            gone = lost[first : first + count].copy()
            changed = False
            for k in range(count):
                if sweep > 1 and not gone[k]:
                    continue
                i, j = k % columns, k // columns
                total, r, g, b = 0.0, 0.0, 0.0, 0.0
                for dj in range(max(j - 1, 0), min(j + 2, rows)):
                    for di in range(max(i - 1, 0), min(i + 2, columns)):
                        q = dj * columns + di
                        if not gone[q]:
                            w = (2.0 if di == i else 1.0) * (2.0 if dj == j else 1.0)
                            total += w
                            r += before[q, 0] * w
                            g += before[q, 1] * w
                            b += before[q, 2] * w
                if total > 0.0:
                    value[first + k, 0] = r / total
                    value[first + k, 1] = g / total
                    value[first + k, 2] = b / total
                    lost[first + k] = False
                    changed = True
            if sweep > 1 and not changed:
                break


def albedo_of(mesh: Mesh) -> Doubles:
    """(T, 3) mean colour of every triangle in linear light: the last level of its texture."""
    first, side = mesh.texture[:, 0].astype(np.int64), mesh.texture[:, 1].astype(np.int64)
    last = mesh.texels[first + ((1 << (2 * side + 2)) - 1) // 3 - 1].astype(np.int64)
    channels = np.stack([last & 255, last >> 8 & 255, last >> 16 & 255], axis=1)
    return np.asarray((channels / 255.0) ** GAMMA)


def bake(mesh: Mesh, charts: Charts, lamps: Lamps, exposure: float) -> Words:
    """The lightmap of a world."""
    tree = (mesh.corner, mesh.box, mesh.link)
    frame = (charts.origin, charts.across, charts.downward, charts.normal)
    albedo = albedo_of(mesh)
    shape = (charts.texels, 3)
    glow = np.repeat(charts.glow, charts.size[:, 1] * charts.size[:, 2])[:, None].astype(np.float64)
    lost = np.zeros(charts.texels, np.bool_)

    direct = np.zeros(shape)
    _lamps(*tree, frame, charts.size, lamps.place, lamps.power, lamps.radius, direct)
    bounced = np.zeros(shape)
    for _ in range(2):
        sent = direct + bounced + glow
        bounced = np.zeros(shape)
        _gather(*tree, mesh.shine, mesh.chart, albedo, frame, charts.size, sent, bounced, lost)
        _settle(charts.size, bounced, lost.copy())
    total = direct + bounced
    hidden = lost.copy()
    _settle(charts.size, direct, hidden)  # fills what is lost; shadows keep their edge below
    total = np.where(lost[:, None], direct + bounced, total)
    shown = np.maximum(1 - np.exp(-exposure * total), np.minimum(glow, 1.0))
    code = (np.clip(shown, 0, 1) ** (1 / GAMMA) * 255 + 0.5).astype(np.uint32)
    return np.asarray(code[:, 0] | code[:, 1] << 8 | code[:, 2] << 16)

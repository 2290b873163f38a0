"""`indoor-frogeyes`: two octagonal halls around round pillars, and a passage below the chin.

White floor, red ceiling, every wall another pattern; bright.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import artwork, diamonds, rings
from sim.indoor.content.plan import Plan
from sim.indoor.content.textures import brick, plain, planks, plaster, rubble, wood
from sim.indoor.geometry.shapes import circle


def draw() -> Plan:
    plan = Plan(height=3.2, exposure=2.1)
    moss = brick("#56654a", "#6b7a58", "#434f3c", "#7d8a68", mortar="#c9c59c", columns=4, rows=10)
    teal = rubble("#2f6f68", "#3d8478", "#69a08f", "#c7cfb5", mortar="#8fa590", stones=8, seed=2)
    lozenge = diamonds("#d9c98f", "#2f5f9a", "#4b7a45", "#c9a23c", count=5)
    flowers = rings("#d8c49a", "#7c5530", "#e7dcc0", "#5d3d22", count=4)
    rose = brick("#d9755f", "#e58a73", "#c9604c", mortar="#f2d9c9", columns=5, rows=12, seed=3)
    felt = plaster("#8f9073", grain=0.10, seed=4)
    white = planks("#f4f3ee", "#b9b7b0", columns=1, rows=10, contrast=0.03, metres=2.4, seed=5)
    slate = planks("#a9adb3", "#6d7178", columns=2, rows=6, contrast=0.06, seed=6)
    red = brick("#a8321f", "#b9402a", "#932616", mortar="#6e1a10", columns=3, rows=10, seed=7)

    outline = [(12, -7), (28, -7), (36.5, 2.5), (40, 6), (40, 14), (36, 18), (27, 18),
               (23, 14.5), (23, 11), (17, 11), (17, 14.5), (13, 18), (4, 18), (0, 14),
               (0, 6), (3.5, 2.5)]  # fmt: skip
    plan.room(
        outline,
        floor=white,
        ceiling=red,
        walls=[
            moss,
            teal,
            felt,
            lozenge,
            rose,
            flowers,
            teal,
            moss,
            lozenge,
            rose,
            felt,
            flowers,
            moss,
            teal,
            rose,
            lozenge,
        ],
    )
    plan.carpet([(12, -7), (28, -7), (33.4, -1), (27.5, -1), (23.5, -2.6), (16.5, -2.6),
                 (12.5, -1), (6.6, -1)], slate)  # fmt: skip
    plan.island(circle((8.8, 10.6), 3.1, 24), walls=wood("#5f3d26", metres=2.0, seed=9))
    plan.island(circle((31.2, 10.6), 3.1, 24), walls=rubble("#6d6f72", "#85878a", mortar="#4a4c50"))
    plan.island(
        [(12.5, 1.5), (16.5, -2.5), (23.5, -2.5), (27.5, 1.5), (24.5, 6), (15.5, 6)],
        walls=[moss, rose, felt, flowers, lozenge, teal],
    )

    plan.put(make.table(), (3.2, 16.0), 45)
    plan.put(make.chair(seat=plain("#c04030")), (4.2, 16.6), 270)
    plan.put(make.sofa(plain("#2a1d1a"), width=1.8), (20, 6.55), 0)
    plan.put(make.shelf(width=1.4, filled=False, material=make.OAK), (0.25, 10), 90)
    plan.put(make.cabinet(plain("#27408b")), (39.65, 8.5), 270)
    plan.put(make.barrel(plain("#1f3f8f")), (38.9, 13.9))
    plan.put(make.wastebasket(plain("#24489a")), (16.5, 12.2))
    plan.put(make.desk(plain("#d0e8f0", glow=0.5), make.WALNUT), (31.5, 17.4), 180)
    plan.put(
        make.picture(artwork("#f0ece0", "#d03020", "#e8e0c8", seed=11), 1.6, 1.0), (22.97, 12.8), 90
    )
    plan.put(
        make.picture(artwork("#1c1c22", "#e8c040", "#d05030", seed=12), 1.6, 1.0), (8.5, 17.98), 180
    )
    plan.put(make.plant(seed=7, height=1.5), (35.2, 17.6))
    plan.put(make.plant(seed=8), (0.8, 6.2))
    plan.put(make.plant(seed=9), (12.7, -6.2))
    plan.put(make.bench(), (20, -6.7), 0)
    plan.put(make.crate(make.OAK), (26.5, -6.4), 12)
    plan.put(make.globe(plain("#e08020"), 0.24), (24.2, 13.9))
    plan.put(make.bicycle(plain("#208050")), (34.0, 0.3), 42)
    plan.put(make.stairs(wood("#c8b088"), steps=4), (6.2, 1.7), 42)
    plan.put(make.door(make.WALNUT), (13.5, 17.56), 131)
    plan.put(make.picture(artwork("#303a30", "#d0d0b0", "#90a060", seed=13)), (20, -2.53), 180)

    for x, y in [(3.5, 10.6), (8.8, 16), (14.2, 10.6), (8.8, 5), (20, 8.5), (25.8, 10.6),
                 (31.2, 16), (36.5, 10.6), (31.2, 5), (10, 0), (30, 0),
                 (15.5, -4.8), (24.5, -4.8)]:  # fmt: skip
        plan.lamp(x, y, "#fff4e2", power=3.2)

    for x, y, heading in [(3.0, 10, 0), (8.5, 15.9, 90), (14.3, 9, 180), (9, 4.6, 270),
                          (20, 8.8, 90), (26, 8.5, 180), (27.8, 16.2, 90), (37, 11, 180),
                          (31, 4.4, 90), (18, -4.7, 90), (25, -4.7, 270)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (2.6, 3.6, 38),
        (15.6, 8.2, 262),
        (25.6, 13.8, 78),
        (37.5, 14.5, 215),
        (8.6, -2.6, 108),
    ]:
        plan.view(x, y, heading)
    return plan

"""`indoor-cloud`: two half-circle lobes around half-discs, like a cloud over the horizon.

Brick of three kinds, a dark wooden floor, few cold lamps: dim, with deep shadows.
"""

from sim.indoor.content import furniture as make
from sim.indoor.content.patterns import artwork
from sim.indoor.content.plan import Plan
from sim.indoor.content.textures import brick, plain, planks, plaster
from sim.indoor.geometry.shapes import arc


def draw() -> Plan:
    plan = Plan(height=3.3, exposure=1.15)
    mixed = brick("#9c5a44", "#b9705a", "#3b3230", "#8b4a38", mortar="#cbbfae", rows=14, seed=1)
    tan = brick("#a97f52", "#8f6a42", "#bb9364", "#6d4f33", mortar="#d8ccb4", rows=18, seed=2)
    pale = brick("#caa79a", "#b98f82", "#54484a", "#d9c3b8", mortar="#efe8df", rows=10, seed=3)
    floor = planks("#3a2218", "#120a06", columns=2, rows=14, contrast=0.22, seed=4)
    ceiling = plaster("#b9bcc2", grain=0.03, seed=5)

    right = arc((33, -1), 9, 0, 126.9, 13)
    left = arc((14.5, 0), 14.5, 25.3, 180, 22)
    outline = [(0, -5), (42, -5), *right, *left[1:]]
    walls = [pale, mixed, *[tan] * 6, *[mixed] * 7, *[pale] * 8, *[tan] * 8, *[mixed] * 20]
    plan.room(outline, floor=floor, ceiling=ceiling, walls=walls[: len(outline)])
    plan.island(arc((14.5, 0), 9.5, 0, 180, 17), walls=[*[tan] * 8, *[mixed] * 8, pale])
    plan.island(arc((33, -0.5), 4.4, 0, 180, 11), walls=[*[pale] * 5, *[tan] * 5, mixed])

    grey = plain("#a9adb5")
    plan.put(make.sofa(grey, cushion=plain("#d9a0a4")), (9.0, -0.5), 180)
    plan.put(make.sofa(plain("#7a1f24"), width=2.4), (20, -4.5), 0)
    plan.put(make.shelf(width=1.6, filled=False, material=make.OAK), (15.0, -0.2), 180)
    plan.put(make.shelf(width=1.2, seed=3), (30.2, -4.8), 0)
    plan.put(make.table(), (25.9, -4.4))
    plan.put(make.chair(), (25.3, -3.8), 160)
    plan.put(make.cabinet(make.WALNUT), (6, -4.7), 0)
    plan.put(make.picture(artwork("#efe8df", "#303040", "#a04030", seed=2)), (18.2, -0.03), 180)
    plan.put(make.picture(artwork("#20242c", "#c0c4cc", "#6080a0", seed=4), 2.0), (12, -4.98), 0)
    plan.put(make.plant(seed=2), (0.7, -4.3))
    plan.put(make.plant(seed=3, height=1.6), (41.3, -4.3))
    plan.put(make.globe(plain("#c22a30"), 0.22), (3.6, 7.0))
    plan.put(make.globe(plain("#e0e0e0"), 0.3), (24.5, -1.0))
    plan.put(make.barrel(plain("#2d3036")), (14.5, 13.9))
    plan.put(make.crate(make.OAK, 0.7), (7.5, 11.8), 30)
    plan.put(make.crate(make.WALNUT, 0.5), (8.2, 12.4), 55)
    plan.put(make.chair(make.METAL, plain("#303030")), (22.6, 11.2), 230)
    plan.put(make.bicycle(plain("#3060a0")), (41.5, 1.0), 90)
    plan.put(make.floor_lamp("#ffe0b0"), (1.0, 2.6))
    plan.glow(1.0, 2.6, 1.5, "#ffcf90", 1.6)
    plan.put(make.floor_lamp("#ffe0b0"), (34.0, 7.3))
    plan.glow(34.0, 7.2, 1.5, "#ffcf90", 1.4)
    plan.put(make.stairs(make.WALNUT, steps=4), (36.5, -3.8), 0)

    cold = "#e4ecff"
    for x, y in [(2.3, -2.5), (12, -2.4), (22.5, -2.6), (34.5, -2.8), (4.0, 6.6), (14.5, 12.0),
                 (23.5, 8.0), (26.3, 2.0), (33.5, 6.0), (39.6, 1.0)]:  # fmt: skip
        plan.lamp(x, y, cold, power=2.3)

    for x, y, heading in [(3, -2.6, 90), (12, -2.5, 270), (18, -2.4, 90), (26.2, 1, 0),
                          (31.5, -2.7, 90), (39.8, -0.5, 0), (33, 6.2, 270), (22, 9.4, 310),
                          (12, 11.8, 270), (2.6, 1.5, 180)]:  # fmt: skip
        plan.start(x, y, heading)
    for x, y, heading in [
        (2.5, -3.2, 80),
        (27.6, -3.6, 330),
        (4.2, 5.2, 38),
        (38.9, -2.6, 285),
        (23.6, -1.6, 258),
    ]:
        plan.view(x, y, heading)
    return plan

"""The shape of a wire in a surface of your own, seen in a slice of the lumen.

    PYTHONPATH=build/release/lib/python /usr/bin/python3 -m torquer.examples.own_surface [PICTURE]

Put your file, its unit, and a place and direction of entry in SCENE: torquer-simulator --check-mesh
FILE proposes them.
"""

import pathlib
import sys

import matplotlib.pyplot as plt
import numpy as np
import torquer

SCENE = """
name = "own_surface"

[vessel]
kind = "surface"
file = "meshes/abdominal_aorta/surface.stl"
mesh_unit = "m"
wall_stiffness_N_mm2 = 10

[entry]
point_mm = [54.4, 128.9, 4.3]
direction = [-0.11, -0.994, 0.01]

[[instrument]]
name = "guidewire"
max_length_mm = 300
radius_mm = 0.4445
from_tip_mm = [0, 15, 80, 150]
rigidity_N_mm2 = [1, 1, 100, 300]
tip_mm = 15
tip_angle_deg = 45
"""


def main(picture="own_surface.png"):
    """Prints and draws the shapes."""
    folder = pathlib.Path(torquer.scene_path("abdominal_aorta")).parent
    scene = torquer.Scene.from_text(SCENE, str(folder))
    for finding in scene.findings:
        print(finding)
    simulation = torquer.Simulation(scene)
    hands = simulation.hands
    shapes = []
    for mm in range(1, 151):
        hands[0, 0] = mm
        simulation.step(0.05 * mm, hands)
        if mm % 50 == 0:
            shapes.append((mm, simulation.nodes_mm.copy()))
            print(f"{mm} mm in: tip at {np.round(simulation.tips_mm[0], 1)} mm, "
                  f"{1e3 * simulation.max_penetration_mm:.0f} um into the wall")

    # Slice in the wire's two widest directions.
    middle = shapes[-1][1].mean(axis=0)
    across = np.linalg.svd(shapes[-1][1] - middle)[2][:2]
    figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
    drawn = [((nodes - middle) @ across.T, mm) for mm, nodes in shapes]
    low, high = drawn[-1][0].min(axis=0) - 20, drawn[-1][0].max(axis=0) + 20
    u, v = np.meshgrid(np.arange(low[0], high[0], 0.5), np.arange(low[1], high[1], 0.5))
    places = middle + u[..., None] * across[0] + v[..., None] * across[1]
    clearance_mm = scene.clearance_mm(places.reshape(-1, 3)).reshape(u.shape)
    axes.contourf(u, v, clearance_mm, levels=[0, 100], colors=["#f6d9d9"])
    axes.contour(u, v, clearance_mm, levels=[0], colors=["#b04040"], linewidths=1)
    for (points, mm), style in zip(drawn, (":", "--", "-")):
        axes.plot(points[:, 0], points[:, 1], style, color="#1a4f8b", label=f"{mm} mm in")
    axes.set(aspect="equal", xlabel="mm", ylabel="mm", title="Lumen (shaded) in the plane of the wire")
    axes.legend(loc="upper left")
    figure.savefig(picture, dpi=150)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Lag of a wire's tip behind the hand that turns its other end, for three coefficients of
friction. The wire twists easily: GJ is a tenth of EI (steel: 0.77).

    PYTHONPATH=build/release/lib/python /usr/bin/python3 -m torquer.examples.torque_lag [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import torquer


def tip_angle_rad(simulation):
    """Direction of the tip's bend across the tube, whose last part is straight along x."""
    nodes_mm = simulation.nodes_mm
    bend = nodes_mm[-1, 1:] - 2 * nodes_mm[-6, 1:] + nodes_mm[-11, 1:]
    return np.arctan2(bend[1], bend[0])


def main(picture="torque_lag.png"):
    """Prints and draws the lags."""
    easily_twisted = {"instrument.guidewire.torsional_rigidity_ratio": 0.1, "effects.torsion": True}
    scene = torquer.Scene("drill_tube").with_values(easily_twisted)
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    print("drill_tube, pushed 275 mm, then turned by 720 degrees in 8 s")
    for coefficient, style in zip((0, 0.1, 0.2), ("-", "--", "-.")):
        friction = {"effects.friction.coefficient": coefficient} if coefficient > 0 else {}
        simulation = torquer.Simulation(scene.with_values(friction))
        hands = simulation.hands
        for mm in range(1, 276):
            hands[0, 0] = mm
            simulation.step(0.05 * mm, hands)
        hand_deg = np.arange(0, 721, 5)
        angle_rad = [tip_angle_rad(simulation)]
        for degrees in hand_deg[1:]:
            hands[0, 1] = np.radians(degrees)
            simulation.step(13.75 + degrees / 90, hands)
            angle_rad.append(tip_angle_rad(simulation))
        tip_deg = np.degrees(np.unwrap(angle_rad) - angle_rad[0])
        lag_deg = hand_deg - tip_deg
        print(f"coefficient {coefficient:4.2f}: the tip is {lag_deg[-1]:5.0f} degrees behind at the end, {lag_deg.max():5.0f} at most")
        axes.plot(hand_deg, lag_deg, style, label=f"{coefficient}")
    axes.set(xlabel="turn of the hand (degrees)", ylabel="tip behind the hand (degrees)", title="Torque through the bends of drill_tube")
    axes.legend(title="coefficient of friction")
    axes.grid(alpha=0.3)
    figure.savefig(picture, dpi=150)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:])

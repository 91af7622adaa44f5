"""Force of a hand that pushes a wire through a bent tube, for four coefficients of friction.

    PYTHONPATH=build/release/lib/python /usr/bin/python3 -m torquer.examples.friction_sweep [PICTURE]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import torquer


def main(picture="friction_sweep.png"):
    """Prints and draws the forces."""
    scene = torquer.Scene("drill_tube").with_values({"effects.internal_forces": True})
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    print("drill_tube, pushed 220 mm at 20 mm/s")
    for coefficient, style in zip((0, 0.05, 0.1, 0.2), ("-", "--", "-.", ":")):
        friction = {"effects.friction.coefficient": coefficient} if coefficient > 0 else {}
        simulation = torquer.Simulation(scene.with_values(friction))
        hands = simulation.hands
        insertion_mm, force_mN = np.arange(1, 221), []
        for mm in insertion_mm:
            hands[0, 0] = mm
            simulation.step(0.05 * mm, hands)
            force_mN.append(simulation.readings()["guidewire.hand_force_mN"])
        print(f"coefficient {coefficient:4.2f}: {force_mN[-1]:6.1f} mN at the end, {max(force_mN):6.1f} mN at most")
        axes.plot(insertion_mm, force_mN, style, label=f"{coefficient}")
    axes.set(xlabel="insertion (mm)", ylabel="force at the hand (mN)", title="A 0.035-inch wire in the bends of drill_tube")
    axes.legend(title="coefficient of friction")
    axes.grid(alpha=0.3)
    figure.savefig(picture, dpi=150)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:])

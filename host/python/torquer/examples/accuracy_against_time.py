"""Cost and accuracy of finer segments: a wire pushed 60 mm through the paper's phantom.

    PYTHONPATH=build/release/lib/python /usr/bin/python3 -m torquer.examples.accuracy_against_time [PICTURE]
"""

import sys
import time

import matplotlib.pyplot as plt
import numpy as np
import torquer


def push(segment_mm):
    """Wire at every 0.5 mm of arc length after 60 mm, and the ms for each millimeter of motion."""
    scene = torquer.Scene("ty_phantom").with_values({"relaxation.segment_mm": segment_mm})
    simulation = torquer.Simulation(scene)
    hands = simulation.hands
    begin_s = time.process_time()
    for mm in range(1, 61):
        hands[0, 0] = mm
        simulation.step(0.05 * mm, hands)
    taken_ms = 1e3 * (time.process_time() - begin_s) / 60
    nodes_mm = simulation.nodes_mm
    arc_mm = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(nodes_mm, axis=0), axis=1))])
    at_mm = np.arange(0, 60, 0.5)
    return np.stack([np.interp(at_mm, arc_mm, nodes_mm[:, axis]) for axis in range(3)], axis=1), taken_ms


def main(picture="accuracy_against_time.png"):
    """Prints and draws the table."""
    reference, taken_ms = push(0.1)
    print(f"reference, segments of 0.10 mm: {taken_ms:6.2f} ms for each mm")
    segments_mm = (2, 1.5, 1, 0.6, 0.4, 0.25)
    times_ms, errors_um = [], []
    for segment_mm in segments_mm:
        shape, taken_ms = push(segment_mm)
        times_ms.append(taken_ms)
        errors_um.append(1e3 * np.linalg.norm(shape - reference, axis=1).mean())
        print(f"segments of {segment_mm:4.2f} mm: {taken_ms:6.3f} ms for each mm, mean distance {errors_um[-1]:6.1f} um")
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    axes.loglog(times_ms, errors_um, "o-")
    for segment_mm, taken_ms, error_um in zip(segments_mm, times_ms, errors_um):
        axes.annotate(f" {segment_mm} mm", (taken_ms, error_um))
    axes.set(xlabel="processor time for a millimeter of motion (ms)", ylabel="mean distance from segments of 0.1 mm (µm)",
             title="Accuracy against time, by the length of segments")
    axes.grid(alpha=0.3, which="both")
    axes.margins(x=0.15)
    figure.savefig(picture, dpi=150)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""What one count is worth and what the hardware gets wrong: the numbers in hardware/README.md.

usage: hardware/budget.py      prints the tables

Every function is a formula of its own, with its source beside it; mm and rad, degrees where it says so.
"""

import math
import os
import re

HERE = os.path.dirname(os.path.abspath(__file__))
MM_PER_INCH = 25.4

# PMW3360 data sheet 1.50: reference plane to surface, speed; resolution in steps of 100.
LENS_TO_SURFACE_MM = (2.2, 2.6)
MAXIMUM_SPEED_IPS = 250
CPIS = (400, 800, 1200, 1600, 3200, 6400, 12000)
RADII_MM = (4.0, 5.0, 6.0, 8.0)


def model_parameter(name: str) -> float:
    """A number from the head of parts/bench_device.scad."""
    with open(os.path.join(HERE, "parts", "bench_device.scad"), encoding="utf-8") as file:
        return float(re.search(rf"^{name} = ([\d.]+);", file.read(), re.M).group(1))


RADIUS_MM = model_parameter("cylinder_radius")
STROKE_MM = model_parameter("pipe_length") - model_parameter("cylinder_length")
CLEARANCE_MM = model_parameter("bore_clearance")


def mm_per_count(cpi: float) -> float:
    return MM_PER_INCH / cpi


def rad_per_count(cpi: float, radius_mm: float) -> float:
    return mm_per_count(cpi) / radius_mm


def counts_a_turn(cpi: float, radius_mm: float) -> float:
    return 2 * math.pi / rad_per_count(cpi, radius_mm)


def false_rotation_rad(angle_rad: float, stroke_mm: float, radius_mm: float) -> float:
    """What pushing by `stroke_mm` looks like as rotation, the sensor turned by `angle_rad`."""
    return stroke_mm * math.sin(angle_rad) / radius_mm


def false_insertion_mm(angle_rad: float, rotation_rad: float, radius_mm: float) -> float:
    """What turning looks like as insertion, the sensor turned by `angle_rad`."""
    return rotation_rad * radius_mm * math.sin(angle_rad)


def gain_loss(angle_rad: float) -> float:
    """Share of the motion along the axis that a turned sensor does not count."""
    return 1 - math.cos(angle_rad)


def sag_mm(half_view_mm: float, radius_mm: float) -> float:
    """How much lower the cylinder lies at the edge of the view than in its middle."""
    return radius_mm - math.sqrt(radius_mm**2 - half_view_mm**2)


def foreshortening(half_view_mm: float, radius_mm: float) -> float:
    """Share by which motion around the cylinder looks shorter, averaged over the view: the surface
    moves along the arc and the sensor sees its projection, cos(asin(y / R)) of it."""
    w, r = half_view_mm, radius_mm
    mean = (w * math.sqrt(r * r - w * w) + r * r * math.asin(w / r)) / (2 * w * r)
    return 1 - mean


def offset_foreshortening(offset_mm: float, radius_mm: float) -> float:
    """The same for a sensor that looks `offset_mm` beside the cylinder's crest."""
    return 1 - math.sqrt(1 - (offset_mm / radius_mm) ** 2)


def surface_distance_mm(lens_to_surface_mm: float, clearance_mm: float) -> tuple[float, float]:
    """Least and largest distance of the lens from a cylinder with that much play in its pipe, the
    sensor set to `lens_to_surface_mm` above a cylinder in the pipe's middle."""
    return lens_to_surface_mm - clearance_mm, lens_to_surface_mm + clearance_mm


def roll_rad(clearance_mm: float, radius_mm: float) -> float:
    """Rotation that is counted when the cylinder shifts sideways by its whole play."""
    return 2 * clearance_mm / radius_mm


def radius_error_deg_a_turn(radius_error_mm: float, radius_mm: float) -> float:
    return 360 * radius_error_mm / radius_mm


def joystick_rate_step_rad_s(full_rate_rad_s: float, dead_zone_counts: float) -> float:
    """Change of the C-arm's rate with one count of the joystick, outside the dead zone."""
    return full_rate_rad_s / (1023 - 512 - dead_zone_counts)


def joystick_defaults() -> tuple[float, float]:
    """Full rate in rad/s and dead zone in counts, of an uncalibrated device."""
    path = os.path.join(HERE, "..", "calibration", "emulator.toml")
    with open(path, encoding="utf-8") as file:
        content = file.read()
    return (
        float(re.search(r"full_rate_rad_per_s = ([\d.]+)", content).group(1)),
        float(re.search(r"dead_zone = ([\d.]+)", content).group(1)),
    )


def resolution_table() -> list[list[str]]:
    rows = [["cpi", "mm a count"] + [f"degrees a count, R = {radius:g} mm" for radius in RADII_MM]
            + [f"counts a turn, R = {RADIUS_MM:g} mm"]]
    for cpi in CPIS:
        rows.append(
            [str(cpi), f"{mm_per_count(cpi):.4f}"]
            + [f"{math.degrees(rad_per_count(cpi, radius)):.3f}" for radius in RADII_MM]
            + [f"{counts_a_turn(cpi, RADIUS_MM):.0f}"]
        )
    return rows


def error_table() -> list[list[str]]:
    one, fitted = math.radians(1), math.radians(0.05)
    low, high = surface_distance_mm(model_parameter("lens_to_surface"), CLEARANCE_MM)
    rate, dead_zone = joystick_defaults()
    step = math.degrees(joystick_rate_step_rad_s(rate, dead_zone))
    cross = math.degrees(false_rotation_rad(one, STROKE_MM, RADIUS_MM))
    left = math.degrees(false_rotation_rad(fitted, STROKE_MM, RADIUS_MM))
    turn = false_insertion_mm(one, 2 * math.pi, RADIUS_MM)
    return [
        ["source", "as built", "after calibration"],
        ["one count at 1200 cpi", f"{mm_per_count(1200):.3f} mm, "
         f"{math.degrees(rad_per_count(1200, RADIUS_MM)):.2f} degrees", "the same"],
        ["sensor turned by 1 degree: pushing looks like turning",
         f"{cross:.1f} degrees in {STROKE_MM:g} mm", f"{left:.1f} degrees (0.05 degrees left)"],
        ["sensor turned by 1 degree: turning looks like pushing", f"{turn:.2f} mm a turn",
         f"{false_insertion_mm(fitted, 2 * math.pi, RADIUS_MM):.3f} mm a turn"],
        ["sensor turned by 1 degree: both gains", f"{100 * gain_loss(one):.3f} %", "0"],
        ["gain of the sensor, 1 % (data sheet, typical)", f"{0.01 * STROKE_MM:.1f} mm in "
         f"{STROKE_MM:g} mm", f"{0.001 * STROKE_MM:.2f} mm (0.1 %)"],
        ["cylinder thicker by 0.1 mm than said",
         f"{radius_error_deg_a_turn(0.1, RADIUS_MM):.1f} degrees a turn", "0.2 degrees a turn"],
        ["curvature, view of +-0.5 mm: height at the edge", f"{1000 * sag_mm(0.5, RADIUS_MM):.0f} um",
         "within the focus"],
        ["curvature, view of +-0.5 mm: turning looks shorter by",
         f"{100 * foreshortening(0.5, RADIUS_MM):.2f} %", "0"],
        ["sensor 0.5 mm beside the crest: turning looks shorter by",
         f"{100 * offset_foreshortening(0.5, RADIUS_MM):.2f} %", "0"],
        [f"play of {CLEARANCE_MM:g} mm in the pipe: lens to surface", f"{low:.2f} to {high:.2f} mm",
         f"the sensor takes {LENS_TO_SURFACE_MM[0]:g} to {LENS_TO_SURFACE_MM[1]:g} mm"],
        [f"play of {CLEARANCE_MM:g} mm in the pipe: rolling from side to side",
         f"{math.degrees(roll_rad(CLEARANCE_MM, RADIUS_MM)):.1f} degrees", "stays"],
        ["fastest push that the sensor follows",
         f"{MAXIMUM_SPEED_IPS * MM_PER_INCH / 1000:.2f} m/s", "the same"],
        ["one count of the joystick: C-arm's rate", f"{step:.3f} degrees/s",
         f"0 within {dead_zone:g} counts of the middle"],
        ["one count of the joystick, in one report of 1 ms: C-arm's angle",
         f"{step / 1000:.5f} degrees", "the same"],
        ["C-arm across its 180 degrees, stick at its end",
         f"{180 / math.degrees(rate):.1f} s", "the same"],
    ]


def markdown(rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join(lines)


if __name__ == "__main__":
    print(markdown(resolution_table()))
    print()
    print(markdown(error_table()))

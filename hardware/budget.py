"""Scale and errors of the hardware: the numbers in hardware/README.md.

Every function is one formula, with its source beside it. Units are mm, N and rad, or degrees if its name ends so.
Lengths are evaluated from the definitions in parts/bench_device.scad, so that the printed parts and this page share one
derivation.
"""

import argparse
import ast
import csv
import math
import operator
import os
import re

HERE = os.path.dirname(os.path.abspath(__file__))
MM_PER_INCH = 25.4

# PMW3360 data sheet 1.50: speed; resolution in steps of 100.
MAXIMUM_SPEED_IPS = 250
CPIS = (400, 800, 1200, 1600, 3200, 6400, 12000)
RADII_MM = (4.0, 5.0, 6.0, 8.0)
# Decrease of the resolution for each millimeter of height, smallest and largest of the surfaces in figure 12.
HEIGHT_GAIN_PER_MM = (0.028, 0.13)
HALF_VIEW_MM = 0.5  # half the side of the sensor's view, at an assumed magnification of 1:1
# The sensor's LED: assumed angle of its light to the vertical, and its distance from the middle of the view. With these
# values the shading of flat paper is that of real pictures, 1.23 to 1.51 along the light.
LIGHT_ANGLE_DEG = 69.0
LIGHT_DISTANCE_MM = 8.0

# Uncertainties from printing and from bought parts, each +-, mm.
PRINT_MM = 0.1  # height of a printed part, in layers of 0.2
FLANGE_MM = 0.05  # position of the lens in its board
RADIUS_MM_ERROR = 0.05  # the caliper's check: 9.9 to 10.1 mm over paper and core

AIR_KG_M3 = 1.2
DISCHARGE = 0.6  # of a sharp-edged hole
PLA_KG_M3 = 1240
PRINTED_SHARE = 0.6  # plastic fraction of a part's volume: three walls and 20 % infill
FRICTION_PAPER_PLA = 0.3  # assumed
GRAVITY_M_S2 = 9.81
CAP_PLAY_MM = 0.3  # of a wire in the hole of a cap
PETG_MPA = 2000  # Young's modulus of the leaf springs, printed on their side

_OPERATORS = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.USub: operator.neg,
}


def _evaluate(node: ast.AST, values: dict[str, float]) -> float:
    """Evaluates a number, a name in `values`, or their sum, difference, product or quotient. Raises
    KeyError for anything else."""
    if isinstance(node, ast.Constant):
        return float(node.value)
    if isinstance(node, ast.Name):
        return values[node.id]
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_evaluate(node.operand, values))
    if isinstance(node, ast.BinOp):
        left, right = _evaluate(node.left, values), _evaluate(node.right, values)
        return _OPERATORS[type(node.op)](left, right)
    raise KeyError(type(node))


def model_values(path: str = os.path.join(HERE, "parts", "bench_device.scad")) -> dict[str, float]:
    """Numbers that the model defines, including those derived from others. Omits lists and
    expressions beyond arithmetic."""
    values: dict[str, float] = {}
    with open(path, encoding="utf-8") as file:
        for name, expression in re.findall(r"^(\w+) = ([^;]+);", file.read(), re.M):
            try:
                values[name] = _evaluate(ast.parse(expression.strip(), mode="eval").body, values)
            except (KeyError, SyntaxError, ValueError, TypeError):
                continue
    return values


MODEL = model_values()
RADIUS_MM = MODEL["cylinder_radius"]
STROKE_MM = MODEL["travel"]
CLEARANCE_MM = MODEL["bore_clearance"]


def mm_per_count(cpi: float) -> float:
    return MM_PER_INCH / cpi


def rad_per_count(cpi: float, radius_mm: float) -> float:
    return mm_per_count(cpi) / radius_mm


def counts_a_turn(cpi: float, radius_mm: float) -> float:
    return 2 * math.pi / rad_per_count(cpi, radius_mm)


def false_rotation_rad(angle_rad: float, stroke_mm: float, radius_mm: float) -> float:
    """Apparent rotation from pushing by `stroke_mm`, with the sensor turned by `angle_rad`."""
    return stroke_mm * math.sin(angle_rad) / radius_mm


def false_insertion_mm(angle_rad: float, rotation_rad: float, radius_mm: float) -> float:
    """Apparent insertion from turning, with the sensor turned by `angle_rad`."""
    return rotation_rad * radius_mm * math.sin(angle_rad)


def gain_loss(angle_rad: float) -> float:
    """Fraction of the motion along the axis that a turned sensor does not count. """
    return 1 - math.cos(angle_rad)


def sag_mm(half_view_mm: float, radius_mm: float) -> float:
    """Drop of the cylinder's surface from the middle to the edge of the view."""
    return radius_mm - math.sqrt(radius_mm**2 - half_view_mm**2)


def foreshortening(half_view_mm: float, radius_mm: float) -> float:
    """Fraction by which motion around the cylinder looks shorter, averaged over the view. The surface
    moves along the arc, and the sensor sees the projection, with the factor cos(asin(y / R))."""
    w, r = half_view_mm, radius_mm
    mean = (w * math.sqrt(r * r - w * w) + r * r * math.asin(w / r)) / (2 * w * r)
    return 1 - mean


def offset_foreshortening(offset_mm: float, radius_mm: float) -> float:
    """Foreshortening for a sensor that looks `offset_mm` beside the cylinder's crest."""
    return 1 - math.sqrt(1 - (offset_mm / radius_mm) ** 2)


def brightness(x_mm: float, y_mm: float, radius_mm: float, light_angle_rad: float, across: bool) -> float:
    """Light on matt paper, `x_mm` along the cylinder and `y_mm` beside its crest. It follows one ray from the LED, with
    Lambert's cosine and the inverse square of the distance. The LED stands across the cylinder or along it. An infinite
    radius is flat paper."""
    if math.isinf(radius_mm):
        normal, drop = (0.0, 0.0, 1.0), 0.0
    else:
        normal = (0.0, y_mm / radius_mm, math.sqrt(1 - (y_mm / radius_mm) ** 2))
        drop = sag_mm(y_mm, radius_mm)
    aside = LIGHT_DISTANCE_MM * math.sin(light_angle_rad)
    lamp = (0.0 if across else aside, aside if across else 0.0, LIGHT_DISTANCE_MM * math.cos(light_angle_rad))
    ray = (lamp[0] - x_mm, lamp[1] - y_mm, lamp[2] + drop)
    distance = math.sqrt(sum(part * part for part in ray))
    return max(0.0, sum(n * r for n, r in zip(normal, ray))) / distance**3


def shading(half_view_mm: float, radius_mm: float, light_angle_rad: float, across: bool, along_view: bool) -> float:
    """Brightest over darkest of the view's middle line: along the cylinder if `along_view`, else across it."""
    places = [half_view_mm * i / 50 for i in range(-50, 51)]
    lights = [brightness(at, 0.0, radius_mm, light_angle_rad, across) if along_view
              else brightness(0.0, at, radius_mm, light_angle_rad, across) for at in places]
    return max(lights) / min(lights)


def focus_mm() -> dict[str, tuple[float, float]]:
    """Smallest and largest distance of lens and surface, as printed without adjustment, and set to half a step. The
    cylinder rests on the floor of its bore, or is lifted to the ceiling."""
    rest = MODEL["lens_plane"] - MODEL["crest_at_rest"]
    lifted = MODEL["lens_plane"] - MODEL["crest_lifted"]
    # The board's seat and the flat on the pipe have printed heights. The lens and the cylinder's radius vary too.
    printed = 2 * PRINT_MM + FLANGE_MM + RADIUS_MM_ERROR
    step = MODEL["focus_step"] / 2
    return {
        "as printed": (rest - printed, rest + printed),
        "at rest": (rest - step, rest + step),
        "lifted": (lifted - step, lifted + step),
        "allowed": (MODEL["focus_low"], MODEL["focus_high"]),
    }


def height_errors(gain_per_mm: float, play_mm: float) -> tuple[float, float, float]:
    """Error of a motion whose cylinder rises by `play_mm` after the calibration. It is a fraction, mm over the
    stroke, and degrees per turn."""
    share = gain_per_mm * play_mm
    return share, share * STROKE_MM, share * 360


def roll_rad(clearance_mm: float, radius_mm: float) -> float:
    """Rotation counted if the cylinder shifts sideways by its whole play."""
    return 2 * clearance_mm / radius_mm


def radius_error_deg_a_turn(radius_error_mm: float, radius_mm: float) -> float:
    return 360 * radius_error_mm / radius_mm


def cap_openings_mm2(vents: float) -> float:
    """Openings of one cap: around the wire, and the vents."""
    hole, wire = MODEL["wire_diameter"] + 0.6, MODEL["wire_diameter"]
    return math.pi / 4 * (hole**2 - wire**2 + vents * MODEL["vent_diameter"] ** 2)


def piston_force_n(speed_m_s: float, radius_mm: float, opening_mm2: float) -> float:
    """Force of the air in front of the cylinder. All of it leaves through the cap, a sharp-edged hole
    (Bernoulli); the flow beside the cylinder is neglected."""
    area_m2 = math.pi * (radius_mm / 1000) ** 2
    jet_m_s = area_m2 * speed_m_s / (DISCHARGE * opening_mm2 * 1e-6)
    return AIR_KG_M3 / 2 * jet_m_s**2 * area_m2


def cylinder_kg(part: str = "cylinder_core") -> float:
    """Mass of the wire's cylinder, or of the catheter's hollow one (`catheter_core`)."""
    with open(os.path.join(HERE, "parts", "parts.csv"), newline="", encoding="utf-8") as file:
        volume_cm3 = next(float(row["volume_cm3"]) for row in csv.DictReader(file) if row["part"] == part)
    return volume_cm3 * 1e-6 * PLA_KG_M3 * PRINTED_SHARE


def friction_n(part: str = "cylinder_core") -> float:
    return FRICTION_PAPER_PLA * cylinder_kg(part) * GRAVITY_M_S2


def leaf_force_n(deflection_mm: float) -> float:
    """Force of one leaf spring at its nub: a cantilever, 3 E I d / L3."""
    inertia_mm4 = MODEL["leaf_width"] * MODEL["leaf_thickness"] ** 3 / 12
    return 3 * PETG_MPA * inertia_mm4 * deflection_mm / MODEL["leaf_length"] ** 3


def lifting_force_n(part: str = "cylinder_core") -> float:
    """Upward force of the wire that lifts the cylinder off the floor of its bore, against weight and both springs."""
    return cylinder_kg(part) * GRAVITY_M_S2 + 2 * leaf_force_n(MODEL["leaf_deflection"])


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


def height_row() -> list[str]:
    low, high = (height_errors(gain, 2 * CLEARANCE_MM) for gain in HEIGHT_GAIN_PER_MM)
    error = (f"{100 * low[0]:.1f} to {100 * high[0]:.1f} % more: {low[1]:.1f} to {high[1]:.1f} mm in "
             f"{STROKE_MM:g} mm, {low[2]:.0f} to {high[2]:.0f} degrees a turn")
    return [error, f"0 below a pull of {lifting_force_n():.2f} N upward, with the leaf springs; beyond, the calibration "
            "measures and states it"]


def error_table() -> list[list[str]]:
    one, fitted = math.radians(1), math.radians(0.05)
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
        [f"curvature, view of +-{HALF_VIEW_MM:g} mm: height at the edge",
         f"{1000 * sag_mm(HALF_VIEW_MM, RADIUS_MM):.0f} um", "within the focus"],
        [f"curvature, view of +-{HALF_VIEW_MM:g} mm: turning looks shorter by",
         f"{100 * foreshortening(HALF_VIEW_MM, RADIUS_MM):.2f} %", "0"],
        ["sensor 0.5 mm beside the crest: turning looks shorter by",
         f"{100 * offset_foreshortening(0.5, RADIUS_MM):.2f} %", "0"],
        [f"cylinder raised by its play of {2 * CLEARANCE_MM:g} mm: counts", *height_row()],
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


def focus_table() -> list[list[str]]:
    heights = focus_mm()

    def span(name: str) -> str:
        low, high = heights[name]
        return f"{low:.2f} to {high:.2f}"

    shims = MODEL["shims_fitted"]
    return [
        ["lens to surface", "mm"],
        ["range of the sensor", span("allowed")],
        [f"as drawn, {shims:g} shims of {MODEL['shim_thickness']:g} mm fitted, the cylinder at rest",
         f"{MODEL['lens_to_surface']:.2f}"],
        ["as printed, nothing set: worst case of heights, lens and radius", span("as printed")],
        [f"set in steps of {MODEL['focus_step']:g} mm, the cylinder at rest", span("at rest")],
        ["the same, the cylinder lifted by its whole play", span("lifted")],
    ]


def shading_table() -> list[list[str]]:
    rows = [["LED against the vertical", "flat paper, along the light", "cylinder, light across it: across",
             "cylinder, light along it, as drawn: across", "the same: along"]]
    for angle in (45.0, 60.0, LIGHT_ANGLE_DEG, 75.0):
        light = math.radians(angle)
        ratios = (shading(HALF_VIEW_MM, math.inf, light, False, True),
                  shading(HALF_VIEW_MM, RADIUS_MM, light, True, False),
                  shading(HALF_VIEW_MM, RADIUS_MM, light, False, False),
                  shading(HALF_VIEW_MM, RADIUS_MM, light, False, True))
        rows.append([f"{angle:g} degrees", *(f"{ratio:.2f} : 1" for ratio in ratios)])
    return rows


def force_table() -> list[list[str]]:
    mass = cylinder_kg()
    closed, vented = cap_openings_mm2(0), cap_openings_mm2(MODEL["vent_count"])
    # The floor of the bore carries the springs' force, and their nubs rub, too.
    spring_friction = 2 * FRICTION_PAPER_PLA * 2 * leaf_force_n(MODEL["leaf_deflection"])

    def piston(opening: float, speed: float) -> str:
        return f"{piston_force_n(speed, RADIUS_MM, opening):.4f}"

    return [
        ["force that the device adds to the hand's", "N"],
        [f"weight of the cylinder, {1000 * mass:.0f} g, sliding on its bore (friction {FRICTION_PAPER_PLA:g})",
         f"{friction_n():.3f}"],
        [f"two leaf springs, {2 * leaf_force_n(MODEL['leaf_deflection']):.2f} N on the cylinder: friction",
         f"{spring_friction:.3f}"],
        ["its inertia, at 2 m/s2", f"{mass * 2:.3f}"],
        ["air, pushing at 0.2 m/s; without the vents", f"{piston(vented, 0.2)}; {piston(closed, 0.2)}"],
        ["air, pushing at 0.5 m/s; without the vents", f"{piston(vented, 0.5)}; {piston(closed, 0.5)}"],
        ["together, at 0.2 m/s and 2 m/s2",
         f"{friction_n() + spring_friction + mass * 2 + piston_force_n(0.2, RADIUS_MM, vented):.3f}"],
        ["pull of the wire upward that lifts the cylinder: with the springs; without",
         f"{lifting_force_n():.2f}; {mass * GRAVITY_M_S2:.2f}"],
        [f"the catheter's hollow cylinder, {1000 * cylinder_kg('catheter_core'):.0f} g: sliding, with the springs",
         f"{friction_n('catheter_core') + spring_friction:.3f}"],
        ["pull upward that lifts it, with the springs", f"{lifting_force_n('catheter_core'):.2f}"],
        [f"wire in its passage: free within {MODEL['passage_play']:.2f} mm of the middle, "
         f"{CLEARANCE_MM + CAP_PLAY_MM:.2f} needed", "0"],
    ]


def suspend_table() -> list[list[str]]:
    """Current from the USB while the bus is suspended, mA: board at 3.3 V, and at 5 V."""
    # Part, at 3.3 V, at 5 V, source.
    parts = [
        ("pull-up on D+ against the host's 15 kohm", 3.3 / 16.5, 3.3 / 16.5, "USB 2.0, 7.1.5"),
        ("ATmega32U4, power-down with watchdog", 0.006, 0.012, "data sheet, typical"),
        ("the same, awake: 16,384 cycles of start and some 0.3 ms in every 32 ms",
         (2.0 + 0.3) / 32 * 4.0, (1.0 + 0.3) / 32 * 12.0, "data sheet: 4 and 12 mA awake"),
        ("joystick, two potentiometers of 10 kohm", 2 * 3.3 / 10, 2 * 5.0 / 10, "Ohm"),
        ("PMW3360 in shutdown", 0.013, 0.013, "data sheet: 10 uA and more"),
        ("sensor module: two regulators, level shifter", 0.15, 0.15, "such parts, typical"),
        ("RX and TX LED, kept dark", 0.0, 0.0, "4 to 9 each when lit"),
        ("board: regulator", 0.1, 0.1, "MIC5219, 80 uA typical"),
    ]
    rows = [["load", "at 3.3 V", "at 5 V", "by"]]
    for what, low, high, source in parts:
        rows.append([what, f"{low:.2f}", f"{high:.2f}", source])
    total_low = sum(part[1] for part in parts)
    total_high = sum(part[2] for part in parts)
    rows.append(["**together**; the USB allows 2.5", f"**{total_low:.2f}**", f"**{total_high:.2f}**", ""])
    rows.append(["power LED of the board, where it has one: comes on top", "1 to 2", "1 to 4",
                 "not measured"])
    return rows


def markdown(rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join(lines)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    for table in (resolution_table(), error_table(), focus_table(), shading_table(), force_table(),
                  suspend_table()):
        print(markdown(table))
        print()

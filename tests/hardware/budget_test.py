"""Resolution and error budget, compared with values from an independent computation."""

import math
import os
import re
import subprocess
import tempfile
import unittest

import budget


class Model(unittest.TestCase):
    def test_only_arithmetic_is_evaluated(self):
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "model.scad")
            with open(path, "w", encoding="utf-8") as file:
                file.write("a = 2;  // mm\nb = a * (3 - 0.5) / -a;\nlist = [1, 2];\n$fn = 64;\n"
                           "part = \"x\";\nc = unknown + 1;\nflag = true;\nd = __import__(1);\n"
                           "module m() { inside = 7; }\n  indented = 8;\n")
            self.assertEqual(budget.model_values(path), {"a": 2, "b": -2.5})

    def test_openscad_derives_the_same(self):
        names = sorted(budget.MODEL)
        self.assertIn("lens_plane", names)
        self.assertGreater(len(names), 50)
        with tempfile.TemporaryDirectory() as work:
            path, answer = os.path.join(work, "ask.scad"), os.path.join(work, "answer.echo")
            with open(path, "w", encoding="utf-8") as file:
                file.write(f"include <{budget.HERE}/parts/bench_device.scad>\npart = \"nothing\";\n")
                file.writelines(f'echo("{name}", {name});\n' for name in names)
            subprocess.run(["openscad", "-o", answer, path], check=True, capture_output=True,
                           env={**os.environ, "HOME": work})
            with open(answer, encoding="utf-8") as file:
                said = dict(re.findall(r'ECHO: "(\w+)", ([-\d.e]+)', file.read()))
        self.assertEqual(set(said), set(names))
        for name in names:
            self.assertAlmostEqual(float(said[name]), budget.MODEL[name], places=4, msg=name)


class Budget(unittest.TestCase):
    def test_a_count(self):
        self.assertAlmostEqual(budget.mm_per_count(1200), 0.0211667, places=7)
        # One turn of a 10 mm cylinder is its circumference, in counts of the sensor.
        self.assertAlmostEqual(budget.counts_a_turn(1200, 5), math.pi * 10 / 25.4 * 1200, places=6)

    def test_agrees_with_the_emulated_devices_calibration(self):
        path = os.path.join(budget.HERE, "..", "calibration", "emulator.toml")
        with open(path, encoding="utf-8") as file:
            content = file.read()
        mm = float(re.search(r"insertion_mm_per_count = \[([\d.]+)", content).group(1))
        rad = float(re.search(r"rotation_rad_per_count = \[[\d.]+, ([\d.]+)", content).group(1))
        cpi = float(re.search(r"cpi = (\d+)", content).group(1))
        self.assertAlmostEqual(budget.mm_per_count(cpi), mm, places=12)
        self.assertAlmostEqual(budget.rad_per_count(cpi, budget.RADIUS_MM), rad, places=12)

    def test_model_has_the_radius_of_the_nominal_calibration(self):
        path = os.path.join(budget.HERE, "..", "calibration", "motion_model.h")
        with open(path, encoding="utf-8") as file:
            radius = re.search(r"kNominalCylinderRadiusMm = ([\d.]+);", file.read()).group(1)
        self.assertEqual(budget.RADIUS_MM, float(radius))
        self.assertEqual(budget.STROKE_MM, 150)

    def test_misalignment_against_the_rotated_motion(self):
        angle = math.radians(0.7)
        # A push by 150 mm in axes rotated by the angle has a component along the other axis.
        seen = complex(150, 0) * complex(math.cos(angle), math.sin(angle))
        self.assertAlmostEqual(budget.false_rotation_rad(angle, 150, 5), seen.imag / 5, places=12)
        self.assertAlmostEqual(budget.gain_loss(angle), 1 - seen.real / 150, places=12)
        turn = complex(0, 2 * math.pi * 5) * complex(math.cos(angle), -math.sin(angle))
        self.assertAlmostEqual(
            budget.false_insertion_mm(angle, 2 * math.pi, 5), turn.real, places=12
        )

    def test_curvature_against_sums_over_the_view(self):
        radius, half = 5.0, 0.5
        steps = 20000
        mean = sum(
            math.cos(math.asin(half * (2 * (i + 0.5) / steps - 1) / radius)) for i in range(steps)
        ) / steps
        self.assertAlmostEqual(budget.foreshortening(half, radius), 1 - mean, places=8)
        self.assertAlmostEqual(1000 * budget.sag_mm(half, radius), 25, delta=0.1)  # um
        tilt = math.asin(0.5 / radius)
        self.assertAlmostEqual(
            budget.offset_foreshortening(0.5, radius), 1 - math.cos(tilt), places=12
        )

    def test_somewhere_in_its_play_the_surface_never_leaves_the_focus(self):
        heights = budget.focus_mm()
        low, high = heights["allowed"]
        self.assertEqual((low, high), (2.2, 2.6))  # PMW3360 data sheet 1.50
        for name in ("at rest", "lifted"):
            self.assertGreaterEqual(heights[name][0], low - 1e-9, name)
            self.assertLessEqual(heights[name][1], high + 1e-9, name)
        # The lens flange is 3.4 mm below the board; the cylinder lies on the floor of its bore.
        model = budget.MODEL
        crest = model["cylinder_radius"] - model["bore_clearance"]
        board = (model["block_top"] + model["shims_fitted"] * model["shim_thickness"]
                 + model["seat_in_carrier"])
        self.assertEqual(model["lens_height"], 3.4)
        self.assertAlmostEqual(sum(heights["at rest"]) / 2, board - 3.4 - crest)
        # Shims correct the uncertainty of printing in both directions: one more, or none.
        printed = heights["as printed"]
        reach = model["shims_fitted"] * model["shim_thickness"]
        self.assertLess(printed[1] - heights["at rest"][1], reach)
        self.assertLess(heights["at rest"][0] - printed[0], reach)

    def test_light_against_a_lamp_over_flat_paper(self):
        """Height h over the paper and distance a aside: h / (h2 + (a - x)2) ^ 1.5. The result is the ratio of both
        ends."""
        for degrees in (45, 60, 69, 75):
            light = math.radians(degrees)
            a, h = 8 * math.sin(light), 8 * math.cos(light)
            near, far = h**2 + (a - 0.5) ** 2, h**2 + (a + 0.5) ** 2
            self.assertAlmostEqual(
                budget.shading(0.5, math.inf, light, False, True), (far / near) ** 1.5, places=9)
        # Real pictures of flat targets: 1.23 to 1.51 along the light, 1.00 to 1.12 across it.
        assumed = math.radians(budget.LIGHT_ANGLE_DEG)
        self.assertTrue(1.23 < budget.shading(0.5, math.inf, assumed, False, True) < 1.51)
        self.assertTrue(1.00 <= budget.shading(0.5, math.inf, assumed, False, False) < 1.12)

    def test_light_of_a_distant_lamp_is_the_cosine_of_the_angle_between(self):
        near, budget.LIGHT_DISTANCE_MM = budget.LIGHT_DISTANCE_MM, 1e7
        try:
            for radius in (4.0, 5.0, 8.0):
                tilt = math.asin(0.5 / radius)
                light = math.radians(69)
                self.assertAlmostEqual(budget.shading(0.5, radius, light, True, False),
                                       math.cos(light - tilt) / math.cos(light + tilt), places=5)
                self.assertAlmostEqual(
                    budget.shading(0.5, radius, light, False, False), 1 / math.cos(tilt), places=5)
        finally:
            budget.LIGHT_DISTANCE_MM = near

    def test_board_lies_along_the_wire_because_of_the_light(self):
        assumed = math.radians(budget.LIGHT_ANGLE_DEG)
        self.assertGreater(budget.shading(0.5, 5, assumed, True, False), 2)
        self.assertLess(budget.shading(0.5, 5, assumed, False, False), 1.12)
        self.assertGreater(budget.MODEL["board_x"], budget.MODEL["board_y"])

    def test_leaf_springs_hold_the_cylinder_and_slide(self):
        """Against the energy of the bent leaf: half of force times way, with the moment P (L - x) along it."""
        model = budget.MODEL
        length, steps = model["leaf_length"], 20000
        stiffness = 2000 * model["leaf_width"] * model["leaf_thickness"] ** 3 / 12
        force = budget.leaf_force_n(1.0)
        energy = sum((force * (length - length * (i + 0.5) / steps)) ** 2 for i in range(steps))
        energy *= length / steps / (2 * stiffness)
        self.assertAlmostEqual(energy, force * 1.0 / 2, places=6)
        # More than the weight, and less friction than the smallest of a wire in a catheter twice over.
        preload = 2 * budget.leaf_force_n(model["leaf_deflection"])
        self.assertGreater(preload, budget.cylinder_kg() * 9.81)
        self.assertLess(2 * 0.3 * preload, 2 * 0.05 + 0.01)
        # Strain of a spring that stays bent, at a cylinder lifted with all shims taken away: below 1 %.
        most = model["leaf_deflection"] + 2 * model["bore_clearance"] + model["shims_fitted"] * model["shim_thickness"]
        self.assertLess(1.5 * model["leaf_thickness"] * most / length**2, 0.01)

    def test_air_against_the_energy_of_its_jet(self):
        # The power of the push equals that of the jet: force times speed, half the mass flow times
        # v2.
        for speed in (0.2, 0.5):
            opening = budget.cap_openings_mm2(0)
            flow_m3_s = math.pi * 0.005**2 * speed
            jet = flow_m3_s / (0.6 * opening * 1e-6)
            power = 0.5 * 1.2 * flow_m3_s * jet**2
            self.assertAlmostEqual(budget.piston_force_n(speed, 5, opening), power / speed, places=9)
        closed, vented = budget.cap_openings_mm2(0), budget.cap_openings_mm2(budget.MODEL["vent_count"])
        self.assertAlmostEqual(budget.piston_force_n(0.2, 5, closed), 0.03, delta=0.01)
        self.assertAlmostEqual(budget.piston_force_n(0.5, 5, closed), 0.2, delta=0.05)
        self.assertLess(budget.piston_force_n(0.5, 5, vented), 0.001)
        self.assertAlmostEqual(closed, math.pi / 4 * (1.5**2 - 0.9**2))

    def test_suspend_current_stays_within_the_usb_limit(self):
        *parts, total, _ = budget.suspend_table()[1:]
        for column in (1, 2):
            together = float(total[column].strip("*"))
            self.assertAlmostEqual(together, sum(float(row[column]) for row in parts), delta=0.04)
            self.assertLess(together, 2.5)

    def test_weight_and_friction(self):
        self.assertAlmostEqual(budget.cylinder_kg(), 0.0094, delta=0.001)
        self.assertAlmostEqual(budget.friction_n(), 0.3 * 9.81 * budget.cylinder_kg())

    def test_hollow_cylinder_is_held_down_and_leaves_the_wire_free(self):
        model = budget.MODEL
        hollow = budget.cylinder_kg("catheter_core")
        # Hollow over 170 mm: a seat of 2.6 mm for 30 mm, else a passage of 2 mm. The core of the wire's cylinder is
        # subtracted.
        taken_mm3 = math.pi / 4 * (140 * (2.0**2 - 1.1**2) + 30 * (2.6**2 - 1.1**2))
        self.assertAlmostEqual(budget.cylinder_kg() - hollow, taken_mm3 * 1e-9 * 1240 * 0.6, delta=1e-4)
        self.assertGreater(budget.lifting_force_n("catheter_core"), 3 * 9.81 * hollow / 1.2)
        self.assertGreater((2.0 - 0.9) / 2, 0.15 + 0.3)
        self.assertAlmostEqual(model["passage_play"], (2.0 - 0.9) / 2)

    def test_roll_and_radius(self):
        # A shift by 0.3 mm across moves the crest past the sensor by the same distance.
        self.assertAlmostEqual(budget.roll_rad(0.15, 5) * 5, 0.3)
        self.assertAlmostEqual(budget.radius_error_deg_a_turn(0.1, 5), 360 * 5.1 / 5 - 360)

    def test_joystick_against_the_calibrations_rate(self):
        rate, dead_zone = budget.joystick_defaults()
        step = budget.joystick_rate_step_rad_s(rate, dead_zone)
        self.assertAlmostEqual(step * (1023 - 512 - dead_zone), rate)
        self.assertAlmostEqual(math.degrees(step), 0.0413, places=4)

    def test_tables_are_rectangular(self):
        for table in (budget.resolution_table(), budget.error_table(), budget.focus_table(),
                      budget.shading_table(), budget.force_table(), budget.suspend_table()):
            self.assertEqual({len(row) for row in table}, {len(table[0])})
            self.assertIn("|---|", budget.markdown(table))

    def test_the_height_of_the_cylinder_changes_the_counts_as_in_figure_12(self):
        """Read off the figure, from 2.1 to 2.7 mm. The steepest surface has 5200 to 4800 counts an inch, the flattest
        5100 to 5020. At 5000 cpi, a share of the nominal."""
        steepest, flattest = (5200 - 4800) / 5000 / 0.6, (5100 - 5020) / 5000 / 0.6
        low, high = budget.HEIGHT_GAIN_PER_MM
        self.assertAlmostEqual(high, steepest, delta=0.005)
        self.assertAlmostEqual(low, flattest, delta=0.005)
        # A push of 150 mm that is calibrated at rest and made at the ceiling of the bore.
        play = budget.MODEL["crest_lifted"] - budget.MODEL["crest_at_rest"]
        share, mm, degrees = budget.height_errors(high, play)
        counts = 150 / 25.4 * 1200
        self.assertAlmostEqual(mm, 150 * (counts * (1 + share)) / counts - 150, places=6)
        self.assertAlmostEqual(mm, 5.9, delta=0.1)
        self.assertAlmostEqual(degrees, 14, delta=0.1)


if __name__ == "__main__":
    unittest.main()

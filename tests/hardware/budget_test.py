"""The resolution and error budget against values that are computed another way."""

import math
import os
import re
import unittest

import budget


class Budget(unittest.TestCase):
    def test_a_count(self):
        self.assertAlmostEqual(budget.mm_per_count(1200), 0.0211667, places=7)
        # A turn of a cylinder of 10 mm is its circumference, in counts of the sensor.
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
        # Pushing 150 mm seen by axes turned by the angle: the part along the other axis.
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

    def test_play_stays_within_the_focus(self):
        low, high = budget.surface_distance_mm(
            budget.model_parameter("lens_to_surface"), budget.CLEARANCE_MM
        )
        self.assertGreaterEqual(low, budget.LENS_TO_SURFACE_MM[0])
        self.assertLessEqual(high, budget.LENS_TO_SURFACE_MM[1])

    def test_roll_and_radius(self):
        # Shifted by 0.3 mm across, the crest passes the sensor by as much.
        self.assertAlmostEqual(budget.roll_rad(0.15, 5) * 5, 0.3)
        self.assertAlmostEqual(budget.radius_error_deg_a_turn(0.1, 5), 360 * 5.1 / 5 - 360)

    def test_joystick_against_the_calibrations_rate(self):
        rate, dead_zone = budget.joystick_defaults()
        step = budget.joystick_rate_step_rad_s(rate, dead_zone)
        self.assertAlmostEqual(step * (1023 - 512 - dead_zone), rate)
        self.assertAlmostEqual(math.degrees(step), 0.0413, places=4)

    def test_tables_are_rectangular(self):
        for table in (budget.resolution_table(), budget.error_table()):
            self.assertEqual({len(row) for row in table}, {len(table[0])})
            self.assertIn("|---|", budget.markdown(table))


if __name__ == "__main__":
    unittest.main()

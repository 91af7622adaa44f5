"""Renders every printed part with OpenSCAD: closed, facing outward, of the size that is told."""

import os
import subprocess
import tempfile
import unittest

import render
import stl
import tables

CUBE = [
    ((0, 0, 0), (0, 1, 0), (1, 1, 0)), ((0, 0, 0), (1, 1, 0), (1, 0, 0)),
    ((0, 0, 1), (1, 0, 1), (1, 1, 1)), ((0, 0, 1), (1, 1, 1), (0, 1, 1)),
    ((0, 0, 0), (1, 0, 0), (1, 0, 1)), ((0, 0, 0), (1, 0, 1), (0, 0, 1)),
    ((0, 1, 0), (0, 1, 1), (1, 1, 1)), ((0, 1, 0), (1, 1, 1), (1, 1, 0)),
    ((0, 0, 0), (0, 0, 1), (0, 1, 1)), ((0, 0, 0), (0, 1, 1), (0, 1, 0)),
    ((1, 0, 0), (1, 1, 0), (1, 1, 1)), ((1, 0, 0), (1, 1, 1), (1, 0, 1)),
]


class Checker(unittest.TestCase):
    def test_cube_is_good(self):
        self.assertEqual(stl.defects(CUBE), [])
        self.assertAlmostEqual(stl.volume_mm3(CUBE), 1)

    def test_hole_is_found(self):
        self.assertTrue(stl.defects(CUBE[1:]))

    def test_flipped_triangle_is_found(self):
        a, b, c = CUBE[0]
        self.assertTrue(stl.defects([(a, c, b)] + CUBE[1:]))

    def test_inside_out_is_found(self):
        turned = [(a, c, b) for a, b, c in CUBE]
        self.assertTrue(any("inward" in text for text in stl.defects(turned)))

    def test_edge_of_four_triangles_is_found(self):
        beside = [tuple((x + 1, y + 1, z) for x, y, z in triangle) for triangle in CUBE]
        self.assertTrue(stl.defects(CUBE + beside))

    def test_nothing_is_found(self):
        self.assertTrue(stl.defects([]))


class Parts(unittest.TestCase):
    def test_every_part_renders_closed_and_as_told(self):
        told = {row["part"]: row for row in tables.rows_of("parts/parts.csv")}
        self.assertEqual(set(told), set(render.PARTS))
        with tempfile.TemporaryDirectory() as work:
            for name in render.PARTS:
                with self.subTest(part=name):
                    path = os.path.join(work, name + ".stl")
                    render.make_stl(name, path)
                    triangles = stl.read_stl(path)
                    self.assertEqual(stl.defects(triangles), [])
                    _, pieces, size, volume = render.table_row(name, triangles).split(",")
                    self.assertEqual(told[name]["pieces"], pieces)
                    # Another version of OpenSCAD may approximate circles otherwise.
                    self.assertAlmostEqual(
                        float(told[name]["volume_cm3"]), float(volume), delta=0.2
                    )
                    for wanted, made in zip(told[name]["size_mm"].split(" x "), size.split(" x ")):
                        self.assertAlmostEqual(float(wanted), float(made), delta=0.1)
                        self.assertLessEqual(float(made), 180, "does not fit a small printer")
                    low, _ = stl.bounds(triangles)
                    self.assertAlmostEqual(low[2], 0, places=3, msg="does not stand on the bed")

    def test_paper_dimensions(self):
        parts = {row["part"]: row["size_mm"] for row in tables.rows_of("parts/parts.csv")}
        self.assertTrue(parts["cylinder_core"].endswith("x 170.0"))
        middle = float(parts["pipe_middle"].split(" x ")[0])
        end = float(parts["pipe_end"].split(" x ")[2])
        self.assertEqual(middle + 2 * (end - 12), 320)  # each end sits 12 mm in the middle part

    def test_other_dimensions_render_as_well(self):
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "part.stl")
            for name, settings in (
                ("pipe_middle", ("cylinder_radius=8", "window_width=12")),
                ("sensor_carrier", ("board_x=28", "board_y=32", "board_lens_y=16")),
            ):
                render.make_stl(name, path, settings)
                self.assertEqual(stl.defects(stl.read_stl(path)), [], name)

    def test_play_beyond_the_focus_is_refused(self):
        with tempfile.TemporaryDirectory() as work:
            with self.assertRaises(subprocess.CalledProcessError):
                render.make_stl("pipe_end", os.path.join(work, "a.stl"), ("bore_clearance=0.3",))


if __name__ == "__main__":
    unittest.main()

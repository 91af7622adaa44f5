"""Every printed part must be closed, face outward and have the size in the table.

The build wrote the parts to the folder that the environment names (TORQUER_PRINT_FILES). OpenSCAD renders the other
pieces here.
"""

import functools
import math
import os
import subprocess
import tempfile
import unittest

import budget
import print_files
import render
import stl
import tables

PRINT_FILES = os.environ["TORQUER_PRINT_FILES"]
CUBE = [
    ((0, 0, 0), (0, 1, 0), (1, 1, 0)), ((0, 0, 0), (1, 1, 0), (1, 0, 0)),
    ((0, 0, 1), (1, 0, 1), (1, 1, 1)), ((0, 0, 1), (1, 1, 1), (0, 1, 1)),
    ((0, 0, 0), (1, 0, 0), (1, 0, 1)), ((0, 0, 0), (1, 0, 1), (0, 0, 1)),
    ((0, 1, 0), (0, 1, 1), (1, 1, 1)), ((0, 1, 0), (1, 1, 1), (1, 1, 0)),
    ((0, 0, 0), (0, 0, 1), (0, 1, 1)), ((0, 0, 0), (0, 1, 1), (0, 1, 0)),
    ((1, 0, 0), (1, 1, 0), (1, 1, 1)), ((1, 0, 0), (1, 1, 1), (1, 0, 1)),
]


@functools.cache
def piece(name: str) -> list:
    """Triangles of a printed part, or of a piece in its place, which is rendered once."""
    if name in print_files.files():
        return stl.read_stl(os.path.join(PRINT_FILES, name + ".stl"))
    with tempfile.TemporaryDirectory() as work:
        path = os.path.join(work, name + ".stl")
        render.make_stl(name, path)
        return stl.read_stl(path)


def crossings(triangles: list, x: float, y: float) -> list[float]:
    """Heights at which the vertical line through a place passes the triangles."""
    found = []
    for a, b, c in triangles:
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0:
            continue
        u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        if u >= 0 and v >= 0 and u + v <= 1:
            found.append(a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))
    return found


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

    def test_no_part_is_faulty(self):
        self.assertTrue(stl.defects([]))


class Parts(unittest.TestCase):
    def test_every_part_renders_closed_and_as_listed(self):
        """The files are those of a release: one for each part, and for each variant."""
        listed = {row["part"]: row for row in tables.rows_of("parts/parts.csv")}
        self.assertEqual(set(listed), set(render.PARTS))
        self.assertEqual({name for name in os.listdir(PRINT_FILES) if name.endswith(".stl")},
                         {name + ".stl" for name in [*render.PARTS, "catheter_clamp_switch"]})
        clamps = [stl.bounds(piece(f"catheter_clamp{variant}"))[1] for variant in ("", "_switch")]
        self.assertGreater(clamps[1][0], clamps[0][0] + 3, "no room for the end switch")
        for name in render.PARTS:
            with self.subTest(part=name):
                triangles = piece(name)
                self.assertEqual(stl.defects(triangles), [])
                _, pieces, size, volume = render.table_row(name, triangles).split(",")
                self.assertEqual(listed[name]["pieces"], pieces)
                # Another version of OpenSCAD may approximate circles differently.
                self.assertAlmostEqual(float(listed[name]["volume_cm3"]), float(volume), delta=0.2)
                for wanted, made in zip(listed[name]["size_mm"].split(" x "), size.split(" x ")):
                    self.assertAlmostEqual(float(wanted), float(made), delta=0.1)
                    self.assertLessEqual(float(made), 180, "does not fit a small printer")
                low, _ = stl.bounds(triangles)
                self.assertAlmostEqual(low[2], 0, places=3, msg="does not stand on the bed")

    def test_no_file_is_replaced(self):
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "box_link.stl")
            with open(path, "w", encoding="ascii") as file:
                file.write("mine")
            with self.assertRaisesRegex(FileExistsError, "remove it, or give another folder"):
                print_files.write(work)
            self.assertEqual(os.listdir(work), ["box_link.stl"])
            with open(path, encoding="ascii") as file:
                self.assertEqual(file.read(), "mine")

    def test_paper_dimensions(self):
        parts = {row["part"]: row["size_mm"] for row in tables.rows_of("parts/parts.csv")}
        self.assertTrue(parts["cylinder_core"].endswith("x 170.0"))
        middle = float(parts["pipe_middle"].split(" x ")[0])
        end = float(parts["pipe_end"].split(" x ")[2])
        self.assertEqual(middle + 2 * (end - 12), 320)  # each end sits 12 mm in the middle part

    def test_the_height_of_the_lens_above_the_paper_agrees_with_the_budget(self):
        """Measured on the parts in their places: the board's seat, less the lens, over the crest."""
        def heights(name: str, inside) -> list[float]:
            return [p[2] for triangle in piece(name) for p in triangle if inside(p)]

        model = budget.MODEL
        paper = model["paper_thickness"]
        crest = max(heights("placed_cylinder", lambda p: True)) + paper
        # The board's corners are inside the recess; the highest face below its top is the seat.
        seats = heights("placed_sensor_carrier", lambda p: abs(p[1]) < model["board_y"] / 2 + 0.3
                        and abs(p[0]) < model["board_x"] - model["board_lens_x"] + 0.3)
        board = min(heights("placed_sensor_board", lambda p: abs(p[0]) > model["lens_x"] / 2 + 1))
        self.assertTrue(any(abs(seat - board) < 1e-3 for seat in seats), (board, sorted(set(seats))))
        lens_to_paper = board - model["lens_height"] - crest
        low, high = budget.focus_mm()["at rest"]
        self.assertAlmostEqual(lens_to_paper, (low + high) / 2, delta=0.02)
        # The cylinder lies on the floor of its bore, and the shims below the carrier.
        self.assertAlmostEqual(
            crest, model["cylinder_radius"] - model["bore_clearance"], delta=0.02)
        bottom = min(heights("placed_sensor_carrier", lambda p: True))
        self.assertAlmostEqual(bottom, model["block_top"], places=3)

    def test_no_part_touches_the_lens_at_the_lowest_setting(self):
        model = budget.MODEL
        below = [p[2] for triangle in piece("placed_pipe") for p in triangle
                 if abs(p[0]) <= model["lens_x"] / 2 and abs(p[1]) <= model["lens_y"] / 2]
        lowest = model["lens_plane"] - model["shims_fitted"] * model["shim_thickness"]
        self.assertLess(max(below), lowest)

    def test_leaf_springs_reach_the_cylinder_through_the_pipe(self):
        model = budget.MODEL
        springs = [p for triangle in piece("placed_leaf_springs") for p in triangle]
        crest = model["cylinder_radius"] - model["bore_clearance"]
        self.assertAlmostEqual(crest - min(p[2] for p in springs), model["leaf_deflection"], places=3)
        for side in (-1, 1):
            nub = [p for p in springs if p[0] * side > 0 and p[1] < 2]
            low, high = min(p[0] for p in nub), max(p[0] for p in nub)
            self.assertAlmostEqual((low + high) / 2, side * model["leaf_x"], places=3)
            for x in (low, high):
                for y in (-1, 1):
                    self.assertLess(max(crossings(piece("placed_pipe"), x, y)), 0, "no slot there")
        self.assertGreater(model["leaf_x"] - model["leaf_width"] / 2, model["lens_x"] / 2 + 1)

    def test_ledges_keep_the_lens(self):
        """Below the lens's corners, and above the pipe at the lowest setting."""
        model = budget.MODEL
        x, y = model["lens_x"] / 2 - 0.3, model["lens_y"] / 2 - 0.6
        lowering = model["shims_fitted"] * model["shim_thickness"]
        for i in (-1, 1):
            for j in (-1, 1):
                faces = [z for z in crossings(piece("placed_sensor_carrier"), i * x, j * y)
                         if z > model["carrier_bottom"] + 0.1]  # not those of the shims
                self.assertTrue(faces, "no ledge there")
                self.assertLess(max(faces), model["lens_plane"])
                self.assertGreater(max(faces), model["lens_plane"] - 0.2)
                pipe = max(crossings(piece("placed_pipe"), i * x, j * y))
                self.assertGreater(min(faces) - lowering, pipe)

    def test_wire_passes_through_the_catheters_cylinder(self):
        """Its outside is that of the wire's cylinder, so that the same springs press it down."""
        hollow, solid = piece("catheter_core"), piece("cylinder_core")
        self.assertEqual(stl.bounds(hollow), stl.bounds(solid))
        model = budget.MODEL
        for angle in range(0, 360, 30):
            x, y = (math.cos(math.radians(angle + 5)), math.sin(math.radians(angle + 5)))
            wire = (model["wire_diameter"] / 2 + model["passage_play"] - 0.1)
            self.assertEqual(crossings(hollow, wire * x, wire * y), [], "the passage is not free")
            # The catheter ends at its seat's bottom; further out, the wall is whole.
            seat = crossings(hollow, 1.17 * x, 1.17 * y)
            self.assertGreater(min(seat), model["catheter_grip"] - 0.1)
            self.assertLess(min(seat), model["catheter_grip"] + 1.1)
            self.assertLess(min(crossings(hollow, 2.9 * x, 2.9 * y)), 0.1)

    def test_catheter_passes_through_its_cap_beside_the_vents(self):
        cap, model = piece("pipe_cap_catheter"), budget.MODEL
        self.assertEqual(stl.bounds(cap), stl.bounds(piece("pipe_cap")))
        radius = model["catheter_diameter"] / 2
        self.assertEqual(crossings(cap, radius, 0), [])
        self.assertEqual(crossings(cap, 0, -radius), [])

    def test_link_brings_the_caps_of_two_boxes_together(self):
        model = budget.MODEL
        low, high = stl.bounds(piece("box_link"))
        overhang = model["pipe_length"] / 2 + model["cap_wall"] - model["box_length"]
        self.assertAlmostEqual(high[0] - low[0], 2 * overhang + 1)
        # Its screws are those of the clamp.
        clamp = stl.bounds(piece("catheter_clamp"))
        self.assertAlmostEqual(high[1] - low[1], clamp[1][1] - clamp[0][1])

    def test_caps_let_the_air_out(self):
        """The volume that the vents take from the wall of a cap."""
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "cap.stl")
            render.make_stl("pipe_cap", path, ("vent_count=0",))
            whole = stl.volume_mm3(stl.read_stl(path))
        opening = (whole - stl.volume_mm3(piece("pipe_cap"))) / budget.MODEL["cap_wall"]
        wanted = budget.cap_openings_mm2(budget.MODEL["vent_count"]) - budget.cap_openings_mm2(0)
        self.assertAlmostEqual(opening, wanted, delta=0.15 * wanted)  # they meet the wire's funnel

    def test_other_dimensions_render_as_well(self):
        with tempfile.TemporaryDirectory() as work:
            path = os.path.join(work, "part.stl")
            for name, settings in (
                ("pipe_middle", ("cylinder_radius=8", "window_width=12")),
                ("sensor_carrier", ("board_x=32", "board_y=28", "board_lens_x=16")),
            ):
                render.make_stl(name, path, settings)
                self.assertEqual(stl.defects(stl.read_stl(path)), [], name)

    def test_play_beyond_the_focus_is_refused(self):
        with tempfile.TemporaryDirectory() as work:
            for setting in ("bore_clearance=0.2", "lens_to_surface=2.65", "lens_to_surface=2.4",
                            "focus_step=0.2", "board_lens_x=9"):
                with self.assertRaises(subprocess.CalledProcessError, msg=setting):
                    render.make_stl("carrier_shim", os.path.join(work, "a.stl"), (setting,))


if __name__ == "__main__":
    unittest.main()

"""Bill of materials, and the tables of hardware/README.md compared with their source files."""

import os
import re
import struct
import unittest
from contextlib import redirect_stdout
from io import StringIO

import tables


class BillOfMaterials(unittest.TestCase):
    def test_device_costs_less_than_60_eur_with_the_joystick(self):
        items = tables.rows_of("bill_of_materials.csv")
        self.assertTrue(any("joystick" in row["what"] for row in items))
        self.assertLess(tables.total_eur(items), 60)

    def test_total_is_price_times_pieces(self):
        items = [
            {"unit_price_eur": "1.20", "quantity": "2"},
            {"unit_price_eur": "0.05", "quantity": "30"},
        ]
        self.assertAlmostEqual(tables.total_eur(items), 3.90)

    def test_entry_page_shows_the_totals(self):
        with open(tables.README, encoding="utf-8") as file:
            page = file.read()
        for name, pattern in (
            ("bill_of_materials.csv", r"\| (\d+) EUR with the joystick"),
            ("mouse_variant.csv", r"\| (\d+) EUR, or nothing"),
        ):
            total = tables.total_eur(tables.rows_of(name))
            self.assertLess(abs(int(re.search(pattern, page).group(1)) - total), 1, name)

    def test_sensor_has_a_second_source_with_open_files_and_none_for_5_v_without_shifters(self):
        boards = tables.rows_of("sensor_boards.csv")
        self.assertGreaterEqual(sum(row["open"].startswith("yes") for row in boards), 1)
        self.assertGreaterEqual(len(boards), 2)
        for row in boards:
            self.assertNotIn(None, row, row["board"])
            self.assertTrue(row["where"].startswith("https://"))
            self.assertIn(row["for_5v"], ("yes", "no"))
            if "level shifters" not in row["supply_and_levels"] or "no level" in row["supply_and_levels"]:
                self.assertEqual(row["for_5v"], "no", row["board"])

    def test_every_item_is_complete(self):
        for name in ("bill_of_materials.csv", "mouse_variant.csv"):
            for number, row in enumerate(tables.rows_of(name), 1):
                self.assertEqual(row["item"], str(number))
                self.assertNotIn(None, row, f"{name}: too many fields in item {number}")
                self.assertTrue(row["what"])
                self.assertIn(row["confirmed"], ("yes", "no"))
                self.assertGreater(float(row["unit_price_eur"]), 0)
                self.assertGreater(int(row["quantity"]), 0)


class Readme(unittest.TestCase):
    def test_is_made_of_its_files(self):
        said = StringIO()
        with redirect_stdout(said):
            self.assertEqual(tables.main(check=True), 0, said.getvalue())

    def test_a_table_without_a_place_is_reported(self):
        with self.assertRaises(KeyError):
            tables.with_tables("a page without marks")

    def test_shows_every_picture(self):
        with open(tables.README, encoding="utf-8") as file:
            page = file.read()
        folder = os.path.join(tables.HERE, "pictures")
        for name in os.listdir(folder):
            self.assertIn("pictures/" + name, page)
            if name.endswith(".png"):
                with open(os.path.join(folder, name), "rb") as file:
                    head = file.read(24)
                self.assertEqual(head[:8], b"\x89PNG\r\n\x1a\n")
                self.assertGreater(min(struct.unpack(">II", head[16:24])), 50)


if __name__ == "__main__":
    unittest.main()

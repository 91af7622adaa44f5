"""wiring.csv compared with the firmware's pins, and wrong wiring that the checks must refuse."""

import os
import unittest
import xml.etree.ElementTree
from dataclasses import replace

import tables
import wiring

FIRMWARE = os.path.join(wiring.HERE, "..", "firmware")


def read(name: str) -> str:
    with open(os.path.join(FIRMWARE, name), encoding="utf-8") as file:
        return file.read()


PINS_HEADER = read("board/atmega32u4/pins.h")
README = read("README.md")


class Wiring(unittest.TestCase):
    def setUp(self):
        self.pins = wiring.firmware_pins(PINS_HEADER, README)
        self.wires = wiring.load()

    def changed(self, net, part, **changes):
        """Copy of the wiring in which the only wire of a net at a part is replaced."""
        index = next(
            i
            for i, wire in enumerate(self.wires)
            if wire.net == net and part in (wire.start[0], wire.end[0])
        )
        wires = list(self.wires)
        wires[index] = replace(wires[index], **changes)
        return wiring.problems(wires, self.pins)

    def test_firmware_has_all_twelve_signals(self):
        self.assertEqual(len(self.pins), 12)
        self.assertEqual(self.pins["NCS_2"], ("PB5", "9"))
        self.assertEqual(self.pins["NCS"], ("PB6", "10"))
        self.assertEqual(self.pins["JOYSTICK_X"], ("PF7", "A0"))
        self.assertEqual(self.pins["REFERENCE"], ("PC6", "5"))
        self.assertEqual(self.pins["STICK"], ("PD7", "6"))

    def test_wiring_is_right(self):
        self.assertEqual(wiring.problems(self.wires, self.pins), [])

    def test_wrong_pin_is_found(self):
        found = self.changed("NCS", "controller", start=("controller", "9"))
        self.assertIn("NCS: the firmware uses PB6, pin 10; wired is 9", found)

    def test_second_sensor_on_the_first_ones_select_is_found(self):
        found = self.changed("NCS_2", "controller", start=("controller", "10"))
        self.assertTrue(any("controller 10 is on nets" in text for text in found), found)
        self.assertTrue(any("NCS_2: the firmware uses PB5, pin 9" in text for text in found), found)

    def test_two_nets_on_a_pin_are_found(self):
        found = self.changed("XRAY", "controller", start=("controller", "3"))
        self.assertTrue(any("controller 3 is on nets" in text for text in found), found)

    def test_missing_wire_is_found(self):
        wires = [wire for wire in self.wires if wire.net != "CLUTCH"]
        self.assertTrue(any("CLUTCH" in text for text in wiring.problems(wires, self.pins)))

    def test_pedal_past_its_filter_is_found(self):
        wires = [
            replace(wire, net="XRAY") if wire.net == "PEDAL" else wire for wire in self.wires
        ]
        found = wiring.problems(wires, self.pins)
        self.assertIn("the pedal's line reaches the controller past its filter", found)

    def test_sensor_on_the_controllers_volts_is_found(self):
        found = self.changed("VDD", "PMW3360", volts=3.3)
        self.assertTrue(any("VDD is at 3.3 V" in text for text in found), found)

    def test_signal_past_the_level_shifter_is_found(self):
        found = self.changed("SENSOR_MOSI", "PMW3360", end=("PMW3360", "MISO"))
        self.assertTrue(any("MOSI is not behind the level shifter" in text for text in found), found)

    def test_net_in_pieces_is_found(self):
        found = self.changed("GND", "contrast button", start=("pedal jack", "ring"))
        self.assertIn("net GND is in pieces", found)

    def test_pins_that_disagree_with_the_readme_are_found(self):
        with self.assertRaises(ValueError):
            wiring.firmware_pins(PINS_HEADER, README.replace("| PD4 (4) |", "| PD4 (5) |"))
        with self.assertRaises(ValueError):
            wiring.firmware_pins(PINS_HEADER.replace("_BIT 6  //", "_BIT 5  //"), README)


class PedalLeakage(unittest.TestCase):
    def test_diode_of_the_bill_of_materials_leaves_an_open_pedal_high(self):
        row = next(row for row in tables.rows_of("bill_of_materials.csv") if "pedal filter" in row["what"])
        self.assertEqual(wiring.pedal_problems(row["part_number"]), [])

    def test_level_of_the_line_by_ohms_law(self):
        """At 3.3 V the chip surely reads 1.56 V as high, and 1.74 V may fall across 50 kilohm."""
        self.assertAlmostEqual(wiring.allowed_leakage_ua(3.3), 34.8, places=1)
        self.assertAlmostEqual(wiring.allowed_leakage_ua(5.0), 62.0, places=1)
        # Three steps of 5 K: 10 uA become 10 x 1.414 x 1.414 x 1.414.
        self.assertAlmostEqual(wiring.leakage_ua("SA9.0CA") - 1, 28.3, places=1)

    def test_diodes_that_leak_are_found(self):
        for diode in ("P6KE6.8A", "SA5.0A", "SA6.5CA"):
            self.assertTrue(any("leaks" in text for text in wiring.pedal_problems(diode)), diode)
        self.assertTrue(wiring.pedal_problems("SA9.0CA", warm_c=60))
        self.assertIn("leakage unknown", wiring.pedal_problems("1N4148")[0])


class Diagram(unittest.TestCase):
    def test_shows_every_part_and_every_signal(self):
        drawing = wiring.draw(wiring.load())
        root = xml.etree.ElementTree.fromstring(drawing)
        words = {element.text for element in root.iter("{http://www.w3.org/2000/svg}text")}
        for wire in wiring.load():
            for part, pin in (wire.start, wire.end):
                self.assertIn(wiring.TITLES.get(part, part), words)
                self.assertIn(pin, words)
        colors = [element.get("stroke") for element in root.iter("{http://www.w3.org/2000/svg}path")]
        for net in ("NCS", "NCS_2", "SCLK", "MOSI", "MISO", "XRAY", "CLUTCH"):
            color = next(wire.color for wire in wiring.load() if wire.net == net)
            self.assertIn(wiring.INK[color], colors)


if __name__ == "__main__":
    unittest.main()

"""Wiring of the bench device: checks wiring.csv against the firmware, and draws it.

The diagram goes to standard output: hardware/wiring.py > hardware/pictures/wiring.svg

The voltages hold for a controller at 3.3 V. With a controller at 5 V the nets of the domain "controller" carry 5 V. The
module's level shifter protects the sensor from this voltage. """

import argparse
import csv
import os
import re
import sys
from dataclasses import dataclass

HERE = os.path.dirname(os.path.abspath(__file__))

SENSOR_VDD_V = (1.8, 2.1)  # PMW3360 data sheet 1.50: operating voltage

# Pedal's line while the pedal is open, by the data sheet of the ATmega32U4 (DC characteristics).
PULL_UP_OHM = (20e3, 50e3)
INPUT_LEAKAGE_UA = 1.0
# Suppressor diodes: standoff voltage in V, and the largest leakage there in uA at 25 degrees C. Source: the data sheets
# of the series SA and P6KE. Up to 10 V, a bidirectional type leaks twice as much as a unidirectional type.
DIODES = {"SA5.0A": (5.0, 600), "SA6.5CA": (6.5, 800), "SA8.5CA": (8.5, 20), "SA9.0CA": (9.0, 10),
          "P6KE6.8A": (5.8, 1000), "P6KE6.8CA": (5.8, 2000), "P6KE11CA": (9.4, 10)}
LEAKAGE_DOUBLES_K = 10.0  # rule for silicon
WARMEST_C = 40.0  # in the panel
SUPPLIES_V = (3.3, 5.0)

CONTROLLER_SIGNALS = {
    "sensor NCS": "NCS",
    "second sensor NCS, on a board for two": "NCS_2",
    "sensor SCLK": "SCLK",
    "sensor MOSI": "MOSI",
    "sensor MISO": "MISO",
    "X-ray pedal, to ground": "XRAY",
    "contrast button, to ground": "CONTRAST",
    "clutch button, to ground": "CLUTCH",
    "stick button, to ground": "STICK",
    "joystick x wiper": "JOYSTICK_X",
    "joystick y wiper": "JOYSTICK_Y",
    "end switch, to ground": "REFERENCE",
}


@dataclass(frozen=True)
class Wire:
    net: str
    volts: float
    start: tuple[str, str]  # part, pin
    end: tuple[str, str]
    color: str
    where: str


def load(path: str = os.path.join(HERE, "wiring.csv")) -> list[Wire]:
    with open(path, newline="", encoding="utf-8") as file:
        return [
            Wire(
                row["net"],
                float(row["volts"]),
                (row["from"], row["from_pin"]),
                (row["to"], row["to_pin"]),
                row["color"],
                row["where"],
            )
            for row in csv.DictReader(file)
        ]


def firmware_pins(pins_header: str, readme: str) -> dict[str, tuple[str, str]]:
    """Map of signal to (port of the chip, pin name on the board), from pins.h; SPI from the README.

    Raises ValueError if the two disagree.
    """
    table = {
        CONTROLLER_SIGNALS[what]: (port, pin)
        for port, pin, what in re.findall(r"^\| (P\w\d) \((\w+)\) \| (.+?) \|$", readme, re.M)
        if what in CONTROLLER_SIGNALS
    }
    macros = {
        "NCS": r"SENSOR_NCS_BIT (\d)  // (P\w\d) \((\w+)\)",
        "NCS_2": r"SECOND_NCS_BIT (\d)  // (P\w\d) \((\w+)\)",
        "XRAY": r"XRAY_BIT (\d) +// (P\w\d) \((\w+)\)",
        "CONTRAST": r"CONTRAST_BIT (\d) +// (P\w\d) \((\w+)\)",
        "CLUTCH": r"CLUTCH_BIT (\d) +// (P\w\d) \((\w+)\)",
        "STICK": r"STICK_BIT (\d) +// (P\w\d) \((\w+)\)",
        "REFERENCE": r"REFERENCE_BIT (\d) +// (P\w\d) \((\w+)\)",
        "JOYSTICK_X": r"JOYSTICK_X_CHANNEL (\d) +// (P\w\d) \((\w+)\)",
        "JOYSTICK_Y": r"JOYSTICK_Y_CHANNEL (\d) +// (P\w\d) \((\w+)\)",
    }
    ports = {
        "NCS": re.search(r"SENSOR_NCS_PORT PORT(\w)", pins_header).group(1),
        "NCS_2": re.search(r"SENSOR_NCS_PORT PORT(\w)", pins_header).group(1),
        "REFERENCE": re.search(r"REFERENCE_PORT PORT(\w)", pins_header).group(1),
    }
    button_port = re.search(r"BUTTON_PORT PORT(\w)", pins_header).group(1)
    for signal, pattern in macros.items():
        bit, port, pin = re.search(pattern, pins_header).groups()
        # ADC channels 4 to 7 of the ATmega32U4 are PF4 to PF7.
        letter = "F" if signal.startswith("JOYSTICK") else ports.get(signal, button_port)
        if port != f"P{letter}{bit}":
            raise ValueError(f"pins.h: {signal} is P{letter}{bit} in code and {port} in words")
        if table.get(signal) != (port, pin):
            raise ValueError(f"{signal}: pins.h has {port} ({pin}), README {table.get(signal)}")
    for name, port in re.findall(r"(SCK|MOSI|MISO) (PB\d)", pins_header):
        signal = "SCLK" if name == "SCK" else name
        if table.get(signal, ("",))[0] != port:
            raise ValueError(f"{signal}: pins.h has {port}, README {table.get(signal)}")
    return table


def problems(wires: list[Wire], pins: dict[str, tuple[str, str]]) -> list[str]:
    """Errors in the wiring; empty if there are none."""
    found = []
    volts: dict[str, float] = {}
    net_at: dict[tuple[str, str], str] = {}
    for wire in wires:
        if volts.setdefault(wire.net, wire.volts) != wire.volts:
            found.append(f"net {wire.net} is at {volts[wire.net]} V and at {wire.volts} V")
        for end in (wire.start, wire.end):
            if net_at.setdefault(end, wire.net) != wire.net:
                found.append(f"{' '.join(end)} is on nets {net_at[end]} and {wire.net}")
    at_controller = {net: pin for (part, pin), net in net_at.items() if part == "controller"}
    for signal, (port, pin) in pins.items():
        if at_controller.get(signal) != pin:
            found.append(
                f"{signal}: the firmware uses {port}, pin {pin}; wired is {at_controller.get(signal)}"
            )
    for net in set(at_controller) - set(pins) - {"VCC", "GND"}:
        found.append(f"{net}: the firmware knows nothing of it")
    found += connected_problems(wires)
    if net_at.get(("pedal jack", "tip")) == net_at.get(("controller", pins["XRAY"][1])):
        found.append("the pedal's line reaches the controller past its filter")
    supply = volts[net_at["PMW3360", "VDD"]]
    if not SENSOR_VDD_V[0] <= supply <= SENSOR_VDD_V[1]:
        found.append(f"PMW3360 VDD is at {supply} V; it takes {SENSOR_VDD_V} V")
    for channel, signal in enumerate(("NCS", "SCLK", "MOSI", "MISO"), 1):
        sides = net_at.get(("level shifter", f"A{channel}")), net_at.get(("level shifter", f"B{channel}"))
        if sides != (signal, "SENSOR_" + signal):
            found.append(f"level shifter channel {channel} joins {sides}, not {signal}")
        if net_at.get(("PMW3360", signal)) != "SENSOR_" + signal:
            found.append(f"PMW3360 {signal} is not behind the level shifter")
    return found


def leakage_ua(diode: str, warm_c: float = WARMEST_C) -> float:
    """Largest current from an open pedal's line to ground. The diode's part is its leakage at the standoff voltage,
    which is above the voltage of the line. """
    return DIODES[diode][1] * 2 ** ((warm_c - 25) / LEAKAGE_DOUBLES_K) + INPUT_LEAKAGE_UA


def allowed_leakage_ua(supply_v: float) -> float:
    """Largest current at which the weakest pull-up keeps the line at a level that reads as high. """
    high_v = 0.2 * supply_v + 0.9  # V_IH, data sheet of the ATmega32U4
    return (supply_v - high_v) / PULL_UP_OHM[1] * 1e6


def pedal_problems(diode: str, warm_c: float = WARMEST_C) -> list[str]:
    """Reasons why an open pedal could read as pressed; empty if there are none."""
    if diode not in DIODES:
        return [f"pedal diode {diode}: leakage unknown; add it to DIODES from its data sheet"]
    found = []
    for supply_v in SUPPLIES_V:
        if DIODES[diode][0] < supply_v:
            found.append(f"pedal diode {diode} conducts at {supply_v} V")
        if leakage_ua(diode, warm_c) > allowed_leakage_ua(supply_v):
            found.append(
                f"pedal diode {diode} leaks {leakage_ua(diode, warm_c):.0f} uA at {warm_c:g} degrees C; the pull-up "
                f"allows {allowed_leakage_ua(supply_v):.0f} uA at {supply_v} V"
            )
    return found


def leakage_table() -> list[list[str]]:
    rows = [["diode at the pedal", f"leakage at {WARMEST_C:g} degrees C, chip included",
             *(f"pull-up of 50 kilohm allows at {supply_v:g} V" for supply_v in SUPPLIES_V)]]
    for diode in ("SA9.0CA", "SA8.5CA", "P6KE6.8A"):
        rows.append([diode, f"{leakage_ua(diode):.0f} uA",
                     *(f"{allowed_leakage_ua(supply_v):.0f} uA" for supply_v in SUPPLIES_V)])
    return rows


def connected_problems(wires: list[Wire]) -> list[str]:
    """Nets whose wires are not all connected."""
    found = []
    for net in {wire.net for wire in wires}:
        edges = [(wire.start, wire.end) for wire in wires if wire.net == net]
        reached = {edges[0][0]}
        grown = True
        while grown:
            more = {end for edge in edges if reached & set(edge) for end in edge}
            grown = not more <= reached
            reached |= more
        if any(end not in reached for edge in edges for end in edge):
            found.append(f"net {net} is in pieces")
    return found


# --- the drawing ----------------------------------------------------------------------------

INK = {
    "red": "#c62828",
    "black": "#222222",
    "orange": "#e07b00",
    "yellow": "#b8a000",
    "green": "#2e8b3d",
    "blue": "#1f5fbf",
    "violet": "#7a3fb0",
    "gray": "#707070",
    "brown": "#7a4a21",
}
PITCH = 24
# Part: left edge, top, width; pins on its left side, on its right side.
PLACES = {
    "joystick": (180, 50, 120, [], ["+5V", "GND", "VRx", "VRy", "SW"]),
    "pedal jack": (5, 215, 100, [], ["tip", "sleeve"]),
    "pedal filter": (180, 215, 120, ["IN"], ["OUT", "GND"]),
    "contrast button": (180, 310, 120, [], ["1", "2"]),
    "clutch button": (180, 405, 120, [], ["1", "2"]),
    "end switch": (150, 500, 150, [], ["1", "2"]),
    "controller": (440, 150, 185, ["A0", "A1", "6", "2", "3", "4", "5"],
                   ["VCC", "GND", "10", "15", "16", "14", "9"]),
    "second sensor module": (760, 490, 190, ["VI", "GD", "SS", "SC", "MO", "MI"], []),
    "level shifter": (895, 290, 120, ["A1", "A2", "A3", "A4", "VREF_A"],
                      ["B1", "B2", "B3", "B4", "VREF_B"]),
    "regulator 1.9 V": (895, 100, 120, ["IN", "GND"], ["OUT"]),
    "regulator 3.3 V": (895, 190, 120, ["IN", "GND"], ["OUT"]),
    "PMW3360": (1125, 218, 160, ["GND", "VDD", "VDDIO", "NCS", "SCLK", "MOSI", "MISO"], []),
}
MODULE = (760, 50, 540, 410)
MODULE_PINS = {"VI": 110, "GD": 134, "SS": 332, "SC": 356, "MO": 380, "MI": 404}
TITLES = {"controller": "Pro Micro (ATmega32U4)", "PMW3360": "PMW3360 + LM19-LSI", "end switch": "end switch, optional",
          "second sensor module": "second sensor, optional"}


def pin_places() -> dict[tuple[str, str], list[tuple[float, float, int]]]:
    """Place of each pin, and the side on which its wire leaves (-1 left, 1 right)."""
    places: dict[tuple[str, str], list[tuple[float, float, int]]] = {}
    for part, (x, y, width, left, right) in PLACES.items():
        for names, px, side in ((left, x, -1), (right, x + width, 1)):
            for index, name in enumerate(names):
                places.setdefault((part, name), []).append((px, y + 42 + index * PITCH, side))
    for name, y in MODULE_PINS.items():
        places["sensor module", name] = [(MODULE[0], y, -1), (MODULE[0], y, 1)]
    return places


def text(x, y, content, anchor="start", size=13, color="#222222", weight="normal"):
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size}" fill="{color}"'
        f' font-weight="{weight}">{content}</text>'
    )


def draw(wires: list[Wire]) -> str:
    """The diagram as SVG: signals as lines, supplies and ground as flags at their pins."""
    out = [
        '<svg xmlns="http://www.w3.org/2000/svg" width="1330" height="710" viewBox="0 0 1330 710"'
        ' font-family="DejaVu Sans, Arial, sans-serif">',
        '<rect width="1330" height="710" fill="white"/>',
        text(30, 30, "Bench device: wiring", size=18, weight="bold"),
        '<rect x="{}" y="{}" width="{}" height="{}" fill="#f3f6fa" stroke="#7a8aa0"'
        ' stroke-dasharray="6 4"/>'.format(*MODULE),
        text(MODULE[0] + MODULE[2] - 12, MODULE[1] + 22, "sensor module", anchor="end", color="#4a5a70"),
    ]
    for part, (x, y, width, left, right) in PLACES.items():
        height = 42 + (max(len(left), len(right)) - 1) * PITCH + 18
        out.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="5" fill="#ffffff"'
            ' stroke="#222222"/>'
        )
        out.append(text(x + width / 2, y + 18, TITLES.get(part, part), "middle", 12, weight="bold"))
        for names, px, anchor in ((left, x + 8, "start"), (right, x + width - 8, "end")):
            for index, name in enumerate(names):
                out.append(text(px, y + 46 + index * PITCH, name, anchor, 12))
    for name, y in MODULE_PINS.items():
        out.append(f'<circle cx="{MODULE[0]}" cy="{y}" r="4" fill="#4a5a70"/>')
        out.append(text(MODULE[0] - 6, y - 6, name, "end", 12))
    places = pin_places()
    flags = set()
    lane: dict[tuple[str, str], int] = {}
    for wire in wires:
        color = INK[wire.color]
        ends = nearest(places[wire.start], places[wire.end])
        if wire.net in ("VCC", "GND", "VDD", "VDDIO"):
            label = "GND" if wire.net == "GND" else f"{wire.net} {wire.volts:g} V"
            for place in ends:
                if (place, label) not in flags:
                    flags.add((place, label))
                    out += flag(place, label, color)
            continue
        (x0, y0, _), (x1, y1, _) = sorted(ends)
        column = "left" if x1 <= 440 else "right"
        # Each wire has its own lane, so that no two wires of a column cross.
        direction = "up" if y1 < y0 else "down"
        lane[column, direction] = lane.get((column, direction), 0) + 1
        bend = {"left": 426, "right": 740}[column] - 12 * lane[column, direction]
        if direction == "up":
            bend = 360 + 12 * lane[column, direction]
        turn = "" if y0 == y1 else f" H{bend} V{y1:g}"
        out.append(
            f'<path d="M{x0:g} {y0:g}{turn} H{x1:g}" fill="none" stroke="{color}" stroke-width="2"/>'
        )
        if y0 != y1:
            name = wire.net.replace("JOYSTICK", "STICK")
            out.append(text(x0 + 6, y0 - 4, name, size=11, color=color))
    out.append(text(20, 678, "Flags of one name are joined. Volts for a controller at 3.3 V; one at"
                    " 5 V needs a module with level shifters, as drawn.", size=12, color="#4a5a70"))
    out.append(text(20, 698, "Pedal filter: 1 kilohm from IN to OUT, 100 nF from OUT to GND, a"
                    " suppressor diode of 9 V from IN to GND, all at the jack.", size=12, color="#4a5a70"))
    out.append("</svg>")
    return "\n".join(out) + "\n"


def nearest(starts, ends):
    """Two places of a wire's pins that face each other."""
    return min(
        ((a, b) for a in starts for b in ends),
        key=lambda pair: abs(pair[0][0] - pair[1][0]) + (1000 if pair[0][2] == pair[1][2] else 0),
    )


def flag(place, label: str, color: str) -> list[str]:
    x, y, side = place
    if side > 0 and x == MODULE[0]:
        return []  # hidden on the cable's side
    tip = x + side * 18
    anchor = "start" if side > 0 else "end"
    return [
        f'<path d="M{x:g} {y:g} H{tip:g}" stroke="{color}" stroke-width="2"/>',
        f'<circle cx="{tip:g}" cy="{y:g}" r="3" fill="{color}"/>',
        text(tip + side * 6, y + 4, label, anchor, 11, color),
    ]


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    sys.stdout.write(draw(load()))

"""Writes the tables of hardware/README.md from their source files.
"""

import argparse
import csv
import os
import re
import sys

import budget
import wiring

HERE = os.path.dirname(os.path.abspath(__file__))
README = os.path.join(HERE, "README.md")
DIAGRAM = os.path.join(HERE, "pictures", "wiring.svg")


def rows_of(name: str) -> list[dict[str, str]]:
    with open(os.path.join(HERE, name), newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def total_eur(items: list[dict[str, str]]) -> float:
    return sum(float(row["unit_price_eur"]) * int(row["quantity"]) for row in items)


def bill_table(name: str) -> str:
    items = rows_of(name)
    rows = [["", "pieces", "item", "part number", "or instead", "EUR, about"]]
    for row in items:
        number = row["part_number"]
        if number and row["confirmed"] != "yes":
            number += " (unconfirmed)"
        price = float(row["unit_price_eur"]) * int(row["quantity"])
        rows.append([row["item"], row["quantity"], row["what"], number, row["alternatives"],
                     f"{price:.2f}"])
    rows.append(["", "", "**together**", "", "", f"**{total_eur(items):.2f}**"])
    return budget.markdown(rows)


def sensor_boards_table() -> str:
    rows = [["board", "design files", "supply and levels", "size, mm", "board at 3.3 V", "at 5 V", "note"]]
    for row in rows_of("sensor_boards.csv"):
        rows.append([f"[{row['board']}]({row['where']})", row["open"], row["supply_and_levels"], row["size_mm"],
                     row["for_3v3"], row["for_5v"], row["note"]])
    return budget.markdown(rows)


def wiring_table() -> str:
    rows = [["net", "from", "to", "color", "where"]]
    for wire in wiring.load():
        if wire.where != "on the module":
            rows.append([wire.net, " ".join(wire.start), " ".join(wire.end), wire.color, wire.where])
    return budget.markdown(rows)


def parts_table() -> str:
    rows = [["picture", "part", "pieces", "size, mm", "volume, cm3"]]
    for row in rows_of("parts/parts.csv"):
        name = row["part"]
        rows.append([f'<img src="pictures/{name}.png" width="120" alt="{name}">', f"`{name}`",
                     row["pieces"], row["size_mm"], row["volume_cm3"]])
    return budget.markdown(rows)


def tables() -> dict[str, str]:
    return {
        "bill of materials": bill_table("bill_of_materials.csv"),
        "mouse variant": bill_table("mouse_variant.csv"),
        "sensor boards": sensor_boards_table(),
        "wiring": wiring_table(),
        "parts": parts_table(),
        "resolution": budget.markdown(budget.resolution_table()),
        "errors": budget.markdown(budget.error_table()),
        "focus": budget.markdown(budget.focus_table()),
        "shading": budget.markdown(budget.shading_table()),
        "forces": budget.markdown(budget.force_table()),
        "leakage": budget.markdown(wiring.leakage_table()),
        "suspend": budget.markdown(budget.suspend_table()),
    }


def with_tables(text: str) -> str:
    """README with every table between its marks replaced; raises KeyError for a missing mark."""
    made = tables()
    missing = [name for name in made if f"<!-- table {name} -->" not in text]
    if missing:
        raise KeyError(f"hardware/README.md has no place for: {missing}")
    return re.sub(
        r"<!-- table ([\w ]+) -->\n.*?<!-- end -->",
        lambda match: f"<!-- table {match.group(1)} -->\n{made[match.group(1)]}\n<!-- end -->",
        text,
        flags=re.S,
    )


def main(check: bool) -> int:
    with open(README, encoding="utf-8") as file:
        before = file.read()
    files = {README: with_tables(before), DIAGRAM: wiring.draw(wiring.load())}
    if check:
        stale = []
        for path, wanted in files.items():
            with open(path, encoding="utf-8") as file:
                if file.read() != wanted:
                    stale.append(os.path.relpath(path, HERE))
        for name in stale:
            print(f"hardware/{name} is stale; write it again with hardware/tables.py")
        return 1 if stale else 0
    for path, wanted in files.items():
        with open(path, "w", encoding="utf-8") as file:
            file.write(wanted)
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--check",
        action="store_true",
        help="write nothing, and fail if the README or the diagram differ from their files",
    )
    sys.exit(main(parser.parse_args().check))

"""Draws the printed parts as pictures: OpenSCAD to STL, and a small renderer to PNG.

Needs openscad, and no display. Pictures are shaded by the direction of each face, with a z buffer
and 2 x 2 samples a pixel.
"""

import argparse
import math
import os
import struct
import subprocess
import tempfile
import zlib

import stl

HERE = os.path.dirname(os.path.abspath(__file__))
MODEL = os.path.join(HERE, "bench_device.scad")

# Printed parts, and the number of copies of each.
PARTS = {
    "cylinder_core": 1,
    "pipe_end": 2,
    "pipe_cap": 2,
    "pipe_cap_switch": 1,
    "pipe_middle": 1,
    "sensor_carrier": 1,
    "carrier_shim": 3,
    "leaf_spring": 2,
    "support_box": 2,
    "catheter_clamp": 1,
    "catheter_lid": 1,
    "control_panel": 1,
    # For two sensors.
    "catheter_core": 1,
    "pipe_cap_catheter": 1,
    "box_link": 1,
}

# Pieces of the assembly, with their colors.
ASSEMBLY = {
    "placed_support_box": (196, 201, 208),
    "placed_pipe": (88, 134, 178),
    "placed_caps": (226, 158, 70),
    "placed_cylinder": (245, 245, 240),
    "placed_leaf_springs": (90, 170, 110),
    "placed_sensor_carrier": (203, 92, 78),
    "placed_sensor_board": (58, 130, 84),
    "placed_catheter_clamp": (226, 158, 70),
    "placed_control_panel": (150, 158, 170),
    "placed_wire": (40, 40, 46),
}
# View direction of parts that are not seen from above: azimuth and elevation in degrees.
VIEWS = {"pipe_cap": (-60, -40), "pipe_cap_switch": (60, -40), "pipe_cap_catheter": (-60, -40)}
SAMPLES = 2
BACKGROUND = (255, 255, 255)


def make_stl(part: str, path: str, settings: tuple[str, ...] = ()) -> None:
    """Renders one part of the model, with further NAME=VALUE settings of it, into an ASCII STL file.

    Raises CalledProcessError.
    """
    options = [option for setting in settings for option in ("-D", setting)]
    subprocess.run(
        ["openscad", "-q", "-D", f'part="{part}"', *options, "-o", path, MODEL],
        check=True,
        env={**os.environ, "HOME": os.path.dirname(path)},
    )


def view_axes(azimuth_deg: float, elevation_deg: float):
    """Right, up and toward the viewer, as unit vectors."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    toward = (
        math.cos(elevation) * math.cos(azimuth),
        math.cos(elevation) * math.sin(azimuth),
        math.sin(elevation),
    )
    right = (-math.sin(azimuth), math.cos(azimuth), 0.0)
    up = (
        toward[1] * right[2] - toward[2] * right[1],
        toward[2] * right[0] - toward[0] * right[2],
        toward[0] * right[1] - toward[1] * right[0],
    )
    return right, up, toward


def dot(a, b) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def normal_of(triangle):
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = triangle
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(x * x + y * y + z * z) or 1.0
    return x / length, y / length, z / length


def draw(pieces, axes, size: int, margin: int = 24):
    """Renders (triangles, color) pieces to rows of RGB samples; the longer side has `size` pixels."""
    right, up, toward = axes
    light = tuple(0.45 * right[i] * -0.6 + 0.55 * up[i] + 0.75 * toward[i] for i in range(3))
    length = math.sqrt(dot(light, light))
    light = tuple(value / length for value in light)
    flat = [
        (tuple((dot(p, right), dot(p, up), dot(p, toward)) for p in triangle), triangle, color)
        for triangles, color in pieces
        for triangle in triangles
    ]
    xs = [p[0] for corners, _, _ in flat for p in corners]
    ys = [p[1] for corners, _, _ in flat for p in corners]
    width, height = max(xs) - min(xs), max(ys) - min(ys)
    scale = (size - 2 * margin) * SAMPLES / max(width, height)
    columns, rows = (
        SAMPLES * (math.ceil(extent * scale / SAMPLES) + 2 * margin) for extent in (width, height)
    )
    depth = [[-math.inf] * columns for _ in range(rows)]
    image = [[BACKGROUND] * columns for _ in range(rows)]
    left, top = min(xs) - margin * SAMPLES / scale, max(ys) + margin * SAMPLES / scale
    for corners, triangle, color in flat:
        normal = normal_of(triangle)
        if dot(normal, toward) <= 0:
            continue
        shade = 0.42 + 0.58 * max(0.0, dot(normal, light))
        painted = tuple(min(255, int(value * shade)) for value in color)
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = (
            ((x - left) * scale, (top - y) * scale, z) for x, y, z in corners
        )
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) < 1e-9:
            continue
        for y in range(max(0, int(min(ay, by, cy))), min(rows - 1, int(max(ay, by, cy)) + 1) + 1):
            # Part of the row inside the triangle, and the depth along it.
            py = y + 0.5
            crossings = []
            for px, pyy, pz, qx, qy, qz in (
                (ax, ay, az, bx, by, bz),
                (bx, by, bz, cx, cy, cz),
                (cx, cy, cz, ax, ay, az),
            ):
                if (pyy <= py) != (qy <= py):
                    t = (py - pyy) / (qy - pyy)
                    crossings.append((px + t * (qx - px), pz + t * (qz - pz)))
            if len(crossings) != 2:
                continue
            (x0, z0), (x1, z1) = sorted(crossings)
            slope = (z1 - z0) / (x1 - x0) if x1 > x0 else 0.0
            depth_row, image_row = depth[y], image[y]
            for x in range(max(0, math.ceil(x0 - 0.5)), min(columns - 1, math.floor(x1 - 0.5)) + 1):
                z = z0 + (x + 0.5 - x0) * slope
                if z > depth_row[x]:
                    depth_row[x] = z
                    image_row[x] = painted
    outline(image, depth, scale)
    return image


def outline(image, depth, scale: float) -> None:
    """Darkens pixels at large steps in depth, so that edges show."""
    step = max(1.5, 3.0 / scale)
    for y in range(1, len(depth)):
        above, row = depth[y - 1], depth[y]
        for x in range(1, len(row)):
            here = row[x]
            nearest, farthest = max(here, above[x], row[x - 1]), min(here, above[x], row[x - 1])
            if nearest - farthest > step:
                image[y][x] = tuple(int(value * 0.45) for value in image[y][x])


def write_png(image, path: str) -> None:
    """Averages the samples of each pixel and writes an RGB PNG file."""
    rows = bytearray()
    count = SAMPLES * SAMPLES
    for y in range(0, len(image), SAMPLES):
        rows.append(0)
        for x in range(0, len(image[y]), SAMPLES):
            block = [image[y + j][x + i] for j in range(SAMPLES) for i in range(SAMPLES)]
            rows += bytes(sum(sample[channel] for sample in block) // count for channel in range(3))

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    size = struct.pack(">IIBBBBB", len(image[0]) // SAMPLES, len(image) // SAMPLES, 8, 2, 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size))
        file.write(chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


def table_row(name: str, triangles) -> str:
    low, high = stl.bounds(triangles)
    size = " x ".join(f"{high[i] - low[i]:.1f}" for i in range(3))
    return f"{name},{PARTS[name]},{size},{stl.volume_mm3(triangles) / 1000:.1f}"


def main(folder: str) -> None:
    os.makedirs(folder, exist_ok=True)
    with tempfile.TemporaryDirectory() as work:
        def triangles_of(name: str, settings: tuple[str, ...] = ()):
            path = os.path.join(work, name + ".stl")
            make_stl(name, path, settings)
            return stl.read_stl(path)

        table = ["part,pieces,size_mm,volume_cm3"]
        for name in PARTS:
            triangles = triangles_of(name)
            table.append(table_row(name, triangles))
            view = view_axes(*VIEWS.get(name, (-60, 35)))
            picture = draw([(triangles, (120, 152, 190))], view, 360)
            write_png(picture, os.path.join(folder, name + ".png"))
        with open(os.path.join(HERE, "parts.csv"), "w", encoding="utf-8") as file:
            file.write("\n".join(table) + "\n")
        pieces = [(triangles_of(name), color) for name, color in ASSEMBLY.items()]
        write_png(draw(pieces, view_axes(-68, 32), 1100), os.path.join(folder, "assembly.png"))
        near = ("pipe", "cylinder", "leaf_springs", "sensor_carrier", "sensor_board", "support_box")
        halves = [
            (triangles_of("placed_" + name, ("cut=true",)), ASSEMBLY["placed_" + name])
            for name in near
        ]
        write_png(draw(halves, view_axes(20, 18), 800), os.path.join(folder, "section.png"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", help="for the pictures; sizes and volumes go to parts.csv")
    main(parser.parse_args().folder)

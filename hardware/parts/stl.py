"""Reads STL files as OpenSCAD writes them, and checks the surfaces for slicers."""

from collections import Counter

Point = tuple[float, float, float]
Triangle = tuple[Point, Point, Point]


def read_stl(path: str) -> list[Triangle]:
    """Reads the triangles of an ASCII STL file, without normals."""
    corners: list[Point] = []
    with open(path, encoding="ascii") as file:
        for line in file:
            words = line.split()
            if words and words[0] == "vertex":
                corners.append((float(words[1]), float(words[2]), float(words[3])))
    return [(corners[i], corners[i + 1], corners[i + 2]) for i in range(0, len(corners), 3)]


def volume_mm3(triangles: list[Triangle]) -> float:
    """Volume enclosed; positive when the triangles face outward."""
    total = 0.0
    for (ax, ay, az), (bx, by, bz), (cx, cy, cz) in triangles:
        total += (
            ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        ) / 6
    return total


def bounds(triangles: list[Triangle]) -> tuple[Point, Point]:
    """Smallest and largest coordinates."""
    points = [point for triangle in triangles for point in triangle]
    low = tuple(min(point[i] for point in points) for i in range(3))
    high = tuple(max(point[i] for point in points) for i in range(3))
    return low, high


def defects(triangles: list[Triangle]) -> list[str]:
    """Defects of a surface that must be closed, orientable and facing outward; empty if there are none.

    Each edge must be shared by exactly two triangles, which pass it in opposite directions.
    """
    found = []
    if not triangles:
        return ["there are no triangles"]
    directed: Counter = Counter()
    for triangle in triangles:
        if len(set(triangle)) != 3:
            found.append(f"a triangle without area at {triangle[0]}")
        for i in range(3):
            directed[triangle[i], triangle[(i + 1) % 3]] += 1
    for (start, end), times in directed.items():
        if times != 1 or directed[end, start] != 1:
            found.append(
                f"the edge {start} to {end} is passed {times} times forward and"
                f" {directed[end, start]} times back; once each is closed"
            )
    if volume_mm3(triangles) <= 0:
        found.append(f"the volume is {volume_mm3(triangles):.1f} mm3: it faces inward")
    return found

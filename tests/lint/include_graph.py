"""The #include lines of this project's files, and the included files."""

import functools
import glob
import os
import re

INCLUDE = re.compile(rb'^[ \t]*#[ \t]*include[ \t]*(?:"([^"]+)"|<([^>]+)>)', re.M)


# Headers that the build generates: beginning of the included name, and their source files.
GENERATED = {"torquer_lcm/": "protocol/lcm/*.lcm", "torquer_version.h": "host/support/version.h.in"}


def origins(name: str, root: str) -> list[str]:
    """Source files of a generated header; empty for other headers."""
    for beginning, pattern in GENERATED.items():
        if name.startswith(beginning):
            return sorted(glob.glob(os.path.join(root, pattern)))
    return []


@functools.cache
def read(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read()


@functools.cache
def include_lines(path: str) -> tuple[tuple[int, str], ...]:
    """(line number, name as written) of each #include in a file, inside any #if."""
    text = read(path)
    return tuple(
        (text.count(b"\n", 0, match.start()) + 1, (match[1] or match[2]).decode())
        for match in INCLUDE.finditer(text)
    )


@functools.cache
def resolve(name: str, includer: str, folders: tuple[str, ...]) -> str | None:
    """Path of an included file: beside its includer or in the folders; None for a system header."""
    for folder in (os.path.dirname(includer), *folders):
        path = os.path.normpath(os.path.join(folder, name))
        if os.path.isfile(path):
            return path
    return None


def reachable(source: str, folders: tuple[str, ...], root: str) -> set[str]:
    """The source and all files that it includes, directly or not, and that lie in the folders.

    Its source files replace a generated header, so that the result is the same before and after a
    build.
    """
    found = {source}
    waiting = [source]
    while waiting:
        includer = waiting.pop()
        for _, name in include_lines(includer):
            made_from = origins(name, root)
            found.update(made_from)
            path = None if made_from else resolve(name, includer, folders)
            if path and path not in found:
                found.add(path)
                waiting.append(path)
    return found

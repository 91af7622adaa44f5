"""Installation into an empty folder, used from outside the tree as other projects use it."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

BUILD = pathlib.Path(sys.argv[1])

PROGRAM = pathlib.Path(__file__).with_name("outside.cpp").read_text()
PROJECT = """
cmake_minimum_required(VERSION 3.25)
project(outside LANGUAGES CXX)
find_package(Torquer 0.1 REQUIRED)
add_executable(by_cmake main.cpp)
target_link_libraries(by_cmake PRIVATE Torquer::torquer)
"""

DEVICE = '[[instrument]]\nname = "guidewire"\ndevice = "sion"\nmax_length_mm = 200\n\n'


def run(*words, **more):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, **more)
    if done.returncode != more.get("wanted", 0):
        sys.exit(f"{words}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def check(what, holds):
    if not holds:
        sys.exit(f"failed: {what}")


def shown_symbols(library):
    lines = run("nm", "-D", "-C", "--defined-only", library).splitlines()
    return [line.split(" ", 2)[2] for line in lines]


def main():
    with tempfile.TemporaryDirectory() as folder:
        prefix = pathlib.Path(folder) / "prefix"
        run("cmake", "--install", BUILD, "--prefix", prefix)
        library = next(prefix.glob("lib*/**/libtorquer.so"))
        environment = dict(os.environ, LD_LIBRARY_PATH=str(library.parent))
        environment.pop("PYTHONPATH", None)

        version = run(BUILD / "bin/torquer-simulator", "--version").split()[-1]
        node = "TORQUER_" + ".".join(version.split(".")[:2])
        symbols = [symbol for symbol in shown_symbols(library) if not symbol.startswith(node)]
        unversioned = [symbol for symbol in symbols if not symbol.endswith(f"@@{node}")]
        check(f"the symbols have the version of the interface: {unversioned[:5]}", not unversioned)
        check("the library shows its classes", any("Simulation::Step" in s for s in symbols))
        strangers = [
            s
            for s in symbols
            if not s.replace("typeinfo for ", "")
            .replace("typeinfo name for ", "")
            .replace("vtable for ", "")
            .startswith(
                ("torquer::Build", "torquer::Check", "torquer::Version", "torquer::Error", "torquer::Scene::",
                 "torquer::Simulation::", "torquer::Surface::")
            )
        ]
        check(f"the library shows nothing else: {strangers[:5]}", not strangers)
        header = (prefix / "include/torquer/torquer.h").read_text()
        check("the header needs the standard library alone", "Eigen" not in header)

        outside = pathlib.Path(folder) / "outside"
        outside.mkdir()
        (outside / "main.cpp").write_text(PROGRAM)
        (outside / "CMakeLists.txt").write_text(PROJECT)
        scenes = prefix / "share/torquer/scenes"
        scene = scenes / "ty_phantom.toml"
        run("cmake", "-S", outside, "-B", outside / "build", f"-DCMAKE_PREFIX_PATH={prefix}")
        run("cmake", "--build", outside / "build")
        said = run(outside / "build/by_cmake", scene, env=environment)
        check(f"the program runs: {said}", said.split()[0] == version)
        pkg_config = dict(environment, PKG_CONFIG_PATH=str(library.parent / "pkgconfig"))
        flags = run("pkg-config", "--cflags", "--libs", "torquer", env=pkg_config).split()
        run("g++", "-std=c++20", outside / "main.cpp", *flags, "-o", outside / "by_pkg_config")
        check("pkg-config builds the same",
              run(outside / "by_pkg_config", scene, env=environment) == said)

        packages = next(prefix.glob("lib/python3/dist-packages"))
        steps = (
            "import sys, torquer\n"
            "s = torquer.Simulation(torquer.Scene(sys.argv[1]))\n"
            "hands = s.hands\n"
            "for k in range(3):\n"
            "    hands[0, 0] += 1\n"
            "    assert s.step(0.1 * (k + 1), hands).converged\n"
            "print(torquer.__version__, round(s.places[0, 0]))\n"
        )
        # No environment names the library.
        python = dict(os.environ, PYTHONPATH=str(packages))
        python.pop("LD_LIBRARY_PATH", None)
        check("Python does the same",
              run("/usr/bin/python3", "-B", "-c", steps, scene, env=python) == said)

        module = {path.name for path in (prefix / "share/torquer/slicer/Torquer").rglob("*")}
        check("the module for 3D Slicer is whole", {"Torquer.py", "TorquerLib", "case.py", "run.py", "states.py"} <= module)

        parts = pathlib.Path(folder) / "parts"
        for part in ("library", "development", "python", "common", "programs", "documentation"):
            run("cmake", "--install", BUILD, "--prefix", parts, "--component", part)
        python["PYTHONPATH"] = str(next(parts.glob("lib/python3/dist-packages")))
        check("components make the same Python",
              run("/usr/bin/python3", "-B", "-c", steps, scene, env=python) == said)

        # Installed programs must find their data files without a build tree.
        programs = prefix / "bin"
        check("programs run from there", version in run(programs / "torquer-simulator", "--version"))
        for scene in sorted(scenes.glob("*.toml")):
            script = pathlib.Path(folder) / "script.csv"
            script.write_text("time_s\n0\n0.02\n")
            run(programs / "torquer-simulator", "--scene", scene, "--script", script, "--states",
                pathlib.Path(folder) / "states.jsonl",
                env=dict(environment, XDG_CACHE_HOME=os.environ.get(
                    "XDG_CACHE_HOME", str(pathlib.Path.home() / ".cache"))))
        # If a shell finds a program by PATH, argv[0] contains no folder.
        by_name = run("torquer-simulator", "--explain", scenes / "neuro_arch.toml", cwd="/",
                      env=dict(environment, PATH=f"{programs}:{environment['PATH']}",
                               XDG_CACHE_HOME=f"{folder}/by_name"))
        check(f"a program is found by its name: {by_name}", "neuro_arch" in by_name)
        # The programs must use the installed files, not those of the build tree.
        phantom = scenes / "ty_phantom.toml"
        phantom.write_text(re.sub(r"\[\[instrument\]\].*?\n\n", DEVICE, phantom.read_text(),
                                  flags=re.DOTALL))
        cases = (
            ("libexec/torquer/torquer-mesh-reader", "#!/bin/false\n", "neuro_arch", "surface.obj"),
            ("share/torquer/devices", None, "ty_phantom", "sion.toml"),
        )
        for below, text, name, said in cases:
            found = prefix / below
            if text is None:
                for device in found.glob("*.toml"):
                    device.write_text("nonsense\n")
            else:
                found.write_text(text)
                found.chmod(0o755)
            scene = scenes / f"{name}.toml"
            refused = subprocess.run([programs / "torquer-simulator", "--explain", scene],
                                     capture_output=True, text=True,
                                     env=dict(environment, XDG_CACHE_HOME=folder))
            check(f"{below} is used: {refused.stderr}",
                  refused.returncode == 2 and said in refused.stderr)
    print("installed, and used from C++ (CMake, pkg-config) and Python")


main()

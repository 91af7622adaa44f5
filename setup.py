"""Makes the wheel: CMake builds and installs its contents, and setuptools packs them. Both work below build/."""

import os
import pathlib
import platform
import re
import shutil
import subprocess
import sysconfig
from typing import Tuple

from setuptools import Distribution, setup
from setuptools.command.build_ext import build_ext
from wheel.bdist_wheel import bdist_wheel

ROOT = pathlib.Path(__file__).resolve().parent
WORK = ROOT / "build" / "wheel"


def version() -> str:
    found = re.search(r"^project\(torquer VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text("utf-8"), re.M)
    assert found is not None
    return found[1]


class Platform(Distribution):
    """A package for one platform and one Python."""

    def has_ext_modules(self) -> bool:
        return True


class Contents(build_ext):
    """Builds and installs everything that the wheel contains, Python files too."""

    def run(self) -> None:
        shutil.rmtree(self.build_lib, ignore_errors=True)
        build = ROOT / "build" / "release"
        subprocess.run(["bash", ROOT / "host" / "build", "release", "torquer_wheel"], check=True)
        component = ["--component", "wheel", "--prefix", pathlib.Path(self.build_lib).resolve(), "--strip"]
        subprocess.run(["cmake", "--install", build, *component], check=True, stdout=subprocess.DEVNULL)
        module = pathlib.Path(self.build_lib, "torquer", "_torquer" + sysconfig.get_config_var("EXT_SUFFIX"))
        if not module.exists():
            raise SystemExit(f"there is no {module.name}: the build is for /usr/bin/python3; use that Python")


class Manylinux(bdist_wheel):
    """Names the C library of this system, which is the oldest that the wheel surely works with."""

    def get_tag(self) -> Tuple[str, str, str]:
        python, abi, _ = super().get_tag()
        glibc = os.confstr("CS_GNU_LIBC_VERSION").split()[1].replace(".", "_")
        return python, abi, f"manylinux_{glibc}_{platform.machine()}"


WORK.mkdir(parents=True, exist_ok=True)
setup(
    version=version(),
    distclass=Platform,
    cmdclass={"build_ext": Contents, "bdist_wheel": Manylinux},
    options={"build": {"build_base": str(WORK)}, "egg_info": {"egg_base": str(WORK)}},
)

"""tests/lint/unchanged finds each change that counts, in a small generated tree."""

import fnmatch
import unittest

from generated_tree import Tree, load

TESTS = """
torquer_test(plain_test LABEL a
  SOURCES plain_test.cpp LINK a)
torquer_test(raced_test LABEL a THREADED
  SOURCES raced_test.cpp more.cpp ${PROJECT_SOURCE_DIR}/tests/support/shared.cpp LINK a)
torquer_test(case_test LABEL a THREADED_CASES "[threads]" SOURCES case_test.cpp)
"""
FILES = {
    "CMakePresets.json": "{}",
    "host/cmake/rules.cmake": "rules",
    "host/bus/bus.h": "  std::atomic<int> count;\n  // A comment.\n",
    "host/bus/plain.h": "int count = 0;\n",
    "host/simulator/cache.cpp": "mutable int kept;\n",
    "host/simulator/program/main.cpp": "std::thread thread;\n",
    "host/tools/tool.cpp": "std::mutex mutex;\n",
    "tests/a/CMakeLists.txt": TESTS,
    "tests/a/plain_test.cpp": "std::thread thread;\n",
    "tests/a/raced_test.cpp": "int a;\n",
    "tests/a/more.cpp": "int b;\n",
    "tests/a/case_test.cpp": "int c;\n",
    "tests/support/tsan_suppressions.cpp": "int d;\n",
    "firmware/src/report.cpp": "// A comment.\nint e;\n",
    "firmware/README.md": "text\n",
    "hardware/udev/70-torquer.rules": "# A comment.\nACTION\n",
    "tests/hil/guest/device": "#!/bin/bash\n# A comment.\nlsusb\n",
}


class Changes(Tree):
    subject: str

    def setUp(self):
        super().setUp()
        self.checked = load("unchanged")
        self.checked.ROOT = self.root
        self.checked.tracked = self.tracked
        self.files = dict(FILES)

    def tracked(self, *patterns: str) -> list[str]:
        """As git: a pattern names a file, a folder, or is a glob; one that begins with :! excludes."""
        def matches(name: str, pattern: str) -> bool:
            return name.startswith(pattern + "/") or fnmatch.fnmatch(name, pattern)

        without = [pattern[2:] for pattern in patterns if pattern.startswith(":!")]
        return [name for name in sorted(self.files)
                if any(matches(name, pattern) for pattern in patterns) and not any(matches(name, pattern) for pattern in without)]

    def lines(self) -> list[str]:
        for name, text in self.files.items():
            self.write(name, text)
        return self.checked.lines(self.subject)

    def changed(self, name: str, text: str) -> list[str]:
        """Names that the check prints after this change."""
        before = self.lines()
        self.files[name] = text
        return self.checked.changes(before, self.lines())


class Threads(Changes):
    subject = "threads"

    def test_nothing_changed(self):
        self.assertEqual(self.checked.changes(self.lines(), self.lines()), [])

    def test_changes_that_count(self):
        for name in ("CMakePresets.json", "host/cmake/rules.cmake", "host/bus/bus.h", "host/simulator/cache.cpp",
                     "tests/a/raced_test.cpp", "tests/a/more.cpp", "tests/a/case_test.cpp", "tests/support/tsan_suppressions.cpp"):
            self.assertEqual(self.changed(name, self.files[name] + "int more;\n"), [name])

    def test_changes_that_do_not_count(self):
        for name in ("host/bus/plain.h", "host/simulator/program/main.cpp", "host/tools/tool.cpp", "tests/a/plain_test.cpp",
                     "firmware/src/report.cpp"):
            self.assertEqual(self.changed(name, self.files[name] + "int more;\n"), [])
        self.assertEqual(self.changed("host/bus/bus.h", self.files["host/bus/bus.h"] + "// Another comment.\n"), [])

    def test_code_that_gets_or_loses_its_threads(self):
        self.assertEqual(self.changed("host/bus/plain.h", "std::jthread thread;\n"), ["host/bus/plain.h"])
        self.assertEqual(self.changed("host/bus/plain.h", "int count = 0;\n"), ["host/bus/plain.h"])
        self.assertEqual(self.changed("host/bus/new.cpp", "std::scoped_lock lock(mutex);\n"), ["host/bus/new.cpp"])

    def test_a_test_that_becomes_threaded(self):
        threaded = TESTS.replace("torquer_test(plain_test LABEL a", "torquer_test(plain_test LABEL a THREADED")
        self.assertEqual(self.changed("tests/a/CMakeLists.txt", threaded), ["tests/a/plain_test.cpp"])


class Guest(Changes):
    subject = "guest"

    def test_changes_that_count(self):
        for name in ("CMakePresets.json", "firmware/src/report.cpp", "hardware/udev/70-torquer.rules", "host/bus/plain.h",
                     "host/tools/tool.cpp", "tests/hil/guest/device"):
            self.assertEqual(self.changed(name, self.files[name] + "more\n"), [name])
        self.assertEqual(self.changed("host/device/new.cpp", "int f;\n"), ["host/device/new.cpp"])

    def test_changes_that_do_not_count(self):
        for name in ("firmware/README.md", "host/simulator/cache.cpp", "tests/a/raced_test.cpp"):
            self.assertEqual(self.changed(name, self.files[name] + "more\n"), [])
        for name in ("hardware/udev/70-torquer.rules", "tests/hil/guest/device"):
            self.assertEqual(self.changed(name, self.files[name] + "# Another comment.\n"), [])

    def test_an_interpreter_counts(self):
        script = self.files["tests/hil/guest/device"].replace("bash", "sh")
        self.assertEqual(self.changed("tests/hil/guest/device", script), ["tests/hil/guest/device"])


class ThisTree(unittest.TestCase):
    def names(self, subject: str) -> list[str]:
        return [line.split()[0] for line in load("unchanged").lines(subject)]

    def test_it_finds_threads_here(self):
        names = self.names("threads")
        for name in ("host/bus/bus.cpp", "host/simulator/vessel/brick_builder.cpp", "host/python/navigation_pool.cpp",
                     "tests/api/usage_test.cpp"):
            self.assertIn(name, names)

    def test_it_finds_sources_of_the_guest_here(self):
        names = self.names("guest")
        for name in ("firmware/board/atmega32u4/usb.cpp", "hardware/udev/70-torquer.rules", "host/daemon/main.cpp",
                     "host/support/realtime.cpp", "protocol/hid_reports.h", "tests/hil/guest/init"):
            self.assertIn(name, names)


if __name__ == "__main__":
    unittest.main()

"""The checks of this folder find their faults in small generated trees."""

import json
import os
import subprocess
import unittest

from generated_tree import HERE, Tree, load

RULES = """
[layers]
"protocol" = []
"low" = []
"low/inner" = ["low"]
"high" = ["low", "protocol"]
[tests]
shared = "tests/support"
except = ["high"]
"tests/high" = ["high"]
[libraries]
"low" = ["Eigen/"]
[exceptions]
"""


class Includes(Tree):
    def violations(self, rules: str = RULES, **files: str) -> list[str]:
        includes = load("includes")
        self.write("layers.toml", rules)
        names = []
        for key, text in files.items():
            name = key.replace("__", "/") + ".h"
            self.write(name, text)
            names.append(name)
        return includes.violations(self.root, names, includes.Rules(os.path.join(self.root, "layers.toml")))

    def test_arrows_that_are_allowed(self):
        self.assertEqual(
            self.violations(
                low__a='#include <vector>\n#include <Eigen/Core>\n#include "low/b.h"\n',
                low__b="",
                low__inner__c='#include "low/a.h"\n',
                high__d='#include "low/a.h"\n#include <sys/socket.h>\n#include "torquer_lcm/x_t.hpp"\n',
                tests__support__e='#include "low/a.h"\n',
                tests__low__f='#include "tests/support/e.h"\n',
                tests__high__g='#include "high/d.h"\n'), [])

    def test_arrows_that_are_not(self):
        cases = [
            ("low may not include high", dict(low__a='#include "high/d.h"\n', high__d="")),
            ("high may not include low/inner", dict(high__d='#include "low/inner/c.h"\n', low__inner__c="")),
            ("low may not include protocol", dict(low__a='#include "torquer_lcm/x_t.hpp"\n')),
            ("standard library and Eigen/ alone", dict(low__a="#include <sys/socket.h>\n")),
            ("standard library and Eigen/ alone", dict(low__a="#  include <nlohmann/json.hpp>\n")),
            ("a test may not include high", dict(tests__low__f='#include "high/d.h"\n', high__d="")),
            ("but not tests/high", dict(tests__low__f='#include "tests/high/g.h"\n', tests__high__g="")),
            ("belongs to no layer", dict(elsewhere__h='#include "low/a.h"\n', low__a="")),
            ("by its path from the root", dict(low__a='#include "b.h"\n', low__b="")),
        ]
        for rule, files in cases:
            found = self.violations(**files)
            self.assertEqual(len(found), 1, (rule, found))
            self.assertIn(rule, found[0])
            self.assertRegex(found[0], r"^[a-z/]+\.h:1 includes [\w/.]+: ")

    def test_circles(self):
        found = self.violations(low__a='#include "low/b.h"\n', low__b='#include "low/c.h"\n',
                                low__c='#include "low/a.h"\n')
        self.assertEqual(found, ["a circle: low/a.h -> low/b.h -> low/c.h -> low/a.h"])
        self.assertIn("a circle", self.violations(low__a='#include "low/a.h"\n')[0])

    def test_a_table_that_contradicts_itself(self):
        circle = RULES.replace('"low" = []', '"low" = ["high"]')
        self.assertTrue(any("layers.toml: a circle" in line for line in self.violations(circle)))
        unknown = RULES.replace('"low" = []', '"low" = ["nowhere"]')
        self.assertTrue(any("nowhere, which is not a layer" in line for line in self.violations(unknown)))

    def test_exceptions_shrink(self):
        excepted = RULES + '"low/a.h -> high/d.h" = "until d moves"\n'
        self.assertEqual(self.violations(excepted, low__a='#include "high/d.h"\n', high__d=""), [])
        self.assertIn("is not needed any more", self.violations(excepted, low__a="", high__d="")[0])


class Links(Tree):
    """Message about a link from page.md."""

    def setUp(self):
        super().setUp()
        self.links = load("links")
        self.write("folder/other.md", "# The *first* one, `x_y`\n\n## Twice\n\n## Twice\n\n"
                   "```\n# no heading\n```\n### [With](a.md) a link\n")
        self.write("page.md", "# Here\n")
        self.write("picture.svg", "")

    def objection(self, link: str) -> str:
        return self.links.objection(os.path.join(self.root, "page.md"), link)

    def test_links_that_lead_somewhere(self):
        for link in ("folder/other.md", "folder", "picture.svg", "#here", "https://example.org/#x", "mailto:a@b.c",
                     "folder/other.md#the-first-one-x_y", "folder/other.md#twice", "folder/other.md#twice-1",
                     "folder/other.md#with-a-link"):
            self.assertEqual(self.objection(link), "", link)

    def test_links_that_lead_nowhere(self):
        for link in ("other.md", "folder/none", "none.svg"):
            self.assertIn("does not exist", self.objection(link))
        for link in ("#there", "folder/other.md#twice-2", "folder/other.md#no-heading", "folder/other.md#First"):
            self.assertIn("has no such heading", self.objection(link))


class Layout(Tree):
    """Result of tests/lint/layout in a small checkout."""

    def setUp(self):
        super().setUp()
        root = os.path.dirname(os.path.dirname(HERE))
        for name in ("tests/lint/layout", "tests/lint/tracked", "host/script_library", ".clang-format"):
            with open(os.path.join(root, name), encoding="utf-8") as file:
                self.write(name, file.read())
        subprocess.run(["git", "init", "-q", self.root], check=True)

    def faults(self, name: str, text: str) -> str:
        self.write(name, text)
        subprocess.run(["git", "-C", self.root, "add", name], check=True)
        done = subprocess.run(["bash", os.path.join(self.root, "tests/lint/layout")], capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode != 0, bool(done.stdout + done.stderr))
        return done.stdout + done.stderr

    def test_layout_and_length(self):
        self.assertEqual(self.faults("a.cpp", "int a;\n" * 450), "")
        self.assertIn("should be clang-formatted", self.faults("a.cpp", "int  a;\n"))
        self.assertEqual(self.faults("a.cpp", "int a;\n"), "")
        self.assertEqual(self.faults("b.py", "a = 1\n" * 451),
                         "b.py: has more than 450 lines; divide it by responsibility\n")


class Recipes(unittest.TestCase):
    """Findings of tests/lint/recipes in a guide before any build."""

    def setUp(self):
        self.recipes = load("recipes")

    def test_files_that_are_not_there(self):
        guide = ("`tests/lint/recipes`, `tests/lint/`, `tests/lint/no_such_check`, `nowhere/a.h`, `NAME.x`,\n"
                 "`tests/lint/made.h`\n```cpp tests/lint/made.h\nint `tests/not_prose`;\n```\n")
        made = set(self.recipes.blocks(guide))
        self.assertEqual(made, {"tests/lint/made.h"})
        self.assertEqual(self.recipes.missing_files(guide, self.recipes.ROOT, made), ["tests/lint/no_such_check"])

    def test_studies_that_are_not_there(self):
        said = "usage: x\n\nCommands:\n  scaling   time\n  paper     tables\n"
        self.assertEqual(self.recipes.unknown_studies("`torquer-study scaling`, `torquer-study trance X`", said),
                         ["trance"])

    def test_places_of_added_lines(self):
        registry = '#include "a.h"\n#include "b.h"\n\nauto& kinds = {\n  A(),\n};\n'
        self.assertEqual(self.recipes.with_lines(registry, ['#include "c.h"', "  C(),"], "r"),
                         '#include "a.h"\n#include "b.h"\n#include "c.h"\n\nauto& kinds = {\n  C(),\n  A(),\n};\n')
        with self.assertRaises(self.recipes.Objection):
            self.recipes.with_lines("int main();\n", ["  C(),"], "r")


class Times(Tree):
    """Verdict of tests/times on results of CTest, and its table of times."""

    BUILDS = {
        "release": """
add_test("a: good" {measured} sh -c "echo fine")
set_tests_properties("a: good" PROPERTIES LABELS a)
add_test("a: busy" {measured} python3 -c "for _ in range(3000000): pass")
set_tests_properties("a: busy" PROPERTIES LABELS a)
""",
        "asan": """
add_test("b: no guest" sh -c "echo x: SKIPPED: no guest here; exit 77")
set_tests_properties("b: no guest" PROPERTIES LABELS b SKIP_RETURN_CODE 77)
add_test("b: partly" sh -c "echo '  skipped: no device'")
set_tests_properties("b: partly" PROPERTIES LABELS b)
""",
        "tsan": "",
    }
    LATE = 'add_test("{name}" sh -c "test -e {root}/{name} || { touch {root}/{name}; exit 1; }")\n'

    def run_build(self, build: str, text: str) -> None:
        measured = os.path.join(os.path.dirname(HERE), "measured")
        self.write(f"{build}/CTestTestfile.cmake", text.replace("{root}", self.root).replace("{measured}", measured))
        suite = os.path.join(self.root, "suite")
        environment = dict(os.environ, TORQUER_TEST_TIMES=os.path.join(suite, "processor"))

        def ctest(*words: str) -> subprocess.CompletedProcess:
            folder = os.path.join(self.root, build)
            return subprocess.run(["ctest", "--test-dir", folder, *words], env=environment, capture_output=True, text=True, check=False)

        self.write(f"suite/{build}.json", ctest("--show-only=json-v1").stdout)
        if ctest("--output-junit", os.path.join(suite, f"{build}.xml")).returncode:
            ctest("--rerun-failed", "--output-junit", os.path.join(suite, f"{build}-again.xml"))

    def run_suite(self, more: str = "") -> tuple[int, str, dict]:
        """Exit status, table and JSON. The release build has the tests of `more` too."""
        self.write("suite/phases", "install,1.5,0.2,0.1\nbuild release,20.0,30.0,5.0\nbuild asan,7.5,9.0,0.5\n"
                   "test release,7.0,6.0,0.5\ntest asan,2.0,1.0,0.5\nwhole,31,0,0\n")
        for build, text in self.BUILDS.items():
            self.run_build(build, text + more if build == "release" else text)
        times = [os.path.join(os.path.dirname(HERE), "times"), os.path.join(self.root, "suite")]
        shown = subprocess.run(times, capture_output=True, text=True, check=False)
        found = subprocess.run([*times, "--json"], capture_output=True, text=True, check=False)
        self.assertEqual(found.returncode, shown.returncode)
        return shown.returncode, shown.stdout, json.loads(found.stdout)

    def test_a_good_run(self):
        status, said, found = self.run_suite()
        self.assertEqual((status, found["passed"]), (0, True))
        self.assertIn("100% tests passed, 0 tests failed out of 4", said)
        self.assertIn("2 tests were skipped:\n  b: no guest: no guest here\n  b: partly: no device", said)
        rows = {(row["phase"], row["build"], row["label"]): row for row in found["times"]}
        self.assertEqual(rows["build", "release", ""]["processor_s"], 35)
        self.assertEqual(rows["total", "", ""]["wall_s"], 31)  # builds and tests overlap
        self.assertAlmostEqual(rows["total", "", ""]["processor_s"], 52.8)
        self.assertIn("Total Test time (real) = 9.00 sec", said)
        self.assertEqual(rows["label", "release", "a"]["tests"], 2)
        self.assertEqual(rows["label", "asan", "b"]["tests"], 2)
        self.assertGreater(rows["label", "release", "a"]["processor_s"], 0.03)
        with open(os.path.join(self.root, "suite/times.csv"), encoding="utf-8") as file:
            self.assertEqual(len(file.readlines()), 1 + len(rows))

    def test_two_late_tests_are_named_and_three_fail_the_run(self):
        two = "".join(self.LATE.replace("{name}", name) for name in ("late1", "late2"))
        status, said, found = self.run_suite(two)
        self.assertEqual(status, 0)
        self.assertIn("FLAKY: late1", said)
        self.assertIn("100% tests passed, 0 tests failed out of 6", said)
        self.assertEqual([test["name"] for test in found["tests"] if test["flaky"]], ["late1", "late2"])
        for name in ("late1", "late2", "suite/release-again.xml"):
            os.remove(os.path.join(self.root, name))
        status, said, found = self.run_suite(two + self.LATE.replace("{name}", "late3"))
        self.assertEqual((status, found["passed"]), (8, False))
        self.assertIn("3 flaky tests are more than the 2 that are allowed", said)

    def test_a_test_that_fails_twice_or_cannot_start_fails_the_run(self):
        for bad in ('add_test(bad sh -c "exit 1")\n', 'add_test(bad "/no/such/program")\n'):
            status, said, _ = self.run_suite(bad)
            self.assertEqual(status, 8)
            self.assertIn("1 tests failed out of 5", said)
            self.assertIn("FAILED:\n\tbad", said)


if __name__ == "__main__":
    unittest.main()

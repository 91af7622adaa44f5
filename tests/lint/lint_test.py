"""The checks of this folder find their faults in small generated trees."""

import importlib.machinery
import importlib.util
import json
import os
import subprocess
import tempfile
import unittest

import include_graph

HERE = os.path.dirname(os.path.abspath(__file__))


def load(script: str):
    """A script of this folder as a module."""
    loader = importlib.machinery.SourceFileLoader(script, os.path.join(HERE, script))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(script, loader))
    loader.exec_module(module)
    return module


class Tree(unittest.TestCase):
    """A folder with files."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = folder.name
        for cached in (include_graph.read, include_graph.include_lines, include_graph.resolve):
            cached.cache_clear()

    def write(self, name: str, text: str) -> None:
        path = os.path.join(self.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        for cached in (include_graph.read, include_graph.include_lines, include_graph.resolve):
            cached.cache_clear()


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
        self.assertTrue(any("nowhere, which is no layer" in line for line in self.violations(unknown)))

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

    def test_what_leads_somewhere(self):
        for link in ("folder/other.md", "folder", "picture.svg", "#here", "https://example.org/#x", "mailto:a@b.c",
                     "folder/other.md#the-first-one-x_y", "folder/other.md#twice", "folder/other.md#twice-1",
                     "folder/other.md#with-a-link"):
            self.assertEqual(self.objection(link), "", link)

    def test_what_does_not(self):
        for link in ("other.md", "folder/none", "none.svg"):
            self.assertIn("does not exist", self.objection(link))
        for link in ("#there", "folder/other.md#twice-2", "folder/other.md#no-heading", "folder/other.md#First"):
            self.assertIn("has no such heading", self.objection(link))


class BugKeys(Tree):
    """Conditions under which the verdict of clang-tidy on a source is known."""

    def setUp(self):
        super().setUp()
        self.bugs = load("bugs")
        self.write(".clang-tidy", "Checks: bugprone-*")
        self.write("a.cpp", '#include "a.h"\n#include <vector>\n')
        self.write("a.h", '#pragma once\n#include "b.h"\n')
        self.write("b.h", "#pragma once\n")
        self.write("other.h", "")

    def source(self, root: str | None = None, command: str = "c++", flags: str = "-O3",
               version: str = "22.1", build: str = "build/release"):
        root = root or self.root
        self.bugs.ROOT = root
        for cached in (include_graph.read, include_graph.include_lines, include_graph.resolve):
            cached.cache_clear()
        build = os.path.normpath(os.path.join(root, build))
        # One folder's path ends like the checkout's path, but is a different folder.
        words = f"{command} -I{root} -I{build}/made -isystem /usr{self.root} -DBIN=\\\"{build}/bin\\\" {flags}"
        entry = {"file": os.path.join(root, "a.cpp"),
                 "command": words.replace("PCH", f"{build}/cmake_pch.hxx") + f" -o a.o -c {root}/a.cpp"}
        return self.bugs.Source(entry["file"], self.bugs.flags_of(entry), build, version)

    def line(self, *where, **how) -> str:
        return self.source(*where, **how).line()

    def test_what_changes_a_key(self):
        keys = [self.line(), self.line(flags="-O3 -DNDEBUG"), self.line(version="23.0"),
                self.line(flags="-O3 -include a.h")]
        for name, text in (("a.cpp", '#include "a.h"\n'), ("a.h", '#include "b.h"\n'), ("b.h", "int b;\n"),
                           (".clang-tidy", "Checks: misc-*"), ("a.h", '#include <torquer_lcm/t.hpp>\n'),
                           ("protocol/lcm/t.lcm", "struct t {}"), ("protocol/lcm/u.lcm", "struct u {}")):
            self.write(name, text)
            keys.append(self.line())
        self.assertEqual(len(set(keys)), 11)

    def test_what_does_not(self):
        key = self.line()
        self.write("b.h", "// why\n#pragma once\n  // and how\n")
        self.assertEqual(self.line(), key)
        self.write("b.h", "// NOLINTBEGIN\n#pragma once\n")
        self.assertNotEqual(self.line(), key)
        self.write("b.h", "#pragma once  // why\n")
        self.assertNotEqual(self.line(), key)
        self.write("b.h", "#pragma once\n")
        self.write("other.h", "int other;\n")
        self.write("tests/.clang-tidy", "Checks: -*")
        # This header is found first, beside its includer.
        self.write("build/release/made/b.h", "int made;\n")
        self.assertEqual(self.line(), key)
        self.assertEqual(self.line(build="build/ci"), key)
        self.assertEqual(self.line(build="../elsewhere/release"), key)
        for name in ("checkout", "usr/include", "I"):
            with tempfile.TemporaryDirectory() as elsewhere:
                elsewhere = os.path.join(elsewhere, name)
                os.makedirs(elsewhere)
                subprocess.run(["cp", "-r", self.root + "/.", elsewhere], check=True)
                self.assertEqual(self.line(elsewhere), key)

    def test_generated_headers_count_as_what_they_are_made_from(self):
        self.write("b.h", "#include <torquer_lcm/t.hpp>\n")
        self.write("protocol/lcm/t.lcm", "struct t {}")
        before_the_build = self.line()
        self.write("build/release/made/torquer_lcm/t.hpp", "class t {};")
        self.assertEqual(self.line(), before_the_build)
        self.write("b.h", "#include <made_otherwise.h>\n")
        self.write("build/release/made/made_otherwise.h", "")
        with self.assertRaisesRegex(SystemExit, "a.cpp includes .*made_otherwise.h, which the build makes"):
            self.line()

    def test_precompiled_headers_and_the_launcher_are_left_out(self):
        plain = self.source()
        other = self.source(command="/usr/bin/ccache /usr/bin/c++", flags="-pthread -Wno-array-bounds -Wno-stringop-overflow -O3 -Winvalid-pch -include PCH")
        self.assertEqual(other.flags, plain.flags)
        self.assertEqual(other.line(), plain.line())

    def test_a_source_in_a_batch_is_one_like_others(self):
        build = os.path.join(self.root, "build/release")
        self.bugs.ROOT = self.root
        batch = "build/release/x.dir/Unity/unity_0_cxx.cxx"
        source = os.path.join(self.root, "a.cpp")
        self.write(batch, f'/* generated by CMake */\n\n#include "{source}"\n\n#include "/x/foreign.cpp"\n')
        lines = []
        for file in (source, os.path.join(self.root, batch)):
            self.write("build/release/compile_commands.json",
                       json.dumps([{"file": file, "command": f"c++ -DX -c {file} -o x.o"}]))
            (one,) = self.bugs.sources_of(build, "22.1")
            lines.append(one.line())
        self.assertEqual(lines[0], lines[1])

    def test_the_order_of_the_targets_does_not_matter(self):
        build = os.path.join(self.root, "build/release")
        self.bugs.ROOT = self.root
        entries = [{"file": os.path.join(self.root, "a.cpp"), "command": f"c++ {flags} -c a.cpp -o {flags}.o"}
                   for flags in ("-DX", "-DY", "-DZ")]
        lines = set()
        for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
            self.write("build/release/compile_commands.json", json.dumps([entries[i] for i in order]))
            (source,) = self.bugs.sources_of(build, "22.1")
            lines.add(source.line())
        self.assertEqual(len(lines), 1)


class Bugs(Tree):
    """The script, with a stand-in for clang-tidy that reports sources with the word BUG."""

    def setUp(self):
        super().setUp()
        self.write("bin/clang-tidy-22",
                   '#!/bin/sh\n[ "$1" = --version ] && { echo "LLVM version 22.1.8"; exit; }\n'
                   'for file; do :; done\necho "$file" >>"$LOOKED_AT"\n'
                   '! grep -q BUG "$file" || { echo "$file: error: a bug"; exit 1; }\n')
        os.chmod(os.path.join(self.root, "bin/clang-tidy-22"), 0o755)
        lint = os.path.join(self.root, "tests/lint")
        os.makedirs(lint)
        for name in ("bugs", "include_graph.py"):
            subprocess.run(["cp", os.path.join(HERE, name), lint], check=True)
        self.names = [f"s{index:02}.cpp" for index in range(40)]
        for name in self.names:
            self.write(name, "// good\n")
        self.write("build/release/compile_commands.json", json.dumps(
            [{"directory": self.root, "file": os.path.join(self.root, name), "command": f"c++ -c {name} -o {name}.o"}
             for name in self.names]))

    def run_bugs(self, *arguments: str) -> tuple[int, set[str], str]:
        """Exit status, the checked sources, output."""
        looked_at = os.path.join(self.root, "looked_at")
        open(looked_at, "w", encoding="utf-8").close()
        environment = dict(os.environ, LOOKED_AT=looked_at, PATH=self.root + "/bin:" + os.environ["PATH"],
                           PYTHONDONTWRITEBYTECODE="1")
        done = subprocess.run([os.path.join(self.root, "tests/lint/bugs"), *arguments], env=environment,
                              capture_output=True, text=True, check=False)
        with open(looked_at, encoding="utf-8") as file:
            seen = {os.path.basename(line.strip()) for line in file}
        return done.returncode, seen, done.stdout + done.stderr

    def passed(self) -> str:
        with open(os.path.join(self.root, "tests/lint/passed"), encoding="utf-8") as file:
            return file.read()

    def test_a_fresh_clone_profits_from_the_list(self):
        status, seen, _ = self.run_bugs("--update")
        self.assertEqual((status, seen), (0, set(self.names)))
        self.assertEqual(len(self.passed().splitlines()), 41)
        subprocess.run(["rm", "-r", os.path.join(self.root, "build/release/tidy")], check=True)
        status, seen, said = self.run_bugs()
        self.assertEqual((status, len(seen)), (0, self.rotation()))
        self.assertIn("looked at 0 with a text that is not in tests/lint/passed", said)
        # --fresh ignores the list.
        self.assertEqual(self.run_bugs("--fresh")[1], set(self.names))

    def rotation(self) -> int:
        return load("bugs").ROTATION

    def test_a_changed_source_is_looked_at_and_a_stale_list_is_no_failure(self):
        self.run_bugs("--update")
        self.write("s07.cpp", "int better;\n")
        status, seen, said = self.run_bugs()
        self.assertEqual(status, 0)
        self.assertIn("s07.cpp", seen)
        self.assertIn("looked at 1 with", said)
        self.write("s07.cpp", "int BUG;\n")
        for _ in range(2):
            status, seen, said = self.run_bugs("--update")
            self.assertEqual(status, 1)
            self.assertIn("s07.cpp: error: a bug", said)
            self.assertNotIn("s07.cpp", self.passed())

    def test_a_header_that_changes_sends_for_one_source_and_the_rotation_is_bounded(self):
        self.write("s05.h", "int a();\n")
        for name in self.names:
            self.write(name, '#include "s05.h"\n')
        self.run_bugs("--update")
        self.write("s05.h", "int b();\n")
        status, seen, said = self.run_bugs("--update")
        self.assertEqual(status, 0)
        self.assertIn("s05.cpp", seen)
        self.assertEqual(len(seen), 1 + self.rotation())
        # Sources that this run skipped come next.
        _, then, said = self.run_bugs()
        self.assertIn("looked at 0 with", said)
        self.assertEqual(then | seen, set(self.names))
        # A header is not listed while its source has findings.
        self.write("s05.h", "int c();\n")
        self.write("s05.cpp", '#include "s05.h"\nint BUG;\n')
        self.assertEqual(self.run_bugs("--update")[0], 1)
        self.write("s05.cpp", '#include "s05.h"\n')
        self.assertIn("s05.cpp", self.run_bugs()[1])

    def test_a_build_of_another_checkout_is_refused(self):
        self.write("build/release/compile_commands.json", '[{"file": "/x/a.cpp", "command": "c++ -c a.cpp"}]')
        status, _, said = self.run_bugs()
        self.assertEqual(status, 2)
        self.assertIn("none of its sources lies there", said)

    def test_a_list_edited_by_hand_hides_nothing_for_long(self):
        self.run_bugs("--update")
        # A key moved to another source or path does not count as a pass.
        lines = self.passed().splitlines()
        self.write("s03.cpp", "int BUG;\n")
        forged = [line.replace("s04.cpp", "s03.cpp") for line in lines if not line.startswith("s03.cpp")]
        self.write("tests/lint/passed", "\n".join(forged) + "\n")
        subprocess.run(["rm", "-r", os.path.join(self.root, "build/release/tidy")], check=True)
        self.assertEqual(self.run_bugs()[0], 1)
        # A forged line with a valid key is found by --fresh, and by some run of some commit.
        bugs = load("bugs")
        bugs.ROOT = self.root
        entry = {"file": os.path.join(self.root, "s03.cpp"), "command": "c++ -c s03.cpp -o s03.cpp.o"}
        right = bugs.Source(entry["file"], bugs.flags_of(entry), os.path.join(self.root, "build/release"),
                            "version 22.1.8").line()
        self.write("tests/lint/passed", "\n".join([right, *lines]) + "\n")
        self.assertEqual(self.run_bugs("--fresh")[0], 1)
        subprocess.run(["rm", "-r", os.path.join(self.root, "build/release/tidy")], check=True)
        git = ["git", "-C", self.root, "-c", "user.name=t", "-c", "user.email=t@localhost"]
        subprocess.run([*git, "init", "-q"], check=True)
        for commit in range(40):
            subprocess.run([*git, "commit", "-q", "--allow-empty", "-m", str(commit)], check=True)
            if self.run_bugs()[0] == 1:
                return
        self.fail("no run of 40 commits looked at the source with the bug")


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

    def test_where_lines_go(self):
        registry = '#include "a.h"\n#include "b.h"\n\nauto& kinds = {\n  A(),\n};\n'
        self.assertEqual(self.recipes.with_lines(registry, ['#include "c.h"', "  C(),"], "r"),
                         '#include "a.h"\n#include "b.h"\n#include "c.h"\n\nauto& kinds = {\n  C(),\n  A(),\n};\n')
        with self.assertRaises(self.recipes.Objection):
            self.recipes.with_lines("int main();\n", ["  C(),"], "r")


class Times(Tree):
    """Verdict of tests/times on results of CTest, and its table of times."""

    SUITE = """
add_test("a: good" {measured} sh -c "echo fine")
set_tests_properties("a: good" PROPERTIES LABELS a WORKING_DIRECTORY {root}/release/tests)
add_test("a: busy" {measured} python3 -c "for _ in range(3000000): pass")
set_tests_properties("a: busy" PROPERTIES LABELS a WORKING_DIRECTORY {root}/release/tests)
add_test("b: no guest" sh -c "echo x: SKIPPED: no guest here; exit 77")
set_tests_properties("b: no guest" PROPERTIES LABELS b SKIP_RETURN_CODE 77 WORKING_DIRECTORY {root}/asan)
add_test("b: partly" sh -c "echo '  skipped: no device'")
set_tests_properties("b: partly" PROPERTIES LABELS b WORKING_DIRECTORY {root}/asan)
"""
    LATE = 'add_test("{name}" sh -c "test -e {root}/{name} || { touch {root}/{name}; exit 1; }")\n'

    def run_suite(self, more: str = "") -> tuple[int, str, dict]:
        """Exit status, table and JSON."""
        for name in ("release/tests/x", "asan/x"):
            self.write(name, "")
        text = (self.SUITE + more).replace("{root}", self.root)
        self.write("suite/CTestTestfile.cmake", text.replace("{measured}", os.path.join(os.path.dirname(HERE), "measured")))
        suite = os.path.join(self.root, "suite")
        self.write("suite/phases", "install,1.5,0.2,0.1\nbuild release,20.0,30.0,5.0\ntest,7.0,6.0,0.5\n")
        environment = dict(os.environ, TORQUER_TEST_TIMES=os.path.join(suite, "processor"))

        def ctest(*words: str) -> subprocess.CompletedProcess:
            return subprocess.run(["ctest", "--test-dir", suite, *words], env=environment, capture_output=True, text=True, check=False)

        self.write("suite/tests.json", ctest("--show-only=json-v1").stdout)
        if ctest("--output-junit", os.path.join(suite, "first.xml")).returncode:
            ctest("--rerun-failed", "--output-junit", os.path.join(suite, "again.xml"))
        times = [os.path.join(os.path.dirname(HERE), "times"), suite]
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
        self.assertEqual(rows["total", "", ""]["wall_s"], 28.5)
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
        for name in ("late1", "late2", "suite/again.xml"):
            os.remove(os.path.join(self.root, name))
        status, said, found = self.run_suite(two + self.LATE.replace("{name}", "late3"))
        self.assertEqual((status, found["passed"]), (8, False))
        self.assertIn("3 flaky tests are more than the 2 that are allowed", said)

    def test_what_fails_twice_or_cannot_start_fails_the_run(self):
        for bad in ('add_test(bad sh -c "exit 1")\n', 'add_test(bad "/no/such/program")\n'):
            status, said, _ = self.run_suite(bad)
            self.assertEqual(status, 8)
            self.assertIn("1 tests failed out of 5", said)
            self.assertIn("FAILED:\n\tbad", said)


if __name__ == "__main__":
    unittest.main()

"""tests/lint/batches finds names that collide when the sources of a target are compiled together."""

import unittest

from generated_tree import load


class Targets(unittest.TestCase):
    """Targets in a CMake file, with their sources."""

    def targets(self, cmake: str) -> dict[str, list[str]]:
        return load("batches").targets(cmake)

    def test_sources_are_those_of_the_call_and_of_its_lists(self):
        cmake = """
            set(more c.cpp  # a comment (with a bracket
                d.cpp)
            torquer_library(one SOURCES a.cpp parts/b.cpp ${more} ${unknown} LINK two.lib)
            torquer_test(two LABEL x
              SOURCES "e.cpp")
            pybind11_add_module(three MODULE f.cpp)
            add_custom_command(OUTPUT g.cpp)
            """
        self.assertEqual(self.targets(cmake), {"one": ["a.cpp", "parts/b.cpp", "c.cpp", "d.cpp"], "two": ["e.cpp"],
                                               "three": ["f.cpp"]})

    def test_targets_without_batches_are_left_out_unless_some_preset_has_them(self):
        cmake = "torquer_library(one SOURCES a.cpp)\n"
        off = "set_target_properties(one PROPERTIES UNITY_BUILD OFF)\n"
        self.assertEqual(self.targets(cmake + off), {})
        self.assertEqual(self.targets(f'{cmake}if(CMAKE_BUILD_TYPE STREQUAL "Release")\n{off}endif()\n'), {"one": ["a.cpp"]})


class Collisions(unittest.TestCase):
    """Messages about two sources of one target."""

    def setUp(self):
        self.batches = load("batches")

    def found(self, one: str, other: str) -> list[str]:
        sources = {"a.cpp": one, "b.cpp": other}
        names = {path: self.batches.Source(text).names for path, text in sources.items()}
        return sorted(self.batches.collisions(names))

    def test_a_message_names_both_places(self):
        self.assertEqual(self.found("namespace {\nint Half(int a) { return a / 2; }\n}", "\n\nstatic int Half(int b) { return b; }"),
                         ["b.cpp:3: Half is also defined in a.cpp"])

    def test_every_kind_of_name_collides(self):
        for definition in ("double kMost = 3;", "constexpr int kLeast = 1, kMost = 2;", "const std::string kMost(\"a\", 1);",
                           "std::array<int, 2> kMost{1, 2};", "const char kMost[] = R\"(a; { \")\";", "int kMost;",
                           "enum class kMost : int { a };", "enum { kLeast, kMost = 3 };", "enum Ends : int { kMost, kLeast };", "struct kMost final : Base<int> { int a; };", "class kMost {};",
                           "using kMost = int;", "typedef int kMost;", "void kMost();\nvoid kMost() { if (a) { b(); } }",
                           "template <typename T>\nstd::vector<T> kMost(T a) { return {a}; }",
                           "[[nodiscard]] auto kMost() -> std::function<void(int)> { return {}; }",
                           "std::function<void(int)> kMost = [](int a) { b(a); };"):
            both = [f"namespace one {{\nnamespace {{\n{text}{definition}\n}}\n}}" for text in ("// {\n", "bool b = '{';\n")]
            self.assertIn("kMost is also defined in a.cpp", "".join(self.found(*both)), definition)
            self.assertEqual(self.found(both[0], both[1].replace("one", "two")), [], definition)

    def test_definitions_behind_others_are_found(self):
        for other in ("#define X {", "A::A(int a) : x_{a}, y_(a) {}", "bool operator<(const A& a, const A& b) { return a.x < b.x; }",
                      "using std::max;", "namespace fs = std::filesystem;", "extern \"C\" {\nint f(int);\n}", "int m = 1'000'000;",
                      "static_assert(sizeof(int) == 4);", "template <int n>\nstruct S {};", "char c = '\\'';", "TEST_CASE(\"a {\") {}",
                      "inline namespace v1 {\nint a;\n}", "std::map<int, std::pair<int, int>> x = {{1, {2, 3}}};"):
            text = f"namespace {{\n{other}\nint Last() {{ return 1; }}\n}}"
            self.assertIn("b.cpp:3: Last is also defined in a.cpp" if "\n" not in other else "Last is also defined",
                          "\n".join(self.found("static int Last() { return 2; }", text)), other)

    def test_a_local_name_collides_with_one_that_another_source_exports(self):
        self.assertEqual(len(self.found("int Half(int a) { return a; }", "namespace {\nint Half(int a) { return 1; }\n}")), 1)

    def test_names_that_may_repeat(self):
        for one, other in (("static int F(int a) { return a; }", "static int F(double a) { return 1; }"),
                           ("static int F(A<int, B> a) { return a; }", "static int F(A<int, C> a) { return 1; }"),
                           ("struct A;", "struct A {};"), ("void A::F() {}", "void B::F() {}"),
                           ("static int F() { int a = 1; return a; }", "static int G() { int a = 1; return a; }"),
                           ("TEST_CASE(\"a\") {}", "TEST_CASE(\"b\") {}"),
                           ("namespace fs = std::filesystem;", "namespace fs = std::filesystem;"),
                           ("int F(int a) { return a; }", "extern int F;")):
            self.assertEqual(self.found(one, other), [], (one, other))

    def test_names_of_parameters_and_defaults_make_no_overloads(self):
        self.assertEqual(len(self.found("static int F(const A<int, B>& a, int b = 1) { return 1; }",
                                        "static int F(const A<int, B>& x, int) { return 1; }")), 1)


if __name__ == "__main__":
    unittest.main()

// Whether a test runs under a sanitizer, which slows it five to twenty times.
#pragma once

namespace torquer::test {

/// True in the builds asan and tsan. Tests that repeat something many times repeat it less there:
/// what a sanitizer finds, it finds in any of the rounds. Fewer rounds, never fewer kinds of them.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kUnderSanitizer = true;
#else
inline constexpr bool kUnderSanitizer = false;
#endif

/// `rounds`, or a `share`-th part of them (at least one) under a sanitizer.
constexpr int Rounds(int rounds, int share) {
  return !kUnderSanitizer ? rounds : rounds < share ? 1 : rounds / share;
}

}  // namespace torquer::test

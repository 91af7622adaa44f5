// Sanitizer detection; sanitizers slow a test down five to twenty times.
#pragma once

namespace torquer::test {

/// True in the builds asan and tsan. Tests with many rounds run fewer of them there, because a
/// sanitizer detects its errors in any round. They never run fewer kinds of rounds.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kUnderSanitizer = true;
#else
inline constexpr bool kUnderSanitizer = false;
#endif

/// `rounds`, or under a sanitizer `rounds` / `share` (at least one).
constexpr int Rounds(int rounds, int share) {
  return !kUnderSanitizer ? rounds : rounds < share ? 1 : rounds / share;
}

}  // namespace torquer::test

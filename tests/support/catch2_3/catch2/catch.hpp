// Catch2's header of version 2, for a system that has version 3 (Debian 13).
#pragma once

#include <catch2/catch_all.hpp>
#include <string>

namespace Catch {

using Matchers::EndsWith;
using Matchers::Equals;
using Matchers::StartsWith;

// Version 3 calls this matcher ContainsSubstring, and has another one with this name.
inline auto Contains(const std::string& part) { return Matchers::ContainsSubstring(part); }

}  // namespace Catch

using Catch::Approx;

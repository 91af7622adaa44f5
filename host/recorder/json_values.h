// Values of JSON outputs that may be unknown.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

namespace torquer {

/// The value, or null if there is none.
template <class T>
nlohmann::ordered_json OrNull(const std::optional<T>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

}  // namespace torquer

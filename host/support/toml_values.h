// Sets values in a TOML table that was read from a file.
#pragma once

#include <toml++/toml.h>

#include <string>

#include "host/support/strict_toml.h"

namespace torquer {

/// Sets `values` in `root`, in their order. Nodes that it sets have no place in a file. In a list,
/// a table without a name has its number as name, from 0. `path` is for messages. Throws UserError
/// for a key that cannot be set.
void SetValues(const TomlValues& values, const std::string& path, toml::table& root);

}  // namespace torquer

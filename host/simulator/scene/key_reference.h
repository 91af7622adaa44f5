// The reference of all keys of a scene file, from the tables that read them.
#pragma once

#include <string>

namespace torquer::scene {

/// For a terminal.
std::string KeysAsText();
/// host/scenes/README.md from the heading "Keys" on.
std::string KeysAsMarkdown();
/// JSON Schema (draft 7), as editors of TOML use it.
std::string KeysAsJsonSchema();

}  // namespace torquer::scene

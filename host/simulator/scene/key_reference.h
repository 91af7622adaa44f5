// Reference of all keys of a scene file, generated from the tables that read them.
#pragma once

#include <string>

namespace torquer::scene {

/// Plain text for a terminal.
std::string KeysAsText();
/// Text of host/scenes/README.md from the heading "Keys" on.
std::string KeysAsMarkdown();
/// JSON Schema (draft 7) for TOML editors.
std::string KeysAsJsonSchema();

}  // namespace torquer::scene

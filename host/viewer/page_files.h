// The only files of the page, which web/build.mjs bundles into the program.
#pragma once

#include <span>
#include <string_view>

namespace torquer::viewer {

struct PageFile {
  std::string_view name;  ///< below the token's folder; "" is the page itself
  std::string_view type;  ///< as in Content-Type
  std::string_view content;
};

std::span<const PageFile> PageFiles();

}  // namespace torquer::viewer

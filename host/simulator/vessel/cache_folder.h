// Cache folder: limits the size of the folder of cached fields.
#pragma once

#include <cstdint>
#include <string>

namespace torquer::vessel {

/// Largest total size of the cached fields in a folder, bytes: about twenty of the largest fields.
inline constexpr std::int64_t kMostCacheBytes = std::int64_t{4} << 30;

/// Removes this user's files from a folder of fields (field_cache.h): unfinished ones of dead
/// writers, and least recently used fields. It stops once the other fields take `most_bytes` or
/// less. The field at `keep` stays. Files that are not fields of this user stay too; name and first
/// bytes decide.
void TidyCacheFolder(const std::string& folder, const std::string& keep,
                     std::int64_t most_bytes = kMostCacheBytes);

}  // namespace torquer::vessel

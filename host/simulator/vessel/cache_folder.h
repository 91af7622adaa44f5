// The folder of cached fields, kept in bounds.
#pragma once

#include <cstdint>
#include <string>

namespace torquer::vessel {

/// Bytes that the cached fields of a folder may take: some twenty of the largest.
inline constexpr std::int64_t kMostCacheBytes = std::int64_t{4} << 30;

/// Removes what this user's runs have left in a folder of fields (field_cache.h): files that a
/// writer began and, since it is dead, will not finish, and the fields that were used least
/// recently, until the others take `most_bytes` or less. The field at `keep` stays, and so does
/// everything that is not a field, by its name and its first bytes, of this user.
void TidyCacheFolder(const std::string& folder, const std::string& keep,
                     std::int64_t most_bytes = kMostCacheBytes);

}  // namespace torquer::vessel

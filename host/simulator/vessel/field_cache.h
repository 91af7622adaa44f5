// Field cache: built fields kept between runs.
//
// File: header, surface, directory of bricks, bricks, in native byte order. The header has the
// format's version and the key. Checksums of header, surface and directory are checked on opening,
// a brick's checksum at its first look-up. A torn file costs time, never correctness.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/brick_field.h"

namespace torquer::vessel {

/// Key of a field: a hash over the content and parameters from which it was built.
struct CacheKey {
  uint64_t words[2] = {0x6a09e667f3bcc908, 0xbb67ae8584caa73b};

  /// Adds bytes to the hash.
  void Add(const void* bytes, size_t size);
  void Add(double number) { Add(&number, sizeof number); }
  std::string Hex() const;
};

/// $XDG_CACHE_HOME/torquer, or ~/.cache/torquer; empty if neither is known.
std::string DefaultCacheFolder();

/// Contents of a cache file.
struct CachedField {
  std::vector<char> surface;  ///< bytes given to WriteFieldCache
  std::vector<StoredBrick> bricks;
  std::vector<bool> complete_levels;
  std::shared_ptr<const void> memory;  ///< owns the bricks' memory
};

/// Opens a cache file and marks it as used. Returns nullopt if it is missing, damaged, of another
/// key or version, or if another user may have written it. `why` receives the reason; it is empty
/// on success and for a missing file.
std::optional<CachedField> ReadFieldCache(const std::string& path, const CacheKey& key,
                                          std::string* why);

/// True if a file begins like those of WriteFieldCache.
bool IsFieldCache(const std::string& path);

/// Writes a file completely or not at all; creates its folder if necessary. Returns the reason of a
/// failure, empty on success.
std::string WriteFieldCache(const std::string& path, const CacheKey& key,
                            const std::vector<char>& surface, const BrickField& field);

}  // namespace torquer::vessel

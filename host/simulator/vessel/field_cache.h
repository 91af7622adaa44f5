// Built fields kept between runs.
//
// File: header, surface, directory of bricks, bricks; native byte order, the format's version and
// the key in the header. Header, surface and directory are checked against their checksums when the
// file is opened, each brick when it is first looked at: a torn file costs time, never correctness.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/vessel/brick_field.h"

namespace torquer::vessel {

/// What a field was built from: a hash over content and parameters.
struct CacheKey {
  uint64_t words[2] = {0x6a09e667f3bcc908, 0xbb67ae8584caa73b};

  /// Takes more bytes in.
  void Add(const void* bytes, size_t size);
  void Add(double number) { Add(&number, sizeof number); }
  std::string Hex() const;
};

/// $XDG_CACHE_HOME/torquer, or ~/.cache/torquer; empty where neither is known.
std::string DefaultCacheFolder();

/// What a cache file gave.
struct CachedField {
  std::vector<char> surface;  ///< bytes as they were written
  std::vector<StoredBrick> bricks;
  std::vector<bool> complete_levels;
  std::shared_ptr<const void> memory;  ///< keeps the bricks' memory
};

/// Opens a file, and notes that it was used; nothing where there is none, or where it is not whole,
/// not of this key, or such that another user may have written it (then `why` says so).
std::optional<CachedField> ReadFieldCache(const std::string& path, const CacheKey& key,
                                          std::string* why);

/// Whether a file begins as those that WriteFieldCache writes.
bool IsFieldCache(const std::string& path);

/// Writes a file whole or not at all, making its folder if need be. Returns why it could not, empty
/// on success.
std::string WriteFieldCache(const std::string& path, const CacheKey& key,
                            const std::vector<char>& surface, const BrickField& field);

}  // namespace torquer::vessel

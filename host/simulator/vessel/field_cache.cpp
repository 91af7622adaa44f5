#include "host/simulator/vessel/field_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "host/simulator/vessel/file_descriptor.h"

namespace torquer::vessel {

namespace {

constexpr char kMagic[8] = {'T', 'O', 'R', 'Q', 'F', 'L', 'D', '\n'};
constexpr uint32_t kVersion = 1;
constexpr size_t kBrickFloats = kernel::kCoefficients + 2;  // with the checksum
constexpr size_t kBrickBytes = kBrickFloats * sizeof(float);
constexpr int kMostLevels = 16;

struct Header {
  char magic[8];
  uint32_t version;
  uint32_t brick_bytes;
  uint64_t key[2];
  uint64_t file_bytes;
  uint64_t surface_bytes, surface_checksum;
  uint64_t brick_count, directory_checksum;
  uint8_t complete[kMostLevels];
  uint64_t checksum;  // of all members above
};

struct DirectoryEntry {
  int32_t level;
  int32_t place[3];
};

uint64_t Checksum(const void* bytes, size_t size) {
  CacheKey hash;
  hash.Add(bytes, size);
  return hash.words[0] ^ hash.words[1];
}

size_t Padded(size_t size) { return (size + 15) / 16 * 16; }

// File mapped to memory during the lifetime of this object.
struct Mapping {
  const char* bytes = nullptr;
  size_t size = 0;
  ~Mapping() {
    if (bytes != nullptr) munmap(const_cast<char*>(bytes), size);
  }
};

bool WriteAll(int file, const void* bytes, size_t size) {
  const char* at = static_cast<const char*>(bytes);
  while (size > 0) {
    const ssize_t written = write(file, at, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    at += written;
    size -= static_cast<size_t>(written);
  }
  return true;
}

}  // namespace

void CacheKey::Add(const void* bytes, size_t size) {
  const char* at = static_cast<const char*>(bytes);
  const auto mix = [&](uint64_t word) {
    words[0] = (words[0] ^ word) * 0x9e3779b97f4a7c15;
    words[0] ^= words[0] >> 32;
    words[1] = (words[1] + word) * 0xd6e8feb86659fd93;
    words[1] ^= words[1] >> 29;
  };
  mix(size);
  for (; size >= 8; at += 8, size -= 8) {
    uint64_t word = 0;
    std::memcpy(&word, at, 8);
    mix(word);
  }
  uint64_t rest = 0;
  if (size > 0) std::memcpy(&rest, at, size);
  mix(rest);
}

std::string CacheKey::Hex() const {
  char text[40];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(words[0]),
                static_cast<unsigned long long>(words[1]));
  return text;
}

std::string DefaultCacheFolder() {
  // The XDG Base Directory Specification demands that relative paths are ignored.
  const char* cache = std::getenv("XDG_CACHE_HOME");
  if (cache != nullptr && cache[0] == '/') return std::string(cache) + "/torquer";
  const char* home = std::getenv("HOME");
  if (home != nullptr && home[0] == '/') return std::string(home) + "/.cache/torquer";
  return "";
}

std::optional<CachedField> ReadFieldCache(const std::string& path, const CacheKey& key,
                                          std::string* why) {
  why->clear();
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (file.number() < 0) {
    if (errno != ENOENT) *why = path + " cannot be read (" + std::strerror(errno) + ")";
    return std::nullopt;
  }
  const auto refuse = [&](const std::string& what) {
    *why = path + " " + what;
    return std::nullopt;
  };
  struct stat status {};
  if (fstat(file.number(), &status) != 0 || !S_ISREG(status.st_mode))
    return refuse("is not an ordinary file");
  if (status.st_uid != geteuid() || (status.st_mode & 022) != 0) {
    return refuse("belongs to another user, or other users may write it");
  }
  const auto size = static_cast<size_t>(status.st_size);
  if (size < sizeof(Header)) return refuse("is cut short");
  auto mapping = std::make_shared<Mapping>();
  void* mapped = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.number(), 0);
  if (mapped == MAP_FAILED)
    return refuse(std::string("cannot be mapped into memory: ") + std::strerror(errno));
  mapping->bytes = static_cast<const char*>(mapped);
  mapping->size = size;

  Header header;
  std::memcpy(&header, mapping->bytes, sizeof header);
  if (std::memcmp(header.magic, kMagic, sizeof kMagic) != 0) return refuse("is not a field file");
  if (header.version != kVersion || header.brick_bytes != kBrickBytes) {
    return refuse("has the format of another version");
  }
  if (header.checksum != Checksum(&header, offsetof(Header, checksum))) return refuse("is damaged");
  if (header.key[0] != key.words[0] || header.key[1] != key.words[1]) {
    return refuse("belongs to another surface");
  }
  if (header.file_bytes != size) return refuse("is cut short");
  if (header.surface_bytes > size || header.brick_count > size / kBrickBytes) {
    return refuse("is damaged");
  }
  const size_t surface_at = Padded(sizeof header);
  const size_t directory_at = surface_at + Padded(header.surface_bytes);
  const size_t directory_bytes = header.brick_count * sizeof(DirectoryEntry);
  const size_t bricks_at = directory_at + Padded(directory_bytes);
  if (bricks_at + header.brick_count * kBrickBytes != size) return refuse("is damaged");
  if (Checksum(mapping->bytes + surface_at, header.surface_bytes) != header.surface_checksum ||
      Checksum(mapping->bytes + directory_at, directory_bytes) != header.directory_checksum) {
    return refuse("is damaged");
  }

  futimens(file.number(), nullptr);  // last use: TidyCacheFolder removes the least recently used
  CachedField field;
  field.surface.assign(mapping->bytes + surface_at,
                       mapping->bytes + surface_at + header.surface_bytes);
  field.complete_levels.assign(header.complete, header.complete + kMostLevels);
  field.bricks.reserve(header.brick_count);
  for (size_t i = 0; i < header.brick_count; ++i) {
    DirectoryEntry entry;
    std::memcpy(&entry, mapping->bytes + directory_at + i * sizeof entry, sizeof entry);
    field.bricks.push_back(
        {entry.level,
         {entry.place[0], entry.place[1], entry.place[2]},
         reinterpret_cast<const float*>(mapping->bytes + bricks_at + i * kBrickBytes)});
  }
  field.memory = std::move(mapping);
  return field;
}

bool IsFieldCache(const std::string& path) {
  const FileDescriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  char magic[sizeof kMagic] = {};
  return file.number() >= 0 && read(file.number(), magic, sizeof magic) == sizeof magic &&
         std::memcmp(magic, kMagic, sizeof kMagic) == 0;
}

std::string WriteFieldCache(const std::string& path, const CacheKey& key,
                            const std::vector<char>& surface, const BrickField& field) {
  std::error_code error;
  const std::filesystem::path target(path);
  std::filesystem::create_directories(target.parent_path(), error);
  if (error) return target.parent_path().string() + " cannot be created (" + error.message() + ")";

  const std::vector<StoredBrick> bricks = field.StoredBricks();
  std::vector<DirectoryEntry> directory;
  directory.reserve(bricks.size());
  for (const auto& brick : bricks) {
    directory.push_back({brick.level, {brick.place[0], brick.place[1], brick.place[2]}});
  }
  const size_t directory_bytes = directory.size() * sizeof(DirectoryEntry);
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.version = kVersion;
  header.brick_bytes = kBrickBytes;
  header.key[0] = key.words[0];
  header.key[1] = key.words[1];
  header.surface_bytes = surface.size();
  header.surface_checksum = Checksum(surface.data(), surface.size());
  header.brick_count = bricks.size();
  header.directory_checksum = Checksum(directory.data(), directory_bytes);
  header.file_bytes = Padded(sizeof header) + Padded(surface.size()) + Padded(directory_bytes) +
                      bricks.size() * kBrickBytes;
  for (int l = 0; l < field.level_count() && l < kMostLevels; ++l) {
    header.complete[l] = field.IsComplete(l) ? 1 : 0;
  }
  header.checksum = Checksum(&header, offsetof(Header, checksum));

  std::string temporary = path + ".XXXXXX";
  const FileDescriptor file(mkostemp(temporary.data(), O_CLOEXEC));
  const auto fail = [&](const std::string& what) {
    const std::string reason = std::strerror(errno);
    if (file.number() >= 0) unlink(temporary.c_str());
    return what + " (" + reason + ")";
  };
  if (file.number() < 0) return fail(path + " cannot be written");
  flock(file.number(), LOCK_EX | LOCK_NB);  // until it closes: TidyCacheFolder tests it
  const char padding[16] = {};
  const auto put = [&](const void* bytes, size_t size) {
    return WriteAll(file.number(), bytes, size) &&
           WriteAll(file.number(), padding, Padded(size) - size);
  };
  bool whole = put(&header, sizeof header) && put(surface.data(), surface.size()) &&
               put(directory.data(), directory_bytes);
  std::vector<float> buffer;
  constexpr size_t kBricksAtOnce = 256;
  for (size_t i = 0; i < bricks.size() && whole; ++i) {
    const uint64_t checksum = bricks[i].Checksum();
    buffer.insert(buffer.end(), bricks[i].coefficients,
                  bricks[i].coefficients + kernel::kCoefficients);
    buffer.resize(buffer.size() + 2);
    std::memcpy(&buffer[buffer.size() - 2], &checksum, sizeof checksum);
    if (buffer.size() >= kBricksAtOnce * kBrickFloats || i + 1 == bricks.size()) {
      whole = WriteAll(file.number(), buffer.data(), buffer.size() * sizeof(float));
      buffer.clear();
    }
  }
  if (!whole) return fail(temporary + " cannot be written");
  if (fsync(file.number()) != 0) return fail(temporary + " cannot be flushed to the disk");
  if (std::rename(temporary.c_str(), path.c_str()) != 0) return fail(path + " cannot be replaced");
  return "";
}

}  // namespace torquer::vessel

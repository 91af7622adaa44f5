// Fuzz target for a cached field: the vessel loads it and evaluates it.
#include "host/simulator/vessel/field_cache.h"

#include <sys/stat.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "host/simulator/vessel/mesh_vessel.h"
#include "tests/fuzz/target.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"

namespace torquer::fuzz::field_cache_target {
namespace {

// A straight tube as a surface, and its field.
class Tube {
 public:
  Tube() : surface_(folder_.Path("tube.obj")) {
    std::ofstream obj(surface_);
    constexpr int kAround = 8, kRings = 4;
    for (int i = 0; i < kRings; ++i) {
      for (int j = 0; j < kAround; ++j) {
        const double angle = 2 * M_PI * j / kAround;
        obj << "v " << 10 * i << ' ' << 3 * std::cos(angle) << ' ' << 3 * std::sin(angle) << '\n';
      }
    }
    for (int i = 0; i + 1 < kRings; ++i) {
      for (int j = 0; j < kAround; ++j) {
        const int a = i * kAround + j + 1, b = i * kAround + (j + 1) % kAround + 1;
        obj << "f " << a << ' ' << b << ' ' << a + kAround << '\n';
        obj << "f " << b << ' ' << b + kAround << ' ' << a + kAround << '\n';
      }
    }
    obj.close();
    const auto vessel = Open();
    Look(*vessel);
    const std::string problem = vessel->SaveCache();
    for (const auto& file : std::filesystem::directory_iterator(folder_.Path("cache"))) {
      kept_ = file.path();
    }
    if (!problem.empty() || kept_.empty()) throw std::logic_error("no field is kept: " + problem);
    const std::string name = std::filesystem::path(kept_).stem();
    key_.words[0] = std::stoull(name.substr(0, 16), nullptr, 16);
    key_.words[1] = std::stoull(name.substr(16), nullptr, 16);
    contents_ = ToBytes(test::Contents(kept_));
  }

  const Bytes& contents() const { return contents_; }
  const vessel::CacheKey& key() const { return key_; }
  void Keep(std::span<const std::uint8_t> bytes) const {
    std::ofstream file(kept_, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    file.close();
    chmod(kept_.c_str(), 0600);
  }
  const std::string& kept() const { return kept_; }
  std::unique_ptr<vessel::MeshVessel> Open() const {
    vessel::MeshVesselOptions options;
    options.field.voxel_mm = 1;
    options.cache_folder = folder_.Path("cache");
    return vessel::MeshVessel::Open(surface_, options);
  }
  static void Look(const vessel::MeshVessel& vessel) {
    for (const double x : {1.0, 15.0, 100.0}) {
      ClearanceSample sample;
      vessel.field().EvaluateGradient({x, 0.5, 0}, sample);
    }
  }

 private:
  test::TemporaryFolder folder_;
  std::string surface_, kept_;
  vessel::CacheKey key_;
  Bytes contents_;
};

const Tube& TheTube() {
  static const Tube tube;
  return tube;
}

bool Accepts(std::span<const std::uint8_t> input) {
  const Tube& tube = TheTube();
  tube.Keep(input);
  std::string why;
  // A refused cache would be rebuilt, which this target does not test.
  if (!vessel::ReadFieldCache(tube.kept(), tube.key(), &why)) return false;
  const auto vessel = tube.Open();
  if (vessel->from_cache()) Tube::Look(*vessel);
  return vessel->from_cache();
}

// Layout of field_cache.cpp: key at 16, then sizes and checksums, then the header's own checksum.
constexpr std::size_t kFileBytes = 32, kSurfaceBytes = 40, kSurfaceSum = 48, kBricks = 56,
                      kDirectorySum = 64, kHeaderSum = 88, kHeader = 96, kEntryBytes = 16;

std::uint64_t WordAt(const Bytes& bytes, std::size_t at) {
  std::uint64_t word = 0;
  std::memcpy(&word, &bytes[at], sizeof word);
  return word;
}
void PutWord(Bytes& bytes, std::size_t at, std::uint64_t word) {
  std::memcpy(&bytes[at], &word, sizeof word);
}
std::uint64_t Checksum(const Bytes& bytes, std::size_t at, std::size_t size) {
  vessel::CacheKey hash;
  hash.Add(&bytes[at], size);
  return hash.words[0] ^ hash.words[1];
}

// Corrects all checksums, the file's length, and the key that identifies this field.
void Repair(Bytes& input) {
  const Bytes& whole = TheTube().contents();
  if (input.size() <= kHeader) return;
  std::copy_n(whole.begin(), kFileBytes, input.begin());
  PutWord(input, kFileBytes, input.size());
  const std::size_t surface = WordAt(input, kSurfaceBytes);
  if (surface < input.size() - kHeader) {
    PutWord(input, kSurfaceSum, Checksum(input, kHeader, surface));
    const std::size_t directory = kHeader + (surface + 15) / 16 * 16;
    const std::size_t bricks = WordAt(input, kBricks);
    if (bricks < input.size() / kEntryBytes && directory + bricks * kEntryBytes < input.size()) {
      PutWord(input, kDirectorySum, Checksum(input, directory, bricks * kEntryBytes));
    }
  }
  PutWord(input, kHeaderSum, Checksum(input, 0, kHeaderSum));
}

const Registration kRegistration({.name = "field_cache",
                                  .seeds = [] { return std::vector<Bytes>{TheTube().contents()}; },
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 500,
                                  .longest = 65536});

}  // namespace
}  // namespace torquer::fuzz::field_cache_target

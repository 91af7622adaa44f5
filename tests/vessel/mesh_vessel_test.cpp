#include "host/simulator/vessel/mesh_vessel.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/cache_folder.h"
#include "host/simulator/vessel/centerline.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::Vector3d;
using test::TemporaryFolder;

MeshVesselOptions Options(const std::string& cache, double voxel_mm) {
  MeshVesselOptions options;
  options.cache_folder = cache;
  options.field.voxel_mm = voxel_mm;
  return options;
}

uint64_t Fingerprint(const BrickField& field) {
  Random random(31);
  uint64_t hash = 1;
  for (int i = 0; i < 1000; ++i) {
    ClearanceSample sample;
    field.EvaluateGradient(random.InBox({-10, -10, -10}, {50, 10, 10}), sample);
    for (const double value : {sample.clearance_mm, sample.gradient.x(), sample.gradient.z()}) {
      uint64_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      hash = (hash ^ bits) * 0x100000001b3;
    }
  }
  return hash;
}

// Tube of few triangles, for tests that do not depend on its shape.
TriangleMesh PlainTube() {
  return MakeTubeMesh(40, 8, 12, [](double) { return 3.0; });
}

std::string OnlyFileIn(const std::string& folder) {
  std::string path;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    CHECK(path.empty());  // no temporary file remains
    path = entry.path().string();
  }
  return path;
}

TEST_CASE("a field from a surface is near its distance everywhere near the wall") {
  const std::string meshes = torquer::test::SourcePath("/host/scenes/meshes/");
  struct Case {
    std::string path;
    MeshUnit unit;
  };
  for (const Case& c : {Case{meshes + "neuro_arch/surface.obj", MeshUnit::kMillimeter},
                        Case{meshes + "abdominal_aorta/surface.stl", MeshUnit::kMeter}}) {
    MeshVesselOptions options = Options("", 0.5);
    options.unit = c.unit;
    const auto vessel = MeshVessel::Open(c.path, options);
    Random random(32);
    const TriangleMesh& mesh = vessel->mesh();
    int checked = 0, off = 0, wrong_sign = 0;
    double worst = 0, steepest = 0;
    // One region only, because every brick costs time.
    const Vector3d about = mesh.Centroid(mesh.triangles.size() / 2);
    while (checked < test::Rounds(1500, 3)) {
      const size_t triangle = random.Next() % mesh.triangles.size();
      if ((mesh.Centroid(triangle) - about).norm() > 40) continue;
      const Vector3d p = mesh.Centroid(triangle) + random.Uniform(0, 1) * random.Direction();
      const double exact = vessel->surface().Distance(p);
      ClearanceSample sample;
      vessel->field().EvaluateGradient(p, sample);
      const double error = std::abs(sample.clearance_mm - exact);
      ++checked;
      off += error > 0.1 ? 1 : 0;
      wrong_sign += (sample.clearance_mm > 0) != (exact > 0) && std::abs(exact) > 0.25 ? 1 : 0;
      worst = std::max(worst, error);
      steepest = std::max(steepest, sample.gradient.norm());
    }
    CHECK(off < checked / 50);
    CHECK(worst < 0.4);
    CHECK(wrong_sign == 0);
    CHECK(steepest <= vessel->field().LipschitzBound());
  }
}

TEST_CASE("an opened cache gives the same vessel and the same field to the bit") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache/deeper");
  WriteObj(path, PlainTube());
  const auto first = MeshVessel::Open(path, Options(cache, 1));
  CHECK_FALSE(first->from_cache());
  CHECK(first->field().Build(0, 2));
  const uint64_t expected = Fingerprint(first->field());
  CHECK(first->SaveCache().empty());
  OnlyFileIn(cache);

  const auto second = MeshVessel::Open(path, Options(cache, 1));
  CHECK(second->from_cache());
  CHECK(Fingerprint(second->field()) == expected);
  CHECK(second->field().Statistics().bricks_built == 0);
  CHECK(second->report().findings == first->report().findings);
  CHECK(second->report().openings.size() == 2);
  CHECK(second->report().volume_mm3 == first->report().volume_mm3);
  CHECK(second->report().bounds_mm.max() == first->report().bounds_mm.max());
  CHECK(second->mesh().triangles == first->mesh().triangles);
  CHECK(second->SaveCache().empty());

  // The cache must not serve another voxel size, unit or surface.
  CHECK_FALSE(MeshVessel::Open(path, Options(cache, 0.9))->from_cache());
  TriangleMesh moved = PlainTube();
  moved.vertices_mm[3].x() += 0.001;
  WriteObj(path, moved);
  CHECK_FALSE(MeshVessel::Open(path, Options(cache, 1))->from_cache());
}

TEST_CASE("a partly built field is kept and grows from run to run", "[threads]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache");
  WriteObj(path, PlainTube());
  const auto first = MeshVessel::Open(path, Options(cache, 1));
  first->field().Prefetch({5, 0, 0}, 5);
  const size_t built = first->field().Statistics().bricks_built;
  CHECK(first->SaveCache().empty());
  const std::string kept = OnlyFileIn(cache);
  // A field that has not grown is not written again.
  std::filesystem::rename(kept, folder.Path("kept"));
  CHECK(first->SaveCache().empty());
  CHECK_FALSE(std::filesystem::exists(kept));
  std::filesystem::rename(folder.Path("kept"), kept);
  const auto second = MeshVessel::Open(path, Options(cache, 1));
  CHECK(second->from_cache());
  second->field().Prefetch({5, 0, 0}, 5);
  CHECK(second->field().Statistics().bricks_built == 0);
  second->field().Prefetch({30, 0, 0}, 5);
  CHECK(second->field().Statistics().bricks_built > 0);
  CHECK(second->SaveCache().empty());
  const auto third = MeshVessel::Open(path, Options(cache, 1));
  CHECK(third->field().StoredBricks().size() > built);
  third->field().Prefetch({30, 0, 0}, 5);
  CHECK(third->field().Statistics().bricks_built == 0);
  const auto fresh = MeshVessel::Open(path, Options("", 1));
  CHECK(Fingerprint(third->field()) == Fingerprint(fresh->field()));
}

TEST_CASE("a torn or altered cache is noticed wherever it is torn, and costs only time") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache");
  WriteObj(path, PlainTube());
  const auto original = MeshVessel::Open(path, Options(cache, 2));
  CHECK(original->field().Build(0, 1));
  const uint64_t expected = Fingerprint(original->field());
  CHECK(original->SaveCache().empty());
  const std::string file = OnlyFileIn(cache);
  std::ifstream in(file, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());

  const auto reopen = [&](const std::string& content) {
    std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
    return MeshVessel::Open(path, Options(cache, 2));
  };
  for (const double share : {0.0, 0.0001, 0.01, 0.2, 0.5, 0.9, 0.99999}) {
    INFO(share);
    const auto vessel =
        reopen(whole.substr(0, static_cast<size_t>(share * static_cast<double>(whole.size()))));
    CHECK_FALSE(vessel->from_cache());
    REQUIRE(vessel->cache_findings().size() == 1);
    CHECK_THAT(vessel->cache_findings()[0], Contains(file) && Contains("the field is built again"));
    CHECK(Fingerprint(vessel->field()) == expected);
  }
  Random random(33);
  for (int i = 0; i < test::Rounds(24, 3); ++i) {
    std::string altered = whole;
    // Half of the changes are in the first bytes: the header, the surface and the directory.
    const size_t at = random.Next() % (i % 2 ? whole.size() : 4096);
    altered[at] = static_cast<char>(altered[at] ^ (1 << (i % 8)));
    INFO("byte " << at);
    const auto vessel = reopen(altered);
    CHECK(Fingerprint(vessel->field()) == expected);
  }
  CHECK(Fingerprint(reopen(std::string(whole.size(), '\0'))->field()) == expected);
}

TEST_CASE("a cache that another user may have written is not used") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache");
  WriteObj(path, PlainTube());
  const auto first = MeshVessel::Open(path, Options(cache, 2));
  first->field().Prefetch({5, 0, 0}, 5);
  CHECK(first->SaveCache().empty());
  const std::string file = OnlyFileIn(cache);
  CHECK(MeshVessel::Open(path, Options(cache, 2))->from_cache());
  std::filesystem::permissions(file, std::filesystem::perms::group_write,
                               std::filesystem::perm_options::add);
  const auto refused = MeshVessel::Open(path, Options(cache, 2));
  CHECK_FALSE(refused->from_cache());
  REQUIRE(refused->cache_findings().size() == 1);
  CHECK_THAT(refused->cache_findings()[0], Contains("another user"));
}

TEST_CASE("a cached surface whose triangles name no vertex is not used") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache");
  WriteObj(path, PlainTube());
  const auto first = MeshVessel::Open(path, Options(cache, 2));
  CHECK(first->SaveCache().empty());
  const std::string file = OnlyFileIn(cache);
  // A file as a faulty program might write it: every checksum is valid.
  const std::string hex = std::filesystem::path(file).stem();
  CacheKey key;
  for (int w = 0; w < 2; ++w) {
    key.words[w] = std::stoull(hex.substr(16 * static_cast<size_t>(w), 16), nullptr, 16);
  }
  std::string why;
  const auto written = ReadFieldCache(file, key, &why);
  REQUIRE(written);
  uint64_t vertices = 0;
  std::memcpy(&vertices, written->surface.data(), sizeof vertices);
  const size_t first_index = 16 + static_cast<size_t>(vertices) * 3 * sizeof(double);
  for (const int32_t wrong : {-1, static_cast<int32_t>(vertices)}) {
    std::vector<char> surface = written->surface;
    std::memcpy(&surface[first_index], &wrong, sizeof wrong);
    REQUIRE(WriteFieldCache(file, key, surface, first->field()).empty());
    const auto refused = MeshVessel::Open(path, Options(cache, 2));
    CHECK_FALSE(refused->from_cache());
    CHECK(refused->mesh().triangles == first->mesh().triangles);
  }
}

TEST_CASE("a cache folder has a limit, and the least recently used field is removed first") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj"), cache = folder.Path("cache");
  WriteObj(path, PlainTube());
  const auto save = [&](double voxel_mm) {
    const auto vessel = MeshVessel::Open(path, Options(cache, voxel_mm));
    vessel->field().Prefetch({5, 0, 0}, 5);
    CHECK(vessel->SaveCache().empty());
  };
  const auto fields = [&cache] {
    std::map<std::filesystem::file_time_type, std::string> by_use;
    for (const auto& entry : std::filesystem::directory_iterator(cache)) {
      if (!entry.is_symlink() && entry.file_size() > 100) {
        by_use[entry.last_write_time()] = entry.path();
      }
    }
    return by_use;
  };
  // Written in this order, each last used long before the next.
  for (const double voxel_mm : {2.0, 1.9, 1.8, 1.7}) {
    save(voxel_mm);
    for (const auto& [used, file] : fields()) {
      std::filesystem::last_write_time(file, used - std::chrono::hours(1));
    }
  }
  const auto all = fields();
  REQUIRE(all.size() == 4);
  const std::string oldest = all.begin()->second;
  // Files that do not belong to the cache, by name, first bytes or kind.
  const std::string key(32, 'a');
  for (const std::string& name :
       {key + ".field", std::string("notes.field"), std::string("notes"), key + ".field.mine"}) {
    std::ofstream(cache + "/" + name) << "mine";
  }
  std::filesystem::create_symlink(oldest, cache + "/" + std::string(32, 'b') + ".field");
  // One file left by a dead writer, and one that is being written.
  std::ofstream(cache + "/" + key + ".field.AbC123") << "half";
  const std::string alive = cache + "/" + key + ".field.zYx987";
  std::ofstream(alive) << "half";
  const int writer = open(alive.c_str(), O_RDONLY | O_CLOEXEC);
  REQUIRE(flock(writer, LOCK_EX) == 0);

  CHECK(MeshVessel::Open(path, Options(cache, 2))->from_cache());  // the oldest, used now
  std::int64_t bytes = 0;
  for (const auto& [used, file] : all) {
    bytes += static_cast<std::int64_t>(std::filesystem::file_size(file));
  }
  TidyCacheFolder(cache, "", bytes - 1);
  const auto second = std::next(all.begin())->second;
  for (const auto& [used, file] : all) {
    CHECK(std::filesystem::exists(file) == (file != second));
  }
  TidyCacheFolder(cache, second, 0);
  for (const auto& [used, file] : all) CHECK_FALSE(std::filesystem::exists(file));
  CHECK_FALSE(std::filesystem::exists(cache + "/" + key + ".field.AbC123"));
  CHECK(std::filesystem::exists(alive));
  CHECK(std::filesystem::is_symlink(cache + "/" + std::string(32, 'b') + ".field"));
  for (const std::string& name :
       {key + ".field", std::string("notes.field"), std::string("notes"), key + ".field.mine"}) {
    CHECK(std::filesystem::exists(cache + "/" + name));
  }
  close(writer);
  // The file written last stays.
  save(2.0);
  CHECK(fields().size() == 1);
  TidyCacheFolder(cache, fields().rbegin()->second, 0);
  CHECK(fields().size() == 1);
}

TEST_CASE("a cache that cannot be written is not an error of the run") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("tube.obj");
  WriteObj(path, PlainTube());
  std::ofstream(folder.Path("file")) << "x";
  const auto vessel = MeshVessel::Open(path, Options(folder.Path("file/below"), 1));
  vessel->field().Prefetch({5, 0, 0}, 2);
  CHECK_THAT(vessel->SaveCache(), Contains("file/below"));
  CHECK(vessel->field().Clearance({20, 0, 0}) > 2);
}

TEST_CASE("the cache lies where the desktop's rules put it") {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  const char* home = std::getenv("HOME");
  const std::string before = cache ? cache : "", home_before = home ? home : "";
  setenv("XDG_CACHE_HOME", "/somewhere", 1);
  CHECK(DefaultCacheFolder() == "/somewhere/torquer");
  setenv("XDG_CACHE_HOME", "relative", 1);
  setenv("HOME", "/home/someone", 1);
  CHECK(DefaultCacheFolder() == "/home/someone/.cache/torquer");
  unsetenv("XDG_CACHE_HOME");
  unsetenv("HOME");
  CHECK(DefaultCacheFolder().empty());
  if (cache) setenv("XDG_CACHE_HOME", before.c_str(), 1);
  if (home) setenv("HOME", home_before.c_str(), 1);
}

}  // namespace
}  // namespace torquer::vessel

// Lack of memory in the thread that builds the field ahead: this program's operator new replaces
// that of the library.
#include "host/simulator/field_ahead.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <new>
#include <thread>

#include "host/simulator/vessel/mesh_vessel.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace {

std::atomic<bool> memory_is_short = false;  // for all threads except the test's
thread_local bool is_the_tests_thread = false;

}  // namespace

// Sanitizers have their own allocation functions, which must not be mixed with these.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
void* operator new(std::size_t size) {
  if (memory_is_short && !is_the_tests_thread) throw std::bad_alloc();
  void* const memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif

TEST_CASE("A session continues without building ahead when memory runs out", "[simulator]") {
  if (torquer::test::kUnderSanitizer) {
    WARN("skipped: memory cannot be made short under a sanitizer");
    return;
  }
  is_the_tests_thread = true;
  torquer::vessel::MeshVesselOptions options;
  options.field.voxel_mm = 2;
  options.cache_folder = "";
  torquer::vessel::Vessel vessel;
  vessel.surface = torquer::vessel::MeshVessel::Open(
      torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/surface.obj"), options);
  vessel.bricks = {vessel.surface, &vessel.surface->field()};
  const auto place = [&mesh = vessel.surface->mesh()](int i) {
    return mesh.Centroid(static_cast<std::size_t>(i) % mesh.triangles.size());
  };
  const Eigen::Vector3d tip_mm = place(0);
  const double expected_mm = vessel.surface->field().Clearance(tip_mm);
  torquer::simulator::FieldAhead ahead(vessel);
  CHECK_FALSE(ahead.gave_up());
  memory_is_short = true;
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
  for (int i = 0; !ahead.gave_up() && std::chrono::steady_clock::now() < end; ++i) {
    ahead.Follow(place(i * 50));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  memory_is_short = false;
  CHECK(ahead.gave_up());
  // Following continues, and so do look-ups, near the tip and elsewhere.
  ahead.Follow(tip_mm);
  CHECK(vessel.surface->field().Clearance(tip_mm) == expected_mm);
  CHECK(std::isfinite(vessel.surface->field().Clearance(place(2000))));
}

TEST_CASE("A field has the same values while a thread builds it ahead of the tip") {
  const torquer::test::TemporaryFolder folder;
  torquer::vessel::TriangleMesh tube = torquer::vessel::MakeTubeMesh();
  torquer::vessel::CapTubeMesh(tube);
  torquer::vessel::WriteObj(folder.Path("tube.obj"), tube);
  torquer::vessel::MeshVesselOptions options;
  options.field.voxel_mm = 1;
  options.cache_folder = "";
  const auto open = [&] {
    return torquer::vessel::MeshVessel::Open(folder.Path("tube.obj"), options);
  };
  torquer::vessel::Vessel vessel;
  vessel.surface = open();
  vessel.bricks = {vessel.surface, &vessel.surface->field()};
  const auto alone = open();
  torquer::simulator::FieldAhead ahead(vessel);
  for (int i = 0; i <= 200; ++i) {
    // Back and forth, near the axis and near the wall.
    const Eigen::Vector3d tip_mm(20 + 18 * std::sin(0.05 * i), 0, 2.5 * std::cos(0.7 * i));
    ahead.Follow(tip_mm);
    INFO("place " << i);
    CHECK(vessel.surface->field().Clearance(tip_mm) == alone->field().Clearance(tip_mm));
  }
  CHECK_FALSE(ahead.gave_up());
}

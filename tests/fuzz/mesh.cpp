// Fuzz target for surfaces: as files, in the process that reads them, and as that process's answer.
#include "host/simulator/vessel/mesh_answer.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "tests/fuzz/target.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/temporary_folder.h"

namespace torquer::fuzz::mesh_target {
namespace {

constexpr const char* kNames[] = {"a.stl", "a.obj", "a.ply"};

// A tube in each format, after a byte that selects the format.
std::vector<Bytes> FileSeeds() {
  const vessel::TriangleMesh tube = vessel::MakeTubeMesh(20, 2, 6, [](double) { return 3.0; });
  const test::TemporaryFolder folder;
  vessel::WriteBinaryStl(folder.Path(kNames[0]), tube);
  vessel::WriteObj(folder.Path(kNames[1]), tube);
  vessel::WritePly(folder.Path(kNames[2]), tube);
  std::vector<Bytes> seeds;
  for (std::uint8_t k = 0; k < 3; ++k) {
    Bytes seed = ToBytes(test::Contents(folder.Path(kNames[k])));
    seed.insert(seed.begin(), k);
    seeds.push_back(std::move(seed));
  }
  return seeds;
}

bool AcceptsFile(std::span<const std::uint8_t> input) {
  if (input.empty()) return false;
  vessel::MeshReader reader = vessel::MeshReader::For(input.size());
  reader.cpu_s = 1;
  vessel::RepairSurface(
      vessel::ImportMesh(ToText(input.subspan(1)), kNames[input[0] % 3], 1, reader), "a");
  return true;
}

std::vector<Bytes> AnswerSeeds() { return {ToBytes(vessel::MeshAnswer(vessel::MakeClosedTube()))}; }

bool AcceptsAnswer(std::span<const std::uint8_t> input) {
  vessel::MeshOfAnswer(ToText(input), "a.stl");
  return true;
}

const Registration kFile(
    {.name = "mesh", .seeds = FileSeeds, .accepts = AcceptsFile, .replay_inputs = 60});
const Registration kAnswer(
    {.name = "mesh_answer", .seeds = AnswerSeeds, .accepts = AcceptsAnswer, .longest = 65536});

}  // namespace
}  // namespace torquer::fuzz::mesh_target

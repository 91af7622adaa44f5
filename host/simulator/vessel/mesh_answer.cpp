#include "host/simulator/vessel/mesh_answer.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer::vessel {

namespace {

constexpr char kMesh = 'M', kRefusal = 'R';
constexpr std::size_t kVertexBytes = 3 * sizeof(double), kTriangleBytes = 3 * sizeof(std::int32_t);
constexpr std::size_t kHeaderBytes = 1 + 2 * sizeof(std::uint64_t);

}  // namespace

std::string MeshAnswer(const TriangleMesh& mesh) {
  std::string answer(1, kMesh);
  answer.reserve(kHeaderBytes + mesh.vertices_mm.size() * kVertexBytes +
                 mesh.triangles.size() * kTriangleBytes);
  const auto put = [&answer](const void* bytes, std::size_t size) {
    answer.append(static_cast<const char*>(bytes), size);
  };
  for (const std::uint64_t count : {mesh.vertices_mm.size(), mesh.triangles.size()}) {
    put(&count, sizeof count);
  }
  for (const Eigen::Vector3d& vertex : mesh.vertices_mm) put(vertex.data(), kVertexBytes);
  for (const auto& triangle : mesh.triangles) put(triangle.data(), kTriangleBytes);
  return answer;
}

std::string RefusalAnswer(const std::string& refusal) { return kRefusal + refusal; }

TriangleMesh MeshOfAnswer(const std::string& answer, const std::string& path) {
  const auto damaged = [&path] {
    return UserError(path + ": the surface reader returned no usable answer; the file is " +
                     "damaged: export it again");
  };
  if (!answer.empty() && answer[0] == kRefusal) throw UserError(Printable(answer.substr(1), 2000));
  if (answer.size() < kHeaderBytes || answer[0] != kMesh) throw damaged();
  std::uint64_t vertices = 0, triangles = 0;
  std::memcpy(&vertices, &answer[1], sizeof vertices);
  std::memcpy(&triangles, &answer[1 + sizeof vertices], sizeof triangles);
  const std::size_t body = answer.size() - kHeaderBytes;
  if (vertices > body / kVertexBytes || triangles > body / kTriangleBytes || triangles == 0 ||
      vertices > std::numeric_limits<std::int32_t>::max() ||
      vertices * kVertexBytes + triangles * kTriangleBytes != body) {
    throw damaged();
  }
  TriangleMesh mesh;
  mesh.vertices_mm.resize(vertices);
  mesh.triangles.resize(triangles);
  const char* at = answer.data() + kHeaderBytes;
  for (Eigen::Vector3d& vertex : mesh.vertices_mm) {
    std::memcpy(vertex.data(), at, kVertexBytes);
    at += kVertexBytes;
    if (!vertex.allFinite()) throw damaged();
  }
  for (auto& triangle : mesh.triangles) {
    std::memcpy(triangle.data(), at, kTriangleBytes);
    at += kTriangleBytes;
    const bool all_there = std::all_of(triangle.begin(), triangle.end(), [&](std::int32_t vertex) {
      return vertex >= 0 && static_cast<std::uint64_t>(vertex) < vertices;
    });
    if (!all_there) throw damaged();
  }
  return mesh;
}

}  // namespace torquer::vessel

#include "host/simulator/vessel/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cctype>
#include <filesystem>
#include <fstream>

#include "host/support/error.h"

namespace torquer::vessel {

namespace {

[[noreturn]] void Refuse(const std::string& path, const std::string& what) {
  throw UserError(path + ": " + what);
}

void AddMeshes(const aiScene& scene, const aiNode& node, const aiMatrix4x4& above,
               double mm_per_unit, TriangleMesh& mesh) {
  const aiMatrix4x4 placed = above * node.mTransformation;
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[node.mMeshes[m]];
    const auto first = static_cast<int32_t>(mesh.vertices_mm.size());
    for (unsigned v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D at = placed * part.mVertices[v];
      mesh.vertices_mm.emplace_back(mm_per_unit * static_cast<double>(at.x),
                                    mm_per_unit * static_cast<double>(at.y),
                                    mm_per_unit * static_cast<double>(at.z));
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;
      mesh.triangles.push_back({first + static_cast<int32_t>(face.mIndices[0]),
                                first + static_cast<int32_t>(face.mIndices[1]),
                                first + static_cast<int32_t>(face.mIndices[2])});
    }
  }
  for (unsigned c = 0; c < node.mNumChildren; ++c) {
    AddMeshes(scene, *node.mChildren[c], placed, mm_per_unit, mesh);
  }
}

}  // namespace

TriangleMesh ReadMeshFile(const std::string& path, double mm_per_unit) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    Refuse(path, "there is no such surface file; check the path in the scene");
  }
  if (!std::filesystem::is_regular_file(status) || !std::ifstream(path)) {
    Refuse(path, "the surface file cannot be read; check that it is a file and its permissions");
  }
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".stl" && ending != ".obj" && ending != ".ply") {
    Refuse(path, "surfaces are read from .stl, .obj and .ply files, not \"" + ending +
                     "\"; convert it (MeshLab, Blender and 3D Slicer export all three)");
  }
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = nullptr;
  try {
    scene = importer.ReadFile(path, aiProcess_Triangulate | aiProcess_SortByPType);
  } catch (const std::exception& e) {
    Refuse(path, std::string("not a readable surface (") + e.what() + "); export it anew");
  }
  if (scene == nullptr || scene->mRootNode == nullptr) {
    Refuse(path, std::string("not a readable surface (") + importer.GetErrorString() +
                     "); the file is damaged or cut short: export it anew");
  }
  TriangleMesh mesh;
  AddMeshes(*scene, *scene->mRootNode, aiMatrix4x4(), mm_per_unit, mesh);
  if (mesh.triangles.empty()) {
    Refuse(path, "the file holds no triangles; export the vessel as a surface mesh");
  }
  for (const auto& triangle : mesh.triangles) {
    for (const int32_t vertex : triangle) {
      if (!mesh.vertices_mm[vertex].allFinite()) {
        Refuse(path, "vertex " + std::to_string(vertex + 1) +
                         " has a coordinate that is not a finite number; repair or export anew");
      }
    }
  }
  return mesh;
}

}  // namespace torquer::vessel

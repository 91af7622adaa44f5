#include "host/simulator/vessel/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <string_view>

#include "host/simulator/vessel/obj_file.h"
#include "host/simulator/vessel/stl_file.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer::vessel {

namespace {

[[noreturn]] void RefuseMesh(const std::string& path, const std::string& what) {
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

// Assimp's time grows with the square of this number.
constexpr std::size_t kMostPlyHeaderLines = 1000;
// The time to triangulate a face grows with the square of its corners.
constexpr unsigned kMostCorners = 1000;

constexpr const char* kCutShort = "; the file is damaged or cut short: export it again";

size_t PlyTypeBytes(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "double" || type == "float64") return 8;
  return 4;
}

// Elements announced by a PLY header, and their smallest size.
struct PlyHeader {
  bool is_text = false;
  size_t elements = 0;
  size_t least_bytes = 0;
};

PlyHeader ReadPlyHeader(const std::string& path, std::istream& file, size_t file_bytes) {
  PlyHeader header;
  std::string line, word;
  size_t count = 0;
  for (size_t lines = 1; std::getline(file, line) && line.rfind("end_header", 0) != 0; ++lines) {
    if (lines > kMostPlyHeaderLines) {
      RefuseMesh(path, "the header has more than " + std::to_string(kMostPlyHeaderLines) +
                           " lines; export it again, without comments");
    }
    std::istringstream words(line);
    words >> word;
    if (word == "format") {
      header.is_text = words >> word && word == "ascii";
    } else if (word == "element") {
      words >> word;
      // An element has at least one byte, in text and in binary files.
      if (!(words >> count) || count > file_bytes) {
        RefuseMesh(path, "the header declares more elements than the file has bytes, \"" +
                             Printable(line) + "\"" + kCutShort);
      }
      header.elements += count;
    } else if (word == "property" && words >> word) {
      size_t bytes = PlyTypeBytes(word);
      if (word == "list") {
        std::string size_type, item_type;
        words >> size_type >> item_type;
        bytes = PlyTypeBytes(size_type) + 3 * PlyTypeBytes(item_type);
      }
      header.least_bytes += count * bytes;
    }
  }
  if (!file)
    RefuseMesh(path, std::string("the header does not end with \"end_header\"") + kCutShort);
  return header;
}

// Refuses a PLY with less than its header declares: one line per element, or the bytes.
void CheckPlyIsWhole(const std::string& path, std::istream& file, size_t file_bytes) {
  const auto [is_text, elements, least_bytes] = ReadPlyHeader(path, file, file_bytes);
  std::string line;
  if (is_text) {
    size_t lines = 0;
    while (std::getline(file, line)) {
      // An unterminated last line counts only if it completes the elements.
      const bool whole = !file.eof() || elements == lines + 1;
      if (whole && line.find_first_not_of(" \t\r") != std::string::npos) ++lines;
    }
    if (lines < elements) {
      RefuseMesh(path, "the header declares " + std::to_string(elements) +
                           " elements, but the file has " + std::to_string(lines) + kCutShort);
    }
    return;
  }
  const auto begin = file.tellg();
  file.seekg(0, std::ios::end);
  const auto bytes = static_cast<size_t>(file.tellg() - begin);
  if (bytes < least_bytes) {
    RefuseMesh(path, "the header declares at least " + std::to_string(least_bytes) +
                         " bytes, but the file has " + std::to_string(bytes) + kCutShort);
  }
}

// OBJ does not state its length. The file was cut if its last line is unterminated and some
// vertices belong to no face.
void CheckObjIsWhole(const std::string& path, std::istream& file) {
  file.seekg(-1, std::ios::end);
  if (file.get() == '\n') return;
  file.seekg(0);
  std::string line, word;
  long long vertices = 0;
  std::set<long long> used;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    words >> word;
    if (word == "v") ++vertices;
    if (word != "f") continue;
    while (words >> word) {
      const long long index = std::strtoll(word.c_str(), nullptr, 10);
      used.insert(index < 0 ? vertices + 1 + index : index);
    }
  }
  if (static_cast<long long>(used.size()) < vertices) {
    RefuseMesh(path, "the last line has no line end, and " +
                         std::to_string(vertices - static_cast<long long>(used.size())) +
                         " vertices belong to no face" + kCutShort);
  }
}

// Assimp accepts truncated text files and truncated PLY files.
void CheckIsWhole(const std::string& contents, const std::string& path, const std::string& ending) {
  std::istringstream file(contents);
  if (ending == ".ply") CheckPlyIsWhole(path, file, contents.size());
  if (ending == ".obj") CheckObjIsWhole(path, file);
}

// Assimp's words without its name for a file in memory.
std::string Reason(std::string error) {
  constexpr std::string_view kInnerName = "$$$___magic___$$$";
  for (size_t at = error.find(kInnerName); at != std::string::npos; at = error.find(kInnerName)) {
    error.replace(at, kInnerName.size(), "the file");
  }
  return error;
}

void CheckHasTriangles(const std::string& path, bool has) {
  if (has) return;
  RefuseMesh(path, "the file holds no triangles; export the vessel as a surface mesh");
}

bool HasPolygons(const aiScene& scene) {
  return std::any_of(scene.mMeshes, scene.mMeshes + scene.mNumMeshes, [](const aiMesh* part) {
    return std::any_of(part->mFaces, part->mFaces + part->mNumFaces,
                       [](const aiFace& face) { return face.mNumIndices > 2; });
  });
}

void CheckIndices(const std::string& path, const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      if (part.mFaces[f].mNumIndices > kMostCorners) {
        RefuseMesh(path, "face " + std::to_string(f + 1) + " has " +
                             std::to_string(part.mFaces[f].mNumIndices) +
                             " corners; split faces of more than " + std::to_string(kMostCorners) +
                             " into triangles");
      }
      for (unsigned i = 0; i < part.mFaces[f].mNumIndices; ++i) {
        if (part.mFaces[f].mIndices[i] < part.mNumVertices) continue;
        RefuseMesh(path, "face " + std::to_string(f + 1) +
                             " refers to a vertex that the file does not have" + kCutShort);
      }
    }
  }
}

TriangleMesh ParseByAssimp(const std::string& contents, const std::string& path,
                           const std::string& ending, double mm_per_unit) {
  CheckIsWhole(contents, path, ending);
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const std::string taken = ending == ".obj" ? OnlyFaces(contents) : contents;
  CheckHasTriangles(
      path, ending != ".obj" || taken.starts_with("f ") || taken.find("\nf ") != std::string::npos);
  const aiScene* scene =
      importer.ReadFileFromMemory(taken.data(), taken.size(), 0, ending.c_str() + 1);
  if (scene != nullptr) {
    // Assimp's postprocessing does not check indices.
    CheckIndices(path, *scene);
    CheckHasTriangles(path, HasPolygons(*scene));
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType);
  }
  if (scene == nullptr || scene->mRootNode == nullptr) {
    RefuseMesh(path,
               "not a readable surface (" + Reason(importer.GetErrorString()) + ")" + kCutShort);
  }
  TriangleMesh mesh;
  AddMeshes(*scene, *scene->mRootNode, aiMatrix4x4(), mm_per_unit, mesh);
  return mesh;
}

}  // namespace

TriangleMesh ParseMesh(const std::string& contents, const std::string& path, double mm_per_unit) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending != ".stl" && ending != ".obj" && ending != ".ply") {
    RefuseMesh(path, "the name of a surface file must end with .stl, .obj or .ply, not \"" +
                         ending +
                         "\"; convert it (MeshLab, Blender and 3D Slicer export all three)");
  }
  TriangleMesh mesh = ending == ".stl" ? ParseStl(contents, path, mm_per_unit)
                                       : ParseByAssimp(contents, path, ending, mm_per_unit);
  CheckHasTriangles(path, !mesh.triangles.empty());
  for (const auto& triangle : mesh.triangles) {
    for (const int32_t vertex : triangle) {
      if (!mesh.vertices_mm[vertex].allFinite()) {
        RefuseMesh(path, "vertex " + std::to_string(vertex + 1) +
                             " has a coordinate that is not a finite number; repair the file, or "
                             "export it again");
      }
    }
  }
  return mesh;
}

}  // namespace torquer::vessel

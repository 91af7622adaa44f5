// OBJ file: reads the parts that a surface needs.
#pragma once

#include <string>

namespace torquer::vessel {

/// Copies the vertices and faces of an OBJ file, so that the result needs no other file. It omits
/// objects, groups, materials, normals, texture coordinates, points and lines. Lines that a
/// backslash continues are joined. Takes time in proportion to the file's size. With assimp, time
/// grows with the square of the number of objects, groups and materials.
std::string OnlyFaces(const std::string& contents);

}  // namespace torquer::vessel

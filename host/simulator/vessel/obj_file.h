// OBJ file: what a surface needs of it.
#pragma once

#include <string>

namespace torquer::vessel {

/// The vertices and faces of an OBJ file as another one, which names no other file: without
/// objects, groups, materials, normals, texture coordinates, points and lines. Lines that a
/// backslash continues are joined. Takes time in proportion to the file's size; assimp's grows with
/// the square of the number of objects, groups and materials.
std::string OnlyFaces(const std::string& contents);

}  // namespace torquer::vessel

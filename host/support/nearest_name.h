// Suggestions for misspelled names.
#pragma once

#include <string>
#include <vector>

namespace torquer {

/// Name in `known` that `given` most likely meant, or "" if none is near. A near name has a small
/// edit distance (Damerau and Levenshtein's, so that two exchanged letters count once). Near are
/// also two names if one, of at least three letters, begins the other: "voxel" and "voxel_mm".
/// Upper and lower case, and '-' and '_', are equal.
std::string NearestName(const std::string& given, const std::vector<std::string>& known);

}  // namespace torquer

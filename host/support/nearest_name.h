// Suggestions for misspelled names.
#pragma once

#include <string>
#include <vector>

namespace torquer {

/// Name in `known` that `given` most likely meant, or "" if none is near. Near is a name at a small
/// edit distance (Damerau and Levenshtein's, so that two exchanged letters count once), and a name
/// of which `given` is the beginning, or the other way round (at least three letters): "voxel" for
/// "voxel_mm". Upper and lower case, and '-' and '_', count as the same.
std::string NearestName(const std::string& given, const std::vector<std::string>& known);

}  // namespace torquer

#include "host/support/nearest_name.h"

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <string_view>

namespace torquer {
namespace {

// Shorter texts begin too many names.
constexpr std::size_t kShortestBeginning = 3;

// Removes the dashes of an option, and makes letters lower case and word separators equal.
std::string Plain(std::string_view name) {
  name.remove_prefix(std::min(name.find_first_not_of('-'), name.size()));
  std::string plain;
  for (const char character : name) {
    plain += character == '-'
                 ? '_'
                 : static_cast<char>(std::tolower(static_cast<unsigned char>(character)));
  }
  return plain;
}

// Number of letters to insert, remove, replace or exchange with their neighbor (optimal string
// alignment).
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> distance(a.size() + 1,
                                                 std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) distance[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) distance[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      std::size_t& here = distance[i][j];
      here = std::min({distance[i - 1][j] + 1, distance[i][j - 1] + 1,
                       distance[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      const bool exchanged = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (exchanged) here = std::min(here, distance[i - 2][j - 2] + 1);
    }
  }
  return distance[a.size()][b.size()];
}

// Distance of `name` from the meaning of `given`, in half edits; more than `limit` if not near.
std::size_t Unlikeliness(const std::string& given, const std::string& name, std::size_t limit) {
  const auto& [shorter, longer] =
      std::minmax(given, name, [](const auto& a, const auto& b) { return a.size() < b.size(); });
  // Lower bound, which avoids the search for names as long as a file.
  const std::size_t fewest = 2 * (longer.size() - shorter.size());
  std::size_t best = fewest > limit ? fewest : 2 * EditDistance(given, name);
  if (shorter.size() >= kShortestBeginning && longer.starts_with(shorter)) {
    // A missing whole word, such as the unit, is likelier than a cut or an overlong name.
    const bool whole_word = given.size() <= name.size() &&
                            (longer.size() == shorter.size() || longer[shorter.size()] == '_');
    best = std::min({best, whole_word ? std::size_t{1} : std::size_t{3}, limit});
  }
  return best;
}

}  // namespace

std::string NearestName(const std::string& given, const std::vector<std::string>& known) {
  const std::string plain = Plain(given);
  const std::size_t limit = 2 * std::max<std::size_t>(1, (plain.size() + 1) / 3);
  std::string best;
  std::size_t best_unlikeliness = limit + 1;
  for (const std::string& name : known) {
    const std::size_t unlikeliness = Unlikeliness(plain, Plain(name), limit);
    const bool shorter = unlikeliness == best_unlikeliness && name.size() < best.size();
    if (unlikeliness < best_unlikeliness || shorter) {
      best_unlikeliness = unlikeliness;
      best = name;
    }
  }
  return best;
}

}  // namespace torquer

#include "host/recorder/svg_text.h"

#include <cmath>

namespace torquer {

double RoundBelow(double most) {
  const double decade = std::pow(10.0, std::floor(std::log10(most)));
  if (5 * decade <= most) return 5 * decade;
  return 2 * decade <= most ? 2 * decade : decade;
}

}  // namespace torquer

#include "host/simulator/core/newton/travel_prediction.h"

#include <cstddef>

#include "host/simulator/core/hash.h"

namespace torquer {

TravelPrediction::TravelPrediction(const WireModel& model) : turns_(model) {
  before_.reserve(model.max_segments() + 1);
}

void TravelPrediction::Travel(const WireModel& model, double travel_mm, double most_mm,
                              Curve& curve) {
  constexpr double kLargestRatio = 4;
  const bool known = travel_mm_ > 0 && before_.size() == curve.tangents().size();
  const double ratio = known ? travel_mm / travel_mm_ : 0;
  if (known) turns_.Measure(before_, curve.tangents());
  before_ = curve.tangents();
  travel_mm_ = travel_mm;
  if (known && ratio < kLargestRatio) turns_.Repeat(model, ratio, most_mm, curve);
}

std::uint64_t TravelPrediction::Hash(std::uint64_t seed) const {
  if (travel_mm_ == 0) return seed;
  return HashVectors(before_, HashDouble(travel_mm_, seed));
}

}  // namespace torquer

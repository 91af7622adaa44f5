// Distance source: the distance to which a brick field is fitted.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <utility>

namespace torquer::vessel {

/// Signed distance to a wall, mm: positive in the lumen, and nowhere steeper than 1.
///
/// A pure function of the point, bit for bit, for every method of this class. Thread-safe.
class DistanceSource {
 public:
  DistanceSource() = default;
  DistanceSource(const DistanceSource&) = delete;
  DistanceSource& operator=(const DistanceSource&) = delete;
  virtual ~DistanceSource() = default;

  virtual double Distance(const Eigen::Vector3d& point_mm) const = 0;

  /// Distances at the count^3 points (x[i], y[j], z[k]), i fastest. The three arrays hold count
  /// numbers each, increasing in equal steps. A distance beyond needed_mm from the wall may be
  /// replaced by another one beyond it, of either sign. An override can share work between
  /// neighbors.
  virtual void SampleGrid(const double* x, const double* y, const double* z, int count,
                          [[maybe_unused]] double needed_mm, double* distances) const {
    for (int k = 0; k < count; ++k) {
      for (int j = 0; j < count; ++j) {
        for (int i = 0; i < count; ++i) *distances++ = Distance({x[i], y[j], z[k]});
      }
    }
  }
};

/// A distance given as a function.
class FunctionSource final : public DistanceSource {
 public:
  explicit FunctionSource(std::function<double(const Eigen::Vector3d&)> function)
      : function_(std::move(function)) {}
  double Distance(const Eigen::Vector3d& point_mm) const override { return function_(point_mm); }

 private:
  std::function<double(const Eigen::Vector3d&)> function_;
};

}  // namespace torquer::vessel

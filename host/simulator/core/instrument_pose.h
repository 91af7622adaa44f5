// Instrument poses: insertion and rotation of each instrument.
#pragma once

#include <array>
#include <cassert>
#include <initializer_list>

namespace torquer {

/// The most instruments of one stack.
inline constexpr int kMostInstruments = 4;

/// Insertion and rotation of an instrument since the start.
struct InstrumentPose {
  double insertion_mm = 0;  ///< length past the sheath
  double rotation_rad = 0;  ///< of the proximal end
  friend bool operator==(const InstrumentPose&, const InstrumentPose&) = default;
};

/// One pose for each instrument of a stack, the innermost first. No heap.
class InstrumentPoses {
 public:
  /// Poses of `count` instruments, 1 .. kMostInstruments, with no length inserted.
  explicit InstrumentPoses(int count = 1) : count_(count) {
    assert(count >= 1 && count <= kMostInstruments);
  }
  /// The pose of a lone wire.
  InstrumentPoses(double insertion_mm, double rotation_rad) : count_(1) {
    poses_[0] = {insertion_mm, rotation_rad};
  }
  InstrumentPoses(std::initializer_list<InstrumentPose> poses)
      : InstrumentPoses(static_cast<int>(poses.size())) {
    InstrumentPose* to = begin();
    for (const InstrumentPose& pose : poses) *to++ = pose;
  }

  int size() const { return count_; }
  InstrumentPose& operator[](int k) { return poses_[k]; }
  const InstrumentPose& operator[](int k) const { return poses_[k]; }
  InstrumentPose* begin() { return poses_.data(); }
  InstrumentPose* end() { return poses_.data() + count_; }
  const InstrumentPose* begin() const { return poses_.data(); }
  const InstrumentPose* end() const { return poses_.data() + count_; }

  /// Index of the instrument that reaches farthest; of equals, the innermost.
  int Leader() const {
    int leader = 0;
    for (int k = 1; k < count_; ++k) {
      if ((*this)[k].insertion_mm > (*this)[leader].insertion_mm) leader = k;
    }
    return leader;
  }
  /// Reach of the leader past the sheath, mm.
  double reach_mm() const { return (*this)[Leader()].insertion_mm; }

  friend bool operator==(const InstrumentPoses& a, const InstrumentPoses& b) {
    if (a.count_ != b.count_) return false;
    for (int k = 0; k < a.count_; ++k) {
      if (!(a[k] == b[k])) return false;
    }
    return true;
  }

 private:
  std::array<InstrumentPose, kMostInstruments> poses_{};
  int count_;
};

}  // namespace torquer

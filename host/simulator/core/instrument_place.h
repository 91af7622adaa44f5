// Instrument places: insertion and rotation of each instrument.
#pragma once

#include <array>
#include <cassert>
#include <initializer_list>

namespace torquer {

/// The most instruments of one stack.
inline constexpr int kMostInstruments = 4;

/// Insertion and rotation of an instrument since the start.
struct InstrumentPlace {
  double insertion_mm = 0;  ///< length past the sheath
  double rotation_rad = 0;  ///< of the proximal end
  friend bool operator==(const InstrumentPlace&, const InstrumentPlace&) = default;
};

/// One place for each instrument of a stack, the innermost first. No heap.
class InstrumentPlaces {
 public:
  /// `count` instruments, 1 .. kMostInstruments, nothing inserted.
  explicit InstrumentPlaces(int count = 1) : count_(count) {
    assert(count >= 1 && count <= kMostInstruments);
  }
  /// The place of a lone wire.
  InstrumentPlaces(double insertion_mm, double rotation_rad) : count_(1) {
    places_[0] = {insertion_mm, rotation_rad};
  }
  InstrumentPlaces(std::initializer_list<InstrumentPlace> places)
      : InstrumentPlaces(static_cast<int>(places.size())) {
    InstrumentPlace* to = begin();
    for (const InstrumentPlace& place : places) *to++ = place;
  }

  int size() const { return count_; }
  InstrumentPlace& operator[](int k) { return places_[static_cast<std::size_t>(k)]; }
  const InstrumentPlace& operator[](int k) const { return places_[static_cast<std::size_t>(k)]; }
  InstrumentPlace* begin() { return places_.data(); }
  InstrumentPlace* end() { return places_.data() + count_; }
  const InstrumentPlace* begin() const { return places_.data(); }
  const InstrumentPlace* end() const { return places_.data() + count_; }

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

  friend bool operator==(const InstrumentPlaces& a, const InstrumentPlaces& b) {
    if (a.count_ != b.count_) return false;
    for (int k = 0; k < a.count_; ++k) {
      if (!(a[k] == b[k])) return false;
    }
    return true;
  }

 private:
  std::array<InstrumentPlace, kMostInstruments> places_{};
  int count_;
};

}  // namespace torquer

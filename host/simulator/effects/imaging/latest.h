// Latest value of a stream, handed from one thread to another without waiting.
#pragma once

#include <array>
#include <atomic>

namespace torquer::effects {

/// One writer, one reader. A value that the reader does not fetch in time is overwritten.
template <class Value>
class Latest {
 public:
  /// Slot in which the writer prepares the next value. It holds an old value, whose memory can be
  /// reused.
  Value& Draft() { return values_[draft_]; }
  /// Makes the draft the newest value.
  void Publish() { draft_ = middle_.exchange(draft_ | kFresh, std::memory_order_acq_rel) & kIndex; }
  /// Fetches the newest value; returns false if the reader already has it.
  bool Fetch() {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    held_ = middle_.exchange(held_, std::memory_order_acq_rel) & kIndex;
    return true;
  }
  /// Value that the reader fetched last.
  const Value& Held() const { return values_[held_]; }
  /// Copies the slots of `other`. No thread may write or read either of them meanwhile.
  void CopyFrom(const Latest& other) {
    values_ = other.values_;
    draft_ = other.draft_;
    middle_ = other.middle_.load();
    held_ = other.held_;
  }

 private:
  static constexpr unsigned kIndex = 3, kFresh = 4;
  std::array<Value, 3> values_;
  unsigned draft_ = 0;
  std::atomic<unsigned> middle_{1};
  unsigned held_ = 2;
};

}  // namespace torquer::effects
